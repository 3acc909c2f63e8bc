//! A confusion matrix and what is read from it.

/// Counts by true class (row) and told class (column).
#[derive(Clone, Debug)]
pub struct Confusion {
    names: Vec<&'static str>,
    counts: Vec<Vec<u64>>,
}

impl Confusion {
    /// Nothing counted yet.
    pub fn new(names: &[&'static str]) -> Self {
        Self { names: names.to_vec(), counts: vec![vec![0; names.len()]; names.len()] }
    }

    /// Counts a place.
    pub fn add(&mut self, truth: usize, told: usize) {
        self.counts[truth][told] += 1;
    }

    /// Names of the classes.
    pub fn names(&self) -> &[&'static str] {
        &self.names
    }

    /// Counts by true class, then told class.
    pub fn counts(&self) -> &[Vec<u64>] {
        &self.counts
    }

    /// Places counted.
    pub fn total(&self) -> u64 {
        self.counts.iter().flatten().sum()
    }

    fn of_row(&self, class: usize) -> u64 {
        self.counts[class].iter().sum()
    }

    fn of_column(&self, class: usize) -> u64 {
        self.counts.iter().map(|row| row[class]).sum()
    }

    /// Share of places told right.
    pub fn accuracy(&self) -> f64 {
        let right: u64 = (0..self.names.len()).map(|class| self.counts[class][class]).sum();
        right as f64 / self.total().max(1) as f64
    }

    /// Harmonic mean of precision and recall of a class; 1 where it is neither there nor told.
    pub fn f1(&self, class: usize) -> f64 {
        let places = self.of_row(class) + self.of_column(class);
        if places == 0 { 1.0 } else { 2.0 * self.counts[class][class] as f64 / places as f64 }
    }

    /// Cohen's κ: agreement beyond what chance gives.
    pub fn kappa(&self) -> f64 {
        let total = self.total().max(1) as f64;
        let chance: f64 = (0..self.names.len())
            .map(|class| self.of_row(class) as f64 / total * (self.of_column(class) as f64 / total))
            .sum();
        if chance >= 1.0 { 1.0 } else { (self.accuracy() - chance) / (1.0 - chance) }
    }
}

#[test]
fn figures_of_a_known_matrix() {
    let mut matrix = Confusion::new(&["a", "b"]);
    for (truth, told, count) in [(0, 0, 20), (0, 1, 5), (1, 0, 10), (1, 1, 15)] {
        (0..count).for_each(|_| matrix.add(truth, told));
    }
    assert_eq!(matrix.total(), 50);
    assert!((matrix.accuracy() - 0.7).abs() < 1e-12);
    assert!((matrix.kappa() - 0.4).abs() < 1e-12);
    assert!((matrix.f1(0) - 40.0 / 55.0).abs() < 1e-12);
}
