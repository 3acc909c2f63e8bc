//! What a person does, without a browser's event types.

/// A key's meaning, wherever it sits on the keyboard.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(u8)]
pub enum Key {
    /// Ahead, level.
    Forward,
    /// Back, level.
    Back,
    /// To the left, level.
    Left,
    /// To the right, level.
    Right,
    /// Turn to the left.
    TurnLeft,
    /// Turn to the right.
    TurnRight,
    /// Rise.
    Up,
    /// Sink.
    Down,
    /// Look further up.
    TiltUp,
    /// Look further down.
    TiltDown,
    /// Toward the middle of the picture.
    ZoomIn,
    /// Away from the middle of the picture.
    ZoomOut,
    /// Faster while it is held.
    Fast,
    /// Back to the scene's own view.
    Home,
}

impl Key {
    /// The meaning of a key by the browser's `KeyboardEvent.code` (its place on the keyboard, the
    /// same in every layout), or else by `key` (what it writes): + and − sit elsewhere everywhere.
    pub fn from_names(code: &str, key: &str) -> Option<Self> {
        Some(match code {
            "ArrowUp" | "KeyW" => Self::Forward,
            "ArrowDown" | "KeyS" => Self::Back,
            "ArrowLeft" | "KeyA" => Self::Left,
            "ArrowRight" | "KeyD" => Self::Right,
            "KeyQ" => Self::TurnLeft,
            "KeyE" => Self::TurnRight,
            "KeyR" | "PageUp" => Self::Up,
            "KeyF" | "PageDown" => Self::Down,
            "KeyT" => Self::TiltUp,
            "KeyG" => Self::TiltDown,
            "NumpadAdd" => Self::ZoomIn,
            "NumpadSubtract" => Self::ZoomOut,
            "ShiftLeft" | "ShiftRight" => Self::Fast,
            "Home" | "KeyH" => Self::Home,
            _ => {
                return match key {
                    "+" | "=" => Some(Self::ZoomIn),
                    "-" | "_" => Some(Self::ZoomOut),
                    _ => None,
                };
            }
        })
    }
}

/// The keys that are down.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Keys(u16);

impl Keys {
    /// Marks a key as down or up.
    pub fn set(&mut self, key: Key, down: bool) {
        let bit = 1 << key as u8;
        self.0 = if down { self.0 | bit } else { self.0 & !bit };
    }

    /// Whether a key is down.
    pub fn has(self, key: Key) -> bool {
        self.0 & (1 << key as u8) != 0
    }

    /// Whether any key that moves is down.
    pub fn move_something(self) -> bool {
        self.0 & !(1 << Key::Fast as u8) != 0
    }

    /// 1 where only `more` is down, −1 where only `less` is, else 0.
    pub fn axis(self, more: Key, less: Key) -> f64 {
        f64::from(u8::from(self.has(more))) - f64::from(u8::from(self.has(less)))
    }
}

/// What a pressed pointer is for.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Grip {
    /// Holds the ground: left button.
    Ground,
    /// Turns and tilts: right or middle button, or left with Ctrl.
    Turn,
    /// A finger: one holds the ground, two zoom, turn and tilt.
    Finger,
}

/// Something that happened. Places are CSS pixels from the picture's upper left corner.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Input {
    /// The picture's size changed, CSS pixels.
    Resize {
        /// Width, at least 1.
        width: f64,
        /// Height, at least 1.
        height: f64,
    },
    /// A pointer went down.
    Press {
        /// Which pointer.
        id: i32,
        /// What it is for.
        grip: Grip,
        /// Pixels from the left.
        x: f64,
        /// Pixels from the top.
        y: f64,
    },
    /// A pointer that is down moved.
    Drag {
        /// Which pointer.
        id: i32,
        /// Pixels from the left.
        x: f64,
        /// Pixels from the top.
        y: f64,
    },
    /// A pointer went up, or was taken away.
    Release {
        /// Which pointer.
        id: i32,
    },
    /// The wheel turned over a place; positive goes away.
    Wheel {
        /// Pixels from the left.
        x: f64,
        /// Pixels from the top.
        y: f64,
        /// Pixels that a page would have scrolled.
        pixels: f64,
    },
    /// A key went down.
    KeyDown(Key),
    /// A key went up.
    KeyUp(Key),
    /// The page lost the keyboard: keys that are down are not any more.
    Blur,
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn keys() {
        let mut keys = Keys::default();
        keys.set(Key::Fast, true);
        assert!(!keys.move_something());
        keys.set(Key::Forward, true);
        keys.set(Key::Home, true);
        assert!(keys.move_something() && keys.has(Key::Home));
        assert_eq!(keys.axis(Key::Forward, Key::Back), 1.0);
        keys.set(Key::Back, true);
        assert_eq!(keys.axis(Key::Forward, Key::Back), 0.0);
        keys.set(Key::Forward, false);
        assert_eq!(keys.axis(Key::Forward, Key::Back), -1.0);
    }

    #[test]
    fn names() {
        assert_eq!(Key::from_names("KeyW", "z"), Some(Key::Forward), "by place: W on a French keyboard");
        assert_eq!(Key::from_names("BracketRight", "+"), Some(Key::ZoomIn), "by writing: + on a German one");
        assert_eq!(Key::from_names("F5", "F5"), None);
    }
}
