//! `cargo xtask report`: error against run time.

use crate::process;

/// Runs the report program of the test crate, which writes into docs/report.
pub fn run() -> anyhow::Result<()> {
    process::check(&mut process::cargo(&[
        "run",
        "--locked",
        "--release",
        "--package=treeline-tests",
        "--bin=report",
        "--",
        "docs/report",
    ]))
}
