//! `treeline`: the program.

use clap::Parser as _;
use std::io::Write as _;
use std::process::ExitCode;
use treeline_server::cli::{Cli, Command, one_line};
use treeline_server::commands;

/// A request is some hundred small allocations, which were a third of its instructions with the C library's allocator,
/// and large maps come and go: this one gives their room back (docs/decisions/0020). It does not know Microsoft's C
/// library.
#[cfg(not(target_env = "msvc"))]
#[global_allocator]
static ALLOCATOR: tikv_jemallocator::Jemalloc = tikv_jemallocator::Jemalloc;

/// How the allocator is set, unless `_RJEM_MALLOC_CONF` in the environment says otherwise: room for large things goes
/// back to the system at once, for small ones (a warm answer reuses it) within half a second; few arenas share it.
#[cfg(not(target_env = "msvc"))]
// SAFETY: the allocator reads a pointer to a text that ends with a zero byte from this symbol, and nothing else has the
// symbol's name: a slice begins with its pointer, and these bytes live for ever.
#[unsafe(export_name = "_rjem_malloc_conf")]
pub static ALLOCATOR_SETTINGS: &[u8] =
    b"narenas:4,oversize_threshold:131072,dirty_decay_ms:500,muzzy_decay_ms:0,lg_tcache_max:17\0";

/// Exit code of `check` where something is wrong with a scene.
const WRONG_SCENE: u8 = 1;
/// Exit code of `health` where no server is ready.
const NOT_READY: u8 = 1;
/// Exit code of everything else that the caller can mend.
const WRONG_USE: u8 = 2;

fn main() -> ExitCode {
    let cli = match Cli::try_parse() {
        Ok(cli) => cli,
        Err(error) if error.use_stderr() => {
            let program = std::env::args()
                .nth(1)
                .filter(|word| ["serve", "check", "seed", "health"].contains(&word.as_str()));
            let program = program.map_or("treeline".to_owned(), |command| format!("treeline {command}"));
            return complain(&one_line(&error, &program), WRONG_USE);
        }
        // --help and --version.
        Err(text) => {
            let _ = text.print();
            return ExitCode::SUCCESS;
        }
    };
    let filter = tracing_subscriber::EnvFilter::try_from_env("TREELINE_LOG")
        .unwrap_or_else(|_| tracing_subscriber::EnvFilter::new("warn"));
    let log = tracing_subscriber::fmt().with_env_filter(filter).with_writer(std::io::stderr);
    if std::env::var("TREELINE_LOG_FORMAT").is_ok_and(|format| format.eq_ignore_ascii_case("json")) {
        log.json().init();
    } else {
        log.init();
    }
    let (result, code) = match &cli.command {
        Command::Serve(arguments) => (commands::serve(arguments), WRONG_USE),
        Command::Check(arguments) => (commands::check(arguments), WRONG_SCENE),
        Command::Seed(arguments) => (commands::seed(arguments), WRONG_USE),
        Command::Health(arguments) => (commands::health(arguments), NOT_READY),
    };
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => complain(&error.to_string(), code),
    }
}

/// One line on standard error.
fn complain(line: &str, code: u8) -> ExitCode {
    let _ = writeln!(std::io::stderr(), "treeline: {line}");
    ExitCode::from(code)
}
