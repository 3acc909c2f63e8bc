//! `treeline health`.

use crate::cli::HealthArguments;
use crate::user_error::UserError;
use std::time::Duration;

/// Longest wait for an answer.
const LONGEST: Duration = Duration::from_secs(5);

/// Asks a running server whether it wants requests: for containers, which have no other program to ask with.
pub fn health(arguments: &HealthArguments) -> Result<(), UserError> {
    let url = format!("{}/readyz", arguments.url.trim_end_matches('/'));
    let request = ureq::get(&url).config().timeout_global(Some(LONGEST)).build();
    request.call().map(|_| ()).map_err(|error| {
        UserError::new(format!(
            "{url}: {error}; is the server there, and is it this address that it listens on?"
        ))
    })
}
