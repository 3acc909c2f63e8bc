//! The bounded pool that CPU work runs on: never on the async threads, never without bound.

use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::Arc;
use tokio::sync::{Semaphore, oneshot};

/// Why a job gave no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overload {
    /// As many jobs wait as may.
    QueueFull,
    /// The job panicked; the panic's message went to the log.
    Panicked,
}

/// Named threads with a bounded queue.
pub struct Workers {
    pool: rayon::ThreadPool,
    /// One permit for each job that runs or waits.
    places: Arc<Semaphore>,
    capacity: usize,
}

impl Workers {
    /// `threads` threads, and room for `queue` jobs that wait. Errors where the system gives no threads.
    pub fn new(threads: usize, queue: usize) -> Result<Self, rayon::ThreadPoolBuildError> {
        let capacity = threads.max(1).saturating_add(queue).min(Semaphore::MAX_PERMITS);
        let pool = rayon::ThreadPoolBuilder::new()
            .num_threads(threads.max(1))
            .thread_name(|index| format!("treeline-worker-{index}"))
            .build()?;
        Ok(Self { pool, places: Arc::new(Semaphore::new(capacity)), capacity })
    }

    /// Runs a job, first come first served. It runs even if the caller goes away.
    pub async fn run<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Overload> {
        let Ok(place) = self.places.clone().try_acquire_owned() else { return Err(Overload::QueueFull) };
        let (sender, receiver) = oneshot::channel();
        self.pool.spawn_fifo(move || {
            // What a job touches is either its own or behind locks that outlive a panic.
            let result = catch_unwind(AssertUnwindSafe(job)).map_err(|_| Overload::Panicked);
            drop(place);
            // The caller may be gone; then nobody misses the result.
            let _ = sender.send(result);
        });
        receiver.await.unwrap_or(Err(Overload::Panicked))
    }

    /// Jobs that run or wait now.
    pub fn jobs(&self) -> usize {
        self.capacity - self.places.available_permits()
    }

    /// Threads of the pool.
    pub fn threads(&self) -> usize {
        self.pool.current_num_threads()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[tokio::test]
    async fn a_panic_is_an_answer_and_the_pool_lives_on() {
        let workers = Workers::new(1, 4).unwrap();
        assert_eq!(workers.run(|| panic!("on purpose")).await, Err::<(), _>(Overload::Panicked));
        assert_eq!(
            workers.run(|| std::thread::current().name().map(str::to_owned)).await,
            Ok(Some("treeline-worker-0".to_owned()))
        );
        assert_eq!((workers.jobs(), workers.threads()), (0, 1));
    }

    #[tokio::test]
    async fn a_full_queue_refuses() {
        let workers = Arc::new(Workers::new(1, 1).unwrap());
        let (release, gate) = std::sync::mpsc::channel::<()>();
        let (begun, begins) = oneshot::channel();
        let pool = workers.clone();
        let running = tokio::spawn(async move {
            pool.run(move || {
                let _ = begun.send(());
                let _ = gate.recv();
            })
            .await
        });
        begins.await.unwrap();
        let pool = workers.clone();
        let waiting = tokio::spawn(async move { pool.run(|| 7).await });
        while workers.jobs() < 2 {
            tokio::task::yield_now().await;
        }
        assert_eq!(workers.run(|| 8).await, Err(Overload::QueueFull));
        release.send(()).unwrap();
        assert_eq!(running.await.unwrap(), Ok(()));
        assert_eq!(waiting.await.unwrap(), Ok(7));
    }
}
