//! A server that is killed while it makes and keeps tiles, and started again: for a test and, with more rounds and the
//! clock beside them, a bench.

use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::path::Path;
use std::process::Child;
use std::sync::atomic::{AtomicUsize, Ordering::SeqCst};
use std::time::{Duration, Instant};

/// Those who ask at once.
const CLIENTS: usize = 4;

/// Starts a server with arguments; gives its address, too.
pub type Start<'a> = &'a dyn Fn(&[&str]) -> (Child, String);

/// What was seen of one round.
#[derive(Debug, Default)]
pub struct Round {
    /// Tiles that somebody had received whole when the server died.
    pub answered: usize,
    /// Tiles that were finished by then: the file had its name.
    pub finished: usize,
    /// Those of them that the next server had to make again.
    pub lost: usize,
    /// Answers of either server that were not the right bytes.
    pub wrong: usize,
    /// The first answer of a server whose folder is empty, and of the one after the kill: a tile that nobody has
    /// asked for before.
    pub first: [Duration; 2],
}

/// The body of a whole answer with status 200; `None` where there is none.
pub fn ask(address: &str, path: &str) -> Option<Vec<u8>> {
    let mut stream = TcpStream::connect(address).ok()?;
    write!(stream, "GET {path} HTTP/1.1\r\nHost: x\r\nConnection: close\r\n\r\n").ok()?;
    let mut answer = Vec::new();
    stream.read_to_end(&mut answer).ok()?;
    let end = answer.windows(4).position(|window| window == b"\r\n\r\n")?;
    let head = String::from_utf8_lossy(&answer[..end]).to_ascii_lowercase();
    let length =
        head.lines().find_map(|line| line.strip_prefix("content-length: ")?.parse::<usize>().ok())?;
    let body = answer.split_off(end + 4);
    (head.starts_with("http/1.1 200") && body.len() == length).then_some(body)
}

/// Number of whole tiles in the cache's folder.
fn finished(folder: &Path) -> usize {
    let entries = std::fs::read_dir(folder).map(|entries| entries.filter_map(Result::ok).collect());
    let entries: Vec<std::fs::DirEntry> = entries.unwrap_or_default();
    let of = |entry: &std::fs::DirEntry| {
        let path = entry.path();
        if path.is_dir() {
            finished(&path)
        } else {
            usize::from(path.extension().is_some_and(|e| e == "tile"))
        }
    };
    entries.iter().map(of).sum()
}

/// Starts a server with an empty folder, has clients ask for the tiles, kills it after `life`, starts the next and asks
/// it for all. `tiles` are paths and the right answers; `fresh` are two more paths, one for either server's first.
pub fn round(
    start: Start,
    arguments: &[&str],
    tiles: &[(String, Vec<u8>)],
    fresh: [&str; 2],
    life: Duration,
) -> Round {
    let folder = tempfile::tempdir().expect("a folder");
    let path = folder.path().to_str().expect("a path").to_owned();
    let arguments = [arguments, &["--cache", &path]].concat();
    let timed = |address: &str, path: &str| {
        let start = Instant::now();
        ask(address, path).expect("a fresh tile");
        start.elapsed()
    };
    let (mut server, address) = start(&arguments);
    let first = timed(&address, fresh[0]);
    let (next, answered, wrong) = (AtomicUsize::new(0), AtomicUsize::new(0), AtomicUsize::new(0));
    std::thread::scope(|scope| {
        for _ in 0..CLIENTS {
            scope.spawn(|| {
                while let Some((path, right)) = tiles.get(next.fetch_add(1, SeqCst)) {
                    let Some(body) = ask(&address, path) else { break };
                    answered.fetch_add(1, SeqCst);
                    wrong.fetch_add(usize::from(&body != right), SeqCst);
                }
            });
        }
        std::thread::sleep(life);
        // SIGKILL: nothing that it could act on.
        server.kill().expect("a process to kill");
        server.wait().expect("its end");
    });
    let finished = finished(folder.path());
    let (mut server, address) = start(&arguments);
    let first = [first, timed(&address, fresh[1])];
    let again = tiles.iter().filter(|(path, right)| ask(&address, path).as_ref() != Some(right)).count();
    // The one other tile that may be in the folder.
    ask(&address, fresh[0]).expect("a tile");
    let metrics = String::from_utf8(ask(&address, "/metrics").expect("metrics")).expect("text");
    let from_disk = |line: &str| {
        let (_, count) = line.strip_prefix("treeline_tiles_total{")?.split_once("outcome=\"disk\"} ")?;
        count.parse::<usize>().ok()
    };
    let from_disk: usize = metrics.lines().filter_map(from_disk).sum();
    server.kill().expect("a process to kill");
    server.wait().expect("its end");
    Round {
        answered: answered.into_inner(),
        finished,
        lost: finished.saturating_sub(from_disk),
        wrong: wrong.into_inner() + again,
        first,
    }
}
