//! Recorded transitions for tests; `tests/data/README.md` says how they were picked.

use crate::plant::{BallCircle, BallRun, PointCircle};

/// A recorded control step.
#[derive(Clone, Debug)]
pub(crate) struct Recorded {
    pub(crate) observation: Vec<f32>,
    pub(crate) action: Vec<f32>,
    pub(crate) reward: f32,
    pub(crate) cost: f32,
    pub(crate) next_observation: Vec<f32>,
}

/// Twenty steps of `ball-run`; the first eight open an episode.
pub(crate) fn ball_run_transitions() -> Vec<Recorded> {
    transitions(include_str!("../tests/data/ball_run_transitions.csv"), BallRun::STATE, BallRun::ACTION)
}

/// Twenty steps of `ball-circle`, an opening.
pub(crate) fn ball_circle_transitions() -> Vec<Recorded> {
    transitions(include_str!("../tests/data/ball_circle_transitions.csv"), BallCircle::STATE, BallCircle::ACTION)
}

/// Twenty steps of `point-circle`; the first eight open an episode.
pub(crate) fn point_circle_transitions() -> Vec<Recorded> {
    transitions(include_str!("../tests/data/point_circle_transitions.csv"), PointCircle::STATE, PointCircle::ACTION)
}

fn transitions(text: &str, state: usize, action: usize) -> Vec<Recorded> {
    let rows: Vec<Recorded> = rows(text).map(|row| split(&row, state, action)).collect();
    assert_eq!(rows.len(), 20);
    rows
}

fn split(values: &[f32], state: usize, action: usize) -> Recorded {
    let (observation, rest) = values.split_at(state);
    let (action, rest) = rest.split_at(action);
    let (outcome, next_observation) = rest.split_at(2);
    assert_eq!(next_observation.len(), state);
    Recorded {
        observation: observation.to_vec(),
        action: action.to_vec(),
        reward: outcome[0],
        cost: outcome[1],
        next_observation: next_observation.to_vec(),
    }
}

/// The numbers of each line.
pub(crate) fn rows<T: std::str::FromStr>(text: &str) -> impl Iterator<Item = Vec<T>> {
    text.lines().map(|line| line.split(',').map(|value| value.parse().ok().expect("a number")).collect())
}
