//! Sources at other servers, over HTTP(S): bounded in time, in bytes and in number, tried again, and left in peace
//! where they fail.
//!
//! Only addresses that the configuration names are asked; a redirect is an error that says where to.

pub mod heights;
pub mod pictures;
pub mod ranges;
pub mod wms;

use std::collections::HashMap;
use std::collections::hash_map::RandomState;
use std::hash::BuildHasher as _;
use std::io::Read as _;
use std::sync::atomic::{AtomicU64, Ordering::Relaxed};
use std::sync::{Arc, Condvar, LazyLock, Mutex, MutexGuard, PoisonError};
use std::time::{Duration, Instant};
use ureq::tls::{Certificate, RootCerts, TlsConfig};

/// Requests at once, to all upstreams together.
const MOST_REQUESTS: usize = 16;
/// Longest wait for a place among them.
const LONGEST_WAIT: Duration = Duration::from_secs(20);
/// Bytes of a refusal that are read, to be quoted.
const SAID_BYTES: u64 = 4096;
/// Longest time for a connection, and for a whole answer.
const CONNECT_TIMEOUT: Duration = Duration::from_secs(5);
const ANSWER_TIMEOUT: Duration = Duration::from_secs(20);
/// Times that an answer is asked for, and the first pause between two of them; each is twice as long.
const TRIES: u32 = 3;
const PAUSE: Duration = Duration::from_millis(200);
/// So long an upstream that failed is not asked again: whoever wants something of it is told at once.
const PEACE: Duration = Duration::from_secs(5);

/// Whether a source's path is an address.
pub fn is_address(path: &std::path::Path) -> bool {
    path.to_str().is_some_and(|text| text.starts_with("http://") || text.starts_with("https://"))
}

/// A part of something, as an upstream gave it.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Part {
    /// The bytes.
    pub bytes: Vec<u8>,
    /// Bytes of the whole.
    pub total: u64,
    /// What tells this version of it from others: its entity tag or its date.
    pub version: String,
}

/// What was asked of upstreams since the start.
#[derive(Debug, Default)]
pub struct Counters {
    /// Answers that were of use.
    pub succeeded: AtomicU64,
    /// Tries that failed.
    pub failed: AtomicU64,
    /// Times that an upstream was left in peace.
    pub spared: AtomicU64,
    /// Bytes received.
    pub bytes: AtomicU64,
    /// Time waited, milliseconds.
    pub milliseconds: AtomicU64,
}

/// The client that asks all upstreams.
pub struct Client {
    agent: ureq::Agent,
    /// Requests under way.
    busy: Mutex<usize>,
    free: Condvar,
    /// Until when origins that failed are left in peace.
    resting: Mutex<HashMap<String, Instant>>,
    jitter: RandomState,
    counters: Arc<Counters>,
}

/// What was asked of all upstreams.
pub fn counters() -> &'static Arc<Counters> {
    static COUNTERS: LazyLock<Arc<Counters>> = LazyLock::new(Arc::default);
    &COUNTERS
}

/// The one client of this process.
pub fn client() -> &'static Client {
    static CLIENT: LazyLock<Client> = LazyLock::new(|| Client::new(ANSWER_TIMEOUT, counters().clone()));
    &CLIENT
}

/// Of what an upstream says, the part that can be quoted in one line.
fn printable(body: &[u8]) -> String {
    let letters = body.iter().map(|&byte| char::from(byte)).filter(|letter| (' '..='~').contains(letter));
    letters.take(160).collect()
}

fn lock<T>(mutex: &Mutex<T>) -> MutexGuard<'_, T> {
    // Nothing below is left half-changed.
    mutex.lock().unwrap_or_else(PoisonError::into_inner)
}

/// Why there is no answer.
enum Failure {
    /// It may work out a moment later.
    Passing(String),
    /// It will not.
    Lasting(String),
}

impl Client {
    fn new(answer_timeout: Duration, counters: Arc<Counters>) -> Self {
        let config = ureq::Agent::config_builder()
            .http_status_as_error(false)
            .max_redirects(0)
            .timeout_connect(Some(CONNECT_TIMEOUT))
            .timeout_global(Some(answer_timeout))
            .user_agent(concat!("Treeline/", env!("CARGO_PKG_VERSION")))
            .tls_config(TlsConfig::builder().root_certs(trusted()).build())
            .build();
        Self {
            agent: ureq::Agent::new_with_config(config),
            busy: Mutex::new(0),
            free: Condvar::new(),
            resting: Mutex::default(),
            jitter: RandomState::new(),
            counters,
        }
    }

