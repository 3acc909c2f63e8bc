//! Letters in pictures: legends, and errors that are to be seen.

use font8x8::{BASIC_FONTS, LATIN_FONTS, UnicodeFonts};

/// Sides of a letter, pixels.
pub const LETTER: u32 = 8;

/// Pixels to draw into, RGBA with straight alpha.
pub struct Canvas {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
    /// Row-major from the top left.
    pub pixels: Vec<[u8; 4]>,
}

impl Canvas {
    /// Of one colour.
    pub fn new(width: u32, height: u32, colour: [u8; 4]) -> Self {
        Self { width, height, pixels: vec![colour; width as usize * height as usize] }
    }

    /// Fills a rectangle, as far as it lies within.
    pub fn fill(&mut self, [left, top, width, height]: [u32; 4], colour: [u8; 4]) {
        for y in top..(top.saturating_add(height)).min(self.height) {
            for x in left..(left.saturating_add(width)).min(self.width) {
                self.pixels[(y * self.width + x) as usize] = colour;
            }
        }
    }

    /// Writes a line whose first letter has its corner at (left, top). What lies outside is cut off; letters that the
    /// font has not become question marks.
    pub fn write(&mut self, left: u32, top: u32, text: &str, colour: [u8; 4]) {
        for (index, letter) in text.chars().enumerate() {
            let bits = BASIC_FONTS
                .get(letter)
                .or_else(|| LATIN_FONTS.get(letter))
                .or_else(|| BASIC_FONTS.get('?'))
                .unwrap_or_default();
            let corner = u64::from(left) + index as u64 * u64::from(LETTER);
            for (row, line) in bits.into_iter().enumerate() {
                for column in 0..LETTER {
                    let (x, y) = (corner + u64::from(column), u64::from(top) + row as u64);
                    if line >> column & 1 == 1 && x < u64::from(self.width) && y < u64::from(self.height) {
                        self.pixels[(y * u64::from(self.width) + x) as usize] = colour;
                    }
                }
            }
        }
    }
}

/// A text in lines of at most so many letters: broken between words where it can be.
pub fn lines(text: &str, letters: usize) -> Vec<String> {
    let letters = letters.max(1);
    let mut lines = Vec::new();
    let mut line = String::new();
    for word in text.split_whitespace() {
        let mut word: Vec<char> = word.chars().collect();
        if !line.is_empty() && line.chars().count() + 1 + word.len() > letters {
            lines.push(std::mem::take(&mut line));
        }
        while word.len() > letters {
            lines.push(word.drain(..letters).collect());
        }
        if !line.is_empty() {
            line.push(' ');
        }
        line.extend(word);
    }
    if !line.is_empty() {
        lines.push(line);
    }
    lines
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn letters_are_drawn_and_cut_off_at_the_edge() {
        let mut canvas = Canvas::new(20, 8, [255; 4]);
        canvas.write(0, 0, "Hé\u{4e00}", [0, 0, 0, 255]);
        let inked = |columns: std::ops::Range<u32>| {
            columns.clone().any(|x| (0..8).any(|y| canvas.pixels[(y * 20 + x) as usize][0] == 0))
        };
        assert!(inked(0..8) && inked(8..16) && inked(16..20));
        let mut tiny = Canvas::new(1, 1, [255; 4]);
        tiny.write(u32::MAX, u32::MAX, "x", [0; 4]);
        tiny.fill([0, 0, u32::MAX, u32::MAX], [1, 2, 3, 4]);
        assert_eq!(tiny.pixels, [[1, 2, 3, 4]]);
    }

    #[test]
    fn lines_break_between_words() {
        assert_eq!(lines("BBOX is wrong here", 9), ["BBOX is", "wrong", "here"]);
        assert_eq!(lines("abcdefgh ij", 3), ["abc", "def", "gh", "ij"]);
        assert!(lines("  ", 3).is_empty());
        assert_eq!(lines("ab", 0), ["a", "b"]);
    }
}
