//! A file at an upstream, read by parts: cloud-optimised GeoTIFFs stay where they are.

use super::{Part, client};
use std::collections::{BTreeMap, HashMap};
use std::io;
use std::sync::{Arc, Mutex, PoisonError};

/// Small reads are made of blocks of so many bytes, which are kept.
const BLOCK: u64 = 64 << 10;
/// What is read when the file is opened: the directories of a cloud-optimised GeoTIFF stand first.
const HEAD: u64 = 4 * BLOCK;
/// Blocks that are kept at most: 16 MiB.
const KEPT: usize = 256;

/// A file of which parts can be asked for.
#[derive(Debug)]
pub struct RemoteBytes {
    address: String,
    length: u64,
    /// The version that was there when the file was opened.
    version: String,
    blocks: Mutex<Blocks>,
}

/// Blocks by number, and by when they were used.
#[derive(Debug, Default)]
struct Blocks {
    held: HashMap<u64, (Arc<[u8]>, u64)>,
    order: BTreeMap<u64, u64>,
    clock: u64,
}

impl Blocks {
    fn get(&mut self, number: u64) -> Option<Arc<[u8]>> {
        self.clock += 1;
        let (bytes, used) = self.held.get_mut(&number)?;
        self.order.remove(used);
        *used = self.clock;
        self.order.insert(self.clock, number);
        Some(bytes.clone())
    }

    fn put(&mut self, number: u64, bytes: Arc<[u8]>) {
        self.clock += 1;
        if let Some((_, used)) = self.held.insert(number, (bytes, self.clock)) {
            self.order.remove(&used);
        }
        self.order.insert(self.clock, number);
        while self.held.len() > KEPT {
            let Some((_, oldest)) = self.order.pop_first() else { break };
            self.held.remove(&oldest);
        }
    }
}

impl RemoteBytes {
    /// Looks at a file and reads its head.
    ///
    /// # Errors
    /// What the upstream says, or that it does not.
    pub fn open(address: &str) -> io::Result<Self> {
        let Part { bytes, total, version } =
            client().range(address, 0, HEAD - 1).map_err(io::Error::other)?;
        let mut blocks = Blocks::default();
        for (number, block) in (0..).zip(bytes.chunks(BLOCK as usize)) {
            blocks.put(number, block.into());
        }
        Ok(Self { address: address.to_owned(), length: total, version, blocks: Mutex::new(blocks) })
    }

    /// Bytes of the whole file.
    pub fn length(&self) -> u64 {
        self.length
    }

    /// Length and version, which change when the file does.
    pub fn identity(address: &str) -> io::Result<String> {
        let part = client().range(address, 0, 0).map_err(io::Error::other)?;
        Ok(format!("{}|{}", part.total, part.version))
    }

    /// Reads bytes that lie within the file.
    ///
    /// # Errors
    /// What the upstream says; that the file is another by now.
    pub fn read(&self, offset: u64, count: usize) -> io::Result<Vec<u8>> {
        if count == 0 {
            return Ok(Vec::new());
        }
        if count as u64 > BLOCK {
            // A tile or a strip: decoded, it is kept elsewhere.
            return self.fetch(offset, offset + count as u64 - 1);
        }
        let (first, last) = (offset / BLOCK, (offset + count as u64 - 1) / BLOCK);
        let mut bytes = Vec::with_capacity(((last - first + 1) * BLOCK) as usize);
        for number in first..=last {
            let held = self.blocks.lock().unwrap_or_else(PoisonError::into_inner).get(number);
            let block = match held {
                Some(block) => block,
                None => {
                    let start = number * BLOCK;
                    let block: Arc<[u8]> = self.fetch(start, (start + BLOCK).min(self.length) - 1)?.into();
                    self.blocks.lock().unwrap_or_else(PoisonError::into_inner).put(number, block.clone());
                    block
                }
            };
            bytes.extend_from_slice(&block);
        }
        let start = (offset - first * BLOCK) as usize;
        bytes.truncate(start + count);
        Ok(bytes.split_off(start))
    }

    fn fetch(&self, first: u64, last: u64) -> io::Result<Vec<u8>> {
        let part = client().range(&self.address, first, last).map_err(io::Error::other)?;
        if part.total != self.length || part.version != self.version {
            // The server notices by itself, and opens it anew.
            return Err(io::Error::other("it has changed since it was opened"));
        }
        Ok(part.bytes)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_are_bounded_and_the_oldest_goes() {
        let mut blocks = Blocks::default();
        for number in 0..KEPT as u64 {
            blocks.put(number, Arc::new([number as u8]));
        }
        assert_eq!(blocks.get(0).as_deref(), Some(&[0][..]));
        blocks.put(1_000, Arc::new([7]));
        blocks.put(1_000, Arc::new([8]));
        assert_eq!(blocks.get(1), None);
        assert_eq!(blocks.get(0).as_deref(), Some(&[0][..]));
        assert_eq!(blocks.get(1_000).as_deref(), Some(&[8][..]));
        assert_eq!((blocks.held.len(), blocks.order.len()), (KEPT, KEPT));
    }
}
