//! `/healthz`, `/readyz` and `/metrics`: for those who run the server.

use crate::http::answer::refusal;
use crate::metrics::Gauge;
use crate::source::{held_by_all, upstream};
use crate::state::AppState;
use axum::extract::State;
use axum::http::{StatusCode, header};
use axum::response::{IntoResponse, Response};
use std::sync::atomic::Ordering::Relaxed;

/// Alive: the process answers.
pub async fn healthz() -> Response {
    ([(header::CACHE_CONTROL, "no-store")], "ok\n").into_response()
}

/// Ready: requests are welcome. 503 while the server drains before it stops.
pub async fn readyz(State(app): State<AppState>) -> Response {
    if app.is_ready() {
        healthz().await
    } else {
        refusal(StatusCode::SERVICE_UNAVAILABLE, "stopping: the server finishes what it has begun")
    }
}

/// Counters as Prometheus text.
pub async fn metrics(State(app): State<AppState>) -> Response {
    let workers = app.cache.workers();
    let space = app.cache.disk().map(|disk| disk.space());
    let upstream = upstream::counters();
    let gauges = [
        Gauge {
            name: "treeline_upstream_answers",
            help: "Answers of upstreams that were of use, since the start.",
            value: upstream.succeeded.load(Relaxed),
        },
        Gauge {
            name: "treeline_upstream_failures",
            help: "Tries at upstreams that failed, since the start.",
            value: upstream.failed.load(Relaxed),
        },
        Gauge {
            name: "treeline_upstream_spared",
            help: "Times that an upstream that had failed was left in peace, since the start.",
            value: upstream.spared.load(Relaxed),
        },
        Gauge {
            name: "treeline_upstream_bytes",
            help: "Bytes received from upstreams since the start.",
            value: upstream.bytes.load(Relaxed),
        },
        Gauge {
            name: "treeline_upstream_milliseconds",
            help: "Time spent waiting for upstreams since the start.",
            value: upstream.milliseconds.load(Relaxed),
        },
        Gauge {
            name: "treeline_disk_cache_bytes",
            help: "Bytes of tiles in the cache's folder.",
            value: space.map_or(0, |space| space.used()),
        },
        Gauge {
            name: "treeline_disk_cache_evicted_tiles",
            help: "Tiles that had to leave the cache's folder since the start.",
            value: space.map_or(0, |space| space.evicted()),
        },
        Gauge {
            name: "treeline_source_cache_bytes",
            help: "Bytes of decoded source data, and of what is made of them, held in memory.",
            value: held_by_all() as u64,
        },
        Gauge {
            name: "treeline_cache_bytes",
            help: "Bytes of tiles held in memory.",
            value: app.cache.memory_bytes(),
        },
        Gauge {
            name: "treeline_cache_tiles",
            help: "Tiles held in memory.",
            value: app.cache.memory_tiles(),
        },
        Gauge {
            name: "treeline_worker_jobs",
            help: "Jobs that run or wait for a worker.",
            value: workers.jobs() as u64,
        },
        Gauge {
            name: "treeline_worker_threads",
            help: "Threads that make tiles.",
            value: workers.threads() as u64,
        },
    ];
    let headers = [
        (header::CONTENT_TYPE, "text/plain; version=0.0.4; charset=utf-8"),
        (header::CACHE_CONTROL, "no-store"),
    ];
    (headers, app.metrics.text(&gauges)).into_response()
}
