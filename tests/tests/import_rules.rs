//! Which crate may use which: the table of the README's *Layout*, checked on the resolved
//! dependency graph, and for what the graph does not show, on the sources.

use serde_json::Value;
use std::collections::{BTreeMap, BTreeSet};
use std::path::{Path, PathBuf};
use std::process::Command;
use treeline_tests::data::workspace;

/// A crate, and what it must not reach, directly or through others.
const RULES: [(&str, &[&str]); 4] = [
    (
        "treeline-core",
        &[
            "tokio",
            "wgpu",
            "axum",
            "image",
            "rayon",
            "web-sys",
            "treeline-shaders",
            "treeline-server",
            "treeline-client",
            "treeline-shot",
        ],
    ),
    ("treeline-shaders", &["tokio", "wgpu", "axum", "treeline-server", "treeline-client", "treeline-shot"]),
    ("treeline-server", &["wgpu", "naga", "treeline-shaders", "treeline-client", "treeline-shot"]),
    ("treeline-client", &["tokio", "axum", "treeline-server", "treeline-shot"]),
];

/// Nothing imports these, but for the tests.
const LEAVES: [&str; 3] = ["treeline-shot", "treeline-tests", "xtask"];

/// The dependency graph for a platform: from each package to those that it is built with.
fn graph(platform: &str) -> BTreeMap<String, BTreeSet<String>> {
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    cargo.args(["metadata", "--format-version", "1", "--locked", "--filter-platform", platform]);
    cargo.current_dir(workspace());
    let output = cargo.output().expect("cargo can be started");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let metadata: Value = serde_json::from_slice(&output.stdout).expect("cargo metadata prints JSON");
    let names: BTreeMap<&str, &str> =
        array(&metadata["packages"]).map(|package| (text(&package["id"]), text(&package["name"]))).collect();
    let mut graph: BTreeMap<String, BTreeSet<String>> = BTreeMap::new();
    for node in array(&metadata["resolve"]["nodes"]) {
        let uses = graph.entry(names[text(&node["id"])].to_owned()).or_default();
        for dependency in array(&node["deps"]) {
            // `kind` is null for what goes into the program; "dev" and "build" do not.
            if array(&dependency["dep_kinds"]).any(|kind| kind["kind"].is_null()) {
                uses.insert(names[text(&dependency["pkg"])].to_owned());
            }
        }
    }
    graph
}

fn array(value: &Value) -> impl Iterator<Item = &Value> {
    value.as_array().expect("a list in cargo metadata").iter()
}

fn text(value: &Value) -> &str {
    value.as_str().expect("a text in cargo metadata")
}

/// All that a package reaches.
fn reached(graph: &BTreeMap<String, BTreeSet<String>>, from: &str) -> BTreeSet<String> {
    let mut found = BTreeSet::new();
    let mut open = vec![from];
    while let Some(name) = open.pop() {
        for next in graph.get(name).into_iter().flatten() {
            if found.insert(next.clone()) {
                open.push(next);
            }
        }
    }
    found
}

#[test]
fn crates_use_only_what_they_may() {
    // One platform at a time: what a dependency would use elsewhere is not what goes into a program.
    for platform in ["x86_64-unknown-linux-gnu", "wasm32-unknown-unknown"] {
        check_rules(&graph(platform));
    }
}

fn check_rules(graph: &BTreeMap<String, BTreeSet<String>>) {
    for (name, refused) in RULES {
        let reached = reached(graph, name);
        assert!(graph.contains_key(name), "there is a {name}");
        for refused in refused {
            assert!(!reached.contains(*refused), "{name} must not use {refused}");
        }
    }
    for (name, uses) in graph {
        for leaf in LEAVES {
            assert!(name == "treeline-tests" || !uses.contains(leaf), "{name} must not import {leaf}");
        }
    }
}

#[test]
fn the_page_has_no_native_graphics_stack_in_it() {
    // As resolved for the page alone: with the whole workspace the features of all members unite.
    let output = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()))
        .args(["tree", "--locked", "--package=treeline-client", "--edges=normal", "--prefix=none"])
        .args(["--format={p}", "--target=wasm32-unknown-unknown"])
        .current_dir(workspace())
        .output()
        .expect("cargo can be started");
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let tree = String::from_utf8_lossy(&output.stdout).into_owned();
    let names: BTreeSet<&str> = tree.lines().filter_map(|line| line.split(' ').next()).collect();
    assert!(names.contains("wgpu") && names.contains("web-sys"), "{names:?}");
    for refused in ["wgpu-core", "wgpu-hal", "naga", "tokio", "image", "pollster"] {
        assert!(!names.contains(refused), "the page must not contain {refused}");
    }
}

/// Rust files under a folder.
fn sources(folder: &Path) -> Vec<PathBuf> {
    let mut files = Vec::new();
    let mut open = vec![folder.to_path_buf()];
    while let Some(folder) = open.pop() {
        for entry in std::fs::read_dir(&folder).expect("a source folder can be listed").flatten() {
            let path = entry.path();
            if path.is_dir() {
                open.push(path);
            } else if path.extension().is_some_and(|extension| extension == "rs") {
                files.push(path);
            }
        }
    }
    files
}

/// Lines of code (comments left out) that use any of the words, as `file:line: text`.
fn uses(files: &[PathBuf], words: &[&str]) -> Vec<String> {
    let mut found = Vec::new();
    for file in files {
        let content = std::fs::read_to_string(file).expect("a source file can be read");
        for (number, line) in content.lines().enumerate() {
            let code = line.split("//").next().unwrap_or_default();
            if words.iter().any(|word| code.contains(word)) {
                found.push(format!("{}:{}: {}", file.display(), number + 1, line.trim()));
            }
        }
    }
    found
}

#[test]
fn core_has_no_clock_no_files_and_no_threads() {
    let files = sources(&workspace().join("core/src"));
    assert!(files.len() > 5);
    let found =
        uses(&files, &["std::fs", "std::net", "std::time", "std::thread", "std::process", "std::env"]);
    assert_eq!(found, Vec::<String>::new());
}

#[test]
fn browser_types_stay_in_web_and_native_ones_in_headless() {
    let client = workspace().join("client-wasm/src");
    let files = sources(&client);
    let outside = |folder: &str| -> Vec<PathBuf> {
        files.iter().filter(|file| !file.starts_with(client.join(folder))).cloned().collect()
    };
    let browser = uses(&outside("web"), &["web_sys::", "js_sys::", "wasm_bindgen"]);
    assert_eq!(browser, Vec::<String>::new());
    let native = uses(
        &outside("headless"),
        &["std::fs", "std::net", "std::thread", "pollster::", "image::", "Instant::now"],
    );
    assert_eq!(native, Vec::<String>::new());
}
