//! What the unit tests share: repeatable numbers, finite differences, a small recording, generated documents.

use armor_core::noise::Noise;

use crate::data::{Dataset, Recording};

/// Trajectories of `steps` rows, with two state entries and one action entry;
/// `reward` and `cost` are of a row.
pub(crate) fn recording(
    trajectories: usize,
    steps: usize,
    reward: impl Fn(usize) -> f32,
    cost: impl Fn(usize) -> f32,
) -> Dataset {
    let rows = trajectories * steps;
    let state = |row: usize| [(row as f32).sin(), (0.3 * row as f32).cos()];
    Dataset::new(Recording {
        state_dim: 2,
        action_dim: 1,
        observations: (0..rows).flat_map(state).collect(),
        next_observations: (1..=rows).flat_map(state).collect(),
        actions: (0..rows).map(|row| (0.7 * row as f32).sin()).collect(),
        rewards: (0..rows).map(reward).collect(),
        costs: (0..rows).map(cost).collect(),
        terminals: vec![false; rows],
        timeouts: (0..rows).map(|row| row % steps == steps - 1).collect(),
        sha256: [5; 32],
    })
    .unwrap()
}

/// Compares a generated document with its file, `path` from the repository's
/// root; with `RENEW_DOCS` set, writes it instead.
#[track_caller]
pub(crate) fn assert_document(path: &str, generated: &str) {
    let file = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("..").join(path);
    if std::env::var_os("RENEW_DOCS").is_some() {
        return std::fs::write(file, generated).unwrap();
    }
    let written = std::fs::read_to_string(&file).unwrap_or_default();
    assert!(
        written == generated,
        "{path} is out of date; renew it with: RENEW_DOCS=1 cargo test -p armor-train --lib document"
    );
}

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

/// Two trajectories of three steps, with one state and one action entry; the
/// first costs 1, 0, 1, the second nothing.
pub(crate) fn dataset() -> Dataset {
    let observations: Vec<f32> = vec![0.0, 1.0, 2.0, 10.0, 11.0, 12.0];
    let recording = Recording {
        state_dim: 1,
        action_dim: 1,
        next_observations: observations.iter().map(|state| state + 1.0).collect(),
        observations,
        actions: vec![0.1, 0.2, 0.3, 0.4, 0.5, 0.6],
        rewards: vec![1.0; 6],
        costs: vec![1.0, 0.0, 1.0, 0.0, 0.0, 0.0],
        terminals: vec![false; 6],
        timeouts: vec![false, false, true, false, false, true],
        sha256: [0; 32],
    };
    Dataset::new(recording).expect("the recording is sound")
}
