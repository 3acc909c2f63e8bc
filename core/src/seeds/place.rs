//! Places as integers: eastward from 180° W and southward from the north pole, 2³² units a turn.

/// Bits of a turn of longitude; half as many units lead from pole to pole.
pub const TURN_BITS: u32 = 32;
/// The level whose cells are one unit: on level L a cell is 2^(22 − L) units.
pub const UNIT_LEVEL: u8 = 22;
/// Units from pole to pole.
pub const POLE_TO_POLE: i64 = 1 << (TURN_BITS - 1);
/// Length of a unit along a meridian, or along the equator, metres.
pub const UNIT_METRES: f64 = crate::geodesy::EQUATOR_METRES / 4_294_967_296.0;
/// Degrees of a unit.
pub const UNIT_DEGREES: f64 = 360.0 / 4_294_967_296.0;

/// Units from 180° W of a longitude in degrees; not wrapped, with a fraction.
pub fn x_from_longitude(longitude: f64) -> f64 {
    (longitude + 180.0) / UNIT_DEGREES
}

/// Units from the north pole of a latitude in degrees, with a fraction.
pub fn y_from_latitude(latitude: f64) -> f64 {
    (90.0 - latitude) / UNIT_DEGREES
}

/// Longitude in degrees of units from 180° W.
pub fn longitude_from_x(x: f64) -> f64 {
    x * UNIT_DEGREES - 180.0
}

/// Latitude in degrees of units from the north pole.
pub fn latitude_from_y(y: f64) -> f64 {
    90.0 - y * UNIT_DEGREES
}

/// Units of one cell of a matrix level; a fraction below [`UNIT_LEVEL`].
pub fn units_of_cell(level: u8) -> f64 {
    f64::from(i32::from(UNIT_LEVEL) - i32::from(level)).exp2()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_unit_is_a_cell_of_level_22() {
        assert!((crate::tile::cell_metres(UNIT_LEVEL) - UNIT_METRES).abs() < 1e-12);
        assert_eq!(units_of_cell(17), 32.0);
        assert_eq!(units_of_cell(24), 0.25);
        assert_eq!(x_from_longitude(180.0), 4_294_967_296.0);
        assert_eq!(latitude_from_y(POLE_TO_POLE as f64), -90.0);
    }
}
