//! bil: samples row by row from the north-west, little-endian, no header.

/// Signed 16-bit metres, rounded to nearest, saturated at the type's ends; `nodata` where there is none.
pub fn bil16(metres: &[f32], nodata: f64) -> Vec<u8> {
    let void = round(nodata);
    metres
        .iter()
        .map(|&metres| if metres.is_finite() { round(f64::from(metres)) } else { void }.to_le_bytes())
        .collect::<Vec<_>>()
        .into_flattened()
}

/// Of a value that an f32 can hold, in f64: adding a half is exact. A conversion to an integer cuts towards zero, and
/// saturates.
fn round(value: f64) -> i16 {
    (value + 0.5_f64.copysign(value)) as i16
}

/// 32-bit float metres; `nodata` where there is none.
pub fn bil32(metres: &[f32], nodata: f64) -> Vec<u8> {
    let void = nodata as f32;
    metres
        .iter()
        .map(|&metres| if metres.is_finite() { metres } else { void }.to_le_bytes())
        .collect::<Vec<_>>()
        .into_flattened()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn samples_are_rounded_and_voids_are_zero_unless_said_otherwise() {
        let metres = [1.5, -1.5, 0.4, f32::NAN, 1.0e9, -1.0e9, 2.49];
        let of = |nodata| -> Vec<i16> {
            bil16(&metres, nodata).chunks_exact(2).map(|b| i16::from_le_bytes([b[0], b[1]])).collect()
        };
        assert_eq!(of(0.0), [2, -2, 0, 0, i16::MAX, i16::MIN, 2]);
        assert_eq!(of(-9999.0)[3], -9999);
        let floats: Vec<f32> = bil32(&metres, -9999.0)
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        assert_eq!(floats, [1.5, -1.5, 0.4, -9999.0, 1.0e9, -1.0e9, 2.49]);
    }

    #[test]
    fn halves_are_rounded_away_from_zero_and_what_is_less_is_not() {
        for metres in [0.499_999_97_f32, 0.5, 0.500_000_06, 2_047.499_9, 2_047.5, 8_388_607.5, 1.0e-30] {
            for metres in [metres, -metres] {
                assert_eq!(round(f64::from(metres)), f64::from(metres).round() as i16, "{metres}");
            }
        }
    }
}
