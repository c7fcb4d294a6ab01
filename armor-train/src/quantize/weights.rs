//! Weights as 8-bit integers with a scale for each row.

/// Parts of a row's largest weight that are tried as the largest code, in 32nds.
const TRIED: std::ops::RangeInclusive<u32> = 20..=32;
/// The largest weight code.
const HIGHEST: f64 = 127.0;

/// A matrix as integers: `codes * scale` stands for the weights.
pub(super) struct QuantizedRows {
    /// Row after row, a code for each input.
    pub(super) codes: Vec<i8>,
    /// The largest scale of a row.
    pub(super) scale: f64,
    /// Each row's scale in parts of it, in steps of `2^-31`.
    pub(super) multiplier: Vec<i32>,
    /// Each row's codes times its scale, summed.
    pub(super) sums: Vec<f64>,
}

impl QuantizedRows {
    /// Quantises weights that are stored input by input, as an image in single precision has them.
    pub(super) fn new(weights: &[f32], outputs: usize) -> Self {
        let row = |output: usize| weights.iter().skip(output).step_by(outputs).map(|&weight| f64::from(weight));
        let scales: Vec<f64> = (0..outputs).map(|output| best_scale(&row(output).collect::<Vec<_>>())).collect();
        // Where all weights are zero, any scale will do.
        let scale = scales.iter().copied().fold(f64::MIN_POSITIVE, f64::max);
        let (mut codes, mut multiplier, mut sums) = (Vec::new(), Vec::new(), Vec::new());
        for (output, own) in scales.into_iter().enumerate() {
            // The scale that the integers say; a row far below the largest one is all zeros.
            let steps = (own / scale * f64::from(1u32 << 31)).round().clamp(1.0, i32::MAX.into());
            let realised = steps / f64::from(1u32 << 31) * scale;
            let start = codes.len();
            codes.extend(row(output).map(|weight| code(weight, realised)));
            multiplier.push(steps as i32);
            sums.push(realised * codes[start..].iter().map(|&code| f64::from(code)).sum::<f64>());
        }
        Self { codes, scale, multiplier, sums }
    }

    /// What the rounding of the weights takes from each row's sum when the
    /// inputs are `means`; `weights` as they were given.
    pub(super) fn shortfall(&self, weights: &[f32], means: &[f64]) -> Vec<f64> {
        let outputs = self.multiplier.len();
        let rows = self.codes.chunks_exact(means.len()).zip(&self.multiplier).enumerate();
        rows.map(|(output, (codes, &multiplier))| {
            let scale = f64::from(multiplier) / f64::from(1u32 << 31) * self.scale;
            let weights = weights.iter().skip(output).step_by(outputs);
            let lost = weights.zip(codes).map(|(&weight, &code)| f64::from(weight) - scale * f64::from(code));
            lost.zip(means).map(|(lost, mean)| lost * mean).sum()
        })
        .collect()
    }
}

/// The scale with the least mean square error of a row.
fn best_scale(row: &[f64]) -> f64 {
    let largest = row.iter().fold(0.0f64, |largest, weight| largest.max(weight.abs()));
    let tried = TRIED.map(|part| f64::from(part) / f64::from(*TRIED.end()) * largest / HIGHEST);
    let error = |scale: f64| row.iter().map(|&w| (w - scale * f64::from(code(w, scale))).powi(2)).sum::<f64>();
    tried.min_by(|a, b| error(*a).total_cmp(&error(*b))).unwrap_or_default()
}

fn code(weight: f64, scale: f64) -> i8 {
    // 0 / 0 is no number, and as an integer 0.
    (weight / scale).round().clamp(-HIGHEST, HIGHEST) as i8
}
