//! Counters of the running server, written as Prometheus text.

use std::fmt::Write as _;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::time::Duration;
use treeline_core::layer::{LAYERS, Layer};

/// Upper edges of the duration histogram's buckets, seconds.
const BUCKETS: [f64; 10] = [0.001, 0.0025, 0.005, 0.01, 0.025, 0.05, 0.1, 0.25, 1.0, 5.0];

/// Where an answer came from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// In memory, or in the making for someone else.
    Memory,
    /// In the folder of `--cache`.
    Disk,
    /// Made for this request.
    Made,
    /// Failed.
    Failed,
    /// Turned away: too much to do.
    Busy,
}

const OUTCOMES: [(Outcome, &str); 5] = [
    (Outcome::Memory, "memory"),
    (Outcome::Disk, "disk"),
    (Outcome::Made, "made"),
    (Outcome::Failed, "failed"),
    (Outcome::Busy, "busy"),
];

/// What is made and kept, each with counters of its own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Product {
    /// A tile or map of a layer.
    Tile(Layer),
    /// The models of a species.
    Trees,
}

impl Product {
    /// All, in the order of their indices.
    fn all() -> impl Iterator<Item = Self> {
        LAYERS.iter().map(|row| Self::Tile(row.layer)).chain([Self::Trees])
    }

    fn index(self) -> usize {
        match self {
            Self::Tile(layer) => layer as usize,
            Self::Trees => LAYERS.len(),
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Tile(layer) => layer.name(),
            Self::Trees => "trees",
        }
    }
}

impl From<Layer> for Product {
    fn from(layer: Layer) -> Self {
        Self::Tile(layer)
    }
}

/// Durations by bucket.
#[derive(Debug, Default)]
struct Histogram {
    buckets: [AtomicU64; BUCKETS.len() + 1],
    microseconds: AtomicU64,
}

impl Histogram {
    fn observe(&self, duration: Duration) {
        let seconds = duration.as_secs_f64();
        let bucket = BUCKETS.iter().position(|&edge| seconds <= edge).unwrap_or(BUCKETS.len());
        self.buckets[bucket].fetch_add(1, Relaxed);
        self.microseconds.fetch_add(duration.as_micros() as u64, Relaxed);
    }

    fn write(&self, name: &str, labels: &str, out: &mut String) {
        let mut count = 0;
        for (bucket, edge) in
            self.buckets.iter().zip(BUCKETS.iter().map(ToString::to_string).chain(["+Inf".to_owned()]))
        {
            count += bucket.load(Relaxed);
            let _ = writeln!(out, "{name}_bucket{{{labels},le=\"{edge}\"}} {count}");
        }
        let sum = self.microseconds.load(Relaxed) as f64 / 1e6;
        let _ = writeln!(out, "{name}_sum{{{labels}}} {sum}\n{name}_count{{{labels}}} {count}");
    }
}

/// Counters of one product.
#[derive(Debug, Default)]
struct ProductMetrics {
    outcomes: [AtomicU64; OUTCOMES.len()],
    bytes: AtomicU64,
    making: Histogram,
}

/// All counters.
#[derive(Debug, Default)]
pub struct Metrics {
    products: [ProductMetrics; LAYERS.len() + 1],
    /// Answers by hundred of the status: index 1 is 1xx.
    statuses: [AtomicU64; 6],
    response_bytes: AtomicU64,
    under_way: AtomicU64,
}

/// A number that is read when the text is written, not counted.
pub struct Gauge {
    /// Metric name.
    pub name: &'static str,
    /// What it is.
    pub help: &'static str,
    /// Its value now.
    pub value: u64,
}

impl Metrics {
    /// Counts one lookup of a tile: exactly one outcome each.
    pub fn tile(&self, product: impl Into<Product>, outcome: Outcome, bytes: usize) {
        let row = &self.products[product.into().index()];
        row.outcomes[outcome as usize].fetch_add(1, Relaxed);
        row.bytes.fetch_add(bytes as u64, Relaxed);
    }

    /// Records how long a worker took to make a tile.
    pub fn made(&self, product: impl Into<Product>, duration: Duration) {
        self.products[product.into().index()].making.observe(duration);
    }

    /// How often a product's lookups had an outcome.
    pub fn count(&self, product: impl Into<Product>, outcome: Outcome) -> u64 {
        self.products[product.into().index()].outcomes[outcome as usize].load(Relaxed)
    }

    /// Counts an answer by its status.
    pub fn response(&self, status: u16, bytes: u64) {
        self.statuses[usize::from(status / 100).min(5)].fetch_add(1, Relaxed);
        self.response_bytes.fetch_add(bytes, Relaxed);
    }

