//! A camera in flight over tiles that have all come: reading maps, choosing tiles and planning allocate nothing.

#[path = "../benches/support/mod.rs"]
mod support;

use support::{Counting, Flight, Map};

#[global_allocator]
static ALLOCATOR: Counting = Counting::new();

/// The only test of this program: another one's allocations would be counted too.
#[test]
fn a_flight_over_what_is_here_allocates_nothing() {
    let mut flight = Flight::new();
    let maps: Vec<Map> = (0..20).map(|step| flight.map(f64::from(step))).collect();
    for map in &maps {
        flight.fill(map);
    }
    assert!(flight.stream.progress().0 > 60, "{:?}", flight.stream.progress());
    // Twice over: lists and tables grow to their sizes.
    for round in 0..3 {
        let before = ALLOCATOR.count();
        for map in &maps {
            flight.read(map);
            assert_eq!(flight.plan(), 0);
        }
        assert!(round == 0 || ALLOCATOR.count() == before, "{} allocations", ALLOCATOR.count() - before);
    }
    let before = ALLOCATOR.count();
    flight.draw(&maps[0]);
    assert!(ALLOCATOR.count() > before, "the allocator counts");
}
