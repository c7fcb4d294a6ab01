//! Signs that a run goes wrong, with their cause and what to try.
//!
//! An alarm depends on the rows of `metrics.csv` and on the data alone, so a
//! resumed run finds those that were raised before by reading its rows again.

use std::fmt;

use super::columns::value;
use super::provenance::Provenance;
use crate::config::Config;

/// How far beyond the largest discounted sum of the data a critic may estimate.
/// Stitching recorded trajectories can beat the best of them, but not several times over.
const EXPLOSION: f64 = 3.0;
/// A lambda of at least this share of its cap sits at it.
const AT_CAP: f64 = 0.99;
/// Rows in a row with lambda at its cap: 500 steps, more than a swing.
const CAP_ROWS: u32 = 5;
/// Active share of counterfactual weights below which they change nothing.
const DEAD_SHARE: f64 = 0.01;

/// What went wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Cause {
    /// `Q_r` left the range that the data allows.
    RewardCritic,
    /// `Q_cL` left the range that the data allows.
    CostCritic,
    /// `lambda(kappa)` cannot rise any further.
    LambdaCap,
    /// Counterfactual weights are 1 almost everywhere.
    DeadWeights,
    /// A number is infinite or not a number.
    NotFinite,
}

impl Cause {
    /// All causes.
    pub const ALL: [Self; 5] =
        [Self::RewardCritic, Self::CostCritic, Self::LambdaCap, Self::DeadWeights, Self::NotFinite];

    /// The alarm's name.
    pub const fn title(self) -> &'static str {
        match self {
            Self::RewardCritic => "the reward critic explodes",
            Self::CostCritic => "the cost critic explodes",
            Self::LambdaCap => "lambda sits at its cap",
            Self::DeadWeights => "the counterfactual weights are dead",
            Self::NotFinite => "a loss is not finite",
        }
    }

    /// When it is raised.
    pub fn rule(self) -> String {
        match self {
            Self::RewardCritic => explosion_rule("q_reward", "reward"),
            Self::CostCritic => explosion_rule("q_long_cost", "cost"),
            Self::LambdaCap => format!(
                "a `lambda_kappa` column is within {:.0} % of exp(`log_lambda_max`) in {CAP_ROWS} consecutive rows",
                100.0 * (1.0 - AT_CAP)
            ),
            Self::DeadWeights => {
                format!("`counterfactual_active` is below {DEAD_SHARE} after two refreshes or any later one")
            }
            Self::NotFinite => {
                "any number is infinite or NaN; the run stops, and the last checkpoint is from before".to_owned()
            }
        }
    }

    /// The usual reason.
    pub const fn reason(self) -> &'static str {
        match self {
            Self::RewardCritic | Self::CostCritic => "values of actions that the data lacks feed on themselves",
            Self::LambdaCap => "at that budget no action satisfies Q_cL <= kappa, often by the critic's noise alone",
            Self::DeadWeights => "almost no perturbed action leaves the budget, so Eq. 8 selects nothing",
            Self::NotFinite => "steps too large, or values too large for single precision",
        }
    }

    /// What to try; names of options stand in backticks.
    pub const fn remedy(self) -> &'static str {
        match self {
            Self::RewardCritic => "a smaller `critic_rate` or `target_rate`, a smaller `eta`, or `bootstrap` in_sample",
            Self::CostCritic => {
                "a smaller `critic_rate` or `target_rate`, a smaller `long_cost_discount`, or `bootstrap` in_sample"
            }
            Self::LambdaCap => {
                "a larger `dual_slack` or a smaller `dual_rate`, or `kappa_unit` limit so that the dual network can tell budgets apart, or `extraction` weighted, which needs no dual"
            }
            Self::DeadWeights => {
                "`counterfactual_reference` realised, a larger `sigma`, or a larger `short_cost_discount` so that Q_cS can exceed a whole unit of cost"
            }
            Self::NotFinite => "a smaller `critic_rate` and `actor_rate`, or a smaller `reward_scale`",
        }
    }
}

fn explosion_rule(column: &str, signal: &str) -> String {
    format!(
        "`{column}_min` or `{column}_max` is further from 0 than {EXPLOSION} times the largest discounted sum of {signal} in the data (and than that many units of recorded {signal})"
    )
}

/// An alarm of a run.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Alarm {
    /// Training steps done when it was noticed.
    pub step: u64,
    /// What went wrong.
    pub cause: Cause,
    /// The numbers that say so.
    pub finding: String,
}

