//! How fast what is in the cache goes out, beside nginx that sends the same bytes from its disk and a bare axum that has
//! them in memory: requests a second at 8 and 64 connections by wrk, in turns, medians; processor time a request;
//! answers 304. Wants wrk and nginx (Debian: `apt-get install wrk nginx-light`), and says so where they are not. One JSON
//! object a line.

use anyhow::{Context, bail};
use std::io::Read as _;
use std::path::{Path, PathBuf};
use std::process::Command;
use treeline_tests::measure::{median, print};
use treeline_tests::program::{Process, Server};

/// A photo tile of 512 × 512 as a map of any box.
const MAP: &str = "/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=texture&STYLES=&CRS=CRS:84&BBOX=11,46.9,11.05,46.95&WIDTH=512&HEIGHT=512&FORMAT=image/jpeg";
const ROUNDS: usize = 5;
const SECONDS: u32 = 3;

/// What wrk saw.
struct Load {
    requests_a_second: f64,
    /// 99th percentile, milliseconds.
    p99: f64,
    requests: f64,
}

fn load(url: &str, connections: u32, header: Option<&str>) -> anyhow::Result<Load> {
    let mut command = Command::new("wrk");
    command.args(["-t1", &format!("-c{connections}"), &format!("-d{SECONDS}"), "--latency"]);
    if let Some(header) = header {
        command.args(["-H", header]);
    }
    let output = command.arg(url).output().context("wrk")?;
    let text = String::from_utf8(output.stdout)?;
    if text.contains("Socket errors") || (header.is_none() && text.contains("Non-2xx")) {
        bail!("{url}: {text}");
    }
    let after = |label: &str| text.lines().find_map(|line| line.trim().strip_prefix(label)).map(str::trim);
    let p99 = after("99%").context("a 99th percentile")?;
    let milliseconds = [("us", 1e-3), ("ms", 1.0), ("s", 1e3)]
        .into_iter()
        .find_map(|(unit, scale)| Some(p99.strip_suffix(unit)?.parse::<f64>().ok()? * scale));
    let requests_a_second: f64 = after("Requests/sec:").context("requests")?.parse()?;
    Ok(Load {
        requests_a_second,
        p99: milliseconds.context("a time")?,
        requests: requests_a_second * f64::from(SECONDS),
    })
}

/// Processor time that a process has used, seconds.
fn processor_seconds(process: u32) -> anyhow::Result<f64> {
    let text = std::fs::read_to_string(format!("/proc/{process}/stat"))?;
    let fields: Vec<&str> = text.rsplit(") ").next().context("fields")?.split(' ').collect();
    // utime and stime, in hundredths.
    Ok((fields[11].parse::<f64>()? + fields[12].parse::<f64>()?) / 100.0)
}

/// Its workers do not end with it unless it is told to stop.
struct Nginx {
    folder: PathBuf,
    process: Process,
}

impl Nginx {
    fn command(folder: &Path) -> Command {
        let mut command = Command::new("nginx");
        command.arg("-e").arg(folder.join("errors")).arg("-c").arg(folder.join("nginx.conf"));
        command
    }
}

impl Drop for Nginx {
    fn drop(&mut self) {
        if Self::command(&self.folder).args(["-s", "stop"]).status().is_ok_and(|status| status.success()) {
            let _ = self.process.child().wait();
        }
    }
}

fn nginx(folder: &Path, port: u16) -> anyhow::Result<Nginx> {
    let root = folder.display();
    let configuration = format!(
        "daemon off; worker_processes 2; pid {root}/pid; error_log {root}/errors;\n\
         events {{ worker_connections 1024; }}\n\
         http {{ access_log off; sendfile on; tcp_nopush on; tcp_nodelay on; keepalive_requests 10000000; etag on;\n\
         types {{ image/jpeg jpg; }} client_body_temp_path {root}/a; proxy_temp_path {root}/b; fastcgi_temp_path {root}/c;\n\
         uwsgi_temp_path {root}/d; scgi_temp_path {root}/e;\n\
         server {{ listen 127.0.0.1:{port}; root {root}/www; }} }}\n"
    );
    std::fs::write(folder.join("nginx.conf"), configuration)?;
    let process = Process::start(&mut Nginx::command(folder))?;
    wait_for(&process, port)?;
    Ok(Nginx { folder: folder.to_owned(), process })
}

/// The argument by which this program is the bare axum: a file and a port follow.
const BARE: &str = "--bare";

/// Answers everything with a file's bytes, until it is killed.
fn bare_axum(file: &str, port: u16) -> anyhow::Result<()> {
    let body = axum::body::Bytes::from(std::fs::read(file)?);
    let answer = move || async move { ([("content-type", "image/jpeg")], body.clone()) };
    tokio::runtime::Builder::new_multi_thread().enable_all().build()?.block_on(async {
        let listener = tokio::net::TcpListener::bind(("127.0.0.1", port)).await?;
        axum::serve(listener, axum::Router::new().fallback(answer)).await
    })?;
    Ok(())
}

fn free_port() -> anyhow::Result<u16> {
    Ok(std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?.port())
}

fn wait_for(process: &Process, port: u16) -> anyhow::Result<()> {
    let start = std::time::Instant::now();
    while std::net::TcpStream::connect(("127.0.0.1", port)).is_err() {
        if start.elapsed().as_secs() > 10 {
            bail!("nobody listens on port {port}: {}", process.errors().join("\n"));
        }
        std::thread::sleep(std::time::Duration::from_millis(20));
    }
    Ok(())
}

