//! Seasons, wind and clouds in a real browser: their shaders compile there, the page's controls move them, and a page
//! without a graphics card rests in the wind.

use anyhow::ensure;
use std::time::Duration;
use treeline_tests::browser::Browser;
use treeline_tests::picture;
use treeline_tests::program::Server;

/// Size of the picture: small enough for a software adapter.
const SIZE: (u32, u32) = (192, 144);

#[test]
fn browser_turns_with_the_year_and_rests_in_the_wind() -> anyhow::Result<()> {
    let server = Server::start(&[])?;
    let browser = Browser::start()?;
    // Among trees, with all that the weather has.
    let view = "#camera=10.9358,46.907,1485,330,-10";
    let address = server.url(&format!("/?season=autumn&wind=6&clouds=0.4&trees=250{view}"));
    let mut page = browser.open(&address, SIZE.0, SIZE.1)?;
    page.settle()?;
    ensure!(page.complaints()?.is_empty(), "{:?}", page.complaints()?);
    let hash = page.evaluate("location.hash")?;
    ensure!(hash.as_str().is_some_and(|hash| hash.contains("-10-") && hash.contains("time=")), "{hash}");
    let pipelines = page.evaluate("window.treeline.stats().pipelines.join()")?;
    ensure!(pipelines.as_str().is_some_and(|names| names.contains("trees")), "{pipelines}");
    let autumn = page.picture()?;

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
    let blue = |picture: &image::RgbaImage| {
        let sums = picture
            .pixels()
            .fold([0_u64; 2], |[red, blue], pixel| [red + u64::from(pixel[0]), blue + u64::from(pixel[2])]);
        sums[1] as f64 / sums[0] as f64
    };
    let difference = picture::difference(&autumn, &winter, 24);
    ensure!(difference.mean > 10.0, "the picture is another one: {difference:?}");
    ensure!(blue(&winter) > blue(&autumn), "gold gives way to snow: {} {}", blue(&autumn), blue(&winter));
    Ok(())
}
