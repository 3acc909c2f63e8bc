//! Undergrowth in a real browser: its shaders compile there with seasons and wind, the page counts what grows, and the
//! address switches it off.

use anyhow::ensure;
use std::time::Duration;
use treeline_tests::browser::Browser;
use treeline_tests::picture;
use treeline_tests::program::Server;

/// Size of the picture: small enough for a software adapter.
const SIZE: (u32, u32) = (128, 96);
/// How long a software adapter on a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(180);
/// An alp, 1.7 m above the ground.
const ALP: &str = "camera=11.07084,46.95368,2043.95,200,-8";

#[test]
fn browser_grows_a_meadow_and_leaves_it_out() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let open = |query: &str| browser.open(&server.url(&format!("/?trees=60&{query}#{ALP}")), SIZE.0, SIZE.1);

    let mut page = open("undergrowth=30&season=spring&wind=5&clouds=0.3")?;
    page.settle()?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    page.wait_for("(window.treeline.stats().undergrowth ?? {}).plants > 20", PATIENCE)?;
    let pipelines = page.evaluate("window.treeline.stats().pipelines.join()")?;
    ensure!(
        pipelines.as_str().is_some_and(|names| names.contains("select_undergrowth,undergrowth")),
        "{pipelines}"
    );
    let meadow = page.picture()?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);

    let mut page = open("undergrowth=0&season=spring&wind=5&clouds=0.3")?;
    page.settle()?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    let stats = page.evaluate("JSON.stringify(window.treeline.stats())")?;
    ensure!(stats.as_str().is_some_and(|stats| !stats.contains("undergrowth")), "{stats}");
    let bare = page.picture()?;
    let difference = picture::difference(&meadow, &bare, 12);
    ensure!(difference.share_over > 0.1, "grass is seen: {difference:?}");
    Ok(())
}
