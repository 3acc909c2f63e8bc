//! The slots: texture arrays that grow by doubling up to the pool's capacity, so that a small scene
//! takes little memory and none grows without bound.

use crate::engine::PhotoPixels;
use crate::passes::compress_photo::{CompressPhoto, PhotoFormat};
use crate::stream::decode::{ELEVATION_SIDE, ElevationPixels, LandCoverPixels, TEXTURE_SIDE};
use treeline_core::tile::CELLS;

/// Layers allocated at first.
const FIRST_LAYERS: u32 = 4;

/// One texture array whose layers are slots.
#[derive(Debug)]
pub struct TileArray {
    label: &'static str,
    texture: wgpu::Texture,
    view: wgpu::TextureView,
    capacity: u32,
}

/// What an array's layers look like.
#[derive(Clone, Copy, Debug)]
struct ArrayShape {
    label: &'static str,
    side: u32,
    mips: u32,
    format: wgpu::TextureFormat,
    usage: wgpu::TextureUsages,
}

impl TileArray {
    fn new(device: &wgpu::Device, shape: ArrayShape, capacity: u32) -> Self {
        let layers = FIRST_LAYERS.min(capacity).max(1);
        let texture = create(device, &shape, layers);
        let view = array_view(&texture);
        Self { label: shape.label, texture, view, capacity: capacity.max(1) }
    }

    /// The array as passes see it.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.view
    }

    /// One mip of one layer.
    pub fn layer_mip(&self, slot: u32, mip: u32) -> wgpu::TextureView {
        self.texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some(self.label),
            dimension: Some(wgpu::TextureViewDimension::D2),
            base_mip_level: mip,
            mip_level_count: Some(1),
            base_array_layer: slot,
            array_layer_count: Some(1),
            ..wgpu::TextureViewDescriptor::default()
        })
    }

    /// Texels along a layer's side.
    pub fn side(&self) -> u32 {
        self.texture.width()
    }

    /// Mips of a layer.
    pub fn mips(&self) -> u32 {
        self.texture.mip_level_count()
    }

    /// Bytes of the layers that there are now.
    pub fn bytes(&self) -> u64 {
        let format = self.texture.format();
        let block = u64::from(format.block_copy_size(None).unwrap_or(4));
        let blocks =
            |mip: u32| u64::from((self.texture.width() >> mip).max(1).div_ceil(format.block_dimensions().0));
        let layer: u64 = (0..self.mips()).map(|mip| blocks(mip).pow(2) * block).sum();
        layer * u64::from(self.texture.depth_or_array_layers())
    }

    fn shape(&self, label: &'static str) -> ArrayShape {
        ArrayShape {
            label,
            side: self.texture.width(),
            mips: self.texture.mip_level_count(),
            format: self.texture.format(),
            usage: self.texture.usage(),
        }
    }

    /// Makes room for a slot; answers whether the array is a new one.
    fn ensure(&mut self, device: &wgpu::Device, queue: &wgpu::Queue, slot: u32) -> bool {
        let layers = self.texture.depth_or_array_layers();
        if slot < layers {
            return false;
        }
        let mut grown = layers;
        while grown <= slot {
            grown = (2 * grown).min(self.capacity.max(slot + 1));
        }
        let shape = self.shape(self.label);
        let larger = create(device, &shape, grown);
        let mut encoder =
            device.create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("grow tile array") });
        for mip in 0..shape.mips {
            let side = (shape.side >> mip).max(1);
            let place = |texture| wgpu::TexelCopyTextureInfo {
                texture,
                mip_level: mip,
                origin: wgpu::Origin3d::ZERO,
                aspect: wgpu::TextureAspect::All,
            };
            encoder.copy_texture_to_texture(
                place(&self.texture),
                place(&larger),
                wgpu::Extent3d { width: side, height: side, depth_or_array_layers: layers },
            );
        }
        queue.submit([encoder.finish()]);
        self.view = array_view(&larger);
        self.texture = larger;
        true
    }

    fn write(&self, queue: &wgpu::Queue, slot: u32, data: &[u8], bytes_per_texel: u32) {
        write_square(queue, self.place(slot), self.texture.width(), data, bytes_per_texel);
    }

    fn place(&self, slot: u32) -> wgpu::TexelCopyTextureInfo<'_> {
        wgpu::TexelCopyTextureInfo {
            texture: &self.texture,
            mip_level: 0,
            origin: wgpu::Origin3d { x: 0, y: 0, z: slot },
            aspect: wgpu::TextureAspect::All,
        }
    }
}