    /// Bytes `first` to `last`, or as many of them as there are.
    ///
    /// # Errors
    /// A few words on what went wrong: a status, a time-out, an answer that is not what was asked for.
    pub fn range(&self, address: &str, first: u64, last: u64) -> Result<Part, String> {
        self.ask(address, || {
            let part = self.try_range(address, first, last)?;
            self.counters.bytes.fetch_add(part.bytes.len() as u64, Relaxed);
            Ok(part)
        })
    }

    /// The whole of something of at most `limit` bytes; `None` where there is nothing at the address.
    ///
    /// # Errors
    /// As [`Self::range`].
    pub fn get(&self, address: &str, limit: u64) -> Result<Option<Vec<u8>>, String> {
        self.ask(address, || {
            let found = self.try_get(address, limit)?;
            self.counters.bytes.fetch_add(found.as_ref().map_or(0, Vec::len) as u64, Relaxed);
            Ok(found)
        })
    }

    /// Asks until there is an answer, or enough is enough.
    fn ask<T>(&self, address: &str, ask: impl Fn() -> Result<T, Failure>) -> Result<T, String> {
        let origin = origin(address);
        let rests = lock(&self.resting).get(origin).copied().filter(|until| *until > Instant::now());
        if rests.is_some() {
            self.counters.spared.fetch_add(1, Relaxed);
            return Err("it failed a moment ago, and is left in peace for some seconds".to_owned());
        }
        let mut pause = PAUSE;
        let mut tries = 1;
        loop {
            let place = self.place()?;
            let start = Instant::now();
            let result = ask();
            drop(place);
            self.counters.milliseconds.fetch_add(start.elapsed().as_millis() as u64, Relaxed);
            match result {
                Ok(answer) => {
                    self.counters.succeeded.fetch_add(1, Relaxed);
                    return Ok(answer);
                }
                Err(Failure::Passing(_)) if tries < TRIES => {
                    self.counters.failed.fetch_add(1, Relaxed);
                    std::thread::sleep(self.with_jitter(pause, tries));
                    pause *= 2;
                    tries += 1;
                }
                Err(Failure::Passing(problem)) => {
                    self.counters.failed.fetch_add(1, Relaxed);
                    lock(&self.resting).insert(origin.to_owned(), Instant::now() + PEACE);
                    return Err(problem);
                }
                Err(Failure::Lasting(problem)) => {
                    self.counters.failed.fetch_add(1, Relaxed);
                    return Err(problem);
                }
            }
        }
    }

    fn try_get(&self, address: &str, limit: u64) -> Result<Option<Vec<u8>>, Failure> {
        let mut response =
            self.agent.get(address).call().map_err(|error| Failure::Passing(format!("{error}")))?;
        let status = response.status();
        match status.as_u16() {
            200 => {}
            204 | 404 | 410 => return Ok(None),
            408 | 429 | 500.. => return Err(Failure::Passing(format!("HTTP {status}"))),
            300..400 => {
                let place = response.headers().get("location").and_then(|value| value.to_str().ok());
                let place = place.unwrap_or("another address");
                return Err(Failure::Lasting(format!("it has moved to {place}; name that address")));
            }
            _ => {
                let mut said = Vec::new();
                // What cannot be read is not quoted.
                let _ = response.body_mut().as_reader().take(SAID_BYTES).read_to_end(&mut said);
                return Err(Failure::Lasting(format!("HTTP {status}: {}", printable(&said))));
            }
        }
        let body = response.body_mut().with_config().limit(limit).read_to_vec();
        body.map(Some).map_err(|error| Failure::Passing(format!("{error}")))
    }

