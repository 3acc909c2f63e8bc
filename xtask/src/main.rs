//! The commands that people and CI run: `cargo xtask COMMAND`. One file per command.

mod bench;
mod bundle;
mod licences;
mod process;
mod report;
mod serve;
mod setup;
mod tally;
mod test;

use std::process::ExitCode;

const HELP: &str = "\
Treeline's own commands

Usage: cargo xtask <COMMAND> [OPTIONS]

Commands:
  serve [-- ARGS]  Build the page and the server in release and start `treeline serve ARGS`
                   (127.0.0.1:8080 and the built-in landscape where ARGS say nothing else)
  test             Everything that CI runs: format, lints, import rules, licences, unit and property
                   tests, shader validation, CPU twins, golden images, HTTP, real browser
  wasm             Build the page into client-wasm/www/dist and check its size
  bench            Run the benchmarks: JSON into docs/report/bench.json, and a table
  report           Measure error against run time into docs/report
  licences         Write THIRD-PARTY.md; `licences --check` only compares
  help             This text

Options of `test`:
  --no-setup       Install nothing: a missing tool is one line that names it
  --no-browser     Leave out what needs a browser (a quick check; CI never does)

Nothing has to be installed by hand: with rustup there, the wasm target is added, and on Debian or
Ubuntu as root Chromium and a software Vulkan driver too.
`cargo xtask serve -- --help` lists the server's own options.";

fn main() -> ExitCode {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    match run(&arguments) {
        Ok(code) => code,
        Err(error) => {
            eprintln!("xtask: {error:#}");
            ExitCode::FAILURE
        }
    }
}

/// What was asked for in a way that this program does not know.
fn usage(message: &str) -> ExitCode {
    eprintln!("xtask: {message}; `cargo xtask help` lists what there is");
    ExitCode::from(2)
}

fn run(arguments: &[String]) -> anyhow::Result<ExitCode> {
    let Some((command, rest)) = arguments.split_first() else {
        println!("{HELP}");
        return Ok(ExitCode::from(2));
    };
    let rest: Vec<&str> = rest.iter().map(String::as_str).collect();
    match command.as_str() {
        "help" | "--help" | "-h" => {
            println!("{HELP}");
            Ok(ExitCode::SUCCESS)
        }
        // The server explains its own flags, so `--help` behind `--` is not ours.
        "serve" => serve::run(rest.strip_prefix(&["--"]).unwrap_or(&rest)),
        _ if rest.iter().any(|argument| matches!(*argument, "--help" | "-h")) => {
            println!("{HELP}");
            Ok(ExitCode::SUCCESS)
        }
        "test" => match test::Options::parse(&rest) {
            Ok(options) => test::run(options),
            Err(unknown) => Ok(usage(&format!("`test` does not know {unknown}"))),
        },
        "licences" if rest == ["--check"] => licences::check().map(|()| ExitCode::SUCCESS),
        "wasm" | "bench" | "report" | "licences" if !rest.is_empty() => {
            Ok(usage(&format!("`{command}` does not know {}", rest[0])))
        }
        "wasm" => bundle::build().map(|()| ExitCode::SUCCESS),
        "bench" => bench::run().map(|()| ExitCode::SUCCESS),
        "report" => report::run().map(|()| ExitCode::SUCCESS),
        "licences" => licences::write().map(|()| ExitCode::SUCCESS),
        unknown => Ok(usage(&format!("there is no command {unknown}"))),
    }
}
