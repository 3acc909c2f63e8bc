//! Seasons, wind and clouds in a real browser: their shaders compile there, the page's controls move them, and a page
//! without a graphics card rests in the wind.

use anyhow::ensure;
use std::time::Duration;
use treeline_tests::browser::Browser;
use treeline_tests::picture;
use treeline_tests::program::Server;

/// Size of the picture: small enough for a software adapter.
const SIZE: (u32, u32) = (128, 96);
/// How long a software adapter on a busy machine may take for anything.
const PATIENCE: Duration = Duration::from_secs(180);

#[test]
fn browser_turns_with_the_year_and_rests_in_the_wind() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    let address = server.url("/?season=autumn&wind=6&clouds=0.4&trees=60");
    let mut page = browser.open(&address, SIZE.0, SIZE.1)?;
    page.settle()?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    let hash = page.evaluate("location.hash")?;
    ensure!(hash.as_str().is_some_and(|hash| hash.contains("-10-") && hash.contains("time=")), "{hash}");
    let autumn = page.picture()?;
    // Pictures are taken of a page that stands still.
    page.evaluate("window.treeline.resume()")?;

    let frames = "window.treeline.stats().page.frames_drawn";
    let before = page.evaluate(frames)?;
    std::thread::sleep(Duration::from_millis(700));
    ensure!(page.evaluate(frames)? == before, "frames were drawn while nobody moved");

    // By the panel.
    page.evaluate("document.getElementById('toggle').click()")?;
    page.evaluate("document.querySelector('#seasons [value=winter]').click()")?;
    let date = page.evaluate("document.getElementById('sun').value")?;
    ensure!(date.as_str().is_some_and(|date| date.contains("-01-")), "{date}");
    page.evaluate(
        "{ const clouds = document.getElementById('clouds'); clouds.value = 0; clouds.dispatchEvent(new Event('input')); }",
    )?;
    page.evaluate("document.getElementById('toggle').click()")?;
    page.settle()?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    let winter = page.picture()?;
    page.evaluate("window.treeline.resume()")?;
    let bright = |picture: &image::RgbaImage| {
        let sum: u64 = picture
            .pixels()
            .map(|pixel| pixel.0[..3].iter().map(|&value| u64::from(value)).sum::<u64>())
            .sum();
        sum as f64 / (3.0 * f64::from(picture.width() * picture.height()))
    };
    let difference = picture::difference(&autumn, &winter, 24);
    ensure!(difference.mean > 10.0, "the picture is another one: {difference:?}");
    ensure!(bright(&winter) > bright(&autumn) + 8.0, "snow lies: {} {}", bright(&autumn), bright(&winter));

    // Down among the trees, which sway: their models are grown now, which takes its time.
    page.evaluate(
        "window.treeline.setCamera({lon: 10.9358, lat: 46.907, height: 1460, heading_deg: 330, pitch_deg: -20})",
    )?;
    page.wait_for("window.treeline.stats().pipelines.includes('trees')", PATIENCE)?;
    page.evaluate("{ window.treeline.settled().then(() => { window.atRest = true; }); }")?;
    page.wait_for("window.atRest === true", PATIENCE)?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    Ok(())
}
