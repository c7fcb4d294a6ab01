//! Campaigns: how a task's recordings are made, and what they shall look like.
//!
//! A new plant is one more entry of [`CAMPAIGNS`].

use std::ops::Range;

/// A task's recordings: the sweep of driving styles, each trajectory with its own.
#[derive(Clone, Debug)]
pub struct Campaign {
    /// The task.
    pub task: &'static str,
    /// Range of [`Style::pace`](firmware_sim::plant::Style::pace).
    pub pace: Range<f64>,
    /// Range of [`Style::margin`](firmware_sim::plant::Style::margin).
    pub margin: Range<f64>,
    /// Range of [`Style::look`](firmware_sim::plant::Style::look).
    pub look: Range<f64>,
    /// Range of the standard deviation of the noise on each action entry.
    pub noise: Range<f64>,
    /// Trajectories; with the task's horizon, the transitions of Table 1.
    pub trajectories: usize,
    /// The task's row of the paper's Table 1; none where the paper has no such task.
    pub table_1: Option<Shares>,
}

/// What Table 1 says of a data set.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Shares {
    /// `P_nz`, the share of transitions with a cost.
    pub p_nz: f64,
    /// `P_feas`, the share of trajectories within the cost limit.
    pub p_feas: f64,
}

/// All campaigns.
pub const CAMPAIGNS: [Campaign; 4] = [
    Campaign {
        task: "ball-run",
        pace: 0.5..3.1,
        margin: -0.4..1.6,
        look: 0.0..1.0,
        noise: 0.0..0.6,
        trajectories: 940,
        table_1: Some(Shares { p_nz: 0.4868, p_feas: 0.0447 }),
    },
    Campaign {
        task: "ball-circle",
        pace: 1.0..7.0,
        margin: -2.0..2.0,
        look: 0.1..0.6,
        noise: 0.0..0.6,
        trajectories: 940,
        table_1: None,
    },
    Campaign {
        task: "point-circle",
        pace: 0.3..1.5,
        margin: -0.8..0.4,
        look: 0.3..0.9,
        noise: 0.0..0.3,
        trajectories: 1098,
        table_1: Some(Shares { p_nz: 0.2262, p_feas: 0.1257 }),
    },
    Campaign {
        task: "point-goal",
        pace: 0.3..1.5,
        margin: 0.01..0.4,
        look: 0.0..1.0,
        noise: 0.0..0.3,
        trajectories: 2022,
        table_1: Some(Shares { p_nz: 0.0307, p_feas: 0.4525 }),
    },
];
