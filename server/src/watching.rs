//! Notices that the files of a scene changed, and opens it anew.

use crate::cli::SceneArguments;
use crate::http::Live;
use crate::opening::open;
use crate::revision::revision;
use crate::state::App;
use crate::user_error::UserError;
use std::sync::Arc;
use std::time::Duration;

/// Looks at the files again and again, for as long as the server runs. A change counts when two looks agree: a file
/// that is being copied changes all the time.
pub async fn watch(scene: SceneArguments, live: Live, interval: Duration) {
    let mut seen: Option<String> = None;
    loop {
        tokio::time::sleep(interval).await;
        let now = look(scene.clone()).await;
        let current = live.app().scene.revision.clone();
        let changed = match now {
            Ok(revision) => Some(revision).filter(|revision| *revision != current),
            Err(error) => {
                // Whoever replaces a file may take it away first.
                tracing::debug!("the scene's files cannot be looked at ({error})");
                None
            }
        };
        let settled = changed.is_some() && changed == seen;
        seen = changed;
        if !settled {
            continue;
        }
        match reopen(scene.clone(), live.clone()).await {
            Ok(revision) => tracing::info!("the scene's files changed: now serving revision {revision}"),
            // Said once; the next change is another revision.
            Err(error) => {
                tracing::warn!(
                    "the scene's files changed, and it cannot be opened any more ({error}); going on as before"
                );
                wait_for_another(&scene, seen.take(), interval).await;
            }
        }
    }
}

/// The revision of the files as they are.
async fn look(scene: SceneArguments) -> Result<String, UserError> {
    blocking(move || revision(scene.scene_file()?.as_ref())).await
}

async fn reopen(scene: SceneArguments, live: Live) -> Result<String, UserError> {
    blocking(move || {
        let scene = Arc::new(open(&scene)?);
        let revision = scene.revision.clone();
        live.replace(App::reopened(scene, &live.app())?);
        Ok(revision)
    })
    .await
}

/// Waits while the files are those that could not be opened.
async fn wait_for_another(scene: &SceneArguments, failed: Option<String>, interval: Duration) {
    while look(scene.clone()).await.ok() == failed {
        tokio::time::sleep(interval).await;
    }
}

async fn blocking<T: Send + 'static>(
    work: impl FnOnce() -> Result<T, UserError> + Send + 'static,
) -> Result<T, UserError> {
    tokio::task::spawn_blocking(work)
        .await
        .unwrap_or_else(|error| Err(UserError::new(format!("looking at the scene's files failed ({error})"))))
}
