//! Milliseconds by pass, where the adapter can time them. Read back some frames later; never waited for.

use std::sync::Arc;
use std::sync::atomic::{AtomicBool, Ordering};

/// Read-backs under way at most; a frame that finds none free is not timed.
const BELT: usize = 3;
/// Times kept of each pass, for the median.
const KEPT: usize = 64;

#[derive(Debug)]
struct Staging {
    buffer: wgpu::Buffer,
    ready: Arc<AtomicBool>,
    busy: bool,
}

/// Times of a fixed list of passes.
#[derive(Debug)]
pub struct PassTimer {
    names: &'static [&'static str],
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    belt: Vec<Staging>,
    current: Option<usize>,
    nanoseconds_per_tick: f64,
    times: Vec<Vec<f64>>,
}

impl PassTimer {
    /// For passes of these names; the device must have timestamp queries.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, names: &'static [&'static str]) -> Self {
        let bytes = 16 * names.len() as u64;
        let buffer = |label, usage| {
            device.create_buffer(&wgpu::BufferDescriptor {
                label: Some(label),
                size: bytes,
                usage,
                mapped_at_creation: false,
            })
        };
        let staging = || Staging {
            buffer: buffer("pass times", wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST),
            ready: Arc::new(AtomicBool::new(false)),
            busy: false,
        };
        Self {
            names,
            queries: device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * names.len() as u32,
            }),
            resolved: buffer(
                "resolved pass times",
                wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
            ),
            belt: (0..BELT).map(|_| staging()).collect(),
            current: None,
            nanoseconds_per_tick: f64::from(queue.get_timestamp_period()),
            times: vec![Vec::new(); names.len()],
        }
    }

    /// Before a frame is recorded: collects what has come back and takes a free place of the belt.
    pub fn begin(&mut self) {
        self.collect();
        self.current = self.belt.iter().position(|staging| !staging.busy);
    }

    /// What to give the pass at an index of the list.
    pub fn writes(&self, pass: usize) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        self.current?;
        Some(wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(2 * pass as u32),
            end_of_pass_write_index: Some(2 * pass as u32 + 1),
        })
    }

    /// After the last pass is recorded.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let Some(current) = self.current else { return };
        encoder.resolve_query_set(&self.queries, 0..2 * self.names.len() as u32, &self.resolved, 0);
        let staging = &self.belt[current].buffer;
        encoder.copy_buffer_to_buffer(&self.resolved, 0, staging, 0, staging.size());
    }

    /// After the frame is submitted.
    pub fn submitted(&mut self) {
        let Some(current) = self.current.take() else { return };
        let staging = &mut self.belt[current];
        staging.busy = true;
        let ready = Arc::clone(&staging.ready);
        staging.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            ready.store(result.is_ok(), Ordering::Release);
        });
    }

    fn collect(&mut self) {
        for staging in &mut self.belt {
            if !staging.busy || !staging.ready.swap(false, Ordering::Acquire) {
                continue;
            }
            if let Ok(range) = staging.buffer.get_mapped_range(..) {
                let ticks: Vec<u64> = range
                    .chunks_exact(8)
                    .map(|bytes| bytes.iter().rev().fold(0, |value, &byte| value << 8 | u64::from(byte)))
                    .collect();
                for (times, pair) in self.times.iter_mut().zip(ticks.chunks_exact(2)) {
                    if times.len() == KEPT {
                        times.remove(0);
                    }
                    times.push(pair[1].saturating_sub(pair[0]) as f64 * self.nanoseconds_per_tick * 1e-6);
                }
            }
            staging.buffer.unmap();
            staging.busy = false;
        }
    }

    /// Median milliseconds of each pass that has been timed.
    pub fn medians(&mut self) -> Vec<(&'static str, f64)> {
        self.collect();
        self.names
            .iter()
            .zip(&self.times)
            .filter_map(|(&name, times)| {
                let mut sorted = times.clone();
                sorted.sort_by(f64::total_cmp);
                sorted.get(sorted.len() / 2).map(|&median| (name, median))
            })
            .collect()
    }

    /// Forgets the times so far.
    pub fn clear(&mut self) {
        self.times.iter_mut().for_each(Vec::clear);
    }
}
