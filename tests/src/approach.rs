//! An approach to a forest slope of the built-in landscape, from 5 km to 20 m, and its frames: as a visitor sees them
//! whose tiles come at once.

use crate::router_tiles::RouterTiles;
use anyhow::{Context as _, ensure};
use glam::{DVec3, Vec3};
use treeline_client::engine::{Engine, EngineOptions, HandOver, ViewRequest};
use treeline_client::frame::FrameTarget;
use treeline_client::headless::capture::{read_texture, wait};
use treeline_client::headless::fetch::fetch_tile;
use treeline_client::headless::trees::drawn_depths;
use treeline_client::headless::{self, AdapterChoice};
use treeline_client::stream::StreamOptions;
use treeline_client::stream::view::ViewGeometry;
use treeline_core::camera::GeographicCamera;
use treeline_core::geodesy::EQUATOR_METRES;

/// Frames of the whole approach.
pub const FRAMES: usize = 600;
/// Distance from the point looked at in the first frame and in the last, metres.
pub const ENDS_METRES: [f64; 2] = [5_000.0, 20.0];
/// Picture: the middle sixteenth of 1280 × 1024 pixels at 50°, so that a pixel is as wide as there.
pub const SIZE: [u32; 2] = [320, 256];
/// Its field of view, degrees.
pub const FOV_Y_DEG: f64 = 13.3;
/// Seconds between frames.
const FRAME_SECONDS: f64 = 1.0 / 60.0;
/// Metres of a degree of latitude.
const DEGREE_METRES: f64 = EQUATOR_METRES / 360.0;
/// Downward slope of the line of approach, degrees.
const DOWN_DEG: f64 = 25.0;
/// Steps of streaming for one frame at most.
const MOST_STEPS: usize = 2_000;

/// The point looked at, and the line along which the eye comes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Approach {
    /// Degrees east and north, metres above the ellipsoid.
    target: [f64; 3],
    heading_deg: f64,
}

/// Heights in a box, samples row by row from the north-west.
pub fn heights(tiles: &RouterTiles, layer: &str, bounds: [f64; 4], side: u32) -> anyhow::Result<Vec<f32>> {
    let [west, south, east, north] = bounds;
    let url = format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS={layer}&STYLES=&CRS=CRS:84&BBOX={west},{south},{east},{north}&WIDTH={side}&HEIGHT={side}&FORMAT=application/bil32"
    );
    Ok(bytemuck::pod_collect_to_vec(&tiles.get(&url)?))
}

/// West, south, east and north of a square about a place, degrees.
fn square(longitude: f64, latitude: f64, half_metres: f64) -> [f64; 4] {
    let half = half_metres / DEGREE_METRES;
    let half_x = half / latitude.to_radians().cos();
    [longitude - half_x, latitude - half, longitude + half_x, latitude + half]
}

/// Bare ground, between samples.
#[derive(Clone, Debug)]
pub struct Ground {
    /// West, south, east, north, degrees.
    bounds: [f64; 4],
    side: usize,
    heights: Vec<f32>,
}

impl Ground {
    /// About a place, so many metres to each side.
    fn read(tiles: &RouterTiles, longitude: f64, latitude: f64, half_metres: f64) -> anyhow::Result<Self> {
        const SIDE: u32 = 1024;
        let bounds = square(longitude, latitude, half_metres);
        Ok(Self { bounds, side: SIDE as usize, heights: heights(tiles, "elevation", bounds, SIDE)? })
    }

    /// Level ground in a box.
    pub fn level(bounds: [f64; 4], metres: f32) -> Self {
        Self { bounds, side: 2, heights: vec![metres; 4] }
    }

    /// Metres; `None` outside.
    pub fn height(&self, longitude: f64, latitude: f64) -> Option<f64> {
        let [west, south, east, north] = self.bounds;
        let side = self.side as f64;
        let x = (longitude - west) / (east - west) * side - 0.5;
        let y = (north - latitude) / (north - south) * side - 0.5;
        if x < 0.0 || y < 0.0 || x > side - 1.0 || y > side - 1.0 {
            return None;
        }
        let (left, top) = ((x as usize).min(self.side - 2), (y as usize).min(self.side - 2));
        let at = |dx: usize, dy: usize| f64::from(self.heights[(top + dy) * self.side + left + dx]);
        let across = x - left as f64;
        let [upper, lower] = [0, 1].map(|row| at(0, row) + across * (at(1, row) - at(0, row)));
        Some(upper + (y - top as f64) * (lower - upper))
    }
}

