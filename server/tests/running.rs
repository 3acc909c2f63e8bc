//! The server as a process: its data changes, it is killed, it is badly treated.

mod process;

use process::{get, hostile, killed, serve, write_dem, write_photo};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::process::Command;

#[test]
fn a_file_that_changes_is_noticed_and_a_broken_one_is_not_served() {
    let folder = tempfile::tempdir().unwrap();
    let dem = folder.path().join("dem.tif");
    let config = folder.path().join("treeline.toml");
    std::fs::write(&config, "watch_seconds = 1\n").unwrap();
    write_dem(&dem, 16, |_, _| 100.0);
    let (mut server, address) =
        serve(&["--dem", dem.to_str().unwrap(), "--config", config.to_str().unwrap()]);
    let query = "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=elevation&STYLES=&CRS=CRS:84&BBOX=10.05,46.05,10.06,46.06&WIDTH=1&HEIGHT=1&FORMAT=application/bil16";
    let height = || {
        let (head, body) = get(&address, query);
        assert!(head.starts_with("HTTP/1.1 200"), "{head}");
        i16::from_le_bytes([body[0], body[1]])
    };
    let revision = || {
        let scene: serde_json::Value = serde_json::from_slice(&get(&address, "/scene.json").1).unwrap();
        scene["revision"].as_str().unwrap().to_owned()
    };
    assert_eq!(height(), 100);
    let first = revision();
    // Until it is noticed; the test's own time-out ends it where it never is.
    let wait_for = |wanted: i16| {
        while height() != wanted {
            std::thread::sleep(std::time::Duration::from_millis(100));
        }
    };
    write_dem(&dem, 16, |_, _| 250.0);
    wait_for(250);
    let second = revision();
    assert_ne!(first, second);
    // A file that is no raster: what was there goes on.
    std::fs::write(&dem, b"this is no raster").unwrap();
    let log = BufReader::new(server.stderr.take().unwrap());
    let told = log.lines().map(Result::unwrap).find(|line| line.contains("cannot be opened any more"));
    assert!(told.unwrap().contains("dem.tif"));
    assert_eq!((height(), revision()), (250, second));
    write_dem(&dem, 16, |_, _| 400.0);
    wait_for(400);
    server.kill().unwrap();
    server.wait().unwrap();
}

/// The second time a request's words are known, and the answer comes without reading them: no header, byte or count
/// differs, nor does what a client's copy or another method is answered.
#[test]
fn the_same_words_get_the_same_answer() {
    let (mut server, address) = serve(&[]);
    let map = "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=texture&STYLES=&CRS=CRS:84&BBOX=11,46.9,11.05,46.95&WIDTH=64&HEIGHT=64&FORMAT=image/jpeg";
    let tile = "/tiles/texture/WorldCRS84Quad/12/958/4346?f=jpeg";
    // Its bytes depend on Accept-Encoding, so that its words alone say nothing.
    let heights = "/tiles/elevation/WorldCRS84Quad/12/958/4346?f=bil16";
    let head_of = |head: &str| {
        let own = |line: &&str| !line.starts_with("x-request-id") && !line.starts_with("date");
        let mut lines: Vec<String> = head.lines().filter(own).map(str::to_owned).collect();
        lines[1..].sort_unstable();
        lines
    };
    let check = |found: (Vec<String>, Vec<u8>), wanted: &(Vec<String>, Vec<u8>)| {
        assert_eq!(found.0, wanted.0);
        assert!(found.1 == wanted.1, "{} bytes, not those {}", found.1.len(), wanted.1.len());
    };
    let ask = |method: &str, path: &str, more: &str| {
        let request = format!("{method} {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n{more}\r\n");
        let answer = process::exchange(&address, request.as_bytes());
        (head_of(&answer.0), answer.1)
    };
    let memory_hits = || {
        let metrics = String::from_utf8(get(&address, "/metrics").1).unwrap();
        let hits = "treeline_tiles_total{layer=\"texture\",outcome=\"memory\"} ";
        metrics.lines().find_map(|line| line.strip_prefix(hits)).unwrap().parse::<u64>().unwrap()
    };
    for path in [map, tile, heights] {
        let first = ask("GET", path, "");
        let tag = first.0.iter().find(|line| line.starts_with("etag")).unwrap().replace("etag: ", "");
        let conditional = format!("If-None-Match: \"x\", {tag}\r\n");
        // By other words, which nobody knows yet.
        let unchanged = ask("GET", &format!("{path}&x=1"), &conditional);
        assert!(unchanged.0[0].contains("304") && unchanged.1.is_empty(), "{unchanged:?}");
        let before = memory_hits();
        check(ask("GET", path, ""), &first);
        check(ask("GET", path, ""), &first);
        assert_eq!(memory_hits() - before, if path == heights { 0 } else { 2 });
        check(ask("GET", path, &conditional), &unchanged);
        check(ask("GET", path, "If-Modified-Since: Sun, 06 Nov 2033 08:49:37 GMT\r\n"), &unchanged);
        check(ask("GET", path, "If-None-Match: \"x\"\r\n"), &first);
        let (head, body) = ask("HEAD", path, "");
        assert_eq!((head, body.len()), (first.0.clone(), 0));
        assert!(ask("POST", path, "").0[0].contains("405"));
    }
    let plain = ask("GET", heights, "");
    let packed = ask("GET", heights, "Accept-Encoding: gzip\r\n");
    assert!(packed.0.iter().any(|line| line == "content-encoding: gzip") && packed.1 != plain.1);
    check(ask("GET", heights, ""), &plain);
    server.kill().unwrap();
    server.wait().unwrap();
}

