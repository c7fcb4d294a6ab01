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

#[cfg(test)]
mod tests {
    use super::*;
    use armor_core::noise::Noise;

    const OUTPUTS: usize = 5;
    const INPUTS: usize = 40;

    /// Rows of very different size, one of them zero, stored input by input.
    fn weights() -> Vec<f32> {
        let mut weights = vec![0.0; INPUTS * OUTPUTS];
        Noise::new(1).fill_normal(0, 0, &mut weights);
        let sizes = [1.0, 1e-3, 0.0, 30.0, 0.1];
        weights.iter().enumerate().map(|(i, weight)| weight * sizes[i % OUTPUTS]).collect()
    }

    fn realised(rows: &QuantizedRows, output: usize, input: usize) -> f64 {
        let scale = f64::from(rows.multiplier[output]) / f64::from(1u32 << 31) * rows.scale;
        scale * f64::from(rows.codes[output * INPUTS + input])
    }

    /// A scale of at least 20/32 of the largest weight over 127 clips what lies beyond.
    #[test]
    fn every_row_keeps_its_weights_to_a_small_part_of_its_own_size() {
        let weights = weights();
        let rows = QuantizedRows::new(&weights, OUTPUTS);
        for output in 0..OUTPUTS {
            let row = |input: usize| f64::from(weights[input * OUTPUTS + output]);
            let size = (0..INPUTS).map(|input| row(input).powi(2)).sum::<f64>().sqrt();
            let error =
                (0..INPUTS).map(|input| (row(input) - realised(&rows, output, input)).powi(2)).sum::<f64>().sqrt();
            assert!(error <= 0.01 * size, "row {output}: {error} of {size}");
            let sum = (0..INPUTS).map(|input| realised(&rows, output, input)).sum::<f64>();
            assert!((rows.sums[output] - sum).abs() <= 1e-12 * size.max(1.0));
        }
    }

    #[test]
    fn the_shortfall_is_what_the_mean_input_misses() {
        let weights = weights();
        let rows = QuantizedRows::new(&weights, OUTPUTS);
        let means: Vec<f64> = (0..INPUTS).map(|input| input as f64 / 10.0 - 1.0).collect();
        for (output, shortfall) in rows.shortfall(&weights, &means).into_iter().enumerate() {
            let exact: f64 = (0..INPUTS).map(|i| means[i] * f64::from(weights[i * OUTPUTS + output])).sum();
            let kept: f64 = (0..INPUTS).map(|i| means[i] * realised(&rows, output, i)).sum();
            assert!((kept + shortfall - exact).abs() < 1e-9, "row {output}");
        }
    }
}
