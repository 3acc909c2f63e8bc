//! Milliseconds by pass, where the adapter can time them. Read back some frames later; never waited for.

use std::cell::Cell;
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
    /// Passes that were timed, a bit each.
    written: u32,
}

/// Distance of two passes' times in the resolved buffer, bytes.
const STRIDE: u64 = wgpu::QUERY_RESOLVE_BUFFER_ALIGNMENT;

/// Times of a fixed list of passes (32 at most), of which a frame need not run all.
#[derive(Debug)]
pub struct PassTimer {
    names: &'static [&'static str],
    queries: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    belt: Vec<Staging>,
    current: Option<usize>,
    written: Cell<u32>,
    nanoseconds_per_tick: f64,
    times: Vec<Vec<f64>>,
}

impl PassTimer {
    /// For passes of these names; the device must have timestamp queries.
    pub fn new(device: &wgpu::Device, queue: &wgpu::Queue, names: &'static [&'static str]) -> Self {
        let bytes = STRIDE * names.len() as u64;
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
            written: 0,
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
            written: Cell::new(0),
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
        let [first, last] = self.indices(pass)?;
        Some(wgpu::RenderPassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(last),
        })
    }

    /// The same for a compute pass.
    pub fn compute_writes(&self, pass: usize) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let [first, last] = self.indices(pass)?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &self.queries,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(last),
        })
    }

    /// The pass's queries, which count as written from now on.
    fn indices(&self, pass: usize) -> Option<[u32; 2]> {
        self.current?;
        self.written.set(self.written.get() | 1 << pass);
        Some([2 * pass as u32, 2 * pass as u32 + 1])
    }

    /// After the last pass is recorded.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        let Some(current) = self.current else { return };
        // A query that nothing was written to may be waited for in vain.
        for pass in (0..self.names.len() as u32).filter(|pass| self.written.get() >> pass & 1 == 1) {
            let offset = STRIDE * u64::from(pass);
            encoder.resolve_query_set(&self.queries, 2 * pass..2 * pass + 2, &self.resolved, offset);
        }
        let staging = &self.belt[current].buffer;
        encoder.copy_buffer_to_buffer(&self.resolved, 0, staging, 0, staging.size());
    }

    /// After the frame is submitted.
    pub fn submitted(&mut self) {
        let Some(current) = self.current.take() else { return };
        let staging = &mut self.belt[current];
        staging.busy = true;
        staging.written = self.written.take();
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
                let tick = |offset: usize| {
                    range[offset..offset + 8]
                        .iter()
                        .rev()
                        .fold(0, |value, &byte| value << 8 | u64::from(byte))
                };
                for (pass, times) in self.times.iter_mut().enumerate() {
                    if staging.written >> pass & 1 == 0 {
                        continue;
                    }
                    if times.len() == KEPT {
                        times.remove(0);
                    }
                    let offset = pass * STRIDE as usize;
                    let ticks = tick(offset + 8).saturating_sub(tick(offset));
                    times.push(ticks as f64 * self.nanoseconds_per_tick * 1e-6);
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
