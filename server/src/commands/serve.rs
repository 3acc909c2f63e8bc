//! `treeline serve`.

use super::config;
use crate::cli::ServeArguments;
use crate::http::{self, Live};
use crate::opening::open;
use crate::state::App;
use crate::user_error::UserError;
use crate::watching::watch;
use std::io::Write as _;
use std::sync::Arc;
use std::time::Duration;
use tokio::net::TcpListener;

/// Longest time for the last tiles to be written.
const LONGEST_FLUSH: Duration = Duration::from_secs(10);

/// Serves until SIGTERM or SIGINT, then finishes what it has begun.
pub fn serve(arguments: &ServeArguments) -> Result<(), UserError> {
    let config = config(arguments)?;
    let scene = Arc::new(open(&arguments.scene)?);
    let live = Live::new(App::new(scene, &config)?);
    let runtime = tokio::runtime::Builder::new_multi_thread()
        .enable_all()
        .thread_name("treeline-http")
        .build()
        .map_err(|error| UserError::new(format!("the system gives no threads ({error})")))?;
    runtime.block_on(async {
        // Signals count from before the address is announced: whoever reads it may send one.
        let stop =
            stop_signal().map_err(|error| UserError::new(format!("signals cannot be watched ({error})")))?;
        let listener = listen(&config.listen).await?;
        let address = listener
            .local_addr()
            .map_err(|error| UserError::new(format!("--listen {}: {error}", config.listen)))?;
        // Whoever started the server may have closed its output; that is no reason to stop.
        let mut output = std::io::stdout().lock();
        let _ = writeln!(output, "treeline: listening on http://{address}").and_then(|()| output.flush());
        drop(output);
        let app = live.app();
        tracing::info!("serving \"{}\", revision {}", app.scene.name, app.scene.revision);
        if config.watch_seconds > 0 {
            let interval = Duration::from_secs(config.watch_seconds);
            tokio::spawn(watch(arguments.scene.clone(), live.clone(), interval));
        }
        http::serve(listener, live.clone(), stop)
            .await
            .map_err(|error| UserError::new(format!("the server stopped: {error}")))
    })?;
    if !live.app().cache.flush(LONGEST_FLUSH) {
        tracing::warn!("some tiles were not written to the cache's folder in time; they will be made again");
    }
    Ok(())
}

async fn listen(address: &str) -> Result<TcpListener, UserError> {
    TcpListener::bind(address).await.map_err(|error| {
        let mend = match error.kind() {
            std::io::ErrorKind::AddrInUse => {
                "another program listens there; stop it or choose another port (0 picks one)"
            }
            std::io::ErrorKind::PermissionDenied => {
                "this user may not listen there; choose a port of 1024 or more"
            }
            std::io::ErrorKind::AddrNotAvailable => {
                "this machine does not have that address; use 127.0.0.1 or 0.0.0.0"
            }
            _ => "write an address and a port, as in 127.0.0.1:8080",
        };
        UserError::new(format!("--listen {address}: cannot listen ({error}); {mend}"))
    })
}

/// Completes on SIGTERM or SIGINT.
#[cfg(unix)]
fn stop_signal() -> std::io::Result<impl Future<Output = ()> + Send + 'static> {
    use tokio::signal::unix::{SignalKind, signal};
    let (mut terminate, mut interrupt) = (signal(SignalKind::terminate())?, signal(SignalKind::interrupt())?);
    Ok(async move {
        tokio::select! {
            _ = terminate.recv() => {}
            _ = interrupt.recv() => {}
        }
    })
}

/// Completes on Ctrl-C.
#[cfg(not(unix))]
fn stop_signal() -> std::io::Result<impl Future<Output = ()> + Send + 'static> {
    Ok(async {
        if tokio::signal::ctrl_c().await.is_err() {
            std::future::pending::<()>().await;
        }
    })
}
