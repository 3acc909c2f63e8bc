//! Counting what `cargo test` reports, over all of its programs.

/// Tests over several test programs.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Tally {
    /// Passed.
    pub passed: u64,
    /// Failed.
    pub failed: u64,
    /// Not run.
    pub ignored: u64,
}

impl Tally {
    /// Reads a program's own summary, `None` for any other line.
    pub fn from_line(line: &str) -> Option<Self> {
        let rest = line.strip_prefix("test result: ")?;
        let (_, counts) = rest.split_once(". ")?;
        let mut tally = Self::default();
        for count in counts.split("; ") {
            let Some((number, what)) = count.split_once(' ') else { continue };
            let Ok(number) = number.parse() else { continue };
            match what {
                "passed" => tally.passed = number,
                "failed" => tally.failed = number,
                "ignored" => tally.ignored = number,
                _ => {}
            }
        }
        Some(tally)
    }

    /// Adds another's counts.
    pub fn add(&mut self, other: Self) {
        self.passed += other.passed;
        self.failed += other.failed;
        self.ignored += other.ignored;
    }

    /// One line in the form of a test program's own, for whoever counts.
    pub fn summary(&self, ok: bool, seconds: f64) -> String {
        let verdict = if ok && self.failed == 0 { "ok" } else { "FAILED" };
        format!(
            "test result: {verdict}. {} passed; {} failed; {} ignored; 0 measured; 0 filtered out; finished in {seconds:.2}s",
            self.passed, self.failed, self.ignored
        )
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_summary_reads_back() {
        let line = "test result: FAILED. 12 passed; 1 failed; 2 ignored; 0 measured; 7 filtered out; finished in 0.10s";
        let tally = Tally::from_line(line).unwrap();
        assert_eq!(tally, Tally { passed: 12, failed: 1, ignored: 2 });
        let mut sum = tally;
        sum.add(tally);
        assert_eq!(
            Tally::from_line(&sum.summary(true, 1.0)).unwrap(),
            Tally { passed: 24, failed: 2, ignored: 4 }
        );
        assert!(sum.summary(true, 1.0).starts_with("test result: FAILED"));
        assert!(Tally { passed: 1, ..Tally::default() }.summary(false, 0.0).contains("FAILED"));
        assert_eq!(Tally::from_line("test a::b ... ok"), None);
    }
}
