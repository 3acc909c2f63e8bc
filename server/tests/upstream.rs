//! Sources at other servers: a photo that is read by parts over HTTP, and what happens where that goes wrong.

mod process;

use process::{get, serve, write_dem, write_photo};
use std::io::{Read as _, Write as _};
use std::net::TcpListener;
use std::process::Command;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering::SeqCst};

/// A file server that answers parts.
struct Upstream {
    address: String,
    /// Whether it answers 500 to everything.
    fails: Arc<AtomicBool>,
    /// Bytes of files sent.
    sent: Arc<AtomicU64>,
}

fn upstream(file: Vec<u8>) -> Upstream {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = format!("http://{}/photo.tif", listener.local_addr().unwrap());
    let (fails, sent) = (Arc::new(AtomicBool::new(false)), Arc::new(AtomicU64::new(0)));
    let (failing, sending) = (fails.clone(), sent.clone());
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut head = Vec::new();
            let mut byte = [0];
            while !head.ends_with(b"\r\n\r\n") && matches!(stream.read(&mut byte), Ok(1)) {
                head.push(byte[0]);
            }
            let head = String::from_utf8(head).unwrap().to_lowercase();
            let Some(range) = head.split("range: bytes=").nth(1).filter(|_| !failing.load(SeqCst)) else {
                let _ =
                    stream.write_all(b"HTTP/1.1 500 Wrong\r\nContent-Length: 0\r\nConnection: close\r\n\r\n");
                continue;
            };
            let (first, last) = range.split_once('-').unwrap();
            let first: usize = first.parse().unwrap();
            let last = last.split('\r').next().unwrap().parse::<usize>().unwrap().min(file.len() - 1);
            let body = &file[first..=last];
            sending.fetch_add(body.len() as u64, SeqCst);
            let _ = write!(
                stream,
                "HTTP/1.1 206 Part\r\nContent-Range: bytes {first}-{last}/{}\r\nETag: \"1\"\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
                file.len(),
                body.len()
            );
            let _ = stream.write_all(body);
        }
    });
    Upstream { address, fails, sent }
}

/// A folder with a terrain model and a photo of the same place, and the photo's bytes.
fn place() -> (tempfile::TempDir, [String; 2], Vec<u8>) {
    let folder = tempfile::tempdir().unwrap();
    let [dem, photo] = ["dem.tif", "photo.tif"].map(|name| folder.path().join(name));
    write_dem(&dem, 16, |_, _| 100.0);
    write_photo(&photo, 1024, |column, row| [column as u8, row as u8, (column / 8 + row / 8) as u8]);
    let bytes = std::fs::read(&photo).unwrap();
    (folder, [dem, photo].map(|path| path.to_str().unwrap().to_owned()), bytes)
}

fn map(west: f64, south: f64) -> String {
    format!(
        "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=texture&STYLES=&CRS=CRS:84&BBOX={west},{south},{},{}&WIDTH=8&HEIGHT=8&FORMAT=image/png",
        west + 0.1,
        south + 0.1
    )
}

