//! The program itself: what it prints, and how it ends.

use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::path::Path;
use std::process::{Child, Command, Stdio};

fn treeline(arguments: &[&str]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_treeline"));
    command.args(arguments).stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    command
}

/// Exit code and standard error of a run that ends by itself.
fn run(arguments: &[&str]) -> (Option<i32>, String, String) {
    let output = treeline(arguments).output().unwrap();
    let text = |bytes: Vec<u8>| String::from_utf8(bytes).unwrap();
    (output.status.code(), text(output.stdout), text(output.stderr))
}

#[test]
fn every_mistake_is_one_line_and_exit_code_2() {
    let folder = tempfile::tempdir().unwrap();
    let file = |name: &str, text: &str| {
        let path = folder.path().join(name);
        std::fs::write(&path, text).unwrap();
        path.to_str().unwrap().to_owned()
    };
    let no_tiff = file("dem.tif", "this is no raster");
    let empty = file("empty.tif", "");
    let scene = file("scene.toml", "[dem]\npath = \"dem.tif\"\nnodta = 3\n");
    let no_dem = file("no_dem.toml", "name = \"x\"\n");
    let missing = file("missing.toml", "[dem]\npath = \"nowhere.tif\"\n");
    let config = file("treeline.toml", "lisen = \"127.0.0.1:0\"\n");
    let cases: &[(&[&str], &str)] = &[
        (&["serve", "--dme", "x"], "--dme"),
        (&["serve", "--dem"], "--dem"),
        (&["sevre"], "sevre"),
        (&["serve", "--photo", "x.tif"], "--photo needs terrain"),
        (&["serve", "--dem", "/nowhere/dem.tif"], "/nowhere/dem.tif"),
        (&["serve", "--dem", &no_tiff], "dem.tif"),
        (&["serve", "--dem", &empty], "empty.tif"),
        (&["serve", "--dem", "/"], "/"),
        (&["serve", "--scene", &scene], "unknown key \"nodta\"; did you mean \"nodata\"?"),
        (&["serve", "--scene", &no_dem], "no [dem]"),
        (&["serve", "--scene", &missing], "nowhere.tif"),
        (&["serve", "--config", &config], "unknown key \"lisen\"; did you mean \"listen\"?"),
        (&["serve", "--listen", "nonsense"], "write for example 127.0.0.1:8080"),
        (&["serve", "--scene", "/dev/zero"], "/dev/zero: cannot be read (it is no regular file)"),
        (&[], "there is no command"),
        (&["serve", "--cache", &no_tiff], "--cache"),
        (&["serve", "--nodata", "x"], "--nodata"),
        (&["serve", "--public-url", "x"], "--public-url"),
        (&["seed", "--bbox", "-1,2,3,4", "--levels", "1..2"], "--cache"),
        (&["seed", "--bbox", "-1,2,3", "--levels", "1..2"], "--bbox"),
    ];
    for (arguments, named) in cases {
        let (code, stdout, stderr) = run(arguments);
        assert_eq!((code, stdout.as_str()), (Some(2), ""), "{arguments:?}: {stderr}");
        assert!(stderr.contains(named) && stderr.lines().count() == 1, "{arguments:?}: {stderr}");
    }
}

#[test]
fn help_and_version_are_no_mistakes() {
    for arguments in [&["--help"][..], &["serve", "--help"], &["--version"]] {
        let (code, stdout, stderr) = run(arguments);
        assert_eq!((code, stderr.as_str()), (Some(0), ""));
        assert!(stdout.contains("treeline") || stdout.contains("--dem"));
    }
}

#[test]
fn check_prints_facts_or_what_is_wrong() {
    let (code, stdout, stderr) = run(&["check"]);
    assert_eq!((code, stderr.as_str()), (Some(0), ""));
    assert!(stdout.contains("built-in"), "{stdout}");
    let (code, _, stderr) = run(&["check", "--dem", "/nowhere/dem.tif"]);
    assert_eq!((code, stderr.lines().count()), (Some(1), 1));
    assert!(stderr.contains("/nowhere/dem.tif"));
}

