//! Bind groups of a frame, and what its passes are specialised for.

use crate::gpu::targets::Targets;
use crate::gpu::tile_arrays::TileArrays;
use crate::passes::select_trees::SelectVariant;
use crate::passes::shade::ShadeVariant;
use crate::stream::page_table::Tables;
use treeline_shaders::layout::{EYE_BELOW, View};
use treeline_shaders::season::FLAG_SEASON;
use treeline_shaders::weather::{FLAG_CLOUDS, FLAG_WIND};

/// Whether a flag of a view is set.
pub(super) fn has(view: &View, flag: u32) -> bool {
    view.flags & flag != 0
}

/// Whether rays of this view start below the surface and can be told what lies above them.
pub(super) fn goes_below(view: &View, arrays: &TileArrays) -> bool {
    has(view, EYE_BELOW) && arrays.minima.is_some()
}

pub(super) fn select_variant(view: &View, tables: &Tables) -> SelectVariant {
    SelectVariant {
        photo: !tables.pages.is_empty(),
        shadows: view.shadow_steps > 0,
        season: has(view, FLAG_SEASON),
        clouds: has(view, FLAG_CLOUDS),
    }
}

pub(super) fn shade_variant(
    format: wgpu::TextureFormat,
    arrays: &TileArrays,
    view: &View,
    tables: &Tables,
) -> ShadeVariant {
    ShadeVariant {
        format,
        photo: !tables.pages.is_empty(),
        surface: arrays.surface.side() > 1,
        shadows: view.shadow_steps > 0,
        season: has(view, FLAG_SEASON),
        wind: has(view, FLAG_WIND),
        clouds: has(view, FLAG_CLOUDS),
        trees: false,
    }
}

pub(super) fn hits_group(
    device: &wgpu::Device,
    layout: &wgpu::BindGroupLayout,
    targets: &Targets,
) -> wgpu::BindGroup {
    let views = [&targets.distance_view, &targets.hit_view];
    bind(device, "hits", layout, views.map(wgpu::BindingResource::TextureView))
}

pub(super) fn bind<const N: usize>(
    device: &wgpu::Device,
    label: &str,
    layout: &wgpu::BindGroupLayout,
    resources: [wgpu::BindingResource<'_>; N],
) -> wgpu::BindGroup {
    let entries: Vec<wgpu::BindGroupEntry<'_>> = resources
        .into_iter()
        .enumerate()
        .map(|(binding, resource)| wgpu::BindGroupEntry { binding: binding as u32, resource })
        .collect();
    device.create_bind_group(&wgpu::BindGroupDescriptor { label: Some(label), layout, entries: &entries })
}
