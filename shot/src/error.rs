//! What went wrong, in one line, and whose it is to mend.

use treeline_client::headless::HeadlessError;

/// Why there is no picture.
#[derive(Clone, Debug, PartialEq, Eq, thiserror::Error)]
pub enum ShotError {
    /// A flag, a file or a key is wrong.
    #[error("{0}")]
    Input(String),
    /// Everything was right, and it still failed: the GPU, a server, the disk.
    #[error("{0}")]
    Failure(String),
}

impl ShotError {
    /// 2 for what the caller can mend, 1 otherwise.
    pub fn exit_code(&self) -> u8 {
        match self {
            Self::Input(_) => 2,
            Self::Failure(_) => 1,
        }
    }

    /// One about the caller's input; line breaks become spaces.
    pub fn input(text: impl std::fmt::Display) -> Self {
        Self::Input(one_line(&text.to_string()))
    }

    /// One about everything else.
    pub fn failure(text: impl std::fmt::Display) -> Self {
        Self::Failure(one_line(&text.to_string()))
    }
}

impl From<HeadlessError> for ShotError {
    fn from(error: HeadlessError) -> Self {
        match &error {
            HeadlessError::TooLarge(..) => Self::input(format!("--{error}")),
            _ => Self::failure(error),
        }
    }
}

fn one_line(text: &str) -> String {
    text.split_whitespace().collect::<Vec<_>>().join(" ")
}
