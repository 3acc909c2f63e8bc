//! What must be on the machine, and installing it where that may be done without asking.

use crate::process;
use std::path::Path;
use std::process::{Command, Stdio};

/// The client's target.
pub const WASM_TARGET: &str = "wasm32-unknown-unknown";

/// Adds a component or target of rustup, quietly where it is there already.
pub fn rustup(arguments: &[&str]) -> anyhow::Result<()> {
    if !process::exists("rustup") {
        // Distributions package the target and the tools under their own names; the build itself
        // says what is missing then.
        return Ok(());
    }
    process::check(Command::new("rustup").args(arguments).current_dir(process::root()).stderr(Stdio::null()))
        .map_err(|error| error.context("rustup cannot add what is needed; is the network there?"))
}

/// Adds the target that the page is built for.
pub fn wasm_target() -> anyhow::Result<()> {
    rustup(&["target", "add", WASM_TARGET])
}

/// Something that tests use and that the system's package manager brings.
struct Tool {
    /// For people.
    name: &'static str,
    /// What lacks without it.
    used_for: &'static str,
    /// Debian's packages.
    packages: &'static [&'static str],
    /// Whether it is there.
    present: fn() -> bool,
}

const TOOLS: [Tool; 6] = [
    Tool {
        name: "Chromium",
        used_for: "the browser tests",
        packages: &["chromium"],
        present: || {
            std::env::var_os("TREELINE_CHROMIUM").is_some()
                || ["chromium", "chromium-browser", "google-chrome"].iter().any(|name| process::exists(name))
        },
    },
    Tool {
        name: "a Vulkan driver",
        used_for: "the image tests",
        packages: &["mesa-vulkan-drivers", "libvulkan1"],
        present: || {
            let drivers = ["/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d"];
            drivers
                .iter()
                .any(|folder| std::fs::read_dir(folder).is_ok_and(|mut entries| entries.next().is_some()))
                && ["/usr/lib", "/usr/lib64", "/lib"]
                    .iter()
                    .any(|folder| has_vulkan_loader(Path::new(folder)))
        },
    },
    Tool {
        name: "xmllint",
        used_for: "the check of WMS documents against their schemas",
        packages: &["libxml2-utils"],
        present: || process::exists("xmllint"),
    },
    Tool {
        name: "MapServer",
        used_for: "the check with MapServer as the upstream of photo and heights",
        packages: &["cgi-mapserver"],
        present: || Path::new("/usr/lib/cgi-bin/mapserv").exists(),
    },
    Tool {
        name: "OWSLib",
        used_for: "the check with OWSLib as a client",
        packages: &["python3-owslib"],
        present: || {
            Command::new("/usr/bin/python3")
                .args(["-c", "import owslib"])
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status()
                .is_ok_and(|status| status.success())
        },
    },
    Tool {
        name: "GDAL for Python",
        used_for: "the comparison of elevations with GDAL",
        packages: &["python3-gdal"],
        present: || {
            Command::new("python3")
                .args(["-c", "import osgeo.gdal, numpy"])
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status()
                .is_ok_and(|status| status.success())
        },
    },
];

/// What the server's allocator is built with, beside the C compiler that Rust links with.
const BUILD_TOOLS: [Tool; 1] = [Tool {
    name: "make",
    used_for: "building the server's allocator",
    packages: &["make"],
    present: || ["make", "gmake"].iter().any(|name| process::exists(name)),
}];

/// Looks for `libvulkan.so.1` in a library folder and the folders of architectures in it.
fn has_vulkan_loader(folder: &Path) -> bool {
    if folder.join("libvulkan.so.1").exists() {
        return true;
    }
    let Ok(entries) = std::fs::read_dir(folder) else { return false };
    entries.flatten().any(|entry| entry.path().join("libvulkan.so.1").exists())
}

/// Installs what the server is built with where that may be done, and else says what is missing.
pub fn build_tools() -> anyhow::Result<()> {
    bring(BUILD_TOOLS.iter().filter(|tool| !(tool.present)()).collect(), true)
}

/// Installs what tests need where that may be done, and else says what is missing. Tests that cannot do without fail
/// later by themselves.
pub fn test_tools(may_install: bool, browser: bool) -> anyhow::Result<()> {
    let wanted = BUILD_TOOLS.iter().chain(&TOOLS).filter(|tool| browser || tool.name != "Chromium");
    bring(wanted.filter(|tool| !(tool.present)()).collect(), may_install)
}

/// Installs what is missing (Debian or Ubuntu, as root), or prints one line for each thing.
fn bring(missing: Vec<&Tool>, may_install: bool) -> anyhow::Result<()> {
    if missing.is_empty() {
        return Ok(());
    }
    let packages: Vec<&str> = missing.iter().flat_map(|tool| tool.packages.iter().copied()).collect();
    if may_install && may_use_apt() {
        println!("installing {}", packages.join(" "));
        process::check(Command::new("apt-get").args(["update", "-qq"]))?;
        process::check(
            Command::new("apt-get")
                .args(["install", "-y", "-qq", "--no-install-recommends"])
                .args(&packages)
                .env("DEBIAN_FRONTEND", "noninteractive")
                .stdout(Stdio::null()),
        )?;
        return Ok(());
    }
    for tool in missing {
        println!(
            "missing: {}, needed for {}; on Debian or Ubuntu: sudo apt-get install {}",
            tool.name,
            tool.used_for,
            tool.packages.join(" ")
        );
    }
    Ok(())
}

/// Whether this is Debian or one of its children, and we are root.
fn may_use_apt() -> bool {
    let root = Command::new("id").arg("-u").output().is_ok_and(|output| output.stdout.trim_ascii() == b"0");
    root && Path::new("/etc/debian_version").exists() && process::exists("apt-get")
}
