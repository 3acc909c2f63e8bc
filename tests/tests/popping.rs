//! Trees come out of the canopy without popping: some frames of an approach, beside the same with hard switches. The
//! whole approach is `cargo bench -p treeline-tests --bench popping`.

use treeline_client::engine::HandOver;
use treeline_tests::approach::{Approach, Flyer, Ground};
use treeline_tests::popping::{Jump, jump};
use treeline_tests::router_tiles::RouterTiles;

/// Frames at about a kilometre.
const FRAMES: std::ops::Range<usize> = 175..180;
/// A fading hand-over jumps by no more than this share of a hard one.
const SHARE: f64 = 0.3;

fn worst(tiles: &RouterTiles, approach: &Approach, ground: &Ground, hand_over: HandOver) -> (Jump, [u64; 2]) {
    let mut flyer = Flyer::new(tiles, hand_over).unwrap();
    let mut frames = Vec::new();
    for frame in FRAMES {
        frames.push(flyer.frame(approach.camera(Approach::distance(frame))).unwrap());
    }
    let jumps = frames.windows(2).map(|pair| jump(&pair[0], &pair[1], ground));
    let worst = jumps.reduce(Jump::worst).unwrap();
    (worst, [frames[0].trees, frames[frames.len() - 1].trees])
}

#[test]
fn trees_come_out_of_the_canopy_without_popping() {
    let tiles = RouterTiles::built_in().unwrap();
    let approach = Approach::new(&tiles).unwrap();
    let ground = approach.ground(&tiles).unwrap();
    let (faded, trees) = worst(&tiles, &approach, &ground, HandOver::Faded);
    let (hard, _) = worst(&tiles, &approach, &ground, HandOver::Hard);
    println!("faded {faded:?}, hard {hard:?}, trees {trees:?}");
    assert!(trees[0] > 150 && trees[1] > trees[0] + 30, "something is handed over: {trees:?}");
    assert!(faded.compared > 0.9 && hard.compared > 0.9);
    // Blocks of several trees hardly change in so few frames, whichever way.
    for (faded, hard) in faded.blocks.into_iter().zip(hard.blocks).take(2) {
        assert!(hard > 3.0 && faded <= SHARE * hard, "{faded} beside {hard}");
    }
}
