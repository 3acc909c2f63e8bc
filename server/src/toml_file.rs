//! Reading TOML that people write: every mistake is one line with the file, the line and the mend.

use crate::small_file::read_text;
use crate::user_error::{UserError, suggestion};
use serde::de::DeserializeOwned;
use std::path::Path;

/// Longest file that is read, bytes.
const MAXIMUM_BYTES: u64 = 4 << 20;

/// Reads and parses a file. Unknown keys (of types that deny them) are errors that name the key,
/// its line and the nearest key that there is.
pub fn read<T: DeserializeOwned>(path: &Path) -> Result<T, UserError> {
    let text = read_text(path, MAXIMUM_BYTES).map_err(|error| {
        UserError::new(format!("{}: cannot be read ({error}); name a TOML file", path.display()))
    })?;
    parse(&text, &path.display().to_string())
}

/// Parses a text; `name` stands for it in errors.
pub fn parse<T: DeserializeOwned>(text: &str, name: &str) -> Result<T, UserError> {
    toml::from_str(text).map_err(|error| {
        let line = error.span().map_or(1, |span| {
            1 + text.as_bytes()[..span.start.min(text.len())].iter().filter(|&&byte| byte == b'\n').count()
        });
        UserError::new(format!("{name}:{line}: {}", explain(error.message())))
    })
}

/// Turns serde's words about an unknown field into ours, with the nearest known key.
fn explain(message: &str) -> String {
    let Some(rest) = message.strip_prefix("unknown field `") else { return message.to_owned() };
    let mut quoted = rest.split('`');
    let key = quoted.next().unwrap_or_default();
    // What follows alternates between words and quoted keys: "…, expected one of `a`, `b`".
    let known: Vec<&str> = quoted.skip(1).step_by(2).collect();
    let near = suggestion(key, known.iter().copied());
    format!("unknown key \"{key}\"{near} (the keys here are: {})", known.join(", "))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[derive(Debug, serde::Deserialize)]
    #[serde(deny_unknown_fields)]
    struct Example {
        #[serde(default)]
        #[expect(dead_code, reason = "only the parser's errors are looked at")]
        listen: String,
        #[serde(default)]
        #[expect(dead_code, reason = "only the parser's errors are looked at")]
        threads: u32,
    }

    #[test]
    fn an_unknown_key_is_named_with_line_and_suggestion() {
        let error = parse::<Example>("threads = 2\nlisten_ = \"a\"\n", "t.toml").unwrap_err();
        assert_eq!(
            error.to_string(),
            "t.toml:2: unknown key \"listen_\"; did you mean \"listen\"? (the keys here are: listen, threads)"
        );
    }

    #[test]
    fn a_wrong_type_and_broken_syntax_are_one_line() {
        let wrong = parse::<Example>("\nthreads = \"two\"", "t.toml").unwrap_err().to_string();
        assert!(wrong.starts_with("t.toml:2: ") && !wrong.contains('\n'), "{wrong}");
        let broken = parse::<Example>("threads = = 2", "t.toml").unwrap_err().to_string();
        assert!(broken.starts_with("t.toml:1: ") && !broken.contains('\n'), "{broken}");
    }
}
