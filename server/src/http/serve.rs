//! Accepting connections until told to stop.

use super::router;
use crate::state::AppState;
use std::future::Future;
use std::io;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::net::TcpListener;

/// Longest time that connections get to finish once the server stops.
const DRAIN: Duration = Duration::from_secs(20);

/// Serves on the listener until `shutdown` completes, then answers what has begun and returns;
/// connections that are not done after 20 seconds are cut.
pub async fn serve(
    listener: TcpListener,
    state: AppState,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> io::Result<()> {
    let (stop, stopped) = tokio::sync::oneshot::channel();
    let stopping = state.clone();
    let until = async move {
        shutdown.await;
        stopping.stopping.store(true, Relaxed);
        let _ = stop.send(());
    };
    let server = axum::serve(listener, router(state)).with_graceful_shutdown(until);
    let too_long = async {
        // An error means that the server ended by itself; then there is nothing to cut.
        if stopped.await.is_err() {
            std::future::pending::<()>().await;
        }
        tokio::time::sleep(DRAIN).await;
    };
    tokio::select! {
        result = server => result,
        () = too_long => {
            tracing::warn!("some connections were not done after {} seconds and were cut", DRAIN.as_secs());
            Ok(())
        }
    }
}
