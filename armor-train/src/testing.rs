//! What the unit tests share: repeatable numbers and finite differences.

use armor_core::noise::Noise;

/// `len` repeatable standard normal draws, halved.
pub(crate) fn fill(len: usize, stream: u32) -> Vec<f64> {
    let mut draws = vec![0f32; len];
    Noise::new(1).fill_normal(stream, 0, &mut draws);
    draws.into_iter().map(|draw| 0.5 * f64::from(draw)).collect()
}

/// Compares a gradient with central differences of `loss`, entry by entry.
#[track_caller]
pub(crate) fn assert_gradient(at: &[f64], gradient: &[f64], loss: impl Fn(&[f64]) -> f64) {
    assert_eq!(at.len(), gradient.len());
    let step = 1e-5;
    let mut point = at.to_vec();
    for (index, &expected) in gradient.iter().enumerate() {
        point[index] = at[index] + step;
        let above = loss(&point);
        point[index] = at[index] - step;
        let below = loss(&point);
        point[index] = at[index];
        let slope = (above - below) / (2.0 * step);
        let tolerance = 1e-7 * (1.0 + slope.abs());
        assert!((slope - expected).abs() < tolerance, "entry {index}: gradient {expected}, slope {slope}");
    }
}
