//! One maker per key, leaders that leave, full queues, restarts.

use super::*;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::sync::mpsc;
use std::sync::{Condvar, Mutex};
use std::time::Duration;
use treeline_core::layer::Layer;

/// A door that makers wait at until the test opens it.
#[derive(Default)]
struct Door(Mutex<bool>, Condvar);

impl Door {
    fn pass(&self) {
        let mut open = self.0.lock().unwrap();
        while !*open {
            open = self.1.wait(open).unwrap();
        }
    }

    fn open(&self) {
        *self.0.lock().unwrap() = true;
        self.1.notify_all();
    }
}

fn cache(threads: usize, queue: usize, disk: Option<Arc<DiskCache>>) -> (Arc<TileCache>, Arc<Metrics>) {
    let metrics = Arc::new(Metrics::default());
    let workers = Arc::new(Workers::new(threads, queue).unwrap());
    (Arc::new(TileCache::new(1 << 20, disk, workers, metrics.clone()).unwrap()), metrics)
}

fn key(text: &str) -> TileKey {
    TileKey { product: Layer::Texture.into(), text: text.into() }
}

fn maker(makes: &Arc<AtomicUsize>) -> Maker {
    let makes = makes.clone();
    Arc::new(move || {
        makes.fetch_add(1, SeqCst);
        Ok(b"tile".to_vec())
    })
}

