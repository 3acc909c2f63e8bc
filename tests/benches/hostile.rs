//! What 500 hostile requests cost the server: the right 4xx (or a closed connection for what is no HTTP), none 5xx, by
//! the clock and in memory; slow ones shown out at the header time-out; a good tile after each. Linux, for the memory.
//! One JSON object a line; fails where an answer is wrong.

use anyhow::{Context, ensure};
use std::io::{Read as _, Write as _};
use std::net::TcpStream;
use std::time::{Duration, Instant};
use treeline_tests::measure::{forget_peak, median, memory, print, quantile};
use treeline_tests::program::Server;
use treeline_tests::raw_http::{Connection, counter};

#[path = "../../server/tests/process/hostile.rs"]
mod hostile;

const GOOD: &str = "/tiles/texture/WorldCRS84Quad/9/119/543?f=png";
const HEADER_TIMEOUT: u64 = 2;
/// Whoever sends so slowly never finishes in time.
const TRICKLE: Duration = Duration::from_millis(100);

fn main() -> anyhow::Result<()> {
    let folder = tempfile::tempdir()?;
    let configuration = folder.path().join("treeline.toml");
    std::fs::write(&configuration, format!("[limits]\nheader_timeout_seconds = {HEADER_TIMEOUT}\n"))?;
    let server = Server::start(&["--config", configuration.to_str().context("a path")?])?;
    hostile_ones(&server)?;
    slow_ones(&server)?;
    ensure!(counter(server.address(), "treeline_responses_total", "5xx")? == 0.0, "an answer was 5xx");
    Ok(())
}

fn hostile_ones(server: &Server) -> anyhow::Result<()> {
    let all = hostile::all();
    let mut milliseconds = Vec::new();
    let mut megabytes = Vec::new();
    let mut slowest = (0.0, "");
    let good = Connection::open(server.address())?.body(GOOD)?;
    // A first round, so that what is allocated once is.
    let mut wrong = Vec::new();
    for request in &all {
        wrong.extend(request.check(&request.send(server.address())?).err());
    }
    ensure!(wrong.is_empty(), "{}", wrong.join("\n"));
    let before = memory(server.id())?.now;
    for request in &all {
        forget_peak(server.id())?;
        let resident = memory(server.id())?.now;
        let start = Instant::now();
        let answer = request.send(server.address())?;
        let took = start.elapsed().as_secs_f64() * 1e3;
        request.check(&answer).map_err(anyhow::Error::msg)?;
        milliseconds.push(took);
        megabytes.push(memory(server.id())?.peak - resident);
        if took > slowest.0 {
            slowest = (took, &request.what);
        }
        // Well within the header time-out, and on a connection of its own: what came before has hurt nobody.
        ensure!(
            Connection::open(server.address())?.body(GOOD)? == good,
            "another tile after {}",
            request.what
        );
    }
    print("hostile requests", all.len() as f64, "");
    print("to the end of the answer, median", median(&milliseconds), "ms");
    print("to the end of the answer, 99th percentile", quantile(&milliseconds, 0.99), "ms");
    print("to the end of the answer, worst", slowest.0, "ms");
    print("memory for one, median", median(&megabytes), "MiB");
    print("memory for one, worst", quantile(&megabytes, 1.0), "MiB");
    print("memory for all, kept", memory(server.id())?.now - before, "MiB");
    println!("slowest: {}", slowest.1);
    Ok(())
}

/// Clients that send nothing, or a byte now and then: how long each keeps its place.
fn slow_ones(server: &Server) -> anyhow::Result<()> {
    let request = format!("GET {GOOD} HTTP/1.1\r\nHost: x\r\nX-Slow: {}", "x".repeat(1000));
    for (name, bytes) in [("silent", ""), ("a byte at a time", request.as_str())] {
        let address = server.address().to_owned();
        let seconds = Instant::now();
        let mut stream = TcpStream::connect(address)?;
        stream.set_nodelay(true)?;
        stream.set_read_timeout(Some(TRICKLE))?;
        let mut bytes = bytes.bytes();
        let mut answer = [0; 256];
        let closed = loop {
            if let Some(byte) = bytes.next()
                && stream.write_all(&[byte]).is_err()
            {
                break true;
            }
            match stream.read(&mut answer) {
                Ok(0) => break true,
                Ok(_) => {}
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
                Err(_) => break true,
            }
            if seconds.elapsed().as_secs() > 10 * HEADER_TIMEOUT {
                break false;
            }
        };
        ensure!(closed, "{name}: still connected");
        let took = seconds.elapsed().as_secs_f64();
        print(&format!("{name}: shown out after (header time-out {HEADER_TIMEOUT} s)"), took, "s");
        ensure!(took < HEADER_TIMEOUT as f64 + 1.0, "{name}: {took} s");
    }
    Connection::open(server.address())?.body(GOOD)?;
    Ok(())
}
