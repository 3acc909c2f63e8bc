//! Clients of others, as their authors publish them.

use anyhow::{Context, bail};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A package's folder, unpacked in the target folder; `None`, with a word, where there is no npm or no network.
///
/// # Errors
/// Where the package was fetched and cannot be unpacked.
pub fn npm(name: &str, version: &str) -> anyhow::Result<Option<PathBuf>> {
    let this = std::env::current_exe()?;
    let target = this.ancestors().nth(3).context("a test lies in target/PROFILE/deps")?;
    let folder = target.join("client-packages").join(format!("{}-{version}", name.replace(['@', '/'], "_")));
    let package = folder.join("package");
    if package.is_dir() {
        return Ok(Some(package));
    }
    // Unpacked beside its place, so that a test that was stopped leaves no half of it.
    std::fs::create_dir_all(target.join("client-packages"))?;
    let fresh = tempfile::tempdir_in(target.join("client-packages"))?;
    let Some(archive) = fetch(name, version, fresh.path()) else { return Ok(None) };
    let unpacked = Command::new("tar").arg("xzf").arg(&archive).arg("-C").arg(fresh.path()).status();
    if !unpacked.context("cannot start tar")?.success() {
        bail!("{}: cannot be unpacked", archive.display());
    }
    std::fs::remove_file(&archive)?;
    let fresh = fresh.keep();
    if std::fs::rename(&fresh, &folder).is_err() {
        // Another test was faster.
        std::fs::remove_dir_all(&fresh)?;
    }
    Ok(Some(package))
}

fn fetch(name: &str, version: &str, into: &Path) -> Option<PathBuf> {
    let packed = Command::new("npm")
        .args([
            "pack",
            "--silent",
            "--fetch-timeout=60000",
            "--fetch-retries=1",
            &format!("{name}@{version}"),
        ])
        .current_dir(into)
        .output();
    let archive = packed.ok().filter(|output| output.status.success()).and_then(|output| {
        let file = String::from_utf8(output.stdout).ok()?.lines().last()?.to_owned();
        Some(into.join(file)).filter(|path| path.is_file())
    });
    if archive.is_none() {
        println!("skipped: npm cannot fetch {name}@{version} here");
    }
    archive
}
