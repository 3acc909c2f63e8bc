//! `cargo xtask wasm`: the page in `client-wasm/www/dist`, which the server embeds.
//!
//! wasm-bindgen is used as a library: its version is that of the workspace, and nothing has to be
//! installed by hand.

use crate::{process, setup};
use anyhow::{Context, bail};
use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

/// All of wasm, JS, HTML and CSS, after brotli, in bytes: what a visitor waits for.
const BUDGET_BYTES: usize = 400 * 1024;

/// Builds the page, writes it with a brotli copy beside each file, prints the sizes and fails
/// where they are over the budget.
pub fn build() -> anyhow::Result<()> {
    setup::wasm_target()?;
    let files = files()?;
    let folder = process::root().join("client-wasm/www/dist");
    let mut total = 0;
    println!("{:<28} {:>10} {:>10}", "file", "bytes", "brotli");
    let mut written = Vec::new();
    for (name, content) in &files {
        let compressed = compressed(&folder, name, content)?;
        println!("{name:<28} {:>10} {:>10}", content.len(), compressed.len());
        total += compressed.len();
        process::write_if_changed(&folder.join(name), content)?;
        process::write_if_changed(&folder.join(format!("{name}.br")), &compressed)?;
        written.extend([name.clone(), format!("{name}.br")]);
    }
    remove_others(&folder, &written)?;
    println!(
        "{:<28} {:>10} {total:>10}  of {BUDGET_BYTES}",
        "all",
        files.values().map(Vec::len).sum::<usize>()
    );
    if total > BUDGET_BYTES {
        bail!("the page is {total} bytes after brotli, {} over its budget", total - BUDGET_BYTES);
    }
    Ok(())
}

/// The page's files by name: the wasm and its glue, and what lies in `client-wasm/www`.
fn files() -> anyhow::Result<BTreeMap<String, Vec<u8>>> {
    process::check(&mut process::cargo(&[
        "build",
        "--locked",
        "--package=treeline-client",
        "--lib",
        "--profile=wasm-release",
        "--target",
        setup::WASM_TARGET,
    ]))?;
    let wasm = process::target_directory()?
        .join(setup::WASM_TARGET)
        .join("wasm-release")
        .join("treeline_client.wasm");
    let glue = process::target_directory()?.join("page");
    wasm_bindgen_cli_support::Bindgen::new()
        .input_path(&wasm)
        .out_name("treeline")
        .web(true)?
        .typescript(false)
        // The library's default would make `init()` without an address fail.
        .omit_default_module_path(false)
        .remove_name_section(true)
        .remove_producers_section(true)
        .generate(&glue)
        .with_context(|| format!("wasm-bindgen on {}", wasm.display()))?;
    let mut files = BTreeMap::new();
    for name in ["treeline.js", "treeline_bg.wasm"] {
        let path = glue.join(name);
        files.insert(
            name.to_owned(),
            std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?,
        );
    }
    let sources = process::root().join("client-wasm/www");
    for entry in std::fs::read_dir(&sources).with_context(|| format!("cannot list {}", sources.display()))? {
        let path = entry?.path();
        if path.is_file() {
            let name = path.file_name().and_then(|name| name.to_str()).context("a file name in www")?;
            files.insert(
                name.to_owned(),
                std::fs::read(&path).with_context(|| format!("cannot read {}", path.display()))?,
            );
        }
    }
    Ok(files)
}

/// The brotli copy: the one that is there where the file has not changed, else a new one.
fn compressed(folder: &Path, name: &str, content: &[u8]) -> anyhow::Result<Vec<u8>> {
    if std::fs::read(folder.join(name)).is_ok_and(|old| old == content)
        && let Ok(compressed) = std::fs::read(folder.join(format!("{name}.br")))
    {
        return Ok(compressed);
    }
    brotli(content)
}

/// Brotli at its best quality.
fn brotli(content: &[u8]) -> anyhow::Result<Vec<u8>> {
    let parameters = brotli::enc::BrotliEncoderParams {
        quality: 11,
        lgwin: 22,
        size_hint: content.len(),
        ..Default::default()
    };
    let mut compressed = Vec::new();
    brotli::BrotliCompress(&mut &content[..], &mut compressed, &parameters).context("brotli")?;
    Ok(compressed)
}

/// Removes what an earlier build left and this one does not have.
fn remove_others(folder: &Path, keep: &[String]) -> anyhow::Result<()> {
    for entry in std::fs::read_dir(folder)? {
        let path: PathBuf = entry?.path();
        let name = path.file_name().and_then(|name| name.to_str()).unwrap_or_default();
        if path.is_file() && !keep.iter().any(|kept| kept == name) {
            std::fs::remove_file(&path).with_context(|| format!("cannot remove {}", path.display()))?;
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    #[test]
    fn brotli_can_be_read_again() {
        let content = b"forest ".repeat(1000);
        let compressed = super::brotli(&content).unwrap();
        assert!(compressed.len() < 100);
        let mut back = Vec::new();
        brotli::BrotliDecompress(&mut &compressed[..], &mut back).unwrap();
        assert_eq!(back, content);
    }

    #[test]
    fn what_an_earlier_build_left_goes() {
        let folder = std::env::temp_dir().join(format!("treeline-bundle-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        for name in ["kept.js", "old.js"] {
            std::fs::write(folder.join(name), "x").unwrap();
        }
        super::remove_others(&folder, &["kept.js".to_owned()]).unwrap();
        assert!(folder.join("kept.js").exists() && !folder.join("old.js").exists());
        std::fs::remove_dir_all(&folder).unwrap();
    }
}
