//! What the terrain pass writes and the shade pass reads: one pair of textures of the picture's size; and the depths
//! that trees are drawn against, where any are.

/// Metres from the eye; −1 for a miss.
pub const DISTANCE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Float;
/// Leaf, u and v as bits, texel fetches.
pub const HIT_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// The pair.
#[derive(Debug)]
pub struct Targets {
    /// Distances.
    pub distance: wgpu::Texture,
    /// Hits.
    pub hit: wgpu::Texture,
    /// View of the distances.
    pub distance_view: wgpu::TextureView,
    /// View of the hits.
    pub hit_view: wgpu::TextureView,
    /// Depths, once trees are drawn.
    pub depth: Option<wgpu::Texture>,
    /// View of the depths.
    pub depth_view: Option<wgpu::TextureView>,
}

impl Targets {
    /// For a picture of so many pixels.
    pub fn new(device: &wgpu::Device, width: u32, height: u32) -> Self {
        let create = |label, format| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some(label),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                    | wgpu::TextureUsages::TEXTURE_BINDING
                    | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        };
        let distance = create("distance", DISTANCE_FORMAT);
        let hit = create("hit", HIT_FORMAT);
        let distance_view = distance.create_view(&wgpu::TextureViewDescriptor::default());
        let hit_view = hit.create_view(&wgpu::TextureViewDescriptor::default());
        Self { distance, hit, distance_view, hit_view, depth: None, depth_view: None }
    }

    /// Makes the depths, where there are none yet.
    pub fn with_depth(&mut self, device: &wgpu::Device, format: wgpu::TextureFormat) {
        let [width, height] = self.size();
        let depth = self.depth.get_or_insert_with(|| {
            device.create_texture(&wgpu::TextureDescriptor {
                label: Some("depth"),
                size: wgpu::Extent3d { width, height, depth_or_array_layers: 1 },
                mip_level_count: 1,
                sample_count: 1,
                dimension: wgpu::TextureDimension::D2,
                format,
                usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
                view_formats: &[],
            })
        });
        self.depth_view.get_or_insert_with(|| depth.create_view(&wgpu::TextureViewDescriptor::default()));
    }

    /// Width and height, pixels.
    pub fn size(&self) -> [u32; 2] {
        [self.distance.width(), self.distance.height()]
    }
}
