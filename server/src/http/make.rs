//! From HTTP's words to the recipes' and back.

use crate::cache::MakeError;
use crate::http::order::Order;
use crate::recipe::{self, RecipeError};
use crate::scene::Scene;
use crate::source::SourceError;

/// Makes the bytes of an order: work for a worker, not for an async thread.
pub fn make(scene: &Scene, order: &Order) -> Result<Vec<u8>, MakeError> {
    recipe::make(scene, order.request()).map_err(make_error)
}

/// Whose fault it is, and the line that says what.
pub fn make_error(error: RecipeError) -> MakeError {
    let line = error.to_string();
    if error.is_request() {
        return MakeError::Refused(line);
    }
    if let RecipeError::Source(SourceError::Upstream { .. }) = error {
        tracing::warn!("{line}");
        return MakeError::Upstream(line);
    }
    tracing::error!("{line}");
    MakeError::Failed(line)
}
