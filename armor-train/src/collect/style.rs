//! Driving styles: how a task's recordings are made, and what they shall look like.
//!
//! A new plant is one more entry of [`CAMPAIGNS`].

use std::ops::Range;

/// What one trajectory is driven with, drawn uniformly from a campaign's ranges.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Speed to reach, m/s.
    pub speed: f64,
    /// Distance to keep from the wall, m; negative beyond it.
    pub margin: f64,
    /// Standard deviation of the noise on each action entry.
    pub noise: f64,
}

/// A task's recordings: the sweep of styles, and its row of the paper's Table 1.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The task.
    pub task: &'static str,
    /// Range of [`Style::speed`].
    pub speed: Range<f64>,
    /// Range of [`Style::margin`].
    pub margin: Range<f64>,
    /// Range of [`Style::noise`].
    pub noise: Range<f64>,
    /// The action that a style takes on an observation, without noise, into `[A]`.
    pub drive: fn(Style, &[f32], &mut [f32]),
    /// Trajectories; with the task's horizon, the transitions of Table 1.
    pub trajectories: usize,
    /// `P_nz` of Table 1, the share of transitions with a cost.
    pub p_nz: f64,
    /// `P_feas` of Table 1, the share of trajectories within the cost limit.
    pub p_feas: f64,
}

/// All campaigns.
pub const CAMPAIGNS: [Campaign; 1] = [Campaign {
    task: "ball-run",
    speed: 0.5..3.1,
    margin: -0.4..1.6,
    noise: 0.0..0.6,
    drive: ball_run,
    trajectories: 940,
    p_nz: 0.4868,
    p_feas: 0.0447,
}];

/// Speeds up along x and keeps to a line beside the wall at y = 2 m; gains in 1/s and 1/s^2
/// of the force that moves the ball.
fn ball_run(style: Style, observation: &[f32], action: &mut [f32]) {
    let entry = |index: usize, factor: f64| observation.get(index).map_or(0.0, |&value| f64::from(value) / factor);
    let (y, vx, vy) = (entry(1, 0.1), entry(2, 0.2), entry(3, 0.2));
    let line = 2.0 - style.margin;
    let wanted = [0.8 * (style.speed - vx), 0.4 * (line - y) - 0.6 * vy];
    for (action, wanted) in action.iter_mut().zip(wanted) {
        *action = wanted.clamp(-1.0, 1.0) as f32;
    }
}