#[test]
fn a_file_at_an_address_is_read_by_parts() {
    let (_folder, [dem, photo], bytes) = place();
    let length = bytes.len() as u64;
    let upstream = upstream(bytes);
    let (mut local, here) = serve(&["--dem", &dem, "--photo", &photo]);
    let (mut remote, there) = serve(&["--dem", &dem, "--photo", &upstream.address]);
    let opened = upstream.sent.load(SeqCst);
    for (west, south) in [(10.5, 45.5), (19.3, 36.1), (12.0, 41.7)] {
        let [wanted, found] = [&here, &there].map(|address| get(address, &map(west, south)));
        assert!(found.0.starts_with("HTTP/1.1 200"), "{}", found.0);
        assert_eq!(wanted.1, found.1);
    }
    let read = upstream.sent.load(SeqCst) - opened;
    assert!(read < length / 2, "three corners need {read} of {length} bytes");
    // As it is when something goes wrong there.
    upstream.fails.store(true, SeqCst);
    let (head, body) = get(&there, &map(17.0, 37.6));
    assert!(head.starts_with("HTTP/1.1 502"), "{head}");
    assert!(head.to_lowercase().contains("retry-after: 5"), "{head}");
    assert!(String::from_utf8_lossy(&body).contains("photo.tif"), "the source is named");
    // What was made before is still there, and so is what was read.
    assert!(get(&there, &map(10.5, 45.5)).0.starts_with("HTTP/1.1 200"));
    assert!(get(&there, &map(10.51, 45.51)).0.starts_with("HTTP/1.1 200"));
    let metrics = String::from_utf8(get(&there, "/metrics").1).unwrap();
    assert!(metrics.contains("treeline_upstream_failures 3"), "{metrics}");
    // It is asked again after a while.
    upstream.fails.store(false, SeqCst);
    while !get(&there, &map(17.0, 37.6)).0.starts_with("HTTP/1.1 200") {
        std::thread::sleep(std::time::Duration::from_millis(200));
    }
    for server in [&mut local, &mut remote] {
        server.kill().unwrap();
        server.wait().unwrap();
    }
}

#[test]
fn an_address_that_cannot_be_used_is_one_line() {
    let (_folder, _, bytes) = place();
    let failing = upstream(bytes);
    failing.fails.store(true, SeqCst);
    let nobody = TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap();
    for (address, named) in [
        (failing.address.clone(), "HTTP 500"),
        (format!("http://{nobody}/x.tif"), "check the address"),
        ("https://no host/x.tif".to_owned(), "check the address"),
        (format!("http://{nobody}/wms?LAYERS=heights"), "bbox = [west, south, east, north]"),
    ] {
        let output =
            Command::new(env!("CARGO_BIN_EXE_treeline")).args(["check", "--dem", &address]).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        let text = format!("{}{error}", String::from_utf8(output.stdout).unwrap());
        assert!(!output.status.success() && text.contains(named), "{address}: {text}");
        assert!(error.lines().count() <= 1, "{error}");
    }
}

/// A service of pictures: answers every path by what `picture` gives for it.
fn service(picture: impl Fn(&str) -> Option<Vec<u8>> + Send + 'static) -> (String, Arc<AtomicBool>) {
    let listener = TcpListener::bind("127.0.0.1:0").unwrap();
    let base = format!("http://{}", listener.local_addr().unwrap());
    let fails = Arc::new(AtomicBool::new(false));
    let failing = fails.clone();
    std::thread::spawn(move || {
        for stream in listener.incoming() {
            let mut stream = stream.unwrap();
            let mut head = Vec::new();
            let mut byte = [0];
            while !head.ends_with(b"\r\n\r\n") && matches!(stream.read(&mut byte), Ok(1)) {
                head.push(byte[0]);
            }
            let head = String::from_utf8(head).unwrap();
            let path = head.split(' ').nth(1).unwrap_or_default();
            let (status, body) = match picture(path) {
                _ if failing.load(SeqCst) => ("500 Wrong", Vec::new()),
                Some(body) => ("200 OK", body),
                None => ("404 Not Found", Vec::new()),
            };
            let _ = write!(
                stream,
                "HTTP/1.1 {status}\r\nContent-Length: {}\r\nConnection: close\r\n\r\n",
                body.len()
            );
            let _ = stream.write_all(&body);
        }
    });
    (base, fails)
}

/// The colour of a place in Web Mercator on a tile of 256 pixels: smooth, and different everywhere.
fn colour(x: f64, y: f64) -> [u8; 3] {
    let wave = |value: f64, metres: f64| (127.5 + 127.0 * (value / metres).sin()).round() as u8;
    [wave(x, 40_000.0), wave(y, 30_000.0), wave(x + y, 90_000.0)]
}

