//! The real programs, built as they are now, and the server as a process of its own.

use anyhow::{Context, bail};
use std::collections::VecDeque;
use std::io::{BufRead, BufReader, Read};
use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::sync::{Arc, Mutex, OnceLock};

/// Lines of standard error that are kept for a failure's message.
const KEPT_LINES: usize = 40;

/// Path of one of the workspace's programs (`treeline`, `treeline-shot`), built from the sources as
/// they are: without this a test would quietly run yesterday's program.
pub fn path(name: &str) -> anyhow::Result<PathBuf> {
    static BUILT: OnceLock<Result<PathBuf, String>> = OnceLock::new();
    let folder = BUILT.get_or_init(|| build().map_err(|error| format!("{error:#}"))).clone();
    let folder = folder.map_err(anyhow::Error::msg)?;
    let program = folder.join(format!("{name}{}", std::env::consts::EXE_SUFFIX));
    if !program.is_file() {
        bail!("there is no {}", program.display());
    }
    Ok(program)
}

/// Builds the programs in the profile of this test program; gives the folder where they are.
fn build() -> anyhow::Result<PathBuf> {
    // target/PROFILE/deps/this-test
    let this = std::env::current_exe().context("where this test is")?;
    let folder =
        this.parent().and_then(|deps| deps.parent()).context("a test lies in target/PROFILE/deps")?;
    let mut cargo = Command::new(std::env::var_os("CARGO").unwrap_or_else(|| "cargo".into()));
    // The same selection of packages as the test command's: features resolve alike, nothing is rebuilt.
    cargo.args(["build", "--locked", "--quiet", "--workspace", "--exclude=xtask", "--bins"]);
    if folder.file_name().is_some_and(|name| name == "release") {
        cargo.arg("--release");
    }
    if let Some(target) = folder.parent() {
        cargo.env("CARGO_TARGET_DIR", target);
    }
    let output = cargo.current_dir(crate::data::workspace()).output().context("cannot start cargo")?;
    if !output.status.success() {
        bail!("building the programs failed:\n{}", String::from_utf8_lossy(&output.stderr));
    }
    Ok(folder.to_path_buf())
}

/// A child process whose standard error is drained, and which is killed when this is dropped.
pub struct Process {
    child: Child,
    errors: Arc<Mutex<VecDeque<String>>>,
}

impl Process {
    /// Starts it; standard output is piped.
    pub fn start(command: &mut Command) -> anyhow::Result<Self> {
        let name = command.get_program().to_string_lossy().into_owned();
        let child = command
            .stdin(Stdio::null())
            .stdout(Stdio::piped())
            .stderr(Stdio::piped())
            .spawn()
            .with_context(|| format!("cannot start {name}"))?;
        Ok(Self::of(child))
    }

    /// Takes a child over.
    pub fn of(mut child: Child) -> Self {
        let errors = Arc::new(Mutex::new(VecDeque::new()));
        if let Some(stderr) = child.stderr.take() {
            drain(stderr, Arc::clone(&errors));
        }
        Self { child, errors }
    }

    /// The child.
    pub fn child(&mut self) -> &mut Child {
        &mut self.child
    }

    /// What it last wrote to standard error.
    pub fn errors(&self) -> Vec<String> {
        self.errors.lock().map(|lines| lines.iter().cloned().collect()).unwrap_or_default()
    }
}

impl Drop for Process {
    fn drop(&mut self) {
        // It may have ended by itself; either is fine.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

/// Keeps reading, so that the child never blocks on a full pipe.
fn drain(stream: impl Read + Send + 'static, lines: Arc<Mutex<VecDeque<String>>>) {
    std::thread::spawn(move || {
        for line in BufReader::new(stream).lines().map_while(Result::ok) {
            if let Ok(mut lines) = lines.lock() {
                if lines.len() == KEPT_LINES {
                    lines.pop_front();
                }
                lines.push_back(line);
            }
        }
    });
}

/// `treeline serve` on a port of its own.
pub struct Server {
    process: Process,
    address: String,
}

impl Server {
    /// Starts it with further arguments and waits until it accepts connections.
    pub fn start(arguments: &[&str]) -> anyhow::Result<Self> {
        Self::start_at("127.0.0.1:0", arguments)
    }

    /// The same at an address of one's own, as after a restart.
    pub fn start_at(address: &str, arguments: &[&str]) -> anyhow::Result<Self> {
        let mut command = Command::new(path("treeline")?);
        command.args(["serve", "--listen", address]).args(arguments);
        let mut process = Process::start(&mut command)?;
        let stdout = process.child().stdout.take().context("standard output is piped")?;
        let mut line = String::new();
        BufReader::new(stdout).read_line(&mut line)?;
        let Some(address) = line.trim().strip_prefix("treeline: listening on http://") else {
            let status = process.child().wait()?;
            bail!("the server said {line:?} and ended ({status}): {}", process.errors().join("\n"));
        };
        Ok(Self { address: address.to_owned(), process })
    }

    /// The process's number.
    pub fn id(&self) -> u32 {
        self.process.child.id()
    }

    /// `HOST:PORT`.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// `http://HOST:PORT` and a path.
    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    /// What it last wrote to standard error.
    pub fn errors(&self) -> Vec<String> {
        self.process.errors()
    }
}
