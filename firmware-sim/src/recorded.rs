//! Recorded transitions for tests; `tests/data/README.md` says how they were picked.

use crate::plant::BallRun;

/// A recorded step of `ball-run`.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Recorded {
    pub(crate) observation: [f32; BallRun::STATE],
    pub(crate) action: [f32; BallRun::ACTION],
    pub(crate) reward: f32,
    pub(crate) cost: f32,
    pub(crate) next_observation: [f32; BallRun::STATE],
}

/// Twenty steps; the first eight open an episode.
pub(crate) fn ball_run_transitions() -> Vec<Recorded> {
    let rows = include_str!("../tests/data/ball_run_transitions.csv").lines();
    let rows: Vec<Recorded> = rows.map(read).collect();
    assert_eq!(rows.len(), 20);
    rows
}

fn read(line: &str) -> Recorded {
    let mut values = line.split(',').map(|value| value.parse().unwrap());
    let mut next = || values.next().unwrap();
    let row = Recorded {
        observation: std::array::from_fn(|_| next()),
        action: std::array::from_fn(|_| next()),
        reward: next(),
        cost: next(),
        next_observation: std::array::from_fn(|_| next()),
    };
    assert!(values.next().is_none());
    row
}
