//! What the person who started the program did wrong, in one line with its mend.

use crate::source::SourceError;

/// One line that names the flag, file or key, says what is wrong and what mends it.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
#[error("{0}")]
pub struct UserError(String);

impl UserError {
    /// The error; line breaks in the text become spaces, so that it stays one line.
    pub fn new(text: impl AsRef<str>) -> Self {
        Self(text.as_ref().split_whitespace().collect::<Vec<_>>().join(" "))
    }
}

impl From<SourceError> for UserError {
    fn from(error: SourceError) -> Self {
        Self::new(error.to_string())
    }
}

/// `; did you mean "x"?` for the candidate nearest to `wrong`, or nothing where none is near.
pub fn suggestion<'a>(wrong: &str, candidates: impl IntoIterator<Item = &'a str>) -> String {
    let similar = |candidate: &&str| strsim::jaro_winkler(&wrong.to_lowercase(), &candidate.to_lowercase());
    candidates
        .into_iter()
        .map(|candidate| (similar(&candidate), candidate))
        .filter(|(score, _)| *score > 0.75)
        .max_by(|a, b| a.0.total_cmp(&b.0))
        .map(|(_, candidate)| format!("; did you mean \"{candidate}\"?"))
        .unwrap_or_default()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn it_is_one_line() {
        assert_eq!(UserError::new("a\n  b\tc").to_string(), "a b c");
    }

    #[test]
    fn near_matches_only() {
        assert_eq!(suggestion("phto", ["dem", "photo"]), "; did you mean \"photo\"?");
        assert_eq!(suggestion("zzz", ["dem", "photo"]), "");
    }
}
