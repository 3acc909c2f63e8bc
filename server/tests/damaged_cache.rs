//! Damage to the cache's files: bits that flip, ends that are missing, files in each other's place. Whatever is left of a
//! file, the answer is the right one, and the file is whole afterwards.
//!
//! `TREELINE_DAMAGES=100000 cargo test --release -p treeline-server --test damaged_cache` is the long form.

use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Duration;
use treeline_core::hash::{hash, minimal_standard};
use treeline_core::layer::Layer;
use treeline_server::cache::{DiskCache, Maker, TileCache, TileKey, Workers};
use treeline_server::metrics::{Metrics, Outcome};

/// Tiles that are damaged and asked for in turn.
const TILES: usize = 50;
const DAMAGES: usize = 1_500;

/// The same numbers each time.
struct Numbers(u32);

impl Numbers {
    fn below(&mut self, count: usize) -> usize {
        self.0 = minimal_standard(self.0);
        self.0 as usize % count
    }
}

fn key(index: usize) -> TileKey {
    TileKey { product: Layer::Texture.into(), text: format!("tile|{index}").into() }
}

/// A tile's bytes: none at all for one, a photo's size for some.
fn payload(index: usize) -> Vec<u8> {
    let mut numbers = Numbers(1 + hash(index as u32, 0, 0) % 0x7fff_fffe);
    let length = if index.is_multiple_of(10) { 60_000 } else { 4_000 };
    (0..if index == 1 { 0 } else { length }).map(|_| numbers.below(256) as u8).collect()
}

fn files(of: &Path) -> Vec<PathBuf> {
    let mut found = Vec::new();
    for entry in std::fs::read_dir(of).unwrap() {
        let path = entry.unwrap().path();
        if path.is_dir() { found.extend(files(&path)) } else { found.push(path) }
    }
    found
}

/// One kind of damage to a file; `None`: the file is gone.
fn damage(numbers: &mut Numbers, whole: &[u8], other: &[u8]) -> Option<Vec<u8>> {
    let mut bytes = whole.to_vec();
    let flips = match numbers.below(8) {
        0..3 => 1,
        3 => 1 + numbers.below(64),
        4 => {
            bytes.truncate(numbers.below(whole.len()));
            0
        }
        5 => {
            // A block that never came to the disk.
            let first = numbers.below(whole.len());
            let last = (first + 512).min(whole.len());
            bytes[first..last].fill(0);
            0
        }
        6 => {
            // Another tile's bytes from somewhere on; at 0 a whole file that belongs elsewhere.
            let from = if numbers.below(2) == 0 { 0 } else { numbers.below(whole.len().min(other.len())) };
            bytes.truncate(from);
            bytes.extend(&other[from..]);
            0
        }
        _ => {
            let more = numbers.below(100);
            if more == 0 {
                return None;
            }
            bytes.extend((0..more).map(|index| index as u8));
            0
        }
    };
    for _ in 0..flips {
        // The first bytes, which say what follows, as often as all others.
        let at = if numbers.below(2) == 0 {
            numbers.below(40.min(whole.len()))
        } else {
            numbers.below(whole.len())
        };
        bytes[at] ^= 1 << numbers.below(8);
    }
    Some(bytes)
}

#[tokio::test(flavor = "multi_thread", worker_threads = 2)]
async fn damaged_tiles_are_made_again_never_served() {
    let damages = std::env::var("TREELINE_DAMAGES").map_or(DAMAGES, |text| text.parse().unwrap());
    let folder = tempfile::tempdir().unwrap();
    let metrics = Arc::new(Metrics::default());
    let disk = Arc::new(DiskCache::open(folder.path(), "r", u64::MAX).unwrap());
    let workers = Arc::new(Workers::new(2, 64).unwrap());
    // No memory: every answer comes from the folder or is made.
    let cache = Arc::new(TileCache::new(0, Some(disk), workers, metrics.clone()).unwrap());
    let payloads: Arc<Vec<Vec<u8>>> = Arc::new((0..TILES).map(payload).collect());
    let get = async |index: usize| {
        let payloads = payloads.clone();
        let maker: Maker = Arc::new(move || Ok(payloads[index].clone()));
        cache.get(&key(index), maker).await.unwrap()
    };
    let mut places = Vec::new();
    for index in 0..TILES {
        get(index).await;
        assert!(cache.flush(Duration::from_secs(60)));
        let new: Vec<PathBuf> =
            files(folder.path()).into_iter().filter(|path| !places.contains(path)).collect();
        places.extend(new);
        assert_eq!(places.len(), index + 1);
    }
    let whole: Vec<Vec<u8>> = places.iter().map(|path| std::fs::read(path).unwrap()).collect();
    let mut numbers = Numbers(4711);
    let (mut done, mut wrong) = (0, 0);
    while done < damages {
        let made = metrics.count(Layer::Texture, Outcome::Made);
        let mut damaged = 0;
        for (index, path) in places.iter().enumerate() {
            let other = &whole[numbers.below(TILES)];
            let left = damage(&mut numbers, &whole[index], other);
            damaged += u64::from(left.as_ref() != Some(&whole[index]));
            match left {
                Some(bytes) => std::fs::write(path, bytes).unwrap(),
                None => std::fs::remove_file(path).unwrap(),
            }
        }
        for (index, right) in payloads.iter().enumerate() {
            wrong += usize::from(get(index).await != right[..]);
        }
        assert!(cache.flush(Duration::from_secs(60)));
        assert_eq!(
            metrics.count(Layer::Texture, Outcome::Made) - made,
            damaged,
            "the damaged ones, no others"
        );
        for (path, whole) in places.iter().zip(&whole) {
            assert!(&std::fs::read(path).unwrap() == whole, "{}: not mended", path.display());
        }
        done += damaged as usize;
    }
    println!("{done} damages, {wrong} wrong answers");
    assert_eq!(wrong, 0);
}
