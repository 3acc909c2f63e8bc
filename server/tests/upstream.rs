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
    ] {
        let output =
            Command::new(env!("CARGO_BIN_EXE_treeline")).args(["check", "--dem", &address]).output().unwrap();
        let error = String::from_utf8(output.stderr).unwrap();
        let text = format!("{}{error}", String::from_utf8(output.stdout).unwrap());
        assert!(!output.status.success() && text.contains(named), "{address}: {text}");
        assert!(error.lines().count() <= 1, "{error}");
    }
}