    fn try_range(&self, address: &str, first: u64, last: u64) -> Result<Part, Failure> {
        let asked = self.agent.get(address).header("Range", format!("bytes={first}-{last}"));
        let mut response = asked.call().map_err(|error| Failure::Passing(format!("{error}")))?;
        let header = |name: &str| response.headers().get(name).and_then(|value| value.to_str().ok());
        let status = response.status();
        match status.as_u16() {
            206 => {}
            200 => {
                let problem = "it answers no parts of files (HTTP ranges); fetch the file and name it here";
                return Err(Failure::Lasting(problem.to_owned()));
            }
            301 | 302 | 303 | 307 | 308 => {
                let place = header("location").unwrap_or("another address");
                return Err(Failure::Lasting(format!("it has moved to {place}; name that address")));
            }
            408 | 429 | 500.. => return Err(Failure::Passing(format!("HTTP {status}"))),
            _ => return Err(Failure::Lasting(format!("HTTP {status}"))),
        }
        // bytes FIRST-LAST/TOTAL (RFC 9110, 14.4)
        let total = header("content-range").and_then(|text| {
            let (range, total) = text.strip_prefix("bytes ")?.split_once('/')?;
            let starts = range.split_once('-')?.0.parse::<u64>().ok()?;
            (starts == first).then_some(total.parse::<u64>().ok()?)
        });
        let Some(total) = total else {
            return Err(Failure::Lasting("it answers other parts of files than those asked for".to_owned()));
        };
        let version = header("etag").or_else(|| header("last-modified")).unwrap_or_default().to_owned();
        let expected = (last.min(total.saturating_sub(1)) + 1).saturating_sub(first);
        let bytes = response
            .body_mut()
            .with_config()
            // One more would be too many: an upstream is not trusted with our memory.
            .limit(expected + 1)
            .read_to_vec()
            .map_err(|error| Failure::Passing(format!("{error}")))?;
        if bytes.len() as u64 != expected {
            let problem = format!("{} bytes came where there should be {expected}", bytes.len());
            return Err(Failure::Passing(problem));
        }
        Ok(Part { bytes, total, version })
    }

    /// Waits for a place among the requests at once.
    fn place(&self) -> Result<Place<'_>, String> {
        let (mut busy, waited) = self
            .free
            .wait_timeout_while(lock(&self.busy), LONGEST_WAIT, |busy| *busy >= MOST_REQUESTS)
            .unwrap_or_else(PoisonError::into_inner);
        if waited.timed_out() {
            return Err("too much is asked of upstreams at once".to_owned());
        }
        *busy += 1;
        drop(busy);
        Ok(Place(self))
    }

    /// Half to one and a half times as long: those who failed together do not come back together.
    fn with_jitter(&self, pause: Duration, tries: u32) -> Duration {
        let random = self.jitter.hash_one((Instant::now(), tries)) % 1000;
        pause.mul_f64(0.5 + random as f64 / 1000.0)
    }
}

/// A request under way.
struct Place<'a>(&'a Client);

impl Drop for Place<'_> {
    fn drop(&mut self) {
        *lock(&self.0.busy) -= 1;
        self.0.free.notify_one();
    }
}

/// The certificates that the system trusts; without any, no https address can be used, and each says so.
fn trusted() -> RootCerts {
    let found = rustls_native_certs::load_native_certs();
    if found.certs.is_empty() {
        tracing::warn!("the system has no certificates (Debian: apt-get install ca-certificates)");
    }
    RootCerts::Specific(Arc::new(
        found.certs.iter().map(|der| Certificate::from_der(der).to_owned()).collect(),
    ))
}