impl Approach {
    /// The ground about the point looked at.
    pub fn ground(&self, tiles: &RouterTiles) -> anyhow::Result<Ground> {
        Ground::read(tiles, self.target[0], self.target[1], 2_000.0)
    }

    /// To the first wooded slope of a grid over the landscape's middle; against the slope.
    pub fn new(tiles: &RouterTiles) -> anyhow::Result<Self> {
        const SIDE: usize = 40;
        const HALF_METRES: f64 = 150.0;
        for step in 0..900 {
            let (longitude, latitude) =
                (10.85 + 0.01 * f64::from(step % 30), 46.85 + 0.008 * f64::from(step / 30));
            let bounds = square(longitude, latitude, HALF_METRES);
            let ground = heights(tiles, "elevation", bounds, SIDE as u32)?;
            let mean = |of: &dyn Fn(usize, usize) -> bool| {
                let chosen = (0..SIDE * SIDE).filter(|index| of(index % SIDE, index / SIDE));
                2.0 * chosen.map(|index| f64::from(ground[index])).sum::<f64>() / (SIDE * SIDE) as f64
            };
            let half = SIDE / 2;
            let east = (mean(&|x, _| x >= half) - mean(&|x, _| x < half)) / HALF_METRES;
            let north = (mean(&|_, y| y < half) - mean(&|_, y| y >= half)) / HALF_METRES;
            if !(0.4..0.7).contains(&east.hypot(north)) {
                continue;
            }
            let combined = heights(tiles, "combined-elevation", bounds, SIDE as u32)?;
            let wooded = combined.iter().zip(&ground).filter(|(map, ground)| **map > **ground + 5.0).count();
            if 4 * wooded < 3 * combined.len() {
                continue;
            }
            let middle = f64::from(ground[half * SIDE + half]) + 14.0;
            let found = Self {
                target: [longitude, latitude, middle],
                heading_deg: east.atan2(north).to_degrees().rem_euclid(360.0),
            };
            if found.is_free(tiles)? {
                return Ok(found);
            }
        }
        anyhow::bail!("the built-in landscape has no wooded slope")
    }

    /// Whether nothing stands before the point, from as far as the first frame.
    fn is_free(&self, tiles: &RouterTiles) -> anyhow::Result<bool> {
        for step in 1..=25 {
            let distance = ENDS_METRES[0] * f64::from(step) / 25.0;
            let camera = self.camera(distance);
            let bounds = square(camera.lon, camera.lat, 20.0);
            let ground = heights(tiles, "elevation", bounds, 2)?;
            if ground.iter().any(|&ground| f64::from(ground) + 60.0 > camera.height && distance > 150.0) {
                return Ok(false);
            }
        }
        Ok(true)
    }

    /// The camera at a distance from the point, metres.
    pub fn camera(&self, distance: f64) -> GeographicCamera {
        let (sine, cosine) = self.heading_deg.to_radians().sin_cos();
        let level = distance * DOWN_DEG.to_radians().cos();
        let [longitude, latitude, height] = self.target;
        GeographicCamera {
            lon: longitude - level * sine / (DEGREE_METRES * latitude.to_radians().cos()),
            lat: latitude - level * cosine / DEGREE_METRES,
            height: height + distance * DOWN_DEG.to_radians().sin(),
            heading_deg: self.heading_deg,
            pitch_deg: -DOWN_DEG,
            fov_y_deg: FOV_Y_DEG,
        }
    }

    /// Distance of a frame, metres: it shrinks by the same ratio every frame.
    pub fn distance(frame: usize) -> f64 {
        ENDS_METRES[0] * (ENDS_METRES[1] / ENDS_METRES[0]).powf(frame as f64 / (FRAMES - 1) as f64)
    }
}

/// A frame, read back.
#[derive(Clone, Debug)]
pub struct Shown {
    /// Who looked.
    pub view: ViewGeometry,
    /// sRGB, of 255.
    pub colours: Vec<Vec3>,
    /// Metres from the eye to the surface of the height map; negative for the sky.
    pub surface: Vec<f32>,
    /// Metres from the eye to what is drawn: trees, the canopy, the ground below.
    pub drawn: Vec<f32>,
    /// Trees drawn.
    pub trees: u64,
}

/// An engine that flies.
pub struct Flyer<'a> {
    /// The engine.
    pub engine: Engine,
    tiles: &'a RouterTiles,
    picture: wgpu::Texture,
    now: f64,
}

