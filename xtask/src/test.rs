//! `cargo xtask test`: everything that CI runs, in order, cheapest first.
//!
//! `cargo test` rather than another runner: it is there wherever cargo is, and the tests of one
//! program share one graphics adapter and one compiled set of shaders.

use crate::tally::Tally;
use crate::{bundle, licences, process, setup};
use std::io::{BufRead, BufReader};
use std::process::{ExitCode, Stdio};
use std::time::Instant;

/// What may be left out.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Options {
    /// Whether missing tools may be installed.
    pub setup: bool,
    /// Whether the browser tests run.
    pub browser: bool,
}

impl Options {
    /// From the command line, or the argument that is unknown.
    pub fn parse(arguments: &[&str]) -> Result<Self, String> {
        let mut options = Self { setup: true, browser: true };
        for argument in arguments {
            match *argument {
                "--no-setup" => options.setup = false,
                "--no-browser" => options.browser = false,
                unknown => return Err(unknown.to_owned()),
            }
        }
        Ok(options)
    }
}

/// Packages whose tests run together: with one selection of packages, features resolve the same in
/// every stage and nothing is built twice.
const TESTED: [&str; 2] = ["--workspace", "--exclude=xtask"];

/// One finished stage.
struct Stage {
    name: &'static str,
    seconds: f64,
    failure: Option<String>,
}

/// The stages so far.
#[derive(Default)]
struct Run {
    stages: Vec<Stage>,
    tally: Tally,
}

impl Run {
    /// Runs a stage; a failure is kept, and later stages still run, so that one look shows all.
    fn stage(&mut self, name: &'static str, work: impl FnOnce(&mut Tally) -> anyhow::Result<()>) -> bool {
        println!("\n=== {name}");
        let start = Instant::now();
        let result = work(&mut self.tally);
        let seconds = start.elapsed().as_secs_f64();
        let failure = result.err().map(|error| format!("{error:#}"));
        match &failure {
            None => println!("=== {name}: done in {seconds:.0} s"),
            Some(failure) => println!("=== {name}: FAILED after {seconds:.0} s: {failure}"),
        }
        let passed = failure.is_none();
        self.stages.push(Stage { name, seconds, failure });
        passed
    }
}

/// Runs all stages, prints a summary, and fails where any failed.
pub fn run(options: Options) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let mut run = Run::default();
    run.stage("tools", |_| {
        setup::rustup(&["component", "add", "rustfmt", "clippy"])?;
        setup::wasm_target()?;
        setup::test_tools(options.setup, options.browser)
    });
    run.stage("format", |_| process::check(&mut process::cargo(&["fmt", "--all", "--check"])));
    run.stage("licences of dependencies", |_| licences::check());
    // Before anything that compiles the server: it embeds the page.
    let page = run.stage("page", |_| bundle::build());
    run.stage("lints", |_| {
        process::check(&mut process::cargo(&[
            "clippy",
            "--locked",
            "--workspace",
            "--all-targets",
            "--",
            "--deny=warnings",
        ]))
    });
    run.stage("lints of the page's code", |_| {
        process::check(&mut process::cargo(&[
            "clippy",
            "--locked",
            "--package=treeline-client",
            "--lib",
            "--target",
            setup::WASM_TARGET,
            "--",
            "--deny=warnings",
        ]))
    });
    run.stage("links in the documentation", |_| {
        process::check(
            process::cargo(&[
                "doc",
                "--locked",
                "--workspace",
                "--no-deps",
                "--lib",
                "--document-private-items",
                "--quiet",
            ])
            .env("RUSTDOCFLAGS", "--deny=warnings --allow=rustdoc::private_intra_doc_links"),
        )
    });
    run.stage("tests of the commands", |tally| {
        // In release, where the commands are compiled already.
        cargo_test(&["--release", "--package=xtask"], tally)
    });
    run.stage("unit and property tests, shaders, twins", |tally| {
        cargo_test(&[TESTED[0], TESTED[1], "--lib", "--bins"], tally)
    });
    let programs = run
        .stage("programs", |_| process::check(process::cargo(&["build", "--locked", "--bins"]).args(TESTED)));
    if page && programs {
        run.stage("images, HTTP, programs, browser", |tally| {
            let mut arguments = vec![TESTED[0], TESTED[1], "--test=*"];
            if !options.browser {
                arguments.extend(["--", "--skip", "browser"]);
            }
            cargo_test(&arguments, tally)
        });
    }
    Ok(summary(&run, start.elapsed().as_secs_f64()))
}

/// Runs `cargo test`, passing its output on, and adds up what its programs report. Their own summary
/// lines are shown in another form, so that the one at the end is the only one to count.
fn cargo_test(arguments: &[&str], tally: &mut Tally) -> anyhow::Result<()> {
    let mut command = process::cargo(&["test", "--locked", "--no-fail-fast"]);
    command.args(arguments).stdout(Stdio::piped());
    let line = process::line_of(&command);
    let mut child = command.spawn()?;
    let output = child.stdout.take().expect("standard output is piped");
    for line in BufReader::new(output).split(b'\n') {
        let line = String::from_utf8_lossy(&line?).into_owned();
        match Tally::from_line(&line) {
            Some(counts) => {
                tally.add(counts);
                println!(
                    "    {} passed, {} failed, {} ignored",
                    counts.passed, counts.failed, counts.ignored
                );
            }
            None => println!("{line}"),
        }
    }
    let status = child.wait()?;
    anyhow::ensure!(status.success(), "`{line}` failed ({status})");
    Ok(())
}

/// Prints the stages with their times and, last, one line of counts.
fn summary(run: &Run, seconds: f64) -> ExitCode {
    println!("\n=== summary");
    for stage in &run.stages {
        let verdict = if stage.failure.is_none() { "ok" } else { "FAILED" };
        println!("{:<45} {:>6.0} s  {verdict}", stage.name, stage.seconds);
    }
    for (name, failure) in run.stages.iter().filter_map(|stage| Some((stage.name, stage.failure.as_ref()?))) {
        println!("failed: {name}: {failure}");
    }
    let ok = run.stages.iter().all(|stage| stage.failure.is_none());
    println!("{}", run.tally.summary(ok, seconds));
    if ok { ExitCode::SUCCESS } else { ExitCode::FAILURE }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn options() {
        assert_eq!(Options::parse(&[]), Ok(Options { setup: true, browser: true }));
        assert_eq!(Options::parse(&["--no-browser"]), Ok(Options { setup: true, browser: false }));
        assert_eq!(Options::parse(&["--fast"]), Err("--fast".to_owned()));
    }

    #[test]
    fn a_failed_stage_is_kept_and_the_next_one_runs() {
        let mut run = Run::default();
        assert!(!run.stage("first", |_| anyhow::bail!("broken")));
        assert!(run.stage("second", |tally| {
            tally.passed += 1;
            Ok(())
        }));
        assert_eq!(run.stages[0].failure.as_deref(), Some("broken"));
        assert_eq!(run.tally.passed, 1);
    }
}
