//! The bounded pool that CPU work runs on: never on the async threads, never without bound.

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::mpsc::{self, Receiver, Sender};
use std::sync::{Arc, Mutex, PoisonError};
use tokio::sync::{Semaphore, oneshot};

/// Why a job gave no result.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Overload {
    /// As many jobs wait as may.
    QueueFull,
    /// The job panicked; the panic's message went to the log.
    Panicked,
}

type Job = Box<dyn FnOnce() + Send>;

/// Named threads with a bounded queue.
///
/// Plain threads, not a rayon pool: a rayon thread that waits for the halves of parallel work takes
/// up another job meanwhile, and where both are in the same `LazyLock`'s initialisation, or want the
/// same lock, it waits for itself for ever. Jobs may use rayon; its own pool then helps them.
pub struct Workers {
    jobs: Sender<Job>,
    /// One permit for each job that runs or waits.
    places: Arc<Semaphore>,
    capacity: usize,
    threads: usize,
}

impl Workers {
    /// `threads` threads, and room for `queue` jobs that wait. Errors where the system gives no
    /// threads. The threads end with the last job after the pool is dropped.
    pub fn new(threads: usize, queue: usize) -> io::Result<Self> {
        let threads = threads.max(1);
        let capacity = threads.saturating_add(queue).min(Semaphore::MAX_PERMITS);
        // The permits bound the channel.
        let (jobs, waiting) = mpsc::channel::<Job>();
        let waiting = Arc::new(Mutex::new(waiting));
        for index in 0..threads {
            let waiting = waiting.clone();
            std::thread::Builder::new()
                .name(format!("treeline-worker-{index}"))
                .spawn(move || work(&waiting))?;
        }
        Ok(Self { jobs, places: Arc::new(Semaphore::new(capacity)), capacity, threads })
    }

    /// Runs a job, first come first served. It runs even if the caller goes away.
    pub async fn run<T: Send + 'static>(
        &self,
        job: impl FnOnce() -> T + Send + 'static,
    ) -> Result<T, Overload> {
        let Ok(place) = self.places.clone().try_acquire_owned() else { return Err(Overload::QueueFull) };
        let (sender, receiver) = oneshot::channel();
        let job = Box::new(move || {
            // What a job touches is either its own or behind locks that outlive a panic.
            let result = catch_unwind(AssertUnwindSafe(job)).map_err(|_| Overload::Panicked);
            drop(place);
            // The caller may be gone; then nobody misses the result.
            let _ = sender.send(result);
        });
        // The threads live as long as the sender; were they gone, the receiver would say so.
        let _ = self.jobs.send(job);
        receiver.await.unwrap_or(Err(Overload::Panicked))
    }

    /// Jobs that run or wait now.
    pub fn jobs(&self) -> usize {
        self.capacity - self.places.available_permits()
    }

    /// Threads of the pool.
    pub fn threads(&self) -> usize {
        self.threads
    }
}

/// Takes jobs until nobody can send any more.
fn work(waiting: &Mutex<Receiver<Job>>) {
    loop {
        // Jobs run outside the lock, and receiving does not panic: the lock is never poisoned.
        let job = waiting.lock().unwrap_or_else(PoisonError::into_inner).recv();
        match job {
            Ok(job) => job(),
            Err(_) => return,
        }
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
        let (release, gate) = mpsc::channel::<()>();
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

    #[tokio::test]
    async fn parallel_work_inside_a_lazy_value_does_not_wait_for_itself() {
        use rayon::prelude::*;
        static SUM: std::sync::LazyLock<u64> = std::sync::LazyLock::new(|| {
            let slow = |number: u64| (0..20_000).fold(number, |sum, step| std::hint::black_box(sum ^ step));
            (0..2_000_u64).into_par_iter().map(slow).reduce(|| 0, |a, b| a ^ b)
        });
        let workers = Arc::new(Workers::new(2, 64).unwrap());
        let mut jobs = tokio::task::JoinSet::new();
        for _ in 0..32 {
            let workers = workers.clone();
            jobs.spawn(async move { workers.run(|| *SUM).await });
        }
        while let Some(job) = jobs.join_next().await {
            assert_eq!(job.unwrap(), Ok(*SUM));
        }
    }
}
