//! MapServer, as it is run where it has to be fast: processes that stay (FastCGI), one for each core, behind nginx.

use std::path::Path;
use treeline_tests::raw_http::Connection;

const PROGRAM: &str = "/usr/lib/cgi-bin/mapserv";

/// It, with the scene's photo and heights.
pub struct MapServer {
    address: String,
    _processes: Vec<treeline_tests::program::Process>,
    _folder: tempfile::TempDir,
}

impl MapServer {
    /// Its address.
    pub fn address(&self) -> &str {
        &self.address
    }

    /// A connection to it.
    pub fn connect(&self) -> anyhow::Result<Connection> {
        Connection::open(&self.address)
    }

    /// `None`, after a word, where it is not installed.
    #[cfg(not(unix))]
    pub fn start(_: &Path, _: &Path) -> anyhow::Result<Option<Self>> {
        println!("skipped: no MapServer here");
        Ok(None)
    }

    /// `None`, after a word, where it is not installed.
    #[cfg(unix)]
    pub fn start(dem: &Path, photo: &Path) -> anyhow::Result<Option<Self>> {
        use anyhow::{Context, bail};
        use std::os::fd::OwnedFd;
        use std::os::unix::net::UnixListener;
        use std::process::{Command, Stdio};
        use treeline_tests::program::Process;

        if !Path::new(PROGRAM).exists() || Command::new("nginx").arg("-v").output().is_err() {
            println!("skipped: no MapServer (Debian: apt-get install cgi-mapserver nginx-light)");
            return Ok(None);
        }
        let folder = tempfile::tempdir()?;
        let path = |name: &str| folder.path().join(name);
        std::fs::write(path("conf"), "CONFIG\n  ENV\n    MS_MAP_PATTERN \".\"\n  END\nEND\n")?;
        std::fs::write(path("peer.map"), map_file(dem, photo))?;
        let socket = path("socket");
        let listener = UnixListener::bind(&socket)?;
        // nginx's own workers may be another user's.
        for (what, mode) in [(folder.path(), 0o755), (&socket, 0o777)] {
            std::fs::set_permissions(what, std::os::unix::fs::PermissionsExt::from_mode(mode))?;
        }
        let mut processes = Vec::new();
        for _ in 0..std::thread::available_parallelism()?.get() {
            // A FastCGI program finds the socket that it is to accept from where others have their input.
            let child = Command::new(PROGRAM)
                .env("MAPSERVER_CONFIG_FILE", path("conf"))
                .stdin(Stdio::from(OwnedFd::from(listener.try_clone()?)))
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .spawn()
                .context("MapServer")?;
            processes.push(Process::of(child));
        }
        let port = std::net::TcpListener::bind("127.0.0.1:0")?.local_addr()?.port();
        std::fs::write(path("nginx.conf"), configuration(folder.path(), &socket, port))?;
        let mut nginx = Command::new("nginx");
        nginx.arg("-e").arg(path("errors")).arg("-c").arg(path("nginx.conf"));
        processes.push(Process::start(&mut nginx)?);
        let address = format!("127.0.0.1:{port}");
        let start = std::time::Instant::now();
        while Connection::open(&address).is_err() {
            if start.elapsed().as_secs() > 10 {
                bail!("nginx does not listen");
            }
            std::thread::sleep(std::time::Duration::from_millis(20));
        }
        Ok(Some(Self { address, _processes: processes, _folder: folder }))
    }
}

#[cfg(unix)]
fn map_file(dem: &Path, photo: &Path) -> String {
    let layer = |name: &str, file: &Path| {
        format!(
            "  LAYER NAME \"{name}\" TYPE RASTER STATUS ON DATA \"{}\" PROCESSING \"RESAMPLE=BILINEAR\"\n    PROJECTION \"init=epsg:4326\" END METADATA \"wms_title\" \"{name}\" END\n  END\n",
            file.display()
        )
    };
    format!(
        "MAP\n  NAME \"peer\"\n  SIZE 512 512\n  EXTENT 114.08 22.15 114.3 22.3\n  PROJECTION \"init=epsg:4326\" END\n  \
         OUTPUTFORMAT NAME \"jpeg\" DRIVER \"AGG/JPEG\" MIMETYPE \"image/jpeg\" IMAGEMODE RGB FORMATOPTION \"QUALITY=85\" END\n  \
         OUTPUTFORMAT NAME \"png16\" DRIVER \"GDAL/PNG\" MIMETYPE \"image/png16\" IMAGEMODE INT16 END\n  \
         WEB METADATA \"wms_title\" \"peer\" \"wms_enable_request\" \"*\" \"wms_srs\" \"EPSG:4326\" \"wms_onlineresource\" \"http://localhost/\" END END\n\
         {}{}END\n",
        layer("photo", photo),
        layer("height", dem)
    )
}

#[cfg(unix)]
fn configuration(folder: &Path, socket: &Path, port: u16) -> String {
    let root = folder.display();
    format!(
        "daemon off; master_process off; pid {root}/pid; error_log {root}/errors;\n\
         events {{ worker_connections 1024; }}\n\
         http {{ access_log off; tcp_nodelay on; keepalive_requests 1000000;\n\
         client_body_temp_path {root}/a; proxy_temp_path {root}/b; fastcgi_temp_path {root}/c;\n\
         uwsgi_temp_path {root}/d; scgi_temp_path {root}/e;\n\
         server {{ listen 127.0.0.1:{port}; location / {{ fastcgi_pass unix:{}; fastcgi_buffers 64 64k;\n\
         fastcgi_param MS_MAPFILE {root}/peer.map; fastcgi_param QUERY_STRING $query_string;\n\
         fastcgi_param REQUEST_METHOD $request_method; }} }} }}\n",
        socket.display()
    )
}
