//! What a data set holds: its row of Table 1, and its returns.

use std::fmt;

use armor_core::units::CostLimit;
use serde::Serialize;

use super::dataset::Dataset;
use super::sorted::Sorted;

/// Statistics of a data set at a cost limit.
///
/// Returns are undiscounted sums over a trajectory; a quantile lies between
/// its two neighbours by linear interpolation.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Stats {
    /// The limit `d` on the cost return.
    pub cost_limit: f32,
    /// Transitions of whole trajectories.
    pub transitions: usize,
    /// Trajectories.
    pub trajectories: usize,
    /// `P_nz`, the share of transitions with a cost above 0 (Table 1).
    pub p_nz: f64,
    /// `P_feas`, the share of trajectories whose cost return is at most `d` (Table 1).
    pub p_feas: f64,
    /// The weight `beta` of Eq. 6.
    pub beta: f64,
    /// `nu_beta(F)`, the mass of the feasible trajectories after weighting.
    pub feasible_mass: f64,
    /// Transitions of the shortest trajectory.
    pub horizon_min: usize,
    /// Transitions of the longest trajectory.
    pub horizon_max: usize,
    /// Reward return, 5 % quantile.
    pub reward_return_p5: f64,
    /// Reward return, median.
    pub reward_return_p50: f64,
    /// Reward return, 95 % quantile.
    pub reward_return_p95: f64,
    /// Reward return, maximum.
    pub reward_return_max: f64,
    /// Cost return, lower quartile.
    pub cost_return_p25: f64,
    /// Cost return, median.
    pub cost_return_p50: f64,
    /// Cost return, upper quartile.
    pub cost_return_p75: f64,
    /// Cost return, maximum: the largest kappa of section 3.1.
    pub cost_return_max: f64,
    /// The largest reward return of a feasible trajectory; none if no trajectory is feasible.
    pub best_feasible_return: Option<f64>,
}

impl Stats {
    /// Counts a data set at the limit `d`, with the weight `beta` of Eq. 6 for the feasible mass.
    pub fn new(dataset: &Dataset, limit: CostLimit, beta: f64) -> Self {
        let cost_limit = limit.cost().to_f32();
        let trajectories = dataset.trajectories();
        let feasible = trajectories.iter().filter(|trajectory| trajectory.cost_return <= cost_limit);
        let p_feas = share(feasible.clone().count(), trajectories.len());
        let horizons = trajectories.iter().map(|trajectory| trajectory.rows.len());
        let rewards = Sorted::new(trajectories.iter().map(|trajectory| trajectory.reward_return));
        let costs = Sorted::new(trajectories.iter().map(|trajectory| f64::from(trajectory.cost_return)));
        Self {
            cost_limit,
            transitions: dataset.len(),
            trajectories: trajectories.len(),
            p_nz: share((0..dataset.len()).filter(|&row| dataset.cost(row) > 0.0).count(), dataset.len()),
            p_feas,
            beta,
            feasible_mass: feasible_mass(p_feas, beta),
            horizon_min: horizons.clone().min().unwrap_or(0),
            horizon_max: horizons.max().unwrap_or(0),
            reward_return_p5: rewards.quantile(0.05),
            reward_return_p50: rewards.quantile(0.5),
            reward_return_p95: rewards.quantile(0.95),
            reward_return_max: rewards.quantile(1.0),
            cost_return_p25: costs.quantile(0.25),
            cost_return_p50: costs.quantile(0.5),
            cost_return_p75: costs.quantile(0.75),
            cost_return_max: costs.quantile(1.0),
            best_feasible_return: feasible.map(|trajectory| trajectory.reward_return).reduce(f64::max),
        }
    }
}

/// `nu_beta(F) = (1 + beta) p / ((1 + beta) p + 1 - p)`: what the weights of Eq. 6 make of a share
/// `p` of feasible trajectories (section 3.3).
pub fn feasible_mass(p: f64, beta: f64) -> f64 {
    let weighted = (1.0 + beta) * p;
    weighted / (weighted + 1.0 - p)
}

fn share(part: usize, whole: usize) -> f64 {
    part as f64 / whole as f64
}

impl fmt::Display for Stats {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut line = |name: &str, value: String, meaning: &str| {
            let line = format!("{name:<22}{value:>9}  {meaning}");
            writeln!(f, "{}", line.trim_end())
        };
        let horizon = match (self.horizon_min, self.horizon_max) {
            (min, max) if min == max => format!("{max} steps each"),
            (min, max) => format!("{min} to {max} steps each"),
        };
        line("transitions", self.transitions.to_string(), "")?;
        line("trajectories", self.trajectories.to_string(), &horizon)?;
        line("p_nz", format!("{:.3}", self.p_nz), "of the transitions have a cost")?;
        let meaning = format!("of the trajectories cost at most {}", self.cost_limit);
        line("p_feas", format!("{:.3}", self.p_feas), &meaning)?;
        let meaning = format!("their mass once weighted with beta {}", self.beta);
        line("nu_beta(F)", format!("{:.3}", self.feasible_mass), &meaning)?;
        let best = self.best_feasible_return.map_or("none".to_owned(), |best| format!("{best:.1}"));
        line("best feasible return", best, "")?;
        let mut row = |name: &str, columns: [(&str, f64); 4], end: &str| {
            write!(f, "{name:<15}")?;
            for (column, value) in columns {
                write!(f, "{column:>7}{value:>9.1}")?;
            }
            f.write_str(end)
        };
        row(
            "reward return",
            [
                ("5 %", self.reward_return_p5),
                ("50 %", self.reward_return_p50),
                ("95 %", self.reward_return_p95),
                ("max", self.reward_return_max),
            ],
            "\n",
        )?;
        row(
            "cost return",
            [
                ("25 %", self.cost_return_p25),
                ("50 %", self.cost_return_p50),
                ("75 %", self.cost_return_p75),
                ("max", self.cost_return_max),
            ],
            "",
        )
    }
}
