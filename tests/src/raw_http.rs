//! HTTP as plainly as can be, for the clock: one connection that is kept, one answer at a time, nothing decoded.

use anyhow::{Context, bail};
use std::io::{BufRead as _, BufReader, Read as _, Write as _};
use std::net::TcpStream;
use std::time::Duration;

/// An answer.
pub struct Answer {
    /// Status.
    pub status: u16,
    /// Status line and headers.
    pub head: String,
    /// As it came.
    pub body: Vec<u8>,
}

/// A connection that is kept.
pub struct Connection {
    stream: BufReader<TcpStream>,
}

impl Connection {
    /// Connects to `HOST:PORT`.
    pub fn open(address: &str) -> anyhow::Result<Self> {
        let stream = TcpStream::connect(address).with_context(|| format!("cannot connect to {address}"))?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(Duration::from_secs(120)))?;
        Ok(Self { stream: BufReader::new(stream) })
    }

    /// Asks, and does not wait for the answer.
    pub fn ask(&mut self, path: &str) -> anyhow::Result<()> {
        self.ask_with(path, "")
    }

    /// The same with further lines of headers, each with its end.
    pub fn ask_with(&mut self, path: &str, headers: &str) -> anyhow::Result<()> {
        let request = format!("GET {path} HTTP/1.1\r\nHost: x\r\n{headers}\r\n");
        Ok(self.stream.get_mut().write_all(request.as_bytes())?)
    }

    /// Reads the answer that comes next.
    pub fn answer(&mut self) -> anyhow::Result<Answer> {
        let mut head = String::new();
        while !head.ends_with("\r\n\r\n") {
            if self.stream.read_line(&mut head)? == 0 {
                bail!("the connection ended in the middle of an answer: {head:?}");
            }
        }
        let status = head.split(' ').nth(1).and_then(|status| status.parse().ok());
        let status: u16 = status.with_context(|| format!("no status in {head:?}"))?;
        let header = |wanted: &str| {
            head.lines().find_map(|line| {
                let (name, value) = line.split_once(':')?;
                name.eq_ignore_ascii_case(wanted).then(|| value.trim())
            })
        };
        let mut body = Vec::new();
        if header("transfer-encoding").is_some_and(|coding| coding == "chunked") {
            while self.chunk(&mut body)? {}
        } else if let Some(length) = header("content-length") {
            body.resize(length.parse().with_context(|| format!("a length in {head:?}"))?, 0);
            self.stream.read_exact(&mut body)?;
        }
        Ok(Answer { status, head, body })
    }

    /// Reads a part of a body in parts; whether another one follows.
    fn chunk(&mut self, body: &mut Vec<u8>) -> anyhow::Result<bool> {
        let mut line = String::new();
        self.stream.read_line(&mut line)?;
        let length =
            usize::from_str_radix(line.trim(), 16).with_context(|| format!("a length in {line:?}"))?;
        let before = body.len();
        body.resize(before + length + 2, 0);
        self.stream.read_exact(&mut body[before..])?;
        body.truncate(before + length);
        Ok(length > 0)
    }

    /// Asks and waits.
    pub fn get(&mut self, path: &str) -> anyhow::Result<Answer> {
        self.ask(path)?;
        self.answer()
    }

    /// The body of a good answer.
    pub fn body(&mut self, path: &str) -> anyhow::Result<Vec<u8>> {
        let answer = self.get(path)?;
        if answer.status != 200 {
            bail!("{path}: {}: {}", answer.status, String::from_utf8_lossy(&answer.body));
        }
        Ok(answer.body)
    }
}

/// The sum of a counter's values over all labels that hold `label`, from the server's `/metrics`.
pub fn counter(address: &str, name: &str, label: &str) -> anyhow::Result<f64> {
    let text = String::from_utf8(Connection::open(address)?.body("/metrics")?)?;
    let values = text.lines().filter_map(|line| {
        let rest = line.strip_prefix(name)?;
        let (labels, value) = rest.rsplit_once(' ')?;
        ((labels.is_empty() || labels.starts_with('{')) && labels.contains(label))
            .then(|| value.parse::<f64>())
    });
    let values = values.collect::<Result<Vec<f64>, _>>()?;
    if values.is_empty() {
        bail!("/metrics has no {name} with {label:?}");
    }
    Ok(values.iter().sum())
}
