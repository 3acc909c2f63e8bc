//! Embeds the page's bundle where it has been built, and a digest of the code that makes tiles.

use std::fmt::Write as _;
use std::path::{Path, PathBuf};
use std::{env, fs, io};

/// Where `cargo xtask wasm` puts the bundle, from this package's folder.
const BUNDLE: &str = "../client-wasm/www/dist";
/// The code on which the bytes of a tile depend.
const TILE_CODE: [&str; 3] = ["../core/src", "src/recipe", "src/source"];

fn main() -> io::Result<()> {
    let package = PathBuf::from(env::var_os("CARGO_MANIFEST_DIR").unwrap_or_default());
    let out = PathBuf::from(env::var_os("OUT_DIR").unwrap_or_default());
    fs::write(out.join("assets.rs"), assets(&package.join(BUNDLE))?)?;
    println!("cargo::rustc-env=TREELINE_TILE_CODE={:016x}", digest(&package)?);
    println!("cargo::rerun-if-changed=build.rs");
    // A path that does not exist counts as changed each time: watch the nearest folder that does.
    let mut watched = package.join(BUNDLE);
    while !watched.exists() && watched.pop() {}
    println!("cargo::rerun-if-changed={}", watched.display());
    for folder in TILE_CODE.iter().filter(|folder| package.join(folder).exists()) {
        println!("cargo::rerun-if-changed={}", package.join(folder).display());
    }
    Ok(())
}

/// Rust source of `ASSETS`: the bundle's files, with their brotli form where there is one.
fn assets(bundle: &Path) -> io::Result<String> {
    let mut source = String::from("static ASSETS: &[Asset] = &[\n");
    for file in
        files(bundle)?.iter().filter(|file| file.extension().is_none_or(|extension| extension != "br"))
    {
        let path = file.strip_prefix(bundle).unwrap_or(file).to_string_lossy().replace('\\', "/");
        let brotli = PathBuf::from(format!("{}.br", file.display()));
        let brotli =
            if brotli.exists() { format!("Some(include_bytes!({brotli:?}))") } else { "None".to_owned() };
        let _ = writeln!(
            source,
            "    Asset {{ path: {path:?}, plain: include_bytes!({file:?}), brotli: {brotli} }},"
        );
    }
    source += "];\n";
    Ok(source)
}

/// FNV-1a over names and contents, so that tiles of other code are never taken for this code's.
fn digest(package: &Path) -> io::Result<u64> {
    let mut digest = 0xcbf2_9ce4_8422_2325_u64;
    for folder in TILE_CODE {
        let root = package.join(folder);
        for file in files(&root)? {
            let name = file.strip_prefix(&root).unwrap_or(&file).to_string_lossy().replace('\\', "/");
            for byte in name.bytes().chain(fs::read(&file)?) {
                digest = (digest ^ u64::from(byte)).wrapping_mul(0x0000_0100_0000_01b3);
            }
        }
    }
    Ok(digest)
}

/// All files below a folder, sorted; none where there is no folder.
fn files(folder: &Path) -> io::Result<Vec<PathBuf>> {
    let mut found = Vec::new();
    if !folder.is_dir() {
        return Ok(found);
    }
    for entry in fs::read_dir(folder)? {
        let path = entry?.path();
        if path.is_dir() {
            found.extend(files(&path)?);
        } else {
            found.push(path);
        }
    }
    found.sort();
    Ok(found)
}