fn create(device: &wgpu::Device, shape: &ArrayShape, layers: u32) -> wgpu::Texture {
    device.create_texture(&wgpu::TextureDescriptor {
        label: Some(shape.label),
        size: wgpu::Extent3d { width: shape.side, height: shape.side, depth_or_array_layers: layers },
        mip_level_count: shape.mips,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: shape.format,
        usage: shape.usage,
        view_formats: &[],
    })
}

/// Writes the whole of a layer, `side` × `side` texels.
fn write_square(
    queue: &wgpu::Queue,
    place: wgpu::TexelCopyTextureInfo<'_>,
    side: u32,
    data: &[u8],
    bytes_per_texel: u32,
) {
    queue.write_texture(
        place,
        data,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(bytes_per_texel * side),
            rows_per_image: Some(side),
        },
        wgpu::Extent3d { width: side, height: side, depth_or_array_layers: 1 },
    );
}

fn array_view(texture: &wgpu::Texture) -> wgpu::TextureView {
    texture.create_view(&wgpu::TextureViewDescriptor {
        dimension: Some(wgpu::TextureViewDimension::D2Array),
        ..wgpu::TextureViewDescriptor::default()
    })
}

/// What decides the trees that are drawn one by one.
#[derive(Debug)]
pub struct LandCoverArrays {
    /// Species, closure and height of stands.
    pub stands: TileArray,
    /// Nodes of the anchors, quanta.
    pub anchors: TileArray,
}

impl LandCoverArrays {
    fn new(device: &wgpu::Device, slots: u32, anchor_side: u32) -> Self {
        use wgpu::{TextureFormat, TextureUsages};
        let usage = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST | TextureUsages::COPY_SRC;
        let array = |label, side, format| {
            TileArray::new(device, ArrayShape { label, side, mips: 1, format, usage }, slots)
        };
        Self {
            stands: array("stands", CELLS, TextureFormat::Rgba8Uint),
            anchors: array("anchors", anchor_side, TextureFormat::R32Sint),
        }
    }
}

/// All arrays of a scene.
#[derive(Debug)]
pub struct TileArrays {
    /// Heights, metres.
    pub heights: TileArray,
    /// Pyramids of maxima over the cells.
    pub maxima: TileArray,
    /// Pyramids of minima over the cells, where the load map is in use ([`Self::with_minima`]).
    pub minima: Option<TileArray>,
    /// Surface type and canopy height.
    pub surface: TileArray,
    /// Photo.
    pub photo: TileArray,
    photo_format: PhotoFormat,
    /// Made with the first photo tile, where they are compressed.
    compress_photo: Option<CompressPhoto>,
    /// Land cover and anchors of trees, once a tile of them has come.
    pub land_cover: Option<LandCoverArrays>,
    /// Counts replaced arrays: bind groups of another generation are stale.
    pub generation: u64,
}

impl TileArrays {
    /// For so many elevation and photo slots. `with_surface`: the elevation layer carries surface types.
    /// The device has the features of `photo_format`.
    pub fn new(
        device: &wgpu::Device,
        elevation_slots: u32,
        texture_slots: u32,
        with_surface: bool,
        photo_format: PhotoFormat,
    ) -> Self {
        use wgpu::{TextureFormat, TextureUsages};
        let grows = TextureUsages::TEXTURE_BINDING | TextureUsages::COPY_DST | TextureUsages::COPY_SRC;
        let elevation = |label, side, mips, format, usage| {
            TileArray::new(device, ArrayShape { label, side, mips, format, usage }, elevation_slots)
        };
        // Where there is nothing to hold, one texel stands in.
        let surface_side = if with_surface { ELEVATION_SIDE } else { 1 };
        let photo_format = if texture_slots > 0 { photo_format } else { PhotoFormat::Rgba8 };
        let photo = ArrayShape {
            label: "photo",
            side: if texture_slots > 0 { TEXTURE_SIDE } else { 1 },
            mips: 1,
            format: photo_format.texture_format(),
            usage: match photo_format {
                // The browser copies decoded images by drawing them.
                PhotoFormat::Rgba8 => grows | TextureUsages::RENDER_ATTACHMENT,
                PhotoFormat::Bc7 | PhotoFormat::Astc => grows,
            },
        };
        Self {
            heights: elevation("heights", ELEVATION_SIDE, 1, TextureFormat::R32Float, grows),
            maxima: elevation(
                "maxima",
                CELLS / 2,
                CELLS.ilog2(),
                TextureFormat::R32Float,
                grows | TextureUsages::STORAGE_BINDING,
            ),
            minima: None,
            surface: elevation("surface", surface_side, 1, TextureFormat::Rg8Uint, grows),
            photo: TileArray::new(device, photo, texture_slots),
            photo_format,
            compress_photo: None,
            land_cover: None,
            generation: 0,
        }
    }

