//! Accepting connections until told to stop.

use super::answer::refusal;
use super::{Live, known};
use crate::limits::Limits;
use axum::body::Body;
use axum::extract::Request;
use axum::http::header::HOST;
use axum::http::{StatusCode, Version};
use axum::response::Response;
use hyper::body::Incoming;
use hyper::server::conn::http1;
use hyper::service::service_fn;
use hyper_util::rt::{TokioIo, TokioTimer};
use hyper_util::server::graceful::GracefulShutdown;
use std::convert::Infallible;
use std::future::Future;
use std::io;
use std::sync::Arc;
use std::sync::atomic::Ordering::Relaxed;
use std::time::Duration;
use tokio::net::{TcpListener, TcpStream};
use tokio::sync::{OwnedSemaphorePermit, Semaphore};
use tokio_io_timeout::TimeoutStream;
use tower::ServiceExt as _;

/// Longest time that connections get to finish once the server stops.
const DRAIN: Duration = Duration::from_secs(20);
/// What a connection keeps of requests that are not answered yet, bytes: more than any head that is read.
const READ_BUFFER: usize = 64 << 10;
/// Rest after the system had no connection to give (no file handles left, say).
const ACCEPT_REST: Duration = Duration::from_millis(50);

/// Serves on the listener until `shutdown` completes, then answers what has begun and returns;
/// connections that are not done after 20 seconds are cut.
pub async fn serve(
    listener: TcpListener,
    live: Live,
    shutdown: impl Future<Output = ()> + Send + 'static,
) -> io::Result<()> {
    let limits = live.app().limits;
    let connections = Arc::new(Semaphore::new(limits.maximum_connections.min(Semaphore::MAX_PERMITS)));
    let graceful = GracefulShutdown::new();
    let builder = builder(&limits);
    let mut shutdown = std::pin::pin!(shutdown);
    loop {
        let next = tokio::select! {
            next = accept(&listener, &connections) => next,
            () = &mut shutdown => break,
        };
        let Some((stream, place)) = next else {
            tokio::time::sleep(ACCEPT_REST).await;
            continue;
        };
        // Answers go out whole; waiting for more to send with them only delays the next.
        if let Err(error) = stream.set_nodelay(true) {
            tracing::debug!("a connection was gone before it was served ({error})");
            continue;
        }
        let mut stream = Box::pin(TimeoutStream::new(stream));
        stream.as_mut().set_write_timeout_pinned(Some(Duration::from_secs(limits.write_timeout_seconds)));
        let live = live.clone();
        let service = service_fn(move |request| answer(live.clone(), request));
        let connection = builder.serve_connection(TokioIo::new(stream), service);
        let connection = graceful.watch(connection);
        tokio::spawn(async move {
            // A client that goes away or dawdles is no news.
            if let Err(error) = connection.await {
                tracing::debug!("a connection ended early ({error})");
            }
            drop(place);
        });
    }
    live.app().stopping.store(true, Relaxed);
    drop(listener);
    if tokio::time::timeout(DRAIN, graceful.shutdown()).await.is_err() {
        tracing::warn!("some connections were not done after {} seconds and were cut", DRAIN.as_secs());
    }
    Ok(())
}

/// Answers a request: from what is known word for word, else by the router.
async fn answer(live: Live, request: Request<Incoming>) -> Result<Response, Infallible> {
    let app = live.app();
    if !names_one_host(&request) {
        app.metrics.response(StatusCode::BAD_REQUEST.as_u16(), 0);
        return Ok(refusal(StatusCode::BAD_REQUEST, "a request of HTTP/1.1 names its host, once"));
    }
    // A server is asked for a path; a bare host and port is for proxies (RFC 9112, 3.2.3).
    if request.uri().path_and_query().is_none() {
        app.metrics.response(StatusCode::BAD_REQUEST.as_u16(), 0);
        return Ok(refusal(StatusCode::BAD_REQUEST, "a request names a path, which begins with a slash"));
    }
    if let Some(response) = known::answer(&app, &request).await {
        return Ok(response);
    }
    let words = known::words(&request);
    let mut response = live.router().oneshot(request.map(Body::new)).await?;
    if let Some(words) = words {
        known::remember(&app, words, &mut response).await;
    }
    Ok(response)
}

/// Whether a request says once whom it asks, as all must since HTTP/1.1 (RFC 9112, 3.2): where there are two hosts,
/// whatever stands before this server may have taken another one for it.
fn names_one_host<B>(request: &Request<B>) -> bool {
    let mut hosts = request.headers().get_all(HOST).iter();
    let (first, second) = (hosts.next(), hosts.next());
    second.is_none() && (first.is_some() || request.version() < Version::HTTP_11)
}

/// How connections are spoken with: HTTP/1.1, kept alive. (Its flushing for pipelines would copy every answer.)
fn builder(limits: &Limits) -> http1::Builder {
    let mut builder = http1::Builder::new();
    builder
        .timer(TokioTimer::new())
        .header_read_timeout(Duration::from_secs(limits.header_timeout_seconds))
        .max_buf_size(READ_BUFFER);
    builder
}

/// The next connection, once there is a place for it; `None` where the system has none to give.
async fn accept(
    listener: &TcpListener,
    connections: &Arc<Semaphore>,
) -> Option<(TcpStream, OwnedSemaphorePermit)> {
    // Until then clients wait in the system's queue. Nobody closes the semaphore.
    let place = connections.clone().acquire_owned().await.ok()?;
    match listener.accept().await {
        Ok((stream, _)) => Some((stream, place)),
        Err(error) => {
            tracing::warn!("a connection could not be accepted ({error})");
            None
        }
    }
}
