//! A real Chromium, headless, driven by the DevTools protocol.

mod connection;
mod frames;
mod page;

pub use frames::{FRAME_RECORDER, RecordedFrame};
pub use page::{Page, Pointer};

use crate::program::Process;
use anyhow::{Context, bail};
use connection::Connection;
use std::path::PathBuf;
use std::process::{Command, Stdio};
use std::sync::{Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use tempfile::TempDir;

/// What makes Chromium draw WebGPU on the processor. All of the last five are needed: without the
/// ones for Vulkan and ANGLE the adapter opens and the first frame destroys the device.
const FLAGS: [&str; 17] = [
    "--headless",
    "--no-sandbox",
    "--disable-quic",
    "--no-first-run",
    "--disable-background-networking",
    "--disable-component-update",
    "--disable-sync",
    // A page that is not in front is not to be slowed down.
    "--disable-renderer-backgrounding",
    "--disable-background-timer-throttling",
    "--hide-scrollbars",
    // A name that is this machine, yet no secure context.
    "--host-resolver-rules=MAP treeline.test 127.0.0.1",
    "--remote-debugging-port=0",
    "--enable-unsafe-webgpu",
    "--enable-features=Vulkan",
    "--use-vulkan=swiftshader",
    "--use-angle=swiftshader",
    "--use-webgpu-adapter=swiftshader",
];

/// One at a time: two software adapters on few cores would only wait for each other.
static ONE: Mutex<()> = Mutex::new(());

/// A running browser. It ends, and its profile goes, when this is dropped.
pub struct Browser {
    // Dropped in this order: the process first, its profile next, then the next test may begin.
    process: Process,
    profile: TempDir,
    endpoint: String,
    _one: MutexGuard<'static, ()>,
}

impl Browser {
    /// Starts one with WebGPU.
    pub fn start() -> anyhow::Result<Self> {
        Self::start_with(&FLAGS)
    }

    /// Starts one that has WebGPU, but no graphics adapter for it.
    pub fn start_without_adapter() -> anyhow::Result<Self> {
        let flags: Vec<&str> =
            FLAGS.into_iter().filter(|flag| !flag.contains("webgpu") && !flag.contains("Vulkan")).collect();
        Self::start_with(&flags)
    }

    fn start_with(flags: &[&str]) -> anyhow::Result<Self> {
        // A test that failed while it held the lock has no bearing on the next.
        let one = ONE.lock().unwrap_or_else(PoisonError::into_inner);
        let profile = tempfile::tempdir().context("a folder for the browser's profile")?;
        let mut command = Command::new(program()?);
        command.args(flags).arg(format!("--user-data-dir={}", profile.path().display())).arg("about:blank");
        let process = Process::start(&mut command)?;
        let mut browser = Self { process, profile, endpoint: String::new(), _one: one };
        browser.endpoint = browser.wait_for_endpoint()?;
        Ok(browser)
    }

    /// The browser writes its port and address into its profile once it listens.
    fn wait_for_endpoint(&mut self) -> anyhow::Result<String> {
        let file = self.profile.path().join("DevToolsActivePort");
        let start = Instant::now();
        while start.elapsed() < Duration::from_secs(60) {
            if let Ok(text) = std::fs::read_to_string(&file)
                && let [port, path, ..] = text.lines().collect::<Vec<_>>()[..]
            {
                return Ok(format!("127.0.0.1:{port}{path}"));
            }
            if let Some(status) = self.process.child().try_wait()? {
                bail!("the browser ended ({status}): {}", self.process.errors().join("\n"));
            }
            std::thread::sleep(Duration::from_millis(20));
        }
        bail!("the browser did not open its DevTools: {}", self.process.errors().join("\n"))
    }

    /// Opens an address in a new tab with a picture of so many CSS pixels.
    pub fn open(&self, url: &str, width: u32, height: u32) -> anyhow::Result<Page> {
        self.open_after("", url, width, height)
    }

    /// The same, with a script that runs before any of the page's own.
    pub fn open_after(&self, script: &str, url: &str, width: u32, height: u32) -> anyhow::Result<Page> {
        Page::open(Connection::to(&self.endpoint)?, script, url, width, height)
    }
}

/// Where Chromium is: `TREELINE_CHROMIUM`, or one of its usual names.
fn program() -> anyhow::Result<PathBuf> {
    if let Some(path) = std::env::var_os("TREELINE_CHROMIUM") {
        return Ok(PathBuf::from(path));
    }
    ["chromium", "chromium-browser", "google-chrome"]
        .into_iter()
        .find(|name| {
            Command::new(name).arg("--version").stdout(Stdio::null()).stderr(Stdio::null()).status().is_ok()
        })
        .map(PathBuf::from)
        .context(
            "no Chromium here; install it (Debian: apt-get install chromium) or name it in TREELINE_CHROMIUM",
        )
}
