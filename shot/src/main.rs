//! `treeline-shot`: the renderer without a browser.
//!
//! It settles a view (every tile that it wants is resident), draws one frame and writes what was asked
//! for: the picture, the depths, the statistics. Whole files or none.

mod arguments;
mod camera_file;
mod error;
mod height_field;
mod host;
mod npy;
mod output;
mod scene;
mod statistics;

use clap::Parser as _;
use error::ShotError;
use std::io::Write as _;
use std::process::ExitCode;

fn main() -> ExitCode {
    // Mesa's device-select layer looks for a Wayland display and complains on standard error where there is
    // none; --adapter selects here.
    // SAFETY: no other thread runs yet that could read the environment.
    unsafe { std::env::set_var("NODEVICE_SELECT", "1") };
    let arguments = match arguments::Arguments::try_parse() {
        Ok(arguments) => arguments,
        Err(error) if error.use_stderr() => {
            let line = treeline_server::cli::one_line(&error, "treeline-shot");
            return complain(&ShotError::Input(line));
        }
        // --help and --version.
        Err(text) => {
            let _ = text.print();
            return ExitCode::SUCCESS;
        }
    };
    match run(&arguments) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => complain(&error),
    }
}

fn run(arguments: &arguments::Arguments) -> Result<(), ShotError> {
    arguments.check()?;
    if arguments.heightfield.is_some() { height_field::shoot(arguments) } else { scene::shoot(arguments) }
}

/// One line on standard error.
fn complain(error: &ShotError) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "treeline-shot: {error}");
    ExitCode::from(error.exit_code())
}