fn png(west: f64, north: f64, span: f64) -> Vec<u8> {
    let picture = image::RgbImage::from_fn(256, 256, |column, row| {
        let at = |index: u32| (f64::from(index) + 0.5) * span / 256.0;
        image::Rgb(colour(west + at(column), north - at(row)))
    });
    let mut bytes = std::io::Cursor::new(Vec::new());
    picture.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

const HALF_TURN: f64 = 20_037_508.342_789_244;

/// Mean difference of 255 of a served Web Mercator tile from the colours of its places.
fn difference(address: &str, zoom: u32, column: u32, row: u32) -> f64 {
    let (head, body) = get(address, &format!("/tiles/texture/WebMercatorQuad/{zoom}/{row}/{column}?f=png"));
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    let picture = image::load_from_memory(&body).unwrap().to_rgba8();
    let span = 2.0 * HALF_TURN / f64::from(1_u32 << zoom);
    let (west, north) = (-HALF_TURN + span * f64::from(column), HALF_TURN - span * f64::from(row));
    let (mut sum, mut count) = (0.0, 0.0);
    for (x, y, pixel) in picture.enumerate_pixels().filter(|(.., pixel)| pixel[3] == 255) {
        let at = |index: u32| (f64::from(index) + 0.5) * span / 256.0;
        let wanted = colour(west + at(x), north - at(y));
        count += 1.0;
        sum += (0..3).map(|channel| f64::from(pixel[channel].abs_diff(wanted[channel]))).sum::<f64>();
    }
    // Around the terrain, and where the service has nothing, there is nothing.
    assert!(count > 500.0, "{count} pixels at zoom {zoom}");
    sum / (3.0 * count)
}

#[test]
fn a_photo_may_be_a_service_of_tiles_or_a_wms() {
    let (_folder, [dem, _], _) = place();
    let tiles = service(|path| {
        let numbers: Vec<u32> =
            path.trim_end_matches(".png").split('/').skip(1).map(|part| part.parse().unwrap()).collect();
        let span = 2.0 * HALF_TURN / f64::from(1_u32 << numbers[0]);
        // East of 10.1° there is nothing.
        let west = -HALF_TURN + span * f64::from(numbers[1]);
        (west < 1_124_327.0).then(|| png(west, HALF_TURN - span * f64::from(numbers[2]), span))
    });
    let wms = service(|path| {
        assert!(
            path.contains("LAYERS=ortho&")
                && path.contains("REQUEST=GetMap")
                && path.contains("SRS=EPSG:3857")
        );
        let bbox = path.split("BBOX=").nth(1).unwrap().split('&').next().unwrap();
        let bbox: Vec<f64> = bbox.split(',').map(|part| part.parse().unwrap()).collect();
        Some(png(bbox[0], bbox[3], bbox[2] - bbox[0]))
    });
    for (path, fails) in [
        (format!("{}/{{z}}/{{x}}/{{y}}.png", tiles.0), &tiles.1),
        (format!("{}/wms?LAYERS=ortho", wms.0), &wms.1),
    ] {
        let folder = tempfile::tempdir().unwrap();
        let scene = folder.path().join("scene.toml");
        std::fs::write(
            &scene,
            format!("[dem]\npath = \"{dem}\"\n[photo]\npath = \"{path}\"\nmaximum_zoom = 14\nattribution = \"someone\"\n"),
        )
        .unwrap();
        let (mut server, address) = serve(&["--scene", scene.to_str().unwrap()]);
        // 10.05° E, 46.1° N, at a zoom of the service, one between two of the quadtree's levels, and coarser.
        for zoom in [9, 12, 13] {
            let count = f64::from(1_u32 << zoom);
            let column = (190.05 / 360.0 * count) as u32;
            let row = (0.355_4 * count) as u32;
            let difference = difference(&address, zoom, column, row);
            assert!(difference < 2.0, "{path}, zoom {zoom}: {difference} of 255");
        }
        fails.store(true, SeqCst);
        let (head, body) = get(&address, "/tiles/texture/WebMercatorQuad/14/5826/8647?f=png");
        assert!(head.starts_with("HTTP/1.1 502"), "{head}");
        assert!(String::from_utf8_lossy(&body).contains("http://127.0.0.1"));
        server.kill().unwrap();
        server.wait().unwrap();
    }
}