fn main() -> anyhow::Result<()> {
    let arguments: Vec<String> = std::env::args().collect();
    if let Some(at) = arguments.iter().position(|argument| argument == BARE) {
        return bare_axum(
            arguments.get(at + 1).context("a file")?,
            arguments.get(at + 2).context("a port")?.parse()?,
        );
    }
    if ["wrk", "nginx"].iter().any(|program| Command::new(program).arg("-v").output().is_err()) {
        eprintln!("skipped: wants wrk and nginx (Debian: apt-get install wrk nginx-light)");
        return Ok(());
    }
    let server = Server::start(&[])?;
    let url = server.url(MAP);
    let mut answer = ureq::get(&url).call()?;
    let tag = answer.headers().get("etag").context("a tag")?.to_str()?.to_owned();
    let mut body = Vec::new();
    answer.body_mut().as_reader().read_to_end(&mut body)?;
    let folder = tempfile::tempdir()?;
    std::fs::create_dir(folder.path().join("www"))?;
    std::fs::write(folder.path().join("www/tile.jpg"), &body)?;
    // nginx's own workers may be another user's.
    #[cfg(unix)]
    std::fs::set_permissions(folder.path(), std::os::unix::fs::PermissionsExt::from_mode(0o755))?;
    let port = free_port()?;
    let _nginx = nginx(folder.path(), port)?;
    let file = format!("http://127.0.0.1:{port}/tile.jpg");
    let bare_port = free_port()?;
    let tile = folder.path().join("www/tile.jpg");
    let mut command = Command::new(std::env::current_exe()?);
    let bare = Process::start(command.arg(BARE).arg(tile).arg(bare_port.to_string()))?;
    wait_for(&bare, bare_port)?;
    let bare = format!("http://127.0.0.1:{bare_port}/");
    print("the tile", body.len() as f64, "B");
    for connections in [8, 64] {
        let (mut ratios, mut own, mut others) = (Vec::new(), Vec::new(), Vec::new());
        let (mut bare_ratios, mut p99, mut p99_ratios) = (Vec::new(), Vec::new(), Vec::new());
        let before = processor_seconds(server.id())?;
        let mut requests = 0.0;
        for _ in 0..ROUNDS {
            let theirs = load(&file, connections, None)?;
            let ours = load(&url, connections, None)?;
            requests += ours.requests;
            ratios.push(ours.requests_a_second / theirs.requests_a_second);
            own.push(ours.requests_a_second);
            others.push(theirs.requests_a_second);
            p99.push(ours.p99);
            let theirs = load(&bare, connections, None)?;
            bare_ratios.push(theirs.requests_a_second / others[others.len() - 1]);
            p99_ratios.push(ours.p99 / theirs.p99);
        }
        let used = processor_seconds(server.id())? - before;
        let of = |what: &str| format!("{connections} connections: {what}");
        print(&of("requests a second"), median(&own), "1/s");
        print(&of("nginx's"), median(&others), "1/s");
        print(&of("over nginx's"), median(&ratios), "ratio");
        print(&of("a bare axum over nginx"), median(&bare_ratios), "ratio");
        print(&of("99th percentile"), median(&p99), "ms");
        print(&of("99th percentile over a bare axum's"), median(&p99_ratios), "ratio");
        print(&of("processor time a request"), used / requests * 1e6, "us");
    }
    // Without memory, each answer is read from the folder of the cache.
    let kept = tempfile::tempdir()?;
    let configuration = kept.path().join("treeline.toml");
    std::fs::write(&configuration, "memory_cache_mib = 0\n")?;
    let (cache, configuration) = (kept.path().join("cache"), configuration.display().to_string());
    let cache = cache.display().to_string();
    let from_disk = Server::start(&["--config", &configuration, "--cache", &cache])?;
    let disk_url = from_disk.url(MAP);
    ureq::get(&disk_url).call()?;
    // It is written after it has been answered.
    std::thread::sleep(std::time::Duration::from_secs(2));
    for connections in [8, 64] {
        let before = processor_seconds(from_disk.id())?;
        let (mut ratios, mut requests) = (Vec::new(), 0.0);
        for _ in 0..ROUNDS {
            let from_memory = load(&url, connections, None)?;
            let from_folder = load(&disk_url, connections, None)?;
            requests += from_folder.requests;
            ratios.push(from_folder.requests_a_second / from_memory.requests_a_second);
        }
        let used = processor_seconds(from_disk.id())? - before;
        print(
            &format!("from the folder, {connections} connections: over from memory"),
            median(&ratios),
            "ratio",
        );
        print(
            &format!("from the folder, {connections} connections: processor time a request"),
            used / requests * 1e6,
            "us",
        );
    }
    drop(from_disk);
    let mut their_tag = ureq::get(&file).call()?;
    let their_tag = their_tag.headers_mut().remove("etag").context("nginx's tag")?.to_str()?.to_owned();
    let (mut ratios, mut requests) = (Vec::new(), 0.0);
    let before = processor_seconds(server.id())?;
    for _ in 0..ROUNDS {
        let theirs = load(&file, 8, Some(&format!("If-None-Match: {their_tag}")))?;
        let ours = load(&url, 8, Some(&format!("If-None-Match: {tag}")))?;
        requests += ours.requests;
        ratios.push(ours.requests_a_second / theirs.requests_a_second);
    }
    let used = processor_seconds(server.id())? - before;
    print("304, 8 connections: over nginx's", median(&ratios), "ratio");
    print("304: processor time a request", used / requests * 1e6, "us");
    Ok(())
}
