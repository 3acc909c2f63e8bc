//! A belt of staging buffers: what the GPU has made is copied now and read when it has come, never waited for.

use std::sync::Arc;
use std::sync::atomic::{AtomicU8, Ordering};

/// Not mapped, and not asked to be.
const IDLE: u8 = 0;
/// Asked to be mapped.
const ASKED: u8 = 1;
/// Mapped.
const READY: u8 = 2;
/// Could not be mapped: the device is lost.
const FAILED: u8 = 3;

#[derive(Debug)]
struct Staging<T> {
    buffer: wgpu::Buffer,
    state: Arc<AtomicU8>,
    /// What is on the way, and its place in the order of schedules.
    load: Option<(T, u64)>,
}

/// Buffers in turn, each with what its maker wants to know when it is read.
#[derive(Debug)]
pub struct Belt<T> {
    staging: Vec<Staging<T>>,
    /// Copied into by the encoder at hand, and not yet submitted.
    recorded: Option<usize>,
    count: u64,
    /// Of the newest that has been read: older ones are of no interest any more.
    newest: u64,
}

impl<T> Belt<T> {
    /// `buffers` of so many bytes (a multiple of 4): as many read-backs may be under way.
    pub fn new(device: &wgpu::Device, bytes: u64, buffers: usize) -> Self {
        let staging = |_| Staging {
            buffer: device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("read-back belt"),
                size: bytes,
                usage: wgpu::BufferUsages::MAP_READ | wgpu::BufferUsages::COPY_DST,
                mapped_at_creation: false,
            }),
            state: Arc::new(AtomicU8::new(IDLE)),
            load: None,
        };
        Self { staging: (0..buffers).map(staging).collect(), recorded: None, count: 0, newest: 0 }
    }

    /// Records copies of the whole of each source, one after the other, into a free buffer. False: all are under
    /// way (or one is recorded already), and nothing was recorded.
    pub fn schedule(
        &mut self,
        encoder: &mut wgpu::CommandEncoder,
        sources: &[&wgpu::Buffer],
        tag: T,
    ) -> bool {
        let free = self.staging.iter().position(|staging| staging.load.is_none());
        let (Some(index), None) = (free, self.recorded) else { return false };
        let staging = &mut self.staging[index];
        let mut offset = 0;
        for source in sources {
            encoder.copy_buffer_to_buffer(source, 0, &staging.buffer, offset, source.size());
            offset += source.size();
        }
        self.count += 1;
        staging.load = Some((tag, self.count));
        self.recorded = Some(index);
        true
    }

    /// After the encoder of the last [`Self::schedule`] has been submitted.
    pub fn submitted(&mut self) {
        let Some(index) = self.recorded.take() else { return };
        let staging = &self.staging[index];
        let state = Arc::clone(&staging.state);
        state.store(ASKED, Ordering::Release);
        staging.buffer.map_async(wgpu::MapMode::Read, .., move |result| {
            state.store(if result.is_ok() { READY } else { FAILED }, Ordering::Release);
        });
    }

    /// Gives the newest that has come, if it is newer than what was given before, to `read`: its tag and its
    /// bytes. Never waits: on native targets the device is asked once what has happened, in the browser nothing
    /// needs asking.
    pub fn poll<R>(&mut self, device: &wgpu::Device, read: impl FnOnce(T, &[u8]) -> R) -> Option<R> {
        // A lost device says so elsewhere.
        let _ = device.poll(wgpu::PollType::Poll);
        let ready = |staging: &Staging<T>| staging.state.load(Ordering::Acquire) == READY;
        let order = |staging: &Staging<T>| staging.load.as_ref().map_or(0, |(_, order)| *order);
        let newest = self
            .staging
            .iter()
            .enumerate()
            .filter(|(_, staging)| ready(staging) && order(staging) > self.newest)
            .max_by_key(|(_, staging)| order(staging))
            .map(|(index, _)| index);
        let mut answer = None;
        if let Some(index) = newest
            && let Some((tag, order)) = self.staging[index].load.take()
        {
            self.newest = order;
            answer = self.staging[index].buffer.get_mapped_range(..).ok().map(|range| read(tag, &range));
            self.staging[index].release();
        }
        for staging in &mut self.staging {
            // Overtaken, or lost.
            let overtaken = ready(staging) && order(staging) < self.newest;
            if overtaken || staging.state.load(Ordering::Acquire) == FAILED {
                staging.release();
            }
        }
        answer
    }

    /// Read-backs under way.
    pub fn in_flight(&self) -> usize {
        self.staging.iter().filter(|staging| staging.load.is_some()).count()
    }
}

impl<T> Staging<T> {
    fn release(&mut self) {
        if self.state.swap(IDLE, Ordering::AcqRel) == READY {
            self.buffer.unmap();
        }
        self.load = None;
    }
}
