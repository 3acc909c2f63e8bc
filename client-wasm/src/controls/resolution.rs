//! Dynamic resolution: while the picture moves or tiles come in, as many pixels as the adapter draws
//! in time; once it is still, all of them.

/// Scales of the picture's sides that are used, finest first. Few, so that the surface is seldom
/// configured anew.
pub const SCALES: [f64; 5] = [1.0, 0.75, 0.5, 0.35, 0.25];

/// Milliseconds that a frame of a moving picture should take at most.
const TARGET_MILLISECONDS: f64 = 40.0;
/// Seconds without motion after which the picture is refined.
const STILL_SECONDS: f64 = 0.15;
/// Seconds after a tile in which more are awaited: each would make a frame in full stale at once.
const ARRIVAL_SECONDS: f64 = 0.4;
/// Seconds since the page was opened after which it no longer waits for the photo's first tile with
/// the first picture in full.
const OPENING_SECONDS: f64 = 15.0;

/// Chooses the scale of each frame.
#[derive(Clone, Debug)]
pub struct Resolution {
    /// Index into [`SCALES`] for moving pictures.
    moving: usize,
    /// Milliseconds of a frame at full scale, smoothed; 0 where none was measured.
    full_milliseconds: f64,
    /// When the picture counts as still, seconds.
    still_at: f64,
    /// Whether the landscape has not been seen yet.
    opening: bool,
}

impl Default for Resolution {
    fn default() -> Self {
        Self { moving: 0, full_milliseconds: 0.0, still_at: f64::NEG_INFINITY, opening: true }
    }
}

impl Resolution {
    /// For an adapter that is known to be slow (a software one): begins with the coarsest, so that there
    /// is a landscape soon.
    pub fn for_slow_adapter() -> Self {
        Self { moving: SCALES.len() - 1, ..Self::default() }
    }

    /// Notes that the landscape, with its photo, has been shown: before that no time goes into pixels
    /// that will be drawn again at once.
    pub fn opened(&mut self) {
        self.opening = false;
    }

    /// Notes that the camera moved, at `now` seconds.
    pub fn moved(&mut self, now: f64) {
        self.still_at = self.still_at.max(now + STILL_SECONDS);
    }

    /// Notes that a tile came, at `now` seconds.
    pub fn arrived(&mut self, now: f64) {
        self.still_at = self.still_at.max(now + ARRIVAL_SECONDS);
    }

    /// Notes how long a frame took that was drawn at `scale`.
    pub fn measured(&mut self, scale: f64, milliseconds: f64) {
        // Nearly all of the cost is per pixel.
        let full = milliseconds / (scale * scale);
        self.full_milliseconds =
            if self.full_milliseconds == 0.0 { full } else { 0.7 * self.full_milliseconds + 0.3 * full };
        let fitting =
            SCALES.iter().position(|side| side * side * self.full_milliseconds <= TARGET_MILLISECONDS);
        let fitting = fitting.unwrap_or(SCALES.len() - 1);
        // Coarser at once, finer only with a margin: no flicker between two scales.
        if fitting > self.moving {
            self.moving = fitting;
        } else if fitting < self.moving {
            let finer = SCALES[self.moving - 1];
            if finer * finer * self.full_milliseconds <= 0.7 * TARGET_MILLISECONDS {
                self.moving -= 1;
            }
        }
    }

    /// The scale of the frame at `now` seconds.
    pub fn scale(&self, now: f64) -> f64 {
        if self.is_still(now) { 1.0 } else { SCALES[self.moving] }
    }

    /// Whether the picture has been still for long enough to be drawn in full.
    pub fn is_still(&self, now: f64) -> bool {
        now >= self.still_at && !(self.opening && now < OPENING_SECONDS)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_still_picture_is_drawn_in_full() {
        let mut resolution = Resolution::for_slow_adapter();
        assert_eq!(resolution.scale(0.0), 0.25, "nothing has been seen yet");
        assert_eq!(resolution.scale(OPENING_SECONDS), 1.0, "a photo that does not come holds nothing up");
        resolution.opened();
        assert_eq!(resolution.scale(0.0), 1.0);
        resolution.moved(1.0);
        assert_eq!(resolution.scale(1.05), 0.25);
        assert_eq!(resolution.scale(1.2), 1.0);
        resolution.arrived(2.0);
        assert_eq!(resolution.scale(2.3), 0.25);
        assert_eq!(resolution.scale(2.5), 1.0);
    }

    #[test]
    fn a_slow_adapter_gets_fewer_pixels_and_a_fast_one_all() {
        let mut slow = Resolution::default();
        slow.moved(0.0);
        for _ in 0..20 {
            let scale = slow.scale(0.0);
            slow.measured(scale, 500.0 * scale * scale);
        }
        assert_eq!(slow.scale(0.0), 0.25);
        for _ in 0..60 {
            let scale = slow.scale(0.0);
            slow.measured(scale, 8.0 * scale * scale);
        }
        assert_eq!(slow.scale(0.0), 1.0);
    }

    #[test]
    fn a_frame_time_at_the_edge_does_not_flicker() {
        let mut resolution = Resolution::default();
        resolution.moved(0.0);
        let mut changes = 0;
        let mut last = resolution.scale(0.0);
        for frame in 0..200 {
            let noise = if frame % 2 == 0 { 1.1 } else { 0.9 };
            resolution.measured(last, 71.0 * noise * last * last);
            let scale = resolution.scale(0.0);
            changes += usize::from(scale != last);
            last = scale;
        }
        assert!(changes <= 3, "{changes}");
    }
}
