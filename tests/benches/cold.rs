//! What a tile takes that nobody has asked for before, beside others that make the same from the same file: GDAL from
//! Python (dataset open, files warm), and MapServer as FastCGI behind nginx. Boxes of the Hong Kong scene at random,
//! 512 × 512: photos as JPEG of quality 85, heights as bil here and as PNG of 16 bits there. In turns, box by box; ratios
//! of medians. Then 8 connections at once, and combined tiles each on its own. One JSON object a line.

use anyhow::{Context, ensure};
use std::fmt::Write as _;
use std::io::{BufRead as _, BufReader, Write as _};
use std::path::{Path, PathBuf};
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::Instant;
use treeline_core::tile::TileAddress;
use treeline_tests::data;
use treeline_tests::measure::{Numbers, median, print, quantile};
use treeline_tests::program::Server;
use treeline_tests::raw_http::Connection;

#[path = "cold/mapserver.rs"]
mod mapserver;

const SIDE: u32 = 512;
/// Where both rasters have data, degrees.
const PLACE: [f64; 4] = [114.081, 22.152, 114.298, 22.299];
/// Boxes in turns.
const BOXES: usize = 150;
/// Boxes that are not counted, before them.
const WARM: usize = 10;
const CONNECTIONS: usize = 8;
/// Requests at once, all connections together.
const CROWD: usize = 800;

type Box = [f64; 4];

/// A box within the place, as wide as high on the ground, an eighth to the whole of it.
fn random_box(numbers: &mut Numbers) -> Box {
    let [west, south, east, north] = PLACE;
    let part = 0.125 * 8_f64.powf(numbers.unit());
    let (width, height) = (part * (east - west), part * (north - south));
    let left = west + numbers.unit() * (east - west - width);
    let bottom = south + numbers.unit() * (north - south - height);
    [left, bottom, left + width, bottom + height]
}

/// A map of WMS 1.1.1, which both servers understand.
fn map(path: &str, layer: &str, [west, south, east, north]: Box, format: &str) -> String {
    format!(
        "{path}?SERVICE=WMS&VERSION=1.1.1&REQUEST=GetMap&LAYERS={layer}&STYLES=&SRS=EPSG:4326&BBOX={west},{south},{east},{north}&WIDTH={SIDE}&HEIGHT={SIDE}&FORMAT={format}"
    )
}

/// Milliseconds of an answer.
fn timed(connection: &mut Connection, path: &str) -> anyhow::Result<f64> {
    let start = Instant::now();
    let answer = connection.get(path)?;
    let took = start.elapsed().as_secs_f64() * 1e3;
    // Some servers tell errors with status 200.
    let is_tile = answer.status == 200 && !["xml", "html"].iter().any(|kind| answer.head.contains(kind));
    ensure!(is_tile, "{path}: {} {}", answer.head, String::from_utf8_lossy(&answer.body));
    Ok(took)
}

/// GDAL in a Python of its own, asked box by box.
struct Gdal {
    child: Child,
    boxes: ChildStdin,
    times: BufReader<ChildStdout>,
}

impl Gdal {
    /// `None`, after a word, where there is no Python with GDAL.
    fn start(kind: &str, file: &Path) -> anyhow::Result<Option<Self>> {
        let works = |python: &&str| {
            let probe = Command::new(python).args(["-c", "import osgeo.gdal"]).output();
            probe.is_ok_and(|output| output.status.success())
        };
        let Some(python) = ["python3", "/usr/bin/python3"].into_iter().find(works) else {
            println!("skipped: no python3 with GDAL (Debian: apt-get install python3-gdal)");
            return Ok(None);
        };
        let mut child = Command::new(python)
            .arg(data::workspace().join("tests/benches/cold/gdal.py"))
            .args([kind, &file.display().to_string(), &SIDE.to_string()])
            .stdin(Stdio::piped())
            .stdout(Stdio::piped())
            .spawn()?;
        let boxes = child.stdin.take().context("its input")?;
        let times = BufReader::new(child.stdout.take().context("its output")?);
        Ok(Some(Self { child, boxes, times }))
    }

    fn timed(&mut self, [west, south, east, north]: Box) -> anyhow::Result<f64> {
        writeln!(self.boxes, "{west} {south} {east} {north}")?;
        let mut line = String::new();
        self.times.read_line(&mut line)?;
        line.trim().parse().with_context(|| format!("GDAL said {line:?}"))
    }
}

impl Drop for Gdal {
    fn drop(&mut self) {
        // It may have ended by itself; either is fine.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Milliseconds of many answers, so many connections each asking for the next as soon as it has one.
fn crowd(address: &str, paths: &[String]) -> anyhow::Result<Vec<f64>> {
    let share = paths.len().div_ceil(CONNECTIONS);
    std::thread::scope(|scope| {
        let clients: Vec<_> = paths
            .chunks(share)
            .map(|paths| {
                scope.spawn(move || {
                    let mut connection = Connection::open(address)?;
                    paths.iter().map(|path| timed(&mut connection, path)).collect::<anyhow::Result<Vec<_>>>()
                })
            })
            .collect();
        let mut times = Vec::new();
        for client in clients {
            times.extend(client.join().map_err(|_| anyhow::anyhow!("a client panicked"))??);
        }
        Ok(times)
    })
}

/// One kind of map, here and elsewhere.
struct Kind<'a> {
    name: &'a str,
    /// GDAL's script's word for it, and MapServer's layer.
    theirs: &'a str,
    file: &'a Path,
    /// MapServer's format.
    peer_format: &'a str,
    layer: &'a str,
    formats: &'a [&'a str],
}

