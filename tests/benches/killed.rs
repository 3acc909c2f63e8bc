//! A server that is killed (SIGKILL) at a random instant while clients ask and tiles are made and kept, a hundred times
//! (`TREELINE_KILLS` says otherwise): wrong bytes served by it or by the next, tiles lost that were finished, and what
//! the next server's first answer takes beside that of a server with an empty folder. A tile is finished when its file
//! has its name: it is answered first, and kept afterwards. One JSON object a line; fails where anything is wrong or lost.

use anyhow::ensure;
use std::io::{BufRead as _, BufReader};
use std::process::{Child, Command, Stdio};
use std::time::Duration;
use treeline_tests::geotiff::{Placement, write_heights};
use treeline_tests::measure::{Numbers, median, print, quantile, setting};
use treeline_tests::program::{Server, path};
use treeline_tests::raw_http::Connection;

#[path = "../../server/tests/process/killed.rs"]
mod killed;

/// Tiles that the clients ask for; a server that lives long enough has all of them.
const TILES: usize = 400;
/// Longest life of a server under load: about as long as all tiles take.
const LIFE: f64 = 0.6;

fn start(arguments: &[&str]) -> (Child, String) {
    let mut child = Command::new(path("treeline").expect("the program"))
        .args(["serve", "--listen", "127.0.0.1:0"])
        .args(arguments)
        .stdin(Stdio::null())
        .stdout(Stdio::piped())
        .stderr(Stdio::null())
        .spawn()
        .expect("a process");
    let mut line = String::new();
    BufReader::new(child.stdout.take().expect("its output")).read_line(&mut line).expect("a line");
    let address = line.trim().strip_prefix("treeline: listening on http://").expect("an address").to_owned();
    (child, address)
}

/// Maps of 256 × 256, pictures and heights in turn.
fn map(index: usize) -> String {
    let (west, south) = (7.0 + 0.02 * (index % 20) as f64, 46.0 + 0.02 * (index / 20) as f64);
    let (layer, format) =
        [("texture", "image/jpeg"), ("elevation", "application/bil16"), ("elevation", "image/png")]
            [index % 3];
    format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS={layer}&STYLES=&CRS=CRS:84&BBOX={west},{south},{},{}&WIDTH=256&HEIGHT=256&FORMAT={format}",
        west + 0.1,
        south + 0.1
    )
}

fn main() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let dem = folder.path().join("dem.tif");
    let placement = Placement { west: 7.0, north: 46.7, step: [0.0007; 2], columns: 1000, rows: 1000 };
    write_heights(&dem, &placement, |longitude, latitude| {
        (1500.0 + 900.0 * (31.0 * longitude).sin() * (43.0 * latitude).cos()) as f32
    })?;
    let dem = dem.to_string_lossy().into_owned();
    let arguments = ["--dem", dem.as_str()];
    let tiles: Vec<(String, Vec<u8>)> = {
        let server = Server::start(&arguments)?;
        let mut connection = Connection::open(server.address())?;
        (0..TILES)
            .map(|index| Ok((map(index), connection.body(&map(index))?)))
            .collect::<anyhow::Result<_>>()?
    };
    let kills = setting("TREELINE_KILLS", 100);
    let mut numbers = Numbers::new(1);
    let mut sum = killed::Round::default();
    let mut first = [Vec::new(), Vec::new()];
    // Either is the first of one server and of the next, in turns.
    let fresh = [map(TILES), map(TILES + 3)];
    for kill in 0..kills {
        let life = Duration::from_secs_f64(LIFE * numbers.unit());
        let order = if kill % 2 == 0 { [&*fresh[0], &*fresh[1]] } else { [&*fresh[1], &*fresh[0]] };
        let seen = killed::round(&start, &arguments, &tiles, order, life);
        ensure!(seen.wrong == 0 && seen.lost == 0, "kill {kill}: {seen:?}");
        sum.answered += seen.answered;
        sum.finished += seen.finished;
        for (times, time) in first.iter_mut().zip(seen.first) {
            times.push(time.as_secs_f64() * 1e3);
        }
    }
    print("kills", kills as f64, "");
    print("tiles answered whole before them", sum.answered as f64, "");
    print("tiles finished by then", sum.finished as f64, "");
    print("wrong bytes served", 0.0, "");
    print("finished tiles lost", 0.0, "");
    print("first answer with an empty folder, median", median(&first[0]), "ms");
    print("first answer after a kill, median", median(&first[1]), "ms");
    print("after a kill over with an empty folder, medians", median(&first[1]) / median(&first[0]), "ratio");
    print("the same, 95th percentiles", quantile(&first[1], 0.95) / quantile(&first[0], 0.95), "ratio");
    Ok(())
}