/// A running server and its address.
fn serve(arguments: &[&str]) -> (Child, String) {
    let mut all = vec!["serve", "--listen", "127.0.0.1:0"];
    all.extend(arguments);
    let mut child = treeline(&all).spawn().unwrap();
    let mut line = String::new();
    BufReader::new(child.stdout.as_mut().unwrap()).read_line(&mut line).unwrap();
    let address = line.trim().strip_prefix("treeline: listening on http://").expect(&line).to_owned();
    (child, address)
}

fn get(address: &str, path: &str) -> String {
    let mut stream = std::net::TcpStream::connect(address).unwrap();
    write!(stream, "GET {path} HTTP/1.1\r\nHost: {address}\r\nConnection: close\r\n\r\n").unwrap();
    let mut bytes = Vec::new();
    stream.read_to_end(&mut bytes).unwrap();
    String::from_utf8_lossy(&bytes).into_owned()
}

#[cfg(unix)]
#[test]
fn it_says_where_it_listens_and_stops_when_told() {
    for signal in ["-TERM", "-INT"] {
        let (mut child, address) = serve(&[]);
        let scene = get(&address, "/scene.json");
        assert!(
            scene.starts_with("HTTP/1.1 200 OK") && scene.contains(&format!("http://{address}/wms?")),
            "{scene}"
        );
        let (code, _, stderr) = run(&["serve", "--listen", &address]);
        assert_eq!((code, stderr.lines().count()), (Some(2), 1));
        assert!(stderr.contains("another program listens there"), "{stderr}");
        assert!(Command::new("kill").args([signal, &child.id().to_string()]).status().unwrap().success());
        assert_eq!(child.wait().unwrap().code(), Some(0), "{signal}");
    }
}

#[test]
fn seed_fills_the_folder_and_resumes() {
    let folder = tempfile::tempdir().unwrap();
    let cache = folder.path().to_str().unwrap();
    // A corner of the built-in landscape; the box may be written with negative numbers.
    let arguments = [
        "seed",
        "--cache",
        cache,
        "--bbox",
        "-20,40,20,50",
        "--levels",
        "6..7",
        "--layers",
        "elevation,texture",
    ];
    let (code, first, stderr) = run(&arguments);
    assert_eq!(code, Some(0), "{stderr}");
    let count = |text: &str| -> (u64, u64) {
        let numbers: Vec<u64> = text.split_whitespace().filter_map(|word| word.parse().ok()).collect();
        (numbers[0], numbers[1])
    };
    let (made, found) = count(&first);
    assert!(made >= 4 && found == 0, "{first}");
    assert_eq!(tiles_below(folder.path()), made);
    let (_, second, _) = run(&arguments);
    assert_eq!(count(&second), (0, made));
}

fn tiles_below(folder: &Path) -> u64 {
    std::fs::read_dir(folder)
        .unwrap()
        .map(|entry| entry.unwrap().path())
        .map(|path| {
            if path.is_dir() {
                tiles_below(&path)
            } else {
                u64::from(path.extension().is_some_and(|e| e == "tile"))
            }
        })
        .sum()
}

#[test]
fn the_example_files_are_understood() {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../docker");
    let read = |name: &str| std::fs::read_to_string(folder.join(name)).unwrap();
    let config = read("treeline.toml");
    treeline_server::toml_file::parse::<treeline_server::config::Config>(&config, "treeline.toml").unwrap();
    // What is commented out is there to be used: with the marks taken off it must be understood as well.
    let is_key = |line: &str| {
        line.starts_with('[')
            || line.split('=').next().is_some_and(|key| {
                line.contains('=')
                    && key.trim().chars().all(|c| c.is_ascii_alphanumeric() || "_.".contains(c))
            })
    };
    let scene: String = read("scene.toml")
        .lines()
        .map(|line| line.strip_prefix("# ").filter(|rest| is_key(rest)).unwrap_or(line).to_owned() + "\n")
        .collect();
    let scene: treeline_server::scene_file::SceneFile =
        treeline_server::toml_file::parse(&scene, "scene.toml").unwrap();
    scene.check().unwrap();
    assert!(scene.land_cover.is_some() && scene.camera.is_some() && scene.sun.is_some());
}
