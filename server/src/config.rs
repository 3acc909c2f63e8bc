//! `treeline.toml`: how the server runs, as opposed to what it shows.

use crate::limits::Limits;
use crate::toml_file;
use crate::user_error::UserError;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// What the file may say; everything has a default, and flags win over the file.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct Config {
    /// Address and port to listen on; port 0 picks one. Default: 127.0.0.1:8080.
    pub listen: String,
    /// URL under which people reach the server, for links in documents. Default: the request's own host.
    pub public_url: Option<String>,
    /// Folder for tiles that outlive the process. Default: none.
    pub cache: Option<PathBuf>,
    /// What that folder may hold, MiB; tiles that were used least recently go. Default: 10240.
    pub disk_cache_mib: u64,
    /// Memory for made tiles and for requests that were answered before, MiB. Default: 256.
    pub memory_cache_mib: u64,
    /// Seconds between two looks at the scene's files; when they have changed, their new tiles are served. Default: 5;
    /// 0: never.
    pub watch_seconds: u64,
    /// Threads that make tiles. Default: 0, one for each core.
    pub worker_threads: usize,
    /// Bounds on requests.
    pub limits: Limits,
}

impl Default for Config {
    fn default() -> Self {
        Self {
            listen: "127.0.0.1:8080".to_owned(),
            public_url: None,
            cache: None,
            disk_cache_mib: 10_240,
            memory_cache_mib: 256,
            watch_seconds: 5,
            worker_threads: 0,
            limits: Limits::default(),
        }
    }
}

impl Config {
    /// Reads the file; a relative `cache` is relative to it.
    pub fn read(path: &Path) -> Result<Self, UserError> {
        let mut config: Self = toml_file::read(path)?;
        if let Some(cache) = &mut config.cache {
            *cache = path.parent().unwrap_or(Path::new("")).join(&cache);
        }
        config.check().map_err(|error| UserError::new(format!("{}: {error}", path.display())))?;
        Ok(config)
    }

    /// What is wrong with the values, or `Ok`.
    pub fn check(&self) -> Result<(), String> {
        self.limits.check()?;
        listen_address(&self.listen).map_err(|error| format!("listen {error}"))?;
        if self.worker_threads > 1024 {
            return Err(format!("worker_threads is {}; it must be at most 1024", self.worker_threads));
        }
        if self.memory_cache_mib > 1 << 20 {
            return Err(format!("memory_cache_mib is {}; it must be at most 1048576", self.memory_cache_mib));
        }
        if !(1..=1 << 30).contains(&self.disk_cache_mib) {
            return Err(format!("disk_cache_mib is {}; it must be 1 to 1073741824", self.disk_cache_mib));
        }
        if let Some(url) = &self.public_url {
            public_url(url).map_err(|error| format!("public_url {error}"))?;
        }
        Ok(())
    }

    /// Threads that make tiles.
    pub fn threads(&self) -> usize {
        match self.worker_threads {
            0 => std::thread::available_parallelism().map_or(2, usize::from),
            threads => threads,
        }
    }
}

/// An address to listen on: a host (a name or a number) and a port.
pub fn listen_address(text: &str) -> Result<String, String> {
    let port =
        text.rsplit_once(':').filter(|(host, _)| !host.is_empty()).map(|(_, port)| port.parse::<u16>());
    match port {
        Some(Ok(_)) => Ok(text.to_owned()),
        _ => Err(format!("\"{text}\" is no address and port; write for example 127.0.0.1:8080")),
    }
}

/// A public URL as links start with it: http or https, a host, no query, no slash at the end.
pub fn public_url(url: &str) -> Result<String, String> {
    let wrong =
        |what: &str| Err(format!("\"{url}\" {what}; write for example https://maps.example.org/treeline"));
    let Some(rest) = url.strip_prefix("https://").or_else(|| url.strip_prefix("http://")) else {
        return wrong("does not start with http:// or https://");
    };
    if rest.is_empty() || rest.starts_with('/') {
        return wrong("names no host");
    }
    if !url.bytes().all(|byte| byte.is_ascii_graphic() && !br#""<>\^`{|}?#&'"#.contains(&byte)) {
        return wrong("holds a character that does not belong in it");
    }
    Ok(url.trim_end_matches('/').to_owned())
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn defaults_are_sound_and_an_empty_file_is_the_defaults() {
        assert_eq!(toml_file::parse::<Config>("", "t"), Ok(Config::default()));
        assert_eq!(Config::default().check(), Ok(()));
        assert!(Config::default().threads() >= 1);
    }

    #[test]
    fn unknown_keys_are_errors_in_tables_too() {
        let error = toml_file::parse::<Config>("[limits]\nmaximum_widht = 3", "t.toml").unwrap_err();
        assert!(
            error
                .to_string()
                .starts_with("t.toml:2: unknown key \"maximum_widht\"; did you mean \"maximum_width\"?")
        );
    }

    #[test]
    fn public_urls() {
        assert_eq!(public_url("https://a.org/x/").as_deref(), Ok("https://a.org/x"));
        for wrong in
            ["a.org", "ftp://a.org", "https://", "https:///x", "http://a b", "http://a/?x", "http://a/<"]
        {
            assert!(public_url(wrong).unwrap_err().contains(wrong), "{wrong}");
        }
    }

    #[test]
    fn addresses_to_listen_on() {
        for right in ["127.0.0.1:0", "[::1]:8080", "localhost:80", "0.0.0.0:65535"] {
            assert_eq!(listen_address(right).as_deref(), Ok(right));
        }
        for wrong in ["", "5", ":80", "localhost", "127.0.0.1:99999", "127.0.0.1:-1", "host:x"] {
            assert!(listen_address(wrong).unwrap_err().contains("127.0.0.1:8080"), "{wrong}");
        }
        let error = Config { listen: "x".to_owned(), ..Config::default() }.check().unwrap_err();
        assert!(error.starts_with("listen \"x\""), "{error}");
    }

    #[test]
    fn a_relative_cache_belongs_to_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("treeline.toml");
        std::fs::write(&path, "cache = \"tiles\"").unwrap();
        assert_eq!(Config::read(&path).unwrap().cache, Some(folder.path().join("tiles")));
    }
}