impl<'a> Flyer<'a> {
    /// With trees as on a graphics card. Where the switch is hard, tiles do not fade in, either.
    pub fn new(tiles: &'a RouterTiles, hand_over: HandOver) -> anyhow::Result<Self> {
        let stream = match hand_over {
            HandOver::Faded => StreamOptions::default(),
            HandOver::Hard => StreamOptions { fade_seconds: 0.0, ..StreamOptions::default() },
        };
        let options = EngineOptions {
            stream,
            tree_metres: Some(1_000.0),
            undergrowth_metres: Some(0.0),
            uploads_per_step: usize::MAX,
            hand_over,
            ..EngineOptions::default()
        };
        let engine = Engine::new(headless::open(AdapterChoice::Software)?, tiles.scene()?, options)?;
        let picture = engine.gpu().device.create_texture(&wgpu::TextureDescriptor {
            label: Some("picture"),
            size: wgpu::Extent3d { width: SIZE[0], height: SIZE[1], depth_or_array_layers: 1 },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba8UnormSrgb,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT | wgpu::TextureUsages::COPY_SRC,
            view_formats: &[],
        });
        Ok(Self { engine, tiles, picture, now: 0.0 })
    }

    /// Draws the next frame, once all that it wants has come.
    pub fn frame(&mut self, camera: GeographicCamera) -> anyhow::Result<Shown> {
        let request = ViewRequest {
            camera,
            width: SIZE[0],
            height: SIZE[1],
            sun_unix_seconds: None,
            shadow_steps: treeline_client::engine::DEFAULT_SHADOW_STEPS,
            weather: treeline_client::engine::Weather::default(),
        };
        let mut steps = 0;
        loop {
            let report = self.engine.step(self.now, &request, None);
            if report.complete {
                break;
            }
            let idle = report.requests.is_empty();
            for asked in report.requests {
                let fetched = fetch_tile(self.tiles, &asked.resource, &asked.url);
                self.engine.deliver(self.now, asked.id, fetched.map(|fetched| fetched.payload));
            }
            if idle {
                wait(self.engine.gpu())?;
            }
            steps += 1;
            ensure!(steps < MOST_STEPS, "not settled: {:?}", report.progress);
        }
        let view = self.picture.create_view(&wgpu::TextureViewDescriptor::default());
        let target = FrameTarget { view: &view, format: self.picture.format() };
        self.engine.invalidate();
        self.engine.step(self.now, &request, Some(&target));
        self.now += FRAME_SECONDS;
        wait(self.engine.gpu())?;
        self.shown()
    }

    fn shown(&mut self) -> anyhow::Result<Shown> {
        let rgba = read_texture(self.engine.gpu(), &self.picture)?;
        let targets = self.engine.targets().context("nothing has been drawn")?;
        let surface: Vec<f32> =
            bytemuck::pod_collect_to_vec(&read_texture(self.engine.gpu(), &targets.distance)?);
        let view = self.engine.drawn_geometry().context("nothing has been drawn")?.clone();
        let depths = drawn_depths(&self.engine)?;
        let drawn = surface.iter().enumerate().map(|(index, &surface)| {
            let Some(depths) = &depths else { return surface };
            let ahead = direction(&view, index).dot(view.forward) as f32;
            let along = depths[index] / ahead;
            // The canopy's own depth is written behind it.
            if (along - surface - 10.0).abs() < 0.01 + 1e-3 * surface { surface } else { along }
        });
        let drawn = drawn.collect();
        let trees = self.engine.stats().seeds.map_or(0, |seeds| seeds.selected);
        let colours =
            rgba.as_chunks::<4>().0.iter().map(|p| Vec3::from([p[0], p[1], p[2]].map(f32::from))).collect();
        Ok(Shown { view, colours, surface, drawn, trees })
    }

    /// The last frame as a picture.
    pub fn picture(&self) -> anyhow::Result<image::RgbaImage> {
        let rgba = read_texture(self.engine.gpu(), &self.picture)?;
        image::RgbaImage::from_raw(SIZE[0], SIZE[1], rgba).context("a picture of another size")
    }
}

/// Unit direction of a pixel's ray, east-north-up at the eye.
pub fn direction(view: &ViewGeometry, index: usize) -> DVec3 {
    let width = view.size[0] as usize;
    view.direction((index % width) as f64 + 0.5, (index / width) as f64 + 0.5)
}
