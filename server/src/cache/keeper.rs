//! Writes tiles to the folder after they have been answered, on a thread of its own.

use super::DiskCache;
use axum::body::Bytes;
use std::io;
use std::sync::mpsc::{self, Receiver, SyncSender};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::JoinHandle;
use std::time::Duration;

/// Tiles that may wait to be written; a worker that makes more waits.
const QUEUE: usize = 64;

enum Task {
    Keep(Arc<str>, Bytes),
    /// Says when all that was handed over before is written.
    Flush(mpsc::Sender<()>),
}

/// The thread that writes. It ends, when all is written, as the keeper is dropped.
pub struct Keeper {
    tasks: Option<SyncSender<Task>>,
    thread: Mutex<Option<JoinHandle<()>>>,
}

impl Keeper {
    /// Starts the thread, which counts what the folder holds first. Errors where the system gives no thread.
    pub fn new(disk: Arc<DiskCache>) -> io::Result<Self> {
        let (tasks, waiting) = mpsc::sync_channel(QUEUE);
        let thread = std::thread::Builder::new()
            .name("treeline-keeper".to_owned())
            .spawn(move || work(&disk, &waiting))?;
        Ok(Self { tasks: Some(tasks), thread: Mutex::new(Some(thread)) })
    }

    /// Hands a tile over; waits while too many are waiting already.
    pub fn keep(&self, key: &Arc<str>, bytes: &Bytes) {
        if let Some(tasks) = &self.tasks {
            // The thread lives as long as the sender.
            let _ = tasks.send(Task::Keep(key.clone(), bytes.clone()));
        }
    }

    /// Waits until what has been handed over is written; `false` where that takes longer.
    pub fn flush(&self, longest: Duration) -> bool {
        let (done, finished) = mpsc::channel();
        let sent = self.tasks.as_ref().is_some_and(|tasks| tasks.send(Task::Flush(done)).is_ok());
        sent && finished.recv_timeout(longest).is_ok()
    }
}

impl Drop for Keeper {
    fn drop(&mut self) {
        self.tasks = None;
        let thread = self.thread.lock().unwrap_or_else(PoisonError::into_inner).take();
        if let Some(thread) = thread {
            // A panic there has been reported already.
            let _ = thread.join();
        }
    }
}

fn work(disk: &DiskCache, tasks: &Receiver<Task>) {
    disk.count();
    for task in tasks {
        match task {
            Task::Keep(key, bytes) => {
                if let Err(error) = disk.write(&key, &bytes) {
                    tracing::warn!("{}: a tile could not be kept ({error})", disk.folder().display());
                }
            }
            Task::Flush(done) => {
                // Whoever waited may have given up.
                let _ = done.send(());
            }
        }
    }
}