fn compare(kind: &Kind, server: &Server, peer: Option<&mapserver::MapServer>) -> anyhow::Result<()> {
    let Some(mut gdal) = Gdal::start(kind.theirs, kind.file)? else { return Ok(()) };
    let mut ours = Connection::open(server.address())?;
    let mut numbers = Numbers::new(kind.name.len() as u32);
    let mut own = vec![Vec::new(); kind.formats.len()];
    let (mut theirs, mut peers) = (Vec::new(), Vec::new());
    for turn in 0..WARM + BOXES {
        let bounds = random_box(&mut numbers);
        let gdal = gdal.timed(bounds)?;
        let mut mine = Vec::new();
        for format in kind.formats {
            mine.push(timed(&mut ours, &map("/wms", kind.layer, bounds, format))?);
        }
        let peer = peer
            .map(|peer| {
                timed(&mut peer.connect()?, &map("/mapserver", kind.theirs, bounds, kind.peer_format))
            })
            .transpose()?;
        if turn >= WARM {
            theirs.push(gdal);
            peers.extend(peer);
            for (times, time) in own.iter_mut().zip(mine) {
                times.push(time);
            }
        }
    }
    let of = |what: &str| format!("{}: {what}", kind.name);
    print(&of("GDAL, median"), median(&theirs), "ms");
    let paths = |path: &str, layer: &str, format: &str, numbers: &mut Numbers| -> Vec<String> {
        (0..CROWD).map(|_| map(path, layer, random_box(numbers), format)).collect()
    };
    for (format, times) in kind.formats.iter().zip(&own) {
        print(&of(&format!("{format}, median")), median(times), "ms");
        print(&of(&format!("{format}, median over GDAL's")), median(times) / median(&theirs), "ratio");
        let crowd = crowd(server.address(), &paths("/wms", kind.layer, format, &mut numbers))?;
        let p99 = quantile(&crowd, 0.99);
        print(&of(&format!("{format}, {CONNECTIONS} connections, 99th percentile")), p99, "ms");
        let ratio = p99 / median(&theirs);
        print(
            &of(&format!("{format}, {CONNECTIONS} connections, 99th percentile over GDAL's median")),
            ratio,
            "ratio",
        );
    }
    if let Some(peer) = peer {
        print(&of("MapServer, median over GDAL's"), median(&peers) / median(&theirs), "ratio");
        let crowd = crowd(peer.address(), &paths("/mapserver", kind.theirs, kind.peer_format, &mut numbers))?;
        let ratio = quantile(&crowd, 0.99) / median(&theirs);
        print(
            &of(&format!("MapServer, {CONNECTIONS} connections, 99th percentile over GDAL's median")),
            ratio,
            "ratio",
        );
    }
    Ok(())
}

/// Combined tiles of all levels at which crowns are seen, no two of them near each other in time.
fn combined(server: &Server) -> anyhow::Result<()> {
    let mut numbers = Numbers::new(3);
    let [west, south, east, north] = PLACE;
    let mut paths = Vec::new();
    while paths.len() < CROWD {
        let level = 10 + numbers.below(9) as u8;
        let (longitude, latitude) =
            (west + numbers.unit() * (east - west), south + numbers.unit() * (north - south));
        let tile = TileAddress::at(level, longitude, latitude);
        let path = format!(
            "/tiles/combined-elevation/TreelineGeographic/{level}/{}/{}?f=treeline",
            tile.row, tile.column
        );
        // Only the first of each is cold.
        if level > 12 || !paths.contains(&path) {
            paths.push(path);
        }
    }
    paths.sort();
    paths.dedup();
    // In no order that makes neighbours meet.
    for index in (1..paths.len()).rev() {
        paths.swap(index, numbers.below(index + 1));
    }
    let (warm, paths) = paths.split_at(CONNECTIONS * 2);
    crowd(server.address(), warm)?;
    let times = crowd(server.address(), paths)?;
    print("combined tiles, each on its own", times.len() as f64, "");
    print(&format!("combined, {CONNECTIONS} connections, median"), median(&times), "ms");
    print(&format!("combined, {CONNECTIONS} connections, 99th percentile"), quantile(&times, 0.99), "ms");
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let Some(folder) = data::find("scene_hongkong") else { return Ok(()) };
    let file = |name: &str| -> anyhow::Result<PathBuf> { Ok(folder.join(name).canonicalize()?) };
    let (dem, photo) = (file("dem_aster30m_4326.tif")?, file("ortho_landsat8_4326.tif")?);
    let mut arguments = String::new();
    write!(arguments, "{}\n{}", dem.display(), photo.display())?;
    let (dem_text, photo_text) = arguments.split_once('\n').context("two paths")?;
    let server = Server::start(&["--dem", dem_text, "--photo", photo_text])?;
    let peer = mapserver::MapServer::start(&dem, &photo)?;
    ensure!(Connection::open(server.address())?.get("/healthz")?.status == 200, "no server");
    compare(
        &Kind {
            name: "photo",
            theirs: "photo",
            file: &photo,
            peer_format: "image/jpeg",
            layer: "texture",
            formats: &["image/jpeg"],
        },
        &server,
        peer.as_ref(),
    )?;
    compare(
        &Kind {
            name: "heights",
            theirs: "height",
            file: &dem,
            peer_format: "image/png16",
            layer: "elevation",
            formats: &["application/bil16", "application/bil32"],
        },
        &server,
        peer.as_ref(),
    )?;
    combined(&server)
}
