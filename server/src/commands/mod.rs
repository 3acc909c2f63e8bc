//! The commands of the program, one file each.

mod check;
mod health;
mod seed;
mod serve;

pub use check::check;
pub use health::health;
pub use seed::seed;
pub use serve::serve;

use crate::cli::ServeArguments;
use crate::config::Config;
use crate::user_error::UserError;

/// Settings from the file and the flags; flags win.
pub fn config(arguments: &ServeArguments) -> Result<Config, UserError> {
    let mut config = match &arguments.config {
        Some(path) => Config::read(path)?,
        None => Config::default(),
    };
    if let Some(listen) = &arguments.listen {
        config.listen.clone_from(listen);
    }
    if arguments.public_url.is_some() {
        config.public_url.clone_from(&arguments.public_url);
    }
    if arguments.cache.is_some() {
        config.cache.clone_from(&arguments.cache);
    }
    Ok(config)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn flags_win_over_the_file() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("treeline.toml");
        std::fs::write(&path, "listen = \"0.0.0.0:80\"\nmemory_cache_mib = 7").unwrap();
        let mut arguments = ServeArguments { config: Some(path), ..ServeArguments::default() };
        assert_eq!(config(&arguments).unwrap().listen, "0.0.0.0:80");
        arguments.listen = Some("127.0.0.1:0".to_owned());
        let merged = config(&arguments).unwrap();
        assert_eq!((merged.listen.as_str(), merged.memory_cache_mib), ("127.0.0.1:0", 7));
    }
}