    /// The same with pyramids of minima, as the load map needs them; to be said before the first upload.
    pub fn with_minima(mut self, device: &wgpu::Device) -> Self {
        let shape = self.maxima.shape("minima");
        self.minima = Some(TileArray::new(device, shape, self.maxima.capacity));
        self
    }

    /// GPU memory of all arrays as they are now, bytes.
    pub fn bytes(&self) -> u64 {
        let arrays = [&self.heights, &self.maxima, &self.surface, &self.photo];
        let land_cover = self.land_cover.iter().flat_map(|arrays| [&arrays.stands, &arrays.anchors]);
        arrays.into_iter().chain(&self.minima).chain(land_cover).map(TileArray::bytes).sum()
    }

    /// How photo tiles are held.
    pub fn photo_format(&self) -> PhotoFormat {
        self.photo_format
    }

    /// The pass that compresses photo tiles, if one has been compressed.
    pub fn compress_photo(&self) -> Option<&CompressPhoto> {
        self.compress_photo.as_ref()
    }

    /// Uploads an elevation tile into its slot; the maxima (and minima) are the caller's to derive.
    pub fn upload_elevation(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        slot: u32,
        pixels: &ElevationPixels,
    ) {
        let mut grown = self.heights.ensure(device, queue, slot);
        grown |= self.maxima.ensure(device, queue, slot);
        if let Some(minima) = &mut self.minima {
            grown |= minima.ensure(device, queue, slot);
        }
        self.heights.write(queue, slot, bytemuck::cast_slice(&pixels.summary.heights), 4);
        if self.surface.texture.width() == ELEVATION_SIDE {
            grown |= self.surface.ensure(device, queue, slot);
            match &pixels.surface {
                Some(surface) => self.surface.write(queue, slot, surface, 2),
                None => {
                    let plain = vec![0_u8; 2 * (ELEVATION_SIDE * ELEVATION_SIDE) as usize];
                    self.surface.write(queue, slot, &plain, 2);
                }
            }
        }
        self.generation += u64::from(grown);
    }

    /// Uploads a tile of land cover into its slot, of which there are so many at most.
    pub fn upload_land_cover(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        (slot, slots): (u32, u32),
        pixels: &LandCoverPixels,
    ) {
        let mut grown = self.land_cover.is_none();
        let arrays =
            self.land_cover.get_or_insert_with(|| LandCoverArrays::new(device, slots, pixels.anchor_side));
        grown |= arrays.stands.ensure(device, queue, slot);
        grown |= arrays.anchors.ensure(device, queue, slot);
        arrays.stands.write(queue, slot, &pixels.stands, 4);
        arrays.anchors.write(queue, slot, bytemuck::cast_slice(&pixels.anchors), 4);
        self.generation += u64::from(grown);
    }

    /// Uploads a photo tile into its slot.
    pub fn upload_photo(
        &mut self,
        device: &wgpu::Device,
        queue: &wgpu::Queue,
        slot: u32,
        pixels: &PhotoPixels,
    ) {
        self.generation += u64::from(self.photo.ensure(device, queue, slot));
        if self.compress_photo.is_none() {
            self.compress_photo = CompressPhoto::new(device, self.photo_format);
        }
        let place = match &self.compress_photo {
            Some(pass) => pass.tile().as_image_copy(),
            None => self.photo.place(slot),
        };
        match pixels {
            PhotoPixels::Rgba(rgba) => write_square(queue, place, TEXTURE_SIDE, rgba, 4),
            #[cfg(target_arch = "wasm32")]
            PhotoPixels::Bitmap(bitmap) => {
                queue.copy_external_image_to_texture(
                    &wgpu::CopyExternalImageSourceInfo {
                        source: wgpu::ExternalImageSource::ImageBitmap(bitmap.clone()),
                        origin: wgpu::Origin2d::ZERO,
                        flip_y: false,
                    },
                    place.to_tagged(wgpu::PredefinedColorSpace::Srgb, false),
                    wgpu::Extent3d { width: TEXTURE_SIDE, height: TEXTURE_SIDE, depth_or_array_layers: 1 },
                );
                // Its memory is the browser's, and not small.
                bitmap.close();
            }
        }
        if let Some(pass) = &self.compress_photo {
            let mut encoder = device
                .create_command_encoder(&wgpu::CommandEncoderDescriptor { label: Some("compress_photo") });
            pass.record(&mut encoder, self.photo.place(slot));
            queue.submit([encoder.finish()]);
        }
    }
}
