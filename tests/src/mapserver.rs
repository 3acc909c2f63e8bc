//! A MapServer as an upstream, which can be made to misbehave: one CGI process for each request, behind a few lines of HTTP.

use anyhow::Context;
use std::io::{BufRead, BufReader, Write};
use std::net::{TcpListener, TcpStream};
use std::path::Path;
use std::process::{Command, Stdio};
use std::sync::atomic::{AtomicU8, AtomicU64, Ordering::SeqCst};
use std::sync::{Arc, mpsc};
use std::time::Duration;

/// Where Debian has it.
pub const PROGRAM: &str = "/usr/lib/cgi-bin/mapserv";

/// How the upstream is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Mood {
    /// As MapServer answers.
    Well,
    /// The same, [`SLOWNESS`] later.
    Slow,
    /// 200, and no picture but an exception.
    Wrong,
    /// 200, and bytes without end.
    Huge,
    /// The connection is closed without an answer.
    Gone,
}

/// How much later a slow answer comes.
pub const SLOWNESS: Duration = Duration::from_millis(1_500);
/// Bytes after which even the endless answer ends.
const HUGE_BYTES: usize = 256 << 20;
const MOODS: [Mood; 5] = [Mood::Well, Mood::Slow, Mood::Wrong, Mood::Huge, Mood::Gone];
/// CGI processes at once.
const WORKERS: usize = 3;

/// The upstream.
pub struct MapServer {
    address: String,
    mood: Arc<AtomicU8>,
    /// Bytes written of endless answers.
    wasted: Arc<AtomicU64>,
    _folder: tempfile::TempDir,
}

impl MapServer {
    /// Serves the layers of a map file; `None`, after a word, where MapServer is not installed.
    ///
    /// # Errors
    /// Where files cannot be written, or nothing can listen.
    pub fn start(map_file: &str) -> anyhow::Result<Option<Self>> {
        if !Path::new(PROGRAM).exists() {
            println!("skipped: no MapServer (Debian: apt-get install cgi-mapserver)");
            return Ok(None);
        }
        let folder = tempfile::tempdir()?;
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("conf"), "CONFIG\n  ENV\n    MS_MAP_PATTERN \".\"\n  END\nEND\n")?;
        std::fs::write(path("upstream.map"), map_file)?;
        let listener = TcpListener::bind("127.0.0.1:0")?;
        let address = listener.local_addr()?.to_string();
        let (mood, wasted) = (Arc::new(AtomicU8::new(0)), Arc::new(AtomicU64::new(0)));
        let (sender, receiver) = mpsc::channel::<TcpStream>();
        let receiver = Arc::new(std::sync::Mutex::new(receiver));
        for _ in 0..WORKERS {
            let (receiver, mood, wasted) = (receiver.clone(), mood.clone(), wasted.clone());
            let (map, configuration) = (path("upstream.map"), path("conf"));
            std::thread::spawn(move || {
                loop {
                    let next = receiver.lock().ok().and_then(|receiver| receiver.recv().ok());
                    let Some(stream) = next else { return };
                    // Whoever hangs up is of no interest.
                    let _ =
                        answer(stream, &map, &configuration, MOODS[usize::from(mood.load(SeqCst))], &wasted);
                }
            });
        }
        std::thread::spawn(move || {
            for stream in listener.incoming().flatten() {
                if sender.send(stream).is_err() {
                    return;
                }
            }
        });
        Ok(Some(Self { address, mood, wasted, _folder: folder }))
    }

    /// Address of a layer's maps in a format.
    pub fn layer(&self, name: &str, format: &str) -> String {
        format!("http://{}/?LAYERS={name}&FORMAT={format}", self.address)
    }

    /// From now on.
    pub fn be(&self, mood: Mood) {
        self.mood.store(mood as u8, SeqCst);
    }

    /// Bytes that anybody took of answers without end.
    pub fn wasted(&self) -> u64 {
        self.wasted.load(SeqCst)
    }
}

fn answer(
    mut stream: TcpStream,
    map: &Path,
    configuration: &Path,
    mood: Mood,
    wasted: &AtomicU64,
) -> anyhow::Result<()> {
    let mut reader = BufReader::new(stream.try_clone()?);
    let mut first = String::new();
    reader.read_line(&mut first)?;
    let mut line = String::new();
    while reader.read_line(&mut line)? > 2 {
        line.clear();
    }
    let query = first.split(' ').nth(1).and_then(|path| path.split_once('?')).map_or("", |(_, query)| query);
    match mood {
        Mood::Well => {}
        Mood::Slow => std::thread::sleep(SLOWNESS),
        Mood::Wrong => {
            let body = "<ServiceExceptionReport><ServiceException>disk full</ServiceException></ServiceExceptionReport>";
            write!(
                stream,
                "HTTP/1.1 200 OK\r\nContent-Type: application/vnd.ogc.se_xml\r\nContent-Length: {}\r\nConnection: close\r\n\r\n{body}",
                body.len()
            )?;
            return Ok(());
        }
        Mood::Huge => {
            write!(stream, "HTTP/1.1 200 OK\r\nContent-Type: image/png\r\nConnection: close\r\n\r\n")?;
            let block = vec![0x89; 1 << 16];
            for _ in 0..HUGE_BYTES / block.len() {
                stream.write_all(&block)?;
                wasted.fetch_add(block.len() as u64, SeqCst);
            }
            return Ok(());
        }
        Mood::Gone => return Ok(()),
    }
    let output = Command::new(PROGRAM)
        .env("QUERY_STRING", query)
        .env("REQUEST_METHOD", "GET")
        .env("MS_MAPFILE", map)
        .env("MAPSERVER_CONFIG_FILE", configuration)
        .stdin(Stdio::null())
        .stderr(Stdio::null())
        .output()
        .context("MapServer")?;
    let end = output.stdout.windows(4).position(|four| four == b"\r\n\r\n").context("a CGI head")?;
    let (head, body) = (&output.stdout[..end], &output.stdout[end + 4..]);
    write!(stream, "HTTP/1.1 200 OK\r\nContent-Length: {}\r\nConnection: close\r\n", body.len())?;
    stream.write_all(head)?;
    stream.write_all(b"\r\n\r\n")?;
    Ok(stream.write_all(body)?)
}