/// A maker that reports that it has begun, and waits at the door.
fn slow_maker(makes: &Arc<AtomicUsize>, door: &Arc<Door>) -> (Maker, mpsc::Receiver<()>) {
    let (makes, door) = (makes.clone(), door.clone());
    let (begun, begins) = mpsc::channel();
    let begun = Mutex::new(begun);
    let maker: Maker = Arc::new(move || {
        makes.fetch_add(1, SeqCst);
        let _ = begun.lock().unwrap().send(());
        door.pass();
        Ok(b"tile".to_vec())
    });
    (maker, begins)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_hundred_clients_one_make() {
    let (cache, metrics) = cache(4, 64, None);
    let (makes, door) = (Arc::new(AtomicUsize::new(0)), Arc::new(Door::default()));
    let (make, begins) = slow_maker(&makes, &door);
    let clients: Vec<_> = (0..100)
        .map(|_| {
            let (cache, make) = (cache.clone(), make.clone());
            tokio::spawn(async move { cache.get(&key("k"), make).await })
        })
        .collect();
    tokio::task::spawn_blocking(move || begins.recv()).await.unwrap().unwrap();
    door.open();
    for client in clients {
        assert_eq!(client.await.unwrap().unwrap(), "tile");
    }
    assert_eq!(makes.load(SeqCst), 1);
    assert_eq!(metrics.count(Layer::Texture, Outcome::Made), 1);
    assert_eq!(metrics.count(Layer::Texture, Outcome::Memory), 99);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_leader_that_leaves_cancels_nobody() {
    let (cache, _) = cache(1, 8, None);
    let (makes, door) = (Arc::new(AtomicUsize::new(0)), Arc::new(Door::default()));
    let (make, begins) = slow_maker(&makes, &door);
    let leader = {
        let (cache, make) = (cache.clone(), make.clone());
        tokio::spawn(async move { cache.get(&key("k"), make).await })
    };
    tokio::task::spawn_blocking(move || begins.recv()).await.unwrap().unwrap();
    let follower = {
        let (cache, make) = (cache.clone(), make.clone());
        tokio::spawn(async move { cache.get(&key("k"), make).await })
    };
    leader.abort();
    assert!(leader.await.unwrap_err().is_cancelled());
    door.open();
    assert_eq!(follower.await.unwrap().unwrap(), "tile");
    assert_eq!(makes.load(SeqCst), 1);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn work_that_nobody_waits_for_is_dropped_from_the_queue() {
    let (cache, _) = cache(1, 8, None);
    let (makes, door) = (Arc::new(AtomicUsize::new(0)), Arc::new(Door::default()));
    let (blocker, begins) = slow_maker(&makes, &door);
    let running = {
        let cache = cache.clone();
        tokio::spawn(async move { cache.get(&key("running"), blocker).await })
    };
    tokio::task::spawn_blocking(move || begins.recv()).await.unwrap().unwrap();
    let unwanted = Arc::new(AtomicUsize::new(0));
    let queued = {
        let (cache, make) = (cache.clone(), maker(&unwanted));
        tokio::spawn(async move { cache.get(&key("queued"), make).await })
    };
    while cache.workers.jobs() < 2 {
        tokio::task::yield_now().await;
    }
    queued.abort();
    assert!(queued.await.unwrap_err().is_cancelled());
    door.open();
    running.await.unwrap().unwrap();
    while cache.workers.jobs() > 0 {
        tokio::task::yield_now().await;
    }
    assert_eq!(unwanted.load(SeqCst), 0, "its only client had left");
    assert_eq!(cache.get(&key("queued"), maker(&unwanted)).await.unwrap(), "tile");
    assert_eq!(unwanted.load(SeqCst), 1);
}

#[tokio::test]
async fn failures_and_panics_are_not_kept() {
    let (cache, metrics) = cache(1, 8, None);
    let failing: Maker = Arc::new(|| Err(MakeError::Failed("dem.tif: cut short".to_owned())));
    assert_eq!(cache.get(&key("k"), failing).await, Err(MakeError::Failed("dem.tif: cut short".to_owned())));
    let panicking: Maker = Arc::new(|| panic!("on purpose"));
    assert_eq!(cache.get(&key("k"), panicking).await, Err(MakeError::Panicked));
    let makes = Arc::new(AtomicUsize::new(0));
    assert_eq!(cache.get(&key("k"), maker(&makes)).await.unwrap(), "tile");
    assert_eq!(metrics.count(Layer::Texture, Outcome::Failed), 2);
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn a_full_queue_is_busy() {
    let (cache, metrics) = cache(1, 0, None);
    let (makes, door) = (Arc::new(AtomicUsize::new(0)), Arc::new(Door::default()));
    let (blocker, begins) = slow_maker(&makes, &door);
    let running = {
        let cache = cache.clone();
        tokio::spawn(async move { cache.get(&key("running"), blocker).await })
    };
    tokio::task::spawn_blocking(move || begins.recv()).await.unwrap().unwrap();
    assert_eq!(cache.get(&key("other"), maker(&makes)).await, Err(MakeError::Busy));
    assert_eq!(metrics.count(Layer::Texture, Outcome::Busy), 1);
    door.open();
    running.await.unwrap().unwrap();
}

#[tokio::test]
async fn the_folder_outlives_the_process() {
    let folder = tempfile::tempdir().unwrap();
    let makes = Arc::new(AtomicUsize::new(0));
    for _ in 0..2 {
        let disk = Arc::new(DiskCache::open(folder.path(), "r", u64::MAX).unwrap());
        let (cache, _) = cache(1, 8, Some(disk));
        assert_eq!(cache.get(&key("k"), maker(&makes)).await.unwrap(), "tile");
        assert!(cache.flush(Duration::from_secs(60)), "written after it was answered");
        assert!(cache.is_on_disk(&key("k")) && !cache.is_on_disk(&key("other")));
    }
    assert_eq!(makes.load(SeqCst), 1);
}

#[tokio::test]
async fn memory_is_bounded_in_bytes() {
    let (cache, _) = cache(1, 8, None);
    for index in 0..64 {
        let big: Maker = Arc::new(|| Ok(vec![0; 100_000]));
        cache.get(&key(&index.to_string()), big).await.unwrap();
    }
    cache.memory.run_pending_tasks().await;
    assert!(cache.memory_bytes() <= 1 << 20, "{}", cache.memory_bytes());
    assert!(cache.memory_tiles() > 0);
}
