//! What a server's memory comes to under mixed load, over what its configuration gives the tiles: a minute, or as many
//! seconds as `TREELINE_SECONDS` says (an hour: 3600). Maps of random boxes in all formats, tiles asked for again,
//! combined tiles, capabilities, places, large maps, wrong requests, clients that leave before their answer. Of the Hong
//! Kong scene where there is one, else of the built-in one. Linux. One JSON object a line.

use anyhow::{Context, ensure};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::Relaxed};
use std::time::{Duration, Instant};
use treeline_core::tile::TileAddress;
use treeline_tests::data;
use treeline_tests::measure::{Numbers, memory, print, quantile, setting};
use treeline_tests::program::Server;
use treeline_tests::raw_http::{Connection, counter};

/// Memory for tiles, MiB: little, so that it is full soon.
const TILES_MIB: u64 = 64;
const CLIENTS: usize = 8;

/// Where requests are for.
struct Place {
    west: f64,
    south: f64,
    east: f64,
    north: f64,
}

impl Place {
    /// The next request: a path and lines of headers.
    fn request(&self, numbers: &mut Numbers) -> (String, &'static str) {
        let kind = numbers.below(100);
        let side = match kind {
            0 => 2048,
            _ => [256, 512, 512][numbers.below(3)],
        };
        let part = 0.05 * 20_f64.powf(numbers.unit());
        let (width, height) = (part * (self.east - self.west), part * (self.north - self.south));
        let mut places = (numbers.unit(), numbers.unit());
        if kind < 50 {
            // Some boxes come again and again.
            places = ((numbers.below(12) as f64) / 12.0, (numbers.below(12) as f64) / 12.0);
        }
        let west = self.west + places.0 * (self.east - self.west - width);
        let south = self.south + places.1 * (self.north - self.south - height);
        let (layer, format) = [
            ("texture", "image/jpeg"),
            ("texture", "image/png"),
            ("texture", "image/webp"),
            ("elevation", "application/bil16"),
            ("elevation", "application/bil32"),
            ("elevation", "image/tiff"),
            ("elevation", "image/png"),
        ][numbers.below(7)];
        let map = |request: &str| {
            format!(
                "/wms?SERVICE=WMS&VERSION=1.1.1&REQUEST={request}&LAYERS={layer}&STYLES=&SRS=EPSG:4326&BBOX={west},{south},{},{}&WIDTH={side}&HEIGHT={side}&FORMAT={format}",
                west + width,
                south + height
            )
        };
        let packed = ["", "Accept-Encoding: zstd\r\n", "Accept-Encoding: gzip\r\n"][numbers.below(3)];
        let path = match kind {
            0..70 => map("GetMap"),
            70..84 => {
                let level = 10 + numbers.below(8) as u8;
                let tile = TileAddress::at(level, west + width / 2.0, south + height / 2.0);
                format!(
                    "/tiles/combined-elevation/TreelineGeographic/{level}/{}/{}?f=treeline",
                    tile.row, tile.column
                )
            }
            84..88 => "/wms?REQUEST=GetCapabilities&SERVICE=WMS".to_owned(),
            88..92 => map("GetFeatureInfo") + &format!("&QUERY_LAYERS={layer}&X=9&Y=9"),
            92..96 => map("GetMap").replace("WIDTH=", "WIDTH=9e9"),
            _ => map("GetMap").replace("LAYERS=", &format!("LAYERS={}", "none,".repeat(500))),
        };
        (path, packed)
    }
}

/// Asks until told to stop.
fn client(
    address: &str,
    seed: usize,
    place: &Place,
    stop: &AtomicBool,
    answers: &AtomicU64,
) -> anyhow::Result<()> {
    let mut numbers = Numbers::new(seed as u32 + 1);
    let mut connection = Connection::open(address)?;
    while !stop.load(Relaxed) {
        let (path, headers) = place.request(&mut numbers);
        connection.ask_with(&path, headers)?;
        if numbers.below(50) == 0 {
            // Gone before its answer.
            connection = Connection::open(address)?;
            continue;
        }
        let answer = connection.answer()?;
        ensure!(answer.status < 500, "{path}: {}", answer.status);
        answers.fetch_add(1, Relaxed);
    }
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let configuration = folder.path().join("treeline.toml");
    std::fs::write(
        &configuration,
        format!("memory_cache_mib = {TILES_MIB}\ndisk_cache_mib = 256\ncache = \"tiles\"\n"),
    )?;
    let configuration = configuration.to_str().context("a path")?;
    let scene = data::find("scene_hongkong");
    let mut arguments = vec!["--config".to_owned(), configuration.to_owned()];
    let place = match &scene {
        Some(folder) => {
            for (flag, name) in [("--dem", "dem_aster30m_4326.tif"), ("--photo", "ortho_landsat8_4326.tif")] {
                arguments.extend([flag.to_owned(), folder.join(name).display().to_string()]);
            }
            Place { west: 114.081, south: 22.152, east: 114.298, north: 22.299 }
        }
        None => Place { west: 10.9, south: 46.8, east: 11.2, north: 47.0 },
    };
    let arguments: Vec<&str> = arguments.iter().map(String::as_str).collect();
    let server = Server::start(&arguments)?;
    let begun = memory(server.id())?.now;
    let seconds = setting("TREELINE_SECONDS", 60);
    let (stop, answers) = (AtomicBool::new(false), AtomicU64::new(0));
    let mut samples = Vec::new();
    std::thread::scope(|scope| {
        let clients: Vec<_> = (0..CLIENTS)
            .map(|seed| {
                let (address, place, stop, answers) = (server.address(), &place, &stop, &answers);
                scope.spawn(move || client(address, seed, place, stop, answers))
            })
            .collect();
        let start = Instant::now();
        while start.elapsed().as_secs() < seconds {
            std::thread::sleep(Duration::from_secs(1));
            samples.push(memory(server.id()).map(|memory| memory.now));
        }
        stop.store(true, Relaxed);
        for client in clients {
            client.join().map_err(|_| anyhow::anyhow!("a client panicked"))??;
        }
        anyhow::Ok(())
    })?;
    let samples = samples.into_iter().collect::<anyhow::Result<Vec<f64>>>()?;
    // What a load leaves when it is over.
    std::thread::sleep(Duration::from_secs(3));
    let left = memory(server.id())?;
    let tiles = counter(server.address(), "treeline_cache_bytes", "")? / f64::from(1 << 20);
    let sources = counter(server.address(), "treeline_source_cache_bytes", "")? / f64::from(1 << 20);
    print("mixed load", seconds as f64, "s");
    print("answers", answers.into_inner() as f64, "");
    print("configured for tiles", TILES_MIB as f64, "MiB");
    print("tiles held at the end", tiles, "MiB");
    print("decoded source data held at the end", sources, "MiB");
    print("resident at the start", begun, "MiB");
    print("resident under load, median", quantile(&samples, 0.5), "MiB");
    print("resident at the end", left.now, "MiB");
    print("most that was resident", left.peak, "MiB");
    // Source data have bounds of their own, which this scene does not reach: what is held counts.
    let budget = TILES_MIB as f64 + sources;
    print("at the end, over the budget", left.now - budget, "MiB");
    print("under load (median), over the budget", quantile(&samples, 0.5) - budget, "MiB");
    let parts: Vec<&[f64]> = samples.chunks(samples.len().div_ceil(4).max(1)).collect();
    if let [_, second, .., last] = parts[..] {
        print(
            "growth from the second quarter to the last",
            quantile(last, 0.5) - quantile(second, 0.5),
            "MiB",
        );
    }
    Ok(())
}