/// Scheme and host of an address.
fn origin(address: &str) -> &str {
    let host = address.find("://").map_or(0, |at| at + 3);
    address[host..].find('/').map_or(address, |end| &address[..host + end])
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::io::Write as _;

    #[test]
    fn origins_and_addresses() {
        assert_eq!(origin("https://a.org:8/b/c.tif"), "https://a.org:8");
        assert_eq!(origin("https://a.org"), "https://a.org");
        assert!(is_address(std::path::Path::new("https://a.org/b.tif")));
        assert!(
            !is_address(std::path::Path::new("/srv/https://x")) && !is_address(std::path::Path::new("a.tif"))
        );
    }

    #[test]
    fn pauses_vary() {
        let client = Client::new(ANSWER_TIMEOUT, Arc::default());
        for tries in 0..50 {
            let pause = client.with_jitter(Duration::from_millis(100), tries);
            assert!((50..=150).contains(&pause.as_millis()), "{pause:?}");
        }
    }

    /// Answers every connection by `answer`, which is given how many came before; gives the address.
    fn upstream(answer: impl Fn(usize, &mut std::net::TcpStream) + Send + 'static) -> String {
        let listener = std::net::TcpListener::bind("127.0.0.1:0").unwrap();
        let address = format!("http://{}/file.tif", listener.local_addr().unwrap());
        std::thread::spawn(move || {
            for (index, stream) in listener.incoming().enumerate() {
                let mut stream = stream.unwrap();
                let mut head = Vec::new();
                let mut byte = [0];
                while !head.ends_with(b"\r\n\r\n") && stream.read(&mut byte).unwrap() == 1 {
                    head.push(byte[0]);
                }
                answer(index, &mut stream);
            }
        });
        address
    }

    fn write(stream: &mut std::net::TcpStream, text: &str) {
        // The client may have had enough.
        let _ = stream.write_all(text.as_bytes());
    }

    const GOOD: &str = "HTTP/1.1 206 Partial Content\r\nContent-Range: bytes 2-4/10\r\nETag: \"a\"\r\nContent-Length: 3\r\nConnection: close\r\n\r\ncde";

    #[test]
    fn what_passes_is_tried_again() {
        let address = upstream(|index, stream| {
            write(stream, if index < 2 { "HTTP/1.1 503 Busy\r\nContent-Length: 0\r\n\r\n" } else { GOOD });
        });
        let client = Client::new(ANSWER_TIMEOUT, Arc::default());
        let part = client.range(&address, 2, 4).unwrap();
        assert_eq!(part, Part { bytes: b"cde".to_vec(), total: 10, version: "\"a\"".to_owned() });
        assert_eq!((client.counters.failed.load(Relaxed), client.counters.succeeded.load(Relaxed)), (2, 1));
    }

    #[test]
    fn what_lasts_is_not() {
        for (answer, named) in [
            ("HTTP/1.1 404 Not Found\r\nContent-Length: 0\r\n\r\n", "404"),
            ("HTTP/1.1 200 OK\r\nContent-Length: 10\r\n\r\n0123456789", "answers no parts"),
            (
                "HTTP/1.1 302 Found\r\nLocation: http://other/\r\nContent-Length: 0\r\n\r\n",
                "moved to http://other/",
            ),
            (
                "HTTP/1.1 206 Part\r\nContent-Range: bytes 0-2/10\r\nContent-Length: 3\r\n\r\nabc",
                "other parts",
            ),
            ("HTTP/1.1 206 Part\r\nContent-Length: 3\r\n\r\nabc", "other parts"),
        ] {
            let address = upstream(move |_, stream| write(stream, answer));
            let client = Client::new(ANSWER_TIMEOUT, Arc::default());
            let problem = client.range(&address, 2, 4).unwrap_err();
            assert!(problem.contains(named), "{problem}");
            assert_eq!(client.counters.failed.load(Relaxed), 1, "{named}");
        }
    }

    #[test]
    fn an_upstream_that_fails_is_left_in_peace() {
        for answer in [
            "HTTP/1.1 500 Wrong\r\nContent-Length: 0\r\n\r\n",
            // Cut short.
            "HTTP/1.1 206 Part\r\nContent-Range: bytes 2-4/10\r\nContent-Length: 3\r\n\r\nc",
            // Too much.
            "HTTP/1.1 206 Part\r\nContent-Range: bytes 2-4/10\r\n\r\ncdefghijkl",
            "no HTTP at all",
        ] {
            let address = upstream(move |_, stream| write(stream, answer));
            let client = Client::new(ANSWER_TIMEOUT, Arc::default());
            client.range(&address, 2, 4).unwrap_err();
            assert_eq!(client.counters.failed.load(Relaxed), u64::from(TRIES), "{answer}");
            assert!(client.range(&address, 2, 4).unwrap_err().contains("left in peace"));
            assert_eq!(client.counters.spared.load(Relaxed), 1);
        }
    }

    #[test]
    fn an_upstream_that_says_nothing_is_not_waited_for() {
        let address = upstream(|_, stream| {
            // Until the client closes.
            let _ = stream.read(&mut [0]);
        });
        let client = Client::new(Duration::from_millis(50), Arc::default());
        let problem = client.range(&address, 2, 4).unwrap_err();
        assert!(problem.contains("timeout"), "{problem}");
        assert_eq!(*lock(&client.busy), 0);
    }
}
