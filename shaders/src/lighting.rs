//! Which variant of the `shade` pass a scene needs: what it does not have is compiled away.

/// Entry point of the pass.
pub const SHADE_FRAGMENT: &str = "shade";

/// Entry point of the pass where trees are drawn one by one.
pub const SHADE_TREES_FRAGMENT: &str = "shade_with_trees";

/// A variant of the `shade` pass, by its pipeline constants.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub struct ShadeVariant {
    /// The scene has a photo (or relief colours in its place).
    pub photo: bool,
    /// Something grows: `surface` holds canopy.
    pub canopy: bool,
    /// There may be open water.
    pub water: bool,
    /// Shadows and the sky's visibility are wanted; otherwise `View::shadow_steps` is not looked at.
    pub shadows: bool,
    /// The day differs from high summer.
    pub season: bool,
    /// The wind blows: the canopy shimmers.
    pub wind: bool,
    /// Clouds throw shadows.
    pub clouds: bool,
    /// The target's format does not encode sRGB: the shader does.
    pub encode_srgb: bool,
}

impl Default for ShadeVariant {
    /// Everything that a scene may have, in summer and fair weather, on a target that encodes sRGB itself.
    fn default() -> Self {
        Self {
            photo: true,
            canopy: true,
            water: true,
            shadows: true,
            season: false,
            wind: false,
            clouds: false,
            encode_srgb: false,
        }
    }
}

impl ShadeVariant {
    /// The pipeline constants, as wgpu wants them.
    pub fn constants(self) -> [(&'static str, f64); 8] {
        let number = |flag: bool| f64::from(u8::from(flag));
        [
            ("WITH_PHOTO", number(self.photo)),
            ("WITH_CANOPY", number(self.canopy)),
            ("WITH_WATER", number(self.water)),
            ("WITH_SHADOWS", number(self.shadows)),
            ("WITH_SEASON", number(self.season)),
            ("WITH_WIND", number(self.wind)),
            ("WITH_CLOUDS", number(self.clouds)),
            ("ENCODE_SRGB", number(self.encode_srgb)),
        ]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_constant_is_an_override_of_the_shader_and_no_other_is() {
        for (pass, entry) in
            [(crate::Pass::Shade, SHADE_FRAGMENT), (crate::Pass::ShadeTrees, SHADE_TREES_FRAGMENT)]
        {
            let text = crate::source(pass);
            let constants = ShadeVariant::default().constants();
            for (name, _) in constants {
                assert!(text.contains(&format!("override {name}: bool")), "{name}");
            }
            assert_eq!(text.matches("override ").count(), constants.len());
            assert!(text.contains(&format!("fn {entry}(")));
        }
    }
}
