//! `treeline seed`: tiles made beforehand, as the page will ask for them.

use super::config;
use crate::cache::MakeError;
use crate::cli::SeedArguments;
use crate::http::{Order, extent, has_layer, layers, make, maximum_level};
use crate::opening::open;
use crate::recipe::Format;
use crate::scene::Scene;
use crate::source::SampleGrid;
use crate::state::{App, AppState};
use crate::user_error::UserError;
use indicatif::{ProgressBar, ProgressStyle};
use std::io::Write as _;
use std::sync::Arc;
use std::time::Duration;
use tokio::task::JoinSet;
use treeline_core::grid::LatticeWindow;
use treeline_core::layer::Layer;
use treeline_core::tile::{GeographicBox, TileAddress, columns, rows, span_degrees};

/// Longest time for the last tiles to be written.
const LONGEST_FLUSH: Duration = Duration::from_secs(120);

/// Makes all tiles of the box and levels that the folder does not hold yet.
pub fn seed(arguments: &SeedArguments) -> Result<(), UserError> {
    let mut config = config(&arguments.serve)?;
    if config.cache.is_none() {
        return Err(UserError::new("seed needs a folder to fill; add --cache FOLDER"));
    }
    // Tiles pass through memory once; what counts is the folder.
    config.memory_cache_mib = config.memory_cache_mib.min(16);
    let scene = Arc::new(open(&arguments.serve.scene)?);
    let wanted = wanted_layers(&scene, &arguments.layers)?;
    let app = App::new(scene, &config)?;
    let runtime = tokio::runtime::Builder::new_current_thread()
        .enable_all()
        .build()
        .map_err(|error| UserError::new(format!("the system gives no threads ({error})")))?;
    runtime.block_on(run(&app, arguments, &wanted, config.threads()))
}

fn wanted_layers(scene: &Scene, asked: &[Layer]) -> Result<Vec<Layer>, UserError> {
    if asked.is_empty() {
        return Ok(layers(scene).map(|row| row.layer).collect());
    }
    match asked.iter().find(|&&layer| !has_layer(scene, layer)) {
        Some(layer) => {
            Err(UserError::new(format!("--layers {}: this scene has no such layer", layer.name())))
        }
        None => Ok(asked.to_vec()),
    }
}

async fn run(
    app: &AppState,
    arguments: &SeedArguments,
    wanted: &[Layer],
    threads: usize,
) -> Result<(), UserError> {
    let ranges: Vec<(Layer, TileRange)> = wanted
        .iter()
        .flat_map(|&layer| {
            let bounds = extent(&app.scene, layer).bounds;
            let deepest = maximum_level(&app.scene, layer);
            let levels = arguments.levels.clone().filter(move |&level| level <= deepest);
            levels.flat_map(move |level| {
                TileRange::all(level, &arguments.bbox, &bounds).into_iter().map(move |range| (layer, range))
            })
        })
        .collect();
    let total = ranges.iter().map(|(_, range)| range.len()).sum();
    let progress = ProgressBar::new(total);
    // The template is ours and sound; a plain bar does as well.
    let style = ProgressStyle::with_template("{bar:40} {pos} of {len} tiles, {per_sec}, {eta} left {msg}");
    progress.set_style(style.unwrap_or_else(|_| ProgressStyle::default_bar()));
    let (mut made, mut found) = (0_u64, 0_u64);
    let mut under_way = JoinSet::new();
    for (layer, address) in ranges.iter().flat_map(|(layer, range)| range.tiles().map(|tile| (*layer, tile)))
    {
        let order = order(layer, address);
        let key = order.key();
        if app.cache.is_on_disk(&key) {
            found += 1;
            progress.inc(1);
            continue;
        }
        // Enough to keep the workers busy, few enough that the queue never overflows.
        if under_way.len() >= 2 * threads {
            made += finish(&mut under_way, &progress).await?;
        }
        let app = app.clone();
        under_way.spawn(async move {
            let scene = app.scene.clone();
            let making = app.cache.get(&key, Arc::new(move || make(&scene, &order))).await;
            making.map(|_| ()).map_err(|error| (layer, address, error))
        });
    }
    while !under_way.is_empty() {
        made += finish(&mut under_way, &progress).await?;
    }
    progress.finish_and_clear();
    if !app.cache.flush(LONGEST_FLUSH) {
        return Err(UserError::new(
            "the folder takes too long to write; run the same command again to go on",
        ));
    }
    let mut output = std::io::stdout().lock();
    let _ = writeln!(output, "treeline: {made} tiles made, {found} were there already");
    Ok(())
}

type Making = Result<(), (Layer, TileAddress, MakeError)>;

async fn finish(under_way: &mut JoinSet<Making>, progress: &ProgressBar) -> Result<u64, UserError> {
    match under_way.join_next().await {
        None => Ok(0),
        Some(Ok(Ok(()))) => {
            progress.inc(1);
            Ok(1)
        }
        Some(Ok(Err((layer, address, error)))) => {
            Err(UserError::new(format!("{} tile {address}: {error}", layer.name())))
        }
        Some(Err(error)) => Err(UserError::new(format!("a tile could not be made ({error})"))),
    }
}