impl fmt::Display for Alarm {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { step, cause, finding } = self;
        write!(f, "step {step}: {}: {finding}; {}; try {}", cause.title(), cause.reason(), cause.remedy())
    }
}

/// Watches the rows of a run; each cause is raised once.
#[derive(Clone, Debug)]
pub(super) struct Alarms {
    /// Largest data-supported `|Q_r|` and `|Q_cL|`.
    largest: [f64; 2],
    /// Steps after which two refreshes of the counterfactual weights are done; none where they are off.
    two_refreshes: Option<u64>,
    limit: f64,
    max_kappa: f64,
    /// The largest lambda.
    cap: f64,
    rows_at_cap: u32,
    raised: Vec<Alarm>,
}

impl Alarms {
    pub(super) fn new(config: &Config, provenance: &Provenance) -> Self {
        // Without any recorded cost its largest sum is 0, and a critic's noise is no explosion.
        let reward = provenance.reward_to_go.largest().max(config.reward_scale);
        let cost = provenance.cost_to_go.largest().max(config.cost_scale);
        Self {
            largest: [reward, cost],
            two_refreshes: config
                .reweight
                .counterfactual()
                .then(|| config.reweight_warmup.max(config.critic_steps).saturating_add(config.reweight_interval)),
            limit: config.limit,
            max_kappa: provenance.max_kappa,
            cap: config.log_lambda_max.exp(),
            rows_at_cap: 0,
            raised: Vec::new(),
        }
    }

    /// Looks at a row in the order of [`COLUMNS`](super::COLUMNS); returns the alarms that are new.
    pub(super) fn look(&mut self, row: &[f64]) -> &[Alarm] {
        let before = self.raised.len();
        let step = value(row, "step") as u64;
        self.explosion(row, step, Cause::RewardCritic, "Q_r", ["q_reward_min", "q_reward_max"], self.largest[0]);
        self.explosion(row, step, Cause::CostCritic, "Q_cL", ["q_long_cost_min", "q_long_cost_max"], self.largest[1]);
        self.lambda(row, step);
        let active = value(row, "counterfactual_active");
        if self.two_refreshes.is_some_and(|steps| step > steps) && active < DEAD_SHARE {
            let finding =
                format!("only {:.2} % of the transitions have one that the last refresh raised", 100.0 * active);
            self.raise(step, Cause::DeadWeights, finding);
        }
        &self.raised[before..]
    }

    fn explosion(&mut self, row: &[f64], step: u64, cause: Cause, name: &str, columns: [&str; 2], largest: f64) {
        let [low, high] = columns.map(|column| value(row, column));
        let furthest = if -low > high { low } else { high };
        if furthest.abs() > EXPLOSION * largest {
            let times = furthest.abs() / largest;
            let finding =
                format!("{name} reaches {furthest:.1}, {times:.1} times the largest of the data, {largest:.1}");
            self.raise(step, cause, finding);
        }
    }

    fn lambda(&mut self, row: &[f64], step: u64) {
        let budgets = [
            ("lambda_kappa_0", 0.0),
            ("lambda_kappa_half", self.limit / 2.0),
            ("lambda_kappa_limit", self.limit),
            ("lambda_kappa_max", self.max_kappa),
        ];
        let at_cap = budgets.iter().filter(|(column, _)| value(row, column) >= AT_CAP * self.cap);
        let at_cap: Vec<String> = at_cap.map(|(_, kappa)| kappa.to_string()).collect();
        self.rows_at_cap = if at_cap.is_empty() { 0 } else { self.rows_at_cap + 1 };
        if self.rows_at_cap >= CAP_ROWS {
            self.raise(step, Cause::LambdaCap, format!("{:.1} at kappa {}", self.cap, at_cap.join(" and ")));
        }
    }

    /// Notes that a column's number is not finite; returns the alarm.
    pub(super) fn not_finite(&mut self, step: u64, column: &str) -> Option<&Alarm> {
        self.raise(step, Cause::NotFinite, format!("`{column}` is no number any more"));
        self.raised.last()
    }

    fn raise(&mut self, step: u64, cause: Cause, finding: String) {
        if self.raised.iter().all(|alarm| alarm.cause != cause) {
            self.raised.push(Alarm { step, cause, finding });
        }
    }

    /// `alarms.log`.
    pub(super) fn text(&self) -> String {
        self.raised.iter().map(|alarm| format!("{alarm}\n")).collect()
    }
}

#[cfg(test)]
#[path = "alarm_tests.rs"]
mod tests;
