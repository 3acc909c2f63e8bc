//! What benches measure with: order statistics, a process's memory, lines of results.

use anyhow::Context;
use treeline_core::hash::{hash, minimal_standard, uniform};

/// Prints a result as `cargo xtask bench` reads it.
pub fn print(name: &str, value: f64, unit: &str) {
    println!("{}", serde_json::json!({ "name": name, "value": value, "unit": unit }));
}

/// The value below which a part of all values lies (0.5: the median), by the nearest rank; NaN where there are none.
pub fn quantile(values: &[f64], part: f64) -> f64 {
    let mut sorted = values.to_vec();
    sorted.sort_by(f64::total_cmp);
    let rank = (part * sorted.len() as f64).ceil() as usize;
    sorted.get(rank.max(1) - 1).or(sorted.last()).copied().unwrap_or(f64::NAN)
}

/// The median.
pub fn median(values: &[f64]) -> f64 {
    quantile(values, 0.5)
}

/// Memory of a process, MiB.
#[derive(Clone, Copy, Debug)]
pub struct Memory {
    /// Resident now.
    pub now: f64,
    /// The most that was resident since the start, or since [`forget_peak`].
    pub peak: f64,
}

/// Memory of a process, from Linux's `/proc`.
pub fn memory(process: u32) -> anyhow::Result<Memory> {
    let text = std::fs::read_to_string(format!("/proc/{process}/status"))?;
    let of = |name: &str| {
        let line = text.lines().find_map(|line| line.strip_prefix(name)).context("a line of memory")?;
        let kibibytes: f64 = line.trim().trim_end_matches("kB").trim().parse()?;
        anyhow::Ok(kibibytes / 1024.0)
    };
    Ok(Memory { now: of("VmRSS:")?, peak: of("VmHWM:")? })
}

/// Begins anew with the greatest memory of a process.
pub fn forget_peak(process: u32) -> anyhow::Result<()> {
    std::fs::write(format!("/proc/{process}/clear_refs"), "5").context("the peak cannot be reset")
}

/// A number from the environment, for how long or how often a bench measures.
///
/// # Panics
/// Where the variable is set and no number.
pub fn setting(name: &str, otherwise: u64) -> u64 {
    match std::env::var(name) {
        Ok(text) => text.parse().unwrap_or_else(|_| panic!("{name} is {text:?}; it must be a whole number")),
        Err(_) => otherwise,
    }
}

/// The same random numbers each time.
pub struct Numbers(u32);

impl Numbers {
    /// By a seed: neighbours give other numbers.
    pub fn new(seed: u32) -> Self {
        Self(1 + hash(seed, 0, 0) % 0x7fff_fffe)
    }

    fn next_state(&mut self) -> u32 {
        self.0 = minimal_standard(self.0);
        self.0
    }

    /// The next from 0 to 1, 1 excluded.
    pub fn unit(&mut self) -> f64 {
        f64::from(uniform(self.next_state()))
    }

    /// The next below `count`.
    pub fn below(&mut self, count: usize) -> usize {
        self.next_state() as usize % count
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn order_statistics() {
        let values: Vec<f64> = (1..=100).rev().map(f64::from).collect();
        assert_eq!((median(&values), quantile(&values, 0.99), quantile(&values, 1.0)), (50.0, 99.0, 100.0));
        assert_eq!(quantile(&[3.0], 0.99), 3.0);
        assert!(median(&[]).is_nan());
    }

    #[test]
    fn numbers_spread_and_repeat() {
        let (mut one, mut other) = (Numbers::new(7), Numbers::new(7));
        let mean = (0..1000).map(|_| one.unit()).sum::<f64>() / 1000.0;
        assert!((0.45..0.55).contains(&mean), "{mean}");
        let first: Vec<usize> = (0..1000).map(|_| other.below(10)).collect();
        assert!((0..10).all(|value| first.contains(&value)));
        assert_ne!(Numbers::new(8).unit(), Numbers::new(7).unit());
    }
}