    /// A request began; it ends when the guard is dropped, also where the client went away.
    pub fn begin(self: &std::sync::Arc<Self>) -> UnderWay {
        self.under_way.fetch_add(1, Relaxed);
        UnderWay(self.clone())
    }

    /// Requests being answered now.
    pub fn under_way(&self) -> u64 {
        self.under_way.load(Relaxed)
    }

    /// Prometheus text format, version 0.0.4.
    pub fn text(&self, gauges: &[Gauge]) -> String {
        let mut out = String::with_capacity(8192);
        let head = |out: &mut String, name: &str, kind: &str, help: &str| {
            let _ = writeln!(out, "# HELP {name} {help}\n# TYPE {name} {kind}");
        };
        head(&mut out, "treeline_responses_total", "counter", "Answers by class of status.");
        for (class, count) in self.statuses.iter().enumerate().skip(1) {
            let _ = writeln!(out, "treeline_responses_total{{class=\"{class}xx\"}} {}", count.load(Relaxed));
        }
        head(
            &mut out,
            "treeline_response_bytes_total",
            "counter",
            "Bytes of answers before content encoding.",
        );
        let _ = writeln!(out, "treeline_response_bytes_total {}", self.response_bytes.load(Relaxed));
        head(&mut out, "treeline_requests_under_way", "gauge", "Requests being answered.");
        let _ = writeln!(out, "treeline_requests_under_way {}", self.under_way.load(Relaxed));
        head(
            &mut out,
            "treeline_tiles_total",
            "counter",
            "Lookups of tiles and maps by where the answer came from.",
        );
        for product in Product::all() {
            for (outcome, name) in OUTCOMES {
                let count = self.count(product, outcome);
                let _ = writeln!(
                    out,
                    "treeline_tiles_total{{layer=\"{}\",outcome=\"{name}\"}} {count}",
                    product.name()
                );
            }
        }
        head(&mut out, "treeline_tile_bytes_total", "counter", "Bytes of tiles and maps handed out.");
        for product in Product::all() {
            let bytes = self.products[product.index()].bytes.load(Relaxed);
            let _ = writeln!(out, "treeline_tile_bytes_total{{layer=\"{}\"}} {bytes}", product.name());
        }
        head(
            &mut out,
            "treeline_tile_making_seconds",
            "histogram",
            "Time a worker took to make a tile or map.",
        );
        for product in Product::all() {
            let labels = format!("layer=\"{}\"", product.name());
            self.products[product.index()].making.write("treeline_tile_making_seconds", &labels, &mut out);
        }
        for gauge in gauges {
            head(&mut out, gauge.name, "gauge", gauge.help);
            let _ = writeln!(out, "{} {}", gauge.name, gauge.value);
        }
        out
    }
}

/// A request under way.
#[derive(Debug)]
pub struct UnderWay(std::sync::Arc<Metrics>);

impl Drop for UnderWay {
    fn drop(&mut self) {
        self.0.under_way.fetch_sub(1, Relaxed);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::Arc;

    #[test]
    fn the_text_holds_what_was_counted() {
        let metrics = Arc::new(Metrics::default());
        metrics.tile(Layer::Texture, Outcome::Made, 100);
        metrics.tile(Layer::Texture, Outcome::Memory, 100);
        metrics.made(Layer::Texture, Duration::from_millis(4));
        metrics.tile(Product::Trees, Outcome::Busy, 0);
        metrics.response(404, 3);
        let guard = metrics.begin();
        let text = metrics.text(&[Gauge { name: "treeline_x", help: "X.", value: 7 }]);
        for line in [
            "treeline_tiles_total{layer=\"texture\",outcome=\"made\"} 1",
            "treeline_tiles_total{layer=\"texture\",outcome=\"memory\"} 1",
            "treeline_tile_bytes_total{layer=\"texture\"} 200",
            "treeline_tile_making_seconds_bucket{layer=\"texture\",le=\"0.0025\"} 0",
            "treeline_tile_making_seconds_bucket{layer=\"texture\",le=\"0.005\"} 1",
            "treeline_tile_making_seconds_bucket{layer=\"texture\",le=\"+Inf\"} 1",
            "treeline_tiles_total{layer=\"trees\",outcome=\"busy\"} 1",
            "treeline_responses_total{class=\"4xx\"} 1",
            "treeline_requests_under_way 1",
            "treeline_x 7",
        ] {
            assert!(text.lines().any(|found| found == line), "{line}\n{text}");
        }
        drop(guard);
        assert!(metrics.text(&[]).contains("treeline_requests_under_way 0"));
    }

    #[test]
    fn outcomes_are_indexed_in_order() {
        for (index, (outcome, _)) in OUTCOMES.iter().enumerate() {
            assert_eq!(*outcome as usize, index);
        }
        for (index, product) in Product::all().enumerate() {
            assert_eq!(product.index(), index);
        }
    }
}
