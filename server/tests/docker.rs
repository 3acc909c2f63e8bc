//! What can be told of `docker/` without a Docker engine: its paths are there, its commands are understood and run, and
//! nginx passes on what links are made of.

mod process;

use clap::Parser as _;
use process::{exchange, get, serve};
use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use treeline_server::cli::Cli;

fn folder() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../docker")
}

fn read(name: &str) -> String {
    std::fs::read_to_string(folder().join(name)).unwrap()
}

/// The lists of words in JSON's spelling that a file holds after a key.
fn lists(text: &str, key: &str) -> Vec<Vec<String>> {
    text.lines()
        .filter_map(|line| {
            let rest = line.trim().split_once(key)?.1;
            serde_json::from_str(&rest[rest.find('[')?..=rest.rfind(']')?]).ok()
        })
        .collect()
}

#[test]
fn every_path_is_there() {
    let compose = read("compose.yaml");
    let mounted: Vec<&str> = compose
        .lines()
        .filter_map(|line| line.trim().strip_prefix("- ./")?.split(':').next())
        .filter(|path| *path != "data")
        .collect();
    assert_eq!(mounted, ["treeline.toml", "nginx.conf"]);
    let dockerfile = compose.lines().find_map(|line| line.trim().strip_prefix("dockerfile: ")).unwrap();
    for path in mounted.iter().map(|name| format!("docker/{name}")).chain([dockerfile.to_owned()]) {
        assert!(folder().join("..").join(&path).is_file(), "{path}");
    }
    // What the image is made of is not kept from the builder.
    let ignored = read("Dockerfile.dockerignore");
    assert!(ignored.lines().all(|line| !["server", "client-wasm", "shaders", "core"].contains(&line)));
    // The cache that the settings name is the folder that outlives the container, and its user's.
    let cache = read("treeline.toml")
        .lines()
        .find_map(|line| Some(line.strip_prefix("cache = \"")?.trim_end_matches('"').to_owned()));
    let cache = cache.unwrap();
    let image = read("Dockerfile");
    assert!(image.contains(&format!("--chown=10001:10001 /out/cache {cache}")));
    assert!(image.contains("USER 10001:10001") && compose.contains(&format!("tiles:{cache}")));
}

#[test]
fn every_command_is_understood() {
    let (compose, image) = (read("compose.yaml"), read("Dockerfile"));
    let mut commands = lists(&compose, "command: ");
    commands.retain(|words| words[0] != "nginx");
    commands.extend(lists(&compose, "test: ").into_iter().map(|words| words[2..].to_vec()));
    commands.extend(lists(&image, "CMD "));
    assert_eq!(commands.len(), 4, "{commands:?}");
    for words in commands {
        let words = words.into_iter().filter(|word| word != "/bin/treeline");
        let parsed = Cli::try_parse_from(std::iter::once("treeline".to_owned()).chain(words.clone()));
        assert!(parsed.is_ok(), "{:?}: {}", words.collect::<Vec<_>>(), parsed.unwrap_err());
    }
}

#[test]
fn health_is_the_running_servers() {
    let health = |url: &str| {
        let output = Command::new(env!("CARGO_BIN_EXE_treeline")).args(["health", url]).output().unwrap();
        (output.status.code(), String::from_utf8(output.stderr).unwrap())
    };
    let (mut server, address) = serve(&[]);
    let url = format!("http://{address}");
    assert_eq!(health(&url), (Some(0), String::new()));
    server.kill().unwrap();
    server.wait().unwrap();
    let (code, line) = health(&url);
    assert_eq!(code, Some(1));
    assert!(line.contains(&address) && line.lines().count() == 1, "{line}");
}

/// nginx with the settings of `docker/`, before a server at an address; on a port of its own.
fn nginx(own: &Path, upstream: &str) -> Option<(Child, String)> {
    let address = std::net::TcpListener::bind("127.0.0.1:0").unwrap().local_addr().unwrap().to_string();
    let text = read("nginx.conf")
        .replace("treeline:8080", upstream)
        .replace("listen 8000", &format!("listen {address}"))
        .replace("/tmp/", &format!("{}/", own.display()));
    let path = own.join("nginx.conf");
    std::fs::write(&path, text).unwrap();
    let command = |more: &[&str]| {
        let mut command = Command::new("nginx");
        command.args(["-e", "stderr", "-c"]).arg(&path).args(more);
        command.stdout(Stdio::null()).stderr(Stdio::piped());
        command
    };
    let checked = command(&["-t"]).output().ok()?;
    assert!(checked.status.success(), "{}", String::from_utf8_lossy(&checked.stderr));
    let child = command(&["-g", "daemon off; master_process off;"]).stderr(Stdio::null()).spawn().unwrap();
    let start = std::time::Instant::now();
    while std::net::TcpStream::connect(&address).is_err() {
        assert!(start.elapsed().as_secs() < 20, "nginx does not listen at {address}");
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    Some((child, address))
}

#[test]
fn behind_nginx_links_lead_to_nginx() {
    let own = tempfile::tempdir().unwrap();
    let (mut server, upstream) = serve(&[]);
    let Some((mut front, address)) = nginx(own.path(), &upstream) else {
        eprintln!("skipped: wants nginx (Debian: apt-get install nginx-light)");
        server.kill().unwrap();
        return;
    };
    let (head, body) = exchange(
        &address,
        b"GET /wms?REQUEST=GetCapabilities HTTP/1.1\r\nHost: maps.example.org\r\nConnection: close\r\n\r\n",
    );
    assert!(head.starts_with("HTTP/1.1 200"), "{head}");
    let text = String::from_utf8_lossy(&body);
    assert!(text.contains("http://maps.example.org/wms?") && !text.contains(&upstream), "{text}");
    let tile = "/tiles/texture/WorldCRS84Quad/12/958/4346?f=jpeg";
    let (direct, through) = (get(&upstream, tile), get(&address, tile));
    assert!(through.0.starts_with("HTTP/1.1 200") && through.1 == direct.1);
    let header = |head: &str, name: &str| {
        head.lines().find(|line| line.to_ascii_lowercase().starts_with(name)).unwrap().to_ascii_lowercase()
    };
    for name in ["etag", "cache-control", "access-control-allow-origin", "last-modified"] {
        assert_eq!(header(&through.0, name), header(&direct.0, name));
    }
    // Gone, it is said so by nginx, and come back by itself.
    server.kill().unwrap();
    server.wait().unwrap();
    assert!(get(&address, tile).0.starts_with("HTTP/1.1 502"));
    front.kill().unwrap();
    front.wait().unwrap();
}
