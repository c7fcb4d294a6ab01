//! Quantiles.

/// Values in ascending order; at least one.
pub(crate) struct Sorted<T>(Vec<T>);

impl<T: Copy + Into<f64>> Sorted<T> {
    pub(crate) fn new(values: impl Iterator<Item = T>) -> Self {
        let mut values: Vec<T> = values.collect();
        values.sort_unstable_by(|&a, &b| f64::total_cmp(&a.into(), &b.into()));
        Self(values)
    }

    /// The value at `q * (n - 1)`, interpolated between its two neighbours.
    pub(crate) fn quantile(&self, q: f64) -> f64 {
        let at = q * (self.0.len() - 1) as f64;
        let [below, above] = [at.floor(), at.ceil()].map(|at| self.0[at as usize].into());
        below + (above - below) * at.fract()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_quantile_lies_between_its_neighbours() {
        let sorted = Sorted::new([4.0, 1.0, 3.0, 2.0].into_iter());
        assert_eq!([0.0, 0.5, 1.0].map(|q| sorted.quantile(q)), [1.0, 2.5, 4.0]);
    }
}
