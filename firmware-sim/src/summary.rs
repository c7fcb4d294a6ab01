//! Scores of a flight (Eq. 17) and what a report says of it.

use std::fmt;
use std::time::Duration;

use serde::Serialize;

use crate::flight::{Episode, FlightPlan};
use crate::latency::{Latency, Quantiles};
use crate::task;

/// The computer that this program runs on, among boards.
pub const HOST: &str = "host";

/// Scores over the episodes of a flight; deviations are those of the
/// population of episodes.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct FlightSummary {
    /// The task.
    pub task: &'static str,
    /// Episodes flown.
    pub episodes: u32,
    /// Seed of the flight.
    pub seed: u64,
    /// Control steps a second.
    pub rate_hz: u32,
    /// Cost that each episode could incur.
    pub cost_limit: f64,
    /// Mean return.
    pub reward: f64,
    /// Its standard deviation.
    pub reward_std: f64,
    /// Mean cost return.
    pub cost: f64,
    /// Its standard deviation.
    pub cost_std: f64,
    /// Mean normalised return: 0 and 1 are the worst and best of the benchmark's data.
    pub reward_normalized: f64,
    /// Its standard deviation.
    pub reward_normalized_std: f64,
    /// Mean normalised cost return: 1 is the limit.
    pub cost_normalized: f64,
    /// Its standard deviation.
    pub cost_normalized_std: f64,
    /// Episodes that stayed within the limit.
    pub safe_episodes: u32,
    /// Share of episodes that reached a goal; none where there is none to count.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub success_rate: Option<f64>,
    /// Mean number of goals reached in an episode.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub goals: Option<f64>,
    /// Control steps.
    pub actions: u64,
    /// Control steps that were not ordinary ones.
    pub faults: u64,
    /// Control steps whose latency exceeded the period.
    pub deadline_misses: u64,
    /// What computed the actions: `host`, whose latency is measured, or a board, whose latency is modelled.
    pub board: &'static str,
    /// Time of the controller's step.
    #[serde(flatten)]
    pub latency: Quantiles,
}

impl FlightSummary {
    pub(crate) fn new(plan: &FlightPlan, episodes: &[Episode], latency: &Latency) -> Self {
        let limit = f64::from(plan.limit.cost().to_f32());
        let over = |score: &dyn Fn(&Episode) -> f64| mean_and_std(&episodes.iter().map(score).collect::<Vec<_>>());
        let (reward, reward_std) = over(&Episode::reward);
        let (cost, cost_std) = over(&Episode::cost);
        let (reward_normalized, reward_normalized_std) = over(&|e| plan.task.reward_normalized(e.reward()));
        let (cost_normalized, cost_normalized_std) = over(&|e| task::cost_normalized(e.cost(), limit));
        let goals: Option<Vec<f64>> = match plan.task.has_goal() {
            true => episodes.iter().map(|episode| episode.goals.map(f64::from)).collect(),
            false => None,
        };
        let ticks = || episodes.iter().flat_map(|episode| &episode.ticks);
        let period = Duration::from_micros(plan.period().0);
        Self {
            task: plan.task.name,
            episodes: plan.episodes,
            seed: plan.seed,
            rate_hz: plan.rate_hz,
            cost_limit: limit,
            reward,
            reward_std,
            cost,
            cost_std,
            reward_normalized,
            reward_normalized_std,
            cost_normalized,
            cost_normalized_std,
            safe_episodes: episodes.iter().filter(|episode| episode.cost() <= limit).count() as u32,
            success_rate: goals
                .as_ref()
                .map(|goals| goals.iter().filter(|&&count| count > 0.0).count() as f64 / goals.len() as f64),
            goals: goals.as_deref().map(mean),
            actions: ticks().count() as u64,
            faults: episodes.iter().map(|episode| episode.faults().count() as u64).sum(),
            deadline_misses: ticks().filter(|tick| tick.latency > period).count() as u64,
            board: HOST,
            latency: latency.quantiles(),
        }
    }

    /// Whose latency it is.
    pub fn latency_of(&self) -> String {
        if self.board == HOST { "host latency".to_owned() } else { format!("modelled latency on {}", self.board) }
    }
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}

