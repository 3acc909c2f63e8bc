//! The pyramid of the picture's distances: its buffer, and the mips beyond those that `mark_pixels` makes.

use treeline_shaders::{Pass, source};

/// Mips that `mark_pixels` makes.
const FIRST_MIPS: u32 = 4;
/// Mips that one dispatch makes.
const MIPS_PER_DISPATCH: u32 = 4;
/// Mips that there are at most: 2^15 texels, as large as textures get.
const MIPS: u32 = 16;
/// Texels along a work group's side.
const GROUP: u32 = 8;

/// Columns and rows of mip 0 for a picture: a texel for 2 × 2 of its quads, of which there is one more along
/// each axis than there are pixels.
pub fn base_size(picture: [u32; 2]) -> [u32; 2] {
    picture.map(|side| (side + 2) >> 1)
}

/// Bytes of the pyramid of a picture.
pub fn buffer_bytes(picture: [u32; 2]) -> u64 {
    (0..MIPS)
        .map(|mip| base_size(picture).map(|side| u64::from(mip_side(side, mip))))
        .map(|[x, y]| 16 * x * y)
        .sum()
}

/// Texels along an axis of a mip.
fn mip_side(base: u32, mip: u32) -> u32 {
    base.div_ceil(1 << mip)
}

/// The pass.
#[derive(Debug)]
pub struct DistancePyramid {
    /// One for each dispatch that the largest picture needs.
    pipelines: Vec<wgpu::ComputePipeline>,
}

impl DistancePyramid {
    /// Compiles the pass; group 1 of `layout` holds the pyramid.
    pub fn new(device: &wgpu::Device, layout: &wgpu::PipelineLayout) -> Self {
        let module = device.create_shader_module(wgpu::ShaderModuleDescriptor {
            label: Some("distance_pyramid"),
            source: wgpu::ShaderSource::Wgsl(source(Pass::DistanceMips).into()),
        });
        let pipelines = (FIRST_MIPS..MIPS)
            .step_by(MIPS_PER_DISPATCH as usize)
            .map(|first| {
                device.create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                    label: Some("distance_pyramid"),
                    layout: Some(layout),
                    module: &module,
                    entry_point: Some("distance_pyramid"),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &[("FROM", f64::from(first - 1))],
                        ..Default::default()
                    },
                    cache: None,
                })
            })
            .collect();
        Self { pipelines }
    }

    /// Records the mips of a picture's pyramid, bind groups being set.
    pub fn record(&self, pass: &mut wgpu::ComputePass<'_>, picture: [u32; 2]) {
        let base = base_size(picture);
        for (pipeline, first) in self.pipelines.iter().zip((FIRST_MIPS..).step_by(MIPS_PER_DISPATCH as usize))
        {
            if base.iter().all(|&side| mip_side(side, first - 1) == 1) {
                break;
            }
            let groups = base.map(|side| mip_side(side, first).div_ceil(GROUP));
            pass.set_pipeline(pipeline);
            pass.dispatch_workgroups(groups[0], groups[1], 1);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_buffer_holds_every_mip() {
        assert_eq!(base_size([1, 1]), [1, 1]);
        assert_eq!(base_size([640, 511]), [321, 256]);
        // 3 × 2, 2 × 1, 1 × 1 and thirteen more of one texel.
        assert_eq!(buffer_bytes([5, 3]), 16 * (6 + 2 + 14));
    }
}
