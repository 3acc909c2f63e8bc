//! `cargo xtask serve`: from a fresh clone to a landscape in the browser.

use crate::{bundle, process, setup};
use anyhow::Context;
use std::process::{Command, ExitCode};

/// Builds page and server in release and starts the server with `arguments`, passing its exit code on.
pub fn run(arguments: &[&str]) -> anyhow::Result<ExitCode> {
    setup::build_tools()?;
    bundle::build()?;
    // After the page: the server embeds it.
    process::check(&mut process::cargo(&[
        "build",
        "--locked",
        "--release",
        "--package=treeline-server",
        "--bin=treeline",
    ]))?;
    let program = process::target_directory()?
        .join("release")
        .join(format!("treeline{}", std::env::consts::EXE_SUFFIX));
    let mut command = Command::new(&program);
    // In the folder where the user is: paths in ARGS are relative to it.
    command.arg("serve").args(arguments);
    start(command).with_context(|| format!("cannot start {}", program.display()))
}

/// Becomes the server, so that signals (Ctrl-C, SIGTERM) reach it and nothing else.
#[cfg(unix)]
fn start(mut command: Command) -> std::io::Result<ExitCode> {
    use std::os::unix::process::CommandExt;
    Err(command.exec())
}

/// Runs the server to its end.
#[cfg(not(unix))]
fn start(mut command: Command) -> std::io::Result<ExitCode> {
    let status = command.status()?;
    let code = status.code().and_then(|code| u8::try_from(code).ok()).unwrap_or(1);
    Ok(ExitCode::from(code))
}