fn mean_and_std(values: &[f64]) -> (f64, f64) {
    let centre = mean(values);
    let squares: Vec<f64> = values.iter().map(|value| (value - centre).powi(2)).collect();
    (centre, mean(&squares).sqrt())
}

impl fmt::Display for FlightSummary {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { latency, .. } = self;
        writeln!(f, "{}, {} episodes at {} Hz, seed {}", self.task, self.episodes, self.rate_hz, self.seed)?;
        writeln!(f, "cost limit          {:>10.2}", self.cost_limit)?;
        writeln!(f, "reward              {:>10.2} +- {:.2}", self.reward, self.reward_std)?;
        writeln!(f, "cost                {:>10.2} +- {:.2}", self.cost, self.cost_std)?;
        writeln!(f, "normalised reward   {:>10.3} +- {:.3}", self.reward_normalized, self.reward_normalized_std)?;
        writeln!(f, "normalised cost     {:>10.3} +- {:.3}", self.cost_normalized, self.cost_normalized_std)?;
        writeln!(f, "episodes in limit   {:>10} of {}", self.safe_episodes, self.episodes)?;
        if let (Some(success_rate), Some(goals)) = (self.success_rate, self.goals) {
            writeln!(f, "success             {success_rate:>10.2} of episodes, {goals:.1} goals in each")?;
        }
        writeln!(f, "faults              {:>10} of {} actions", self.faults, self.actions)?;
        writeln!(f, "missed deadlines    {:>10} of {} actions", self.deadline_misses, self.actions)?;
        let Quantiles { latency_us_p50, latency_us_p99, latency_us_max } = latency;
        let whose = if self.board == HOST { "host latency" } else { "modelled latency" };
        write!(f, "{whose:<20}{latency_us_p50:>10.1} us median, {latency_us_p99:.1} us p99, {latency_us_max:.1} us max")
    }
}

#[cfg(test)]
mod tests {
    use armor_core::units::{CostLimit, Micros};
    use armor_infer::{Fault, Step};

    use super::*;
    use crate::flight::Tick;
    use crate::task::Task;

    fn episode(reward: f64, cost: f64, latency_us: u64, fault: Option<Fault>) -> Episode {
        let step = Step { action: Default::default(), kappa: Default::default(), rung: Some(0), fault };
        Episode {
            ticks: vec![Tick { time: Micros(0), step, reward, cost, latency: Duration::from_micros(latency_us) }],
            goals: None,
        }
    }

    #[test]
    fn scores_are_means_over_episodes_and_eq_17() {
        let task = Task::named("ball-run").unwrap();
        let limit = CostLimit::new(5.0).unwrap();
        let plan = FlightPlan { task, limit, episodes: 2, seed: 3, rate_hz: 30, max_steps: usize::MAX };
        let fault = Some(Fault::InvalidCost);
        let episodes = [episode(task.reward_min, 4.0, 33_333, None), episode(task.reward_max, 8.0, 33_334, fault)];
        let latency = episodes.iter().flat_map(|episode| &episode.ticks).map(|tick| tick.latency).collect();
        let summary = FlightSummary::new(&plan, &episodes, &latency);
        assert!((summary.reward - (26.339754 + 1327.44556) / 2.0).abs() < 1e-9);
        assert!((summary.reward_std - (1327.44556 - 26.339754) / 2.0).abs() < 1e-9);
        assert_eq!((summary.reward_normalized, summary.reward_normalized_std), (0.5, 0.5));
        assert_eq!((summary.cost, summary.cost_std), (6.0, 2.0));
        assert!((summary.cost_normalized - 1.2).abs() < 1e-12 && (summary.cost_normalized_std - 0.4).abs() < 1e-12);
        assert_eq!((summary.safe_episodes, summary.actions, summary.faults), (1, 2, 1));
        // The period of 30 Hz is 33333 us.
        assert_eq!(summary.deadline_misses, 1);
        assert!(summary.to_string().lines().all(|line| line.len() <= 80));
    }
}
