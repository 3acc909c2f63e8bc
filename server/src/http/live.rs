//! The application that answers now: it gives way to another when the data changes, between two requests.

use super::router;
use crate::state::AppState;
use axum::Router;
use std::sync::{Arc, PoisonError, RwLock};

/// What answers requests, shared by all connections.
#[derive(Clone)]
pub struct Live(Arc<RwLock<(AppState, Router)>>);

impl Live {
    /// Answers with an application.
    pub fn new(app: AppState) -> Self {
        let router = router(app.clone());
        Self(Arc::new(RwLock::new((app, router))))
    }

    /// The application that answers now.
    pub fn app(&self) -> AppState {
        self.0.read().unwrap_or_else(PoisonError::into_inner).0.clone()
    }

    /// Its routes.
    pub fn router(&self) -> Router {
        self.0.read().unwrap_or_else(PoisonError::into_inner).1.clone()
    }

    /// From the next request on another application answers; what has begun ends with the one before.
    pub fn replace(&self, app: AppState) {
        let next = (app.clone(), router(app));
        let before = std::mem::replace(&mut *self.0.write().unwrap_or_else(PoisonError::into_inner), next);
        // Its last tiles are written as it goes, which takes a moment: not under the lock.
        drop(before);
    }
}
