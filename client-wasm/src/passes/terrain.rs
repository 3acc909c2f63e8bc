//! The terrain pass: a ray a pixel through the page table, to distance and hit.

use super::{flag, full_screen_pipeline};
use crate::gpu::targets::{DISTANCE_FORMAT, HIT_FORMAT, Targets};
use treeline_shaders::{Pass, source};

/// The pass.
#[derive(Debug)]
pub struct Terrain {
    pipeline: wgpu::RenderPipeline,
}

impl Terrain {
    /// Compiles the pass. `count_fetches`: write the number of texel fetches beside each hit. `use_minima`: for an eye
    /// below the surface, with the pyramids of minima bound; what it hits is the same.
    pub fn new(
        device: &wgpu::Device,
        frame: &wgpu::BindGroupLayout,
        count_fetches: bool,
        use_minima: bool,
    ) -> Self {
        let constants = [flag("COUNT_FETCHES", count_fetches), flag("USE_MINIMA", use_minima)];
        let pipeline = full_screen_pipeline(
            device,
            "terrain",
            source(Pass::Terrain),
            &[Some(frame)],
            "terrain",
            &constants,
            &[DISTANCE_FORMAT, HIT_FORMAT],
        );
        Self { pipeline }
    }

    /// Records the pass.
    pub fn record(
        &self,
        encoder: &mut wgpu::CommandEncoder,
        frame: &wgpu::BindGroup,
        targets: &Targets,
        timestamps: Option<wgpu::RenderPassTimestampWrites<'_>>,
    ) {
        let attachment = |view| {
            Some(wgpu::RenderPassColorAttachment {
                view,
                depth_slice: None,
                resolve_target: None,
                // Every pixel is written.
                ops: wgpu::Operations {
                    load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                    store: wgpu::StoreOp::Store,
                },
            })
        };
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("terrain"),
            color_attachments: &[attachment(&targets.distance_view), attachment(&targets.hit_view)],
            timestamp_writes: timestamps,
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, frame, &[]);
        pass.draw(0..3, 0..1);
    }
}
