//! Logarithm and exponential in plain arithmetic, which compilers turn into vector instructions. Good to
//! 1e-4, and the same bits on every machine.

/// A float of this magnitude has no fraction bits: adding it rounds to a whole number, found in its bits.
const WHOLE: f32 = 12_582_912.0;

/// Natural logarithm of a positive number.
#[inline(always)]
pub fn ln(x: f32) -> f32 {
    let bits = x.to_bits();
    let exponent = (bits >> 23) as i32 - 127;
    let mantissa = f32::from_bits(bits & 0x007f_ffff | 0x3f80_0000);
    // ln m = 2·artanh((m − 1)/(m + 1)); the argument is below a third.
    let t = (mantissa - 1.0) / (mantissa + 1.0);
    let square = t * t;
    let series = t * (2.0 + square * (2.0 / 3.0 + square * (2.0 / 5.0 + square * (2.0 / 7.0))));
    exponent as f32 * std::f32::consts::LN_2 + series
}

/// Exponential of a number from −80 to 80.
#[inline(always)]
pub fn exp(x: f32) -> f32 {
    let halvings = x * std::f32::consts::LOG2_E;
    let rounded = halvings + WHOLE;
    let whole = rounded - WHOLE;
    let rest = (halvings - whole) * std::f32::consts::LN_2;
    let series = 1.0 + rest * (1.0 + rest * (0.5 + rest * (1.0 / 6.0 + rest * (1.0 / 24.0))));
    let power = rounded.to_bits().wrapping_sub(WHOLE.to_bits()).wrapping_add(127) << 23;
    series * f32::from_bits(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn near_the_library_s() {
        for step in 1..4000_u16 {
            let x = f32::from(step) * 0.07;
            assert!((ln(x) - x.ln()).abs() < 1e-4, "{x}: {}", ln(x));
            let y = f32::from(step) * 0.02 - 79.0;
            assert!((exp(y) / y.exp() - 1.0).abs() < 1e-4, "{y}: {}", exp(y));
        }
    }
}
