//! Axis order: which coordinate reference systems name their northing (or latitude) first.

/// EPSG codes of projected systems whose first axis is the northing, as inclusive ranges.
///
/// Taken from the axis definitions of the EPSG registry. Ranges bridge only codes that are not
/// projected systems or are not in use, so that every projected system is told right.
#[rustfmt::skip]
const NORTHING_FIRST: [(u32, u32); 90] = [
    (2036, 2036), (2044, 2045), (2081, 2083), (2085, 2086), (2091, 2093), (2096, 2098),
    (2105, 2132), (2166, 2180), (2193, 2193), (2199, 2200), (2206, 2212), (2319, 2549),
    (2551, 2735), (2738, 2758), (2935, 2941), (2953, 2953), (3006, 3030), (3034, 3035),
    (3038, 3051), (3058, 3059), (3068, 3068), (3114, 3118), (3120, 3120), (3126, 3140),
    (3146, 3147), (3150, 3152), (3300, 3301), (3328, 3335), (3346, 3346), (3350, 3352),
    (3366, 3366), (3386, 3390), (3396, 3399), (3407, 3407), (3414, 3414), (3416, 3416),
    (3764, 3764), (3788, 3793), (3795, 3796), (3833, 3854), (3873, 3885), (4026, 4026),
    (4037, 4038), (4417, 4417), (4434, 4434), (4491, 4554), (4568, 4589), (4652, 4656),
    (4766, 4800), (4812, 4812), (4822, 4822), (4839, 4880), (5048, 5048), (5105, 5130),
    (5167, 5188), (5253, 5259), (5269, 5275), (5343, 5349), (5367, 5367), (5479, 5482),
    (5518, 5520), (5562, 5588), (5632, 5639), (5651, 5653), (6362, 6362), (6372, 6387),
    (6669, 6687), (6707, 6709), (6870, 6870), (6875, 6876), (6962, 6962), (7799, 7801),
    (7825, 7831), (8433, 8441), (20004, 20092), (21413, 21483), (21891, 21899), (22171, 22197),
    (25884, 25884), (27205, 27232), (27391, 27398), (28402, 28492), (29701, 29702), (30161, 30179),
    (30800, 30800), (31251, 31297), (31462, 31469), (31700, 31700), (32661, 32661), (32761, 32761),
];

/// Whether the system's first axis points north, so that WMS 1.3.0 writes its boxes as
/// `BBOX=min northing,min easting,max northing,max easting`.
///
/// Every geographic system of the registry has latitude first; an unknown code is taken for a
/// projected system with easting first.
pub fn northing_first(epsg: u32) -> bool {
    if super::is_geographic_code(epsg) {
        return true;
    }
    let after = NORTHING_FIRST.partition_point(|&(first, _)| first <= epsg);
    after > 0 && epsg <= NORTHING_FIRST[after - 1].1
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn well_known_codes() {
        for code in [4326, 4258, 4269, 2193, 3035, 2180, 31287, 31467, 3006, 32661, 2397] {
            assert!(northing_first(code), "EPSG:{code}");
        }
        for code in [3857, 32632, 25832, 2056, 21781, 28992, 27700, 5514, 3031, 3067, 26911, 99999] {
            assert!(!northing_first(code), "EPSG:{code}");
        }
    }

    #[test]
    fn the_ranges_are_sorted_and_disjoint() {
        assert!(NORTHING_FIRST.windows(2).all(|pair| pair[0].1 < pair[1].0));
        assert!(NORTHING_FIRST.iter().all(|range| range.0 <= range.1));
    }
}
