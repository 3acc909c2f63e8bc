//! A bad connection: a proxy before a server that is slow, late, and fails now and then.
//!
//! Which request fails is decided by a hash of the seed, the request's target and how often it was
//! asked before, so that a run can be repeated whatever the order of its requests.

use std::collections::HashMap;
use std::io::{Read, Write};
use std::net::{SocketAddr, TcpListener, TcpStream};
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// How bad the link is.
#[derive(Clone, Debug)]
pub struct Quality {
    /// Bits a second, shared by all connections.
    pub bits_per_second: f64,
    /// Time before a request arrives.
    pub latency: Duration,
    /// One in so many requests for data fails; 0 for none.
    pub one_failing_in: u64,
    /// Chooses which fail.
    pub seed: u64,
}

impl Quality {
    /// 1 Mbit/s, 200 ms, one request in ten failing.
    pub fn bad(seed: u64) -> Self {
        Self { bits_per_second: 1.0e6, latency: Duration::from_millis(200), one_failing_in: 10, seed }
    }
}

/// How a request fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Fault {
    /// The connection is closed without an answer.
    Closed,
    /// 503.
    Unavailable,
    /// The connection is cut in the middle of the body.
    Cut,
}

/// A running proxy.
pub struct FaultyLink {
    address: SocketAddr,
    state: Arc<State>,
}

struct State {
    upstream: String,
    quality: Quality,
    /// When the line is free again.
    free_at: Mutex<Instant>,
    attempts: Mutex<HashMap<String, u64>>,
    failed: AtomicU64,
    answered: AtomicU64,
    stop: AtomicBool,
}

impl FaultyLink {
    /// Listens on a port of its own, before `upstream` (`HOST:PORT`).
    pub fn before(upstream: &str, quality: Quality) -> std::io::Result<Self> {
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = listener.local_addr()?;
        let state = Arc::new(State {
            upstream: upstream.to_owned(),
            quality,
            free_at: Mutex::new(Instant::now()),
            attempts: Mutex::default(),
            failed: AtomicU64::new(0),
            answered: AtomicU64::new(0),
            stop: AtomicBool::new(false),
        });
        let shared = Arc::clone(&state);
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                if shared.stop.load(Ordering::Relaxed) {
                    break;
                }
                let state = Arc::clone(&shared);
                // A broken connection is what this is for: nobody is told.
                std::thread::spawn(move || drop(state.serve(stream)));
            }
        });
        Ok(Self { address, state })
    }

    /// `http://HOST:PORT` and a path.
    pub fn url(&self, path: &str) -> String {
        format!("http://{}{path}", self.address)
    }

    /// Requests that failed on purpose.
    pub fn failed(&self) -> u64 {
        self.state.failed.load(Ordering::Relaxed)
    }

    /// Requests that were answered in full.
    pub fn answered(&self) -> u64 {
        self.state.answered.load(Ordering::Relaxed)
    }
}

impl Drop for FaultyLink {
    fn drop(&mut self) {
        self.state.stop.store(true, Ordering::Relaxed);
        // Wakes the listener, so that it sees the flag.
        drop(TcpStream::connect(self.address));
    }
}

impl State {
    /// One request on one connection.
    fn serve(&self, mut client: TcpStream) -> std::io::Result<()> {
        let Some(request) = head(&mut client)? else { return Ok(()) };
        std::thread::sleep(self.quality.latency);
        let target = request.split(' ').nth(1).unwrap_or_default().to_owned();
        let fault = self.fault(&target);
        if fault.is_some() {
            self.failed.fetch_add(1, Ordering::Relaxed);
        }
        match fault {
            Some(Fault::Closed) => return Ok(()),
            Some(Fault::Unavailable) => {
                let answer = "HTTP/1.1 503 Service Unavailable\r\nAccess-Control-Allow-Origin: *\r\nContent-Length: 0\r\nConnection: close\r\n\r\n";
                return client.write_all(answer.as_bytes());
            }
            Some(Fault::Cut) | None => {}
        }
        let mut upstream = TcpStream::connect(&self.upstream)?;
        upstream.write_all(closing(&request).as_bytes())?;
        let mut answer = Vec::new();
        upstream.read_to_end(&mut answer)?;
        if fault == Some(Fault::Cut) {
            answer.truncate(answer.len() / 2);
        }
        let mut pieces = answer.chunks(4096).peekable();
        while let Some(piece) = pieces.next() {
            self.wait_for_line(piece.len());
            // Counted before the last piece goes out: who has it all finds it counted.
            if fault.is_none() && pieces.peek().is_none() {
                self.answered.fetch_add(1, Ordering::Relaxed);
            }
            client.write_all(piece)?;
        }
        Ok(())
    }

    /// Sleeps until the shared line has carried so many bytes more.
    fn wait_for_line(&self, bytes: usize) {
        let takes = Duration::from_secs_f64(bytes as f64 * 8.0 / self.quality.bits_per_second);
        let done = {
            let Ok(mut free_at) = self.free_at.lock() else { return };
            *free_at = (*free_at).max(Instant::now()) + takes;
            *free_at
        };
        std::thread::sleep(done.saturating_duration_since(Instant::now()));
    }