/// The order that the client's URL of the tile comes down to.
fn order(layer: Layer, address: TileAddress) -> Order {
    let row = layer.row();
    let window = LatticeWindow::of_tile(address, row.registration, row.border);
    let format = Format::from_media_type(layer, row.client_format).unwrap_or(Format::Png);
    Order::new(layer, SampleGrid::Lattice(window), format).filled(true)
}

/// The tiles of a level that a box touches; columns may run past the last, and wrap.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
struct TileRange {
    level: u8,
    rows: (u32, u32),
    first_column: i64,
    columns: u32,
}

impl TileRange {
    /// The tiles that touch both the box asked for and the extent: none, one range, or one for each
    /// end of the turn where the box crosses the antimeridian.
    fn all(level: u8, asked: &GeographicBox, extent: &GeographicBox) -> Vec<Self> {
        [-360.0, 0.0, 360.0]
            .into_iter()
            .filter_map(|turn| Self::on_turn(level, asked, extent, turn))
            .collect()
    }

    fn on_turn(level: u8, asked: &GeographicBox, extent: &GeographicBox, turn: f64) -> Option<Self> {
        let span = span_degrees(level);
        let west = (asked.west + turn).max(extent.west);
        let east = (asked.east + turn).min(extent.east);
        let north = asked.north.min(extent.north);
        let south = asked.south.max(extent.south);
        if west >= east || south >= north {
            return None;
        }
        let last = rows(level) - 1;
        let row = |latitude: f64| ((90.0 - latitude) / span).max(0.0);
        let first_row = (row(north).floor() as u32).min(last);
        let last_row = ((row(south).ceil() as u32).max(first_row + 1) - 1).min(last);
        let first_column = ((west + 180.0) / span).floor() as i64;
        let last_column = (((east + 180.0) / span).ceil() as i64).max(first_column + 1) - 1;
        let columns_wanted = (last_column - first_column + 1).min(i64::from(columns(level))) as u32;
        Some(Self { level, rows: (first_row, last_row), first_column, columns: columns_wanted })
    }

    fn len(&self) -> u64 {
        u64::from(self.rows.1 - self.rows.0 + 1) * u64::from(self.columns)
    }

    fn tiles(self) -> impl Iterator<Item = TileAddress> {
        let around = i64::from(columns(self.level));
        (self.rows.0..=self.rows.1).flat_map(move |row| {
            (0..i64::from(self.columns)).filter_map(move |offset| {
                let column = (self.first_column + offset).rem_euclid(around) as u32;
                TileAddress::new(self.level, row, column)
            })
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const WORLD: GeographicBox = GeographicBox::WORLD;

    #[test]
    fn tiles_of_a_box() {
        let alps = GeographicBox { west: 10.0, south: 46.0, east: 11.0, north: 47.0 };
        let ranges = TileRange::all(6, &alps, &WORLD);
        let tiles: Vec<TileAddress> = ranges.iter().flat_map(|range| range.tiles()).collect();
        assert_eq!(tiles.len() as u64, ranges.iter().map(TileRange::len).sum::<u64>());
        assert!(tiles.iter().all(|tile| tile.bounds().intersects(&alps)));
        assert!(tiles.contains(&TileAddress::at(6, 10.5, 46.5)));
        let there = GeographicBox { west: 20.0, south: 0.0, east: 21.0, north: 1.0 };
        assert_eq!(TileRange::all(6, &alps, &there), []);
    }

    #[test]
    fn a_box_on_tile_edges_takes_no_neighbours() {
        let quarter = GeographicBox { west: 0.0, south: 0.0, east: 90.0, north: 90.0 };
        let ranges = TileRange::all(1, &quarter, &WORLD);
        assert_eq!(ranges.len(), 1);
        assert_eq!(ranges[0].tiles().collect::<Vec<_>>(), [TileAddress::new(1, 0, 2).unwrap()]);
        assert_eq!(TileRange::all(1, &WORLD, &WORLD)[0].len(), 8);
    }

    #[test]
    fn across_the_antimeridian() {
        let fiji = GeographicBox { west: 177.0, south: -19.0, east: 183.0, north: -16.0 };
        let source = GeographicBox { west: 176.0, south: -20.0, east: 182.0, north: -15.0 };
        for extent in [WORLD, source] {
            let tiles: Vec<TileAddress> =
                TileRange::all(5, &fiji, &extent).iter().flat_map(|range| range.tiles()).collect();
            assert!(tiles.iter().all(|tile| tile.bounds().intersects(&fiji)));
            assert!(tiles.iter().any(|tile| tile.column == 0) && tiles.iter().any(|tile| tile.column == 63));
        }
    }

    #[test]
    fn the_order_is_what_the_clients_url_comes_down_to() {
        for row in &treeline_core::layer::LAYERS {
            let address = TileAddress::new(11, 490, 1087).unwrap();
            let window = LatticeWindow::of_tile(address, row.registration, row.border);
            let SampleGrid::Lattice(found) =
                crate::http::geographic_grid(row.layer, &window.pixel_box(), window.width, window.height)
            else {
                panic!("{} is no window of the lattice", row.name)
            };
            assert_eq!(order(row.layer, address).request().grid, SampleGrid::Lattice(found));
        }
    }
}