#[test]
fn tiles_outlive_the_server_however_it_ends() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().to_str().unwrap();
    let paths: Vec<String> = (0..6)
        .map(|column| format!("/tiles/elevation/WorldCRS84Quad/12/958/{}?f=bil16", 4346 + column))
        .collect();
    let body = |address: &str, path: &str| {
        let (head, body) = get(address, path);
        assert!(head.starts_with("HTTP/1.1 200"), "{head}");
        body
    };
    let (mut server, address) = serve(&[]);
    let right: Vec<Vec<u8>> = paths.iter().map(|path| body(&address, path)).collect();
    server.kill().unwrap();
    server.wait().unwrap();
    for killed_after in [1, 3, 5, 6] {
        let (mut server, address) = serve(&["--cache", cache]);
        for (path, right) in paths.iter().zip(&right).take(killed_after) {
            assert_eq!(&body(&address, path), right, "{path}");
        }
        // With no signal that it could act on.
        server.kill().unwrap();
        server.wait().unwrap();
    }
    let (mut server, address) = serve(&["--cache", cache]);
    assert!(paths.iter().zip(&right).all(|(path, right)| &body(&address, path) == right));
    // Asked to stop, it writes what it has answered.
    let stopped = Command::new("kill").args(["-TERM", &server.id().to_string()]).status().unwrap();
    assert!(stopped.success() && server.wait().unwrap().success());
    let (mut server, address) = serve(&["--cache", cache]);
    assert!(paths.iter().zip(&right).all(|(path, right)| &body(&address, path) == right));
    let metrics = String::from_utf8(body(&address, "/metrics")).unwrap();
    let from_disk = "treeline_tiles_total{layer=\"elevation\",outcome=\"disk\"} 6";
    assert!(metrics.lines().any(|line| line == from_disk), "{metrics}");
    server.kill().unwrap();
    server.wait().unwrap();
}

#[test]
fn killed_at_any_instant_it_has_lost_nothing_that_was_finished() {
    let folder = tempfile::tempdir().unwrap();
    let [dem, photo] = ["dem.tif", "photo.tif"].map(|name| folder.path().join(name));
    write_dem(&dem, 64, |column, row| (column * row) as f32);
    write_photo(&photo, 64, |column, row| [column as u8, row as u8, (column * row) as u8]);
    let arguments = ["--dem", dem.to_str().unwrap(), "--photo", photo.to_str().unwrap()];
    let map = |column: usize, row: usize| {
        let (west, south) = (10.0 + 0.01 * column as f64, 45.6 + 0.01 * row as f64);
        format!(
            "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=texture&STYLES=&CRS=CRS:84&BBOX={west},{south},{},{}&WIDTH=128&HEIGHT=128&FORMAT=image/png",
            west + 0.1,
            south + 0.1
        )
    };
    let (mut server, address) = serve(&arguments);
    let paths = (0..300).map(|index| map(index % 20, index / 20));
    let tiles: Vec<(String, Vec<u8>)> = paths.map(|path| (path.clone(), get(&address, &path).1)).collect();
    server.kill().unwrap();
    server.wait().unwrap();
    let (mut finished, mut in_the_middle) = (0, 0);
    for round in 0..5 {
        let life = std::time::Duration::from_millis(20 + 35 * round);
        let fresh = [map(30, 30), map(31, 30)];
        let seen = killed::round(&serve, &arguments, &tiles, [&fresh[0], &fresh[1]], life);
        assert_eq!((seen.wrong, seen.lost), (0, 0), "{seen:?}");
        finished += seen.finished;
        in_the_middle += usize::from(seen.answered > 0 && seen.answered < tiles.len());
    }
    assert!(
        finished > 0 && in_the_middle > 0,
        "{finished} tiles finished, {in_the_middle} kills in the middle"
    );
}

#[test]
fn whoever_dawdles_is_shown_out_and_the_rest_served() {
    let folder = tempfile::tempdir().unwrap();
    let config = folder.path().join("treeline.toml");
    std::fs::write(&config, "[limits]\nheader_timeout_seconds = 1\nmaximum_connections = 8\n").unwrap();
    let (mut server, address) = serve(&["--config", config.to_str().unwrap()]);
    let mut slow: Vec<_> = (0..8).map(|_| std::net::TcpStream::connect(&address).unwrap()).collect();
    for stream in &mut slow {
        stream.write_all(b"GET / HTTP/1.1\r\nHost: x\r\n").unwrap();
    }
    // All places are taken until the slow ones have had their time.
    assert!(get(&address, "/healthz").0.starts_with("HTTP/1.1 200"));
    for stream in &mut slow {
        let mut rest = Vec::new();
        // Closed, with or without a word.
        let _ = stream.read_to_end(&mut rest);
        assert!(rest.is_empty() || rest.starts_with(b"HTTP/1.1 408"), "{}", String::from_utf8_lossy(&rest));
    }
    server.kill().unwrap();
    server.wait().unwrap();
}

#[test]
fn hostile_requests_are_refused_and_a_good_one_answered() {
    let (mut server, address) = serve(&[]);
    let all = hostile::all();
    assert_eq!(all.len(), 500);
    let wrong: Vec<String> = all
        .iter()
        .filter_map(|request| request.check(&request.send(&address).expect(&request.what)).err())
        .collect();
    assert!(wrong.is_empty(), "{} of {}:\n{}", wrong.len(), all.len(), wrong.join("\n"));
    assert!(get(&address, "/tiles/texture/WorldCRS84Quad/9/119/543?f=png").0.starts_with("HTTP/1.1 200"));
    let metrics = String::from_utf8(get(&address, "/metrics").1).unwrap();
    assert!(metrics.contains("treeline_responses_total{class=\"5xx\"} 0"), "{metrics}");
    server.kill().unwrap();
    server.wait().unwrap();
}