    /// Whether and how this asking of a target fails. Only data does: a page that does not come at
    /// all is the browser's to say.
    fn fault(&self, target: &str) -> Option<Fault> {
        let is_data = target.contains("/wms") || target.contains("/scene.json");
        if self.quality.one_failing_in == 0 || !is_data {
            return None;
        }
        let attempt = {
            let mut attempts = self.attempts.lock().ok()?;
            let attempt = attempts.entry(target.to_owned()).or_default();
            *attempt += 1;
            *attempt
        };
        let hash = hash(self.quality.seed ^ attempt.wrapping_mul(0x9e37_79b9_7f4a_7c15), target);
        hash.is_multiple_of(self.quality.one_failing_in).then_some(match (hash >> 32) % 3 {
            0 => Fault::Closed,
            1 => Fault::Unavailable,
            _ => Fault::Cut,
        })
    }
}

/// FNV-1a with a last mix.
fn hash(seed: u64, text: &str) -> u64 {
    let mut hash = text.bytes().fold(0xcbf2_9ce4_8422_2325 ^ seed, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    });
    hash = (hash ^ (hash >> 32)).wrapping_mul(0xd6e8_feb8_6659_fd93);
    hash ^ (hash >> 32)
}

/// A request's head; `None` where the client closed without one.
fn head(client: &mut TcpStream) -> std::io::Result<Option<String>> {
    let mut head = Vec::new();
    let mut byte = [0];
    while !head.ends_with(b"\r\n\r\n") {
        if head.len() > 64 * 1024 || client.read(&mut byte)? == 0 {
            return Ok(None);
        }
        head.push(byte[0]);
    }
    Ok(Some(String::from_utf8_lossy(&head).into_owned()))
}

/// The head with `Connection: close`, so that the answer ends where the connection does.
fn closing(head: &str) -> String {
    let mut lines: Vec<&str> = head
        .split("\r\n")
        .filter(|line| !line.is_empty() && !line.to_ascii_lowercase().starts_with("connection:"))
        .collect();
    lines.push("Connection: close");
    lines.join("\r\n") + "\r\n\r\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Answers every request with 4,000 bytes.
    fn upstream() -> SocketAddr {
        let listener = TcpListener::bind("127.0.0.1:0").unwrap();
        let address = listener.local_addr().unwrap();
        std::thread::spawn(move || {
            for mut stream in listener.incoming().flatten() {
                head(&mut stream).unwrap();
                let mut answer =
                    b"HTTP/1.1 200 OK\r\nContent-Length: 4000\r\nConnection: close\r\n\r\n".to_vec();
                answer.resize(answer.len() + 4000, b'x');
                stream.write_all(&answer).unwrap();
            }
        });
        address
    }

    fn get(url: &str) -> Option<usize> {
        let mut answer = ureq::get(url).call().ok()?;
        Some(answer.body_mut().read_to_vec().ok()?.len())
    }

    #[test]
    fn one_in_ten_fails_and_the_same_ones_again() {
        let upstream = upstream();
        let quality = Quality { bits_per_second: 1e9, latency: Duration::ZERO, ..Quality::bad(3) };
        let runs: Vec<Vec<bool>> = (0..2)
            .map(|_| {
                let link = FaultyLink::before(&upstream.to_string(), quality.clone()).unwrap();
                (0..200).map(|tile| get(&link.url(&format!("/wms?tile={tile}"))) == Some(4000)).collect()
            })
            .collect();
        assert_eq!(runs[0], runs[1]);
        let failed = runs[0].iter().filter(|answered| !**answered).count();
        assert!((8..=35).contains(&failed), "{failed} of 200");
    }

    #[test]
    fn a_request_that_failed_does_not_fail_for_ever() {
        let link = FaultyLink::before(
            &upstream().to_string(),
            Quality { bits_per_second: 1e9, latency: Duration::ZERO, one_failing_in: 2, seed: 1 },
        )
        .unwrap();
        for tile in 0..20 {
            let url = link.url(&format!("/wms?tile={tile}"));
            assert!((0..20).any(|_| get(&url) == Some(4000)), "{url}");
        }
        assert!(link.failed() > 0 && link.answered() == 20);
        assert_eq!(get(&link.url("/index.html")), Some(4000));
    }

    #[test]
    fn the_line_is_as_slow_as_it_says() {
        let quality = Quality { latency: Duration::from_millis(50), one_failing_in: 0, ..Quality::bad(1) };
        let link = FaultyLink::before(&upstream().to_string(), quality).unwrap();
        let start = Instant::now();
        assert_eq!(get(&link.url("/wms")), Some(4000));
        // 4,000 bytes and a head at 1 Mbit/s are 32 ms, after 50 ms of latency.
        assert!(start.elapsed() >= Duration::from_millis(80), "{:?}", start.elapsed());
    }
}
