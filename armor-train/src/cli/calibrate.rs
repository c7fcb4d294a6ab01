//! `armor-train calibrate`

use std::fmt;
use std::path::PathBuf;

use firmware_sim::cli::output::{CommandResult, Output};
use indicatif::{ProgressBar, ProgressDrawTarget};
use serde::Serialize;

use super::run_folder::checkpoint_and_data;
use crate::calibrate::fitted::Evaluation;
use crate::calibrate::{CalibrateError, Knots, MAP_FILE, grid, returns};
use crate::data::Dataset;
use crate::extraction::condition::Condition;
use crate::learner::Learner;
use crate::phase::Phase;
use crate::run::Checkpoint;
use crate::source::Source;

/// Choose how an actor conditioned on the price of cost meets a budget.
///
/// From the run's data and critics alone: the cost of an episode is estimated
/// for policies from the strictest to the boldest, and each remaining budget is
/// given the boldest that fits. The map is written into the run's folder, and
/// `armor-train export` puts it into the image.
#[derive(Debug, clap::Args)]
pub(super) struct Calibrate {
    /// Folder of a run with `condition` = lambda.
    dir: PathBuf,
    /// The estimate that the map follows.
    #[arg(long, default_value = "fitted")]
    estimate: Estimate,
    /// Steps of fitting.
    #[arg(long, default_value_t = 6000, value_parser = clap::value_parser!(u64).range(1..))]
    steps: u64,
    /// Factor on the estimated costs; above 1 is more careful.
    #[arg(long, default_value_t = 1.0, value_parser = positive)]
    margin: f64,
    /// Give every budget this leniency, from 0 to 1, and estimate nothing.
    #[arg(long, value_name = "X", value_parser = leniency, conflicts_with_all = ["estimate", "steps", "margin"])]
    constant: Option<f32>,
    /// The run's recorded data, if it was moved.
    #[arg(long)]
    data: Option<PathBuf>,
}

#[derive(Clone, Copy, Debug, Serialize, clap::ValueEnum)]
#[serde(rename_all = "snake_case")]
enum Estimate {
    /// Fitted Q evaluation of the policies.
    Fitted,
    /// Cost of the trajectories that the policies imitate.
    Returns,
}

#[derive(Serialize)]
struct Report {
    map: PathBuf,
    estimate: Option<Estimate>,
    policies: Vec<Judged>,
}

/// A policy of the family, and what an episode of it should cost.
#[derive(Serialize)]
struct Judged {
    leniency: f64,
    lambda: f64,
    cost_fitted: f64,
    cost_returns: f64,
}

impl Calibrate {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let (checkpoint, data) = checkpoint_and_data(&self.dir, self.data.as_ref(), output)?;
        check(&checkpoint)?;
        let (knots, policies) = match self.constant {
            Some(leniency) => (Knots::constant(leniency), Vec::new()),
            None => self.judge(&checkpoint, &data, output),
        };
        knots.write(&self.dir)?;
        let estimate = self.constant.is_none().then_some(self.estimate);
        output.report(&Report { map: self.dir.join(MAP_FILE), estimate, policies })
    }

    /// Both estimates, and the map by the one that was asked for.
    fn judge(&self, checkpoint: &Checkpoint, data: &Dataset, output: Output) -> (Knots, Vec<Judged>) {
        let config = &checkpoint.config;
        let learner = Learner::resume(config.clone(), data, checkpoint.state.clone());
        let evaluation = Evaluation {
            config,
            actor: (&learner.model().actor, checkpoint.state.flying_actor()),
            data,
            source: Source::new(config, data, learner.normaliser()),
        };
        output.note(format_args!("evaluating the policies in {} steps", self.steps));
        let bar = ProgressBar::with_draw_target(Some(self.steps), ProgressDrawTarget::stderr());
        let leniencies = grid();
        let fitted = evaluation.costs(&leniencies, self.steps, |step| bar.set_position(step));
        bar.finish_and_clear();
        let returns = learner.judge_data().map_or_else(Vec::new, |cloning| returns::costs(&cloning, data, &leniencies));
        let chosen = match self.estimate {
            Estimate::Fitted => &fitted,
            Estimate::Returns => &returns,
        };
        let knots = Knots::choose(&leniencies, chosen, self.margin);
        let range = config.lambda_range();
        let pairs = leniencies.into_iter().zip(fitted.iter().zip(&returns));
        let judged = |(leniency, (&cost_fitted, &cost_returns))| Judged {
            leniency,
            lambda: range.lambda(leniency),
            cost_fitted,
            cost_returns,
        };
        (knots, pairs.map(judged).collect())
    }
}

/// Whether the run has an actor that is conditioned on the price of cost.
fn check(checkpoint: &Checkpoint) -> Result<(), CalibrateError> {
    let (config, done) = (&checkpoint.config, checkpoint.state.step);
    if config.condition != Condition::Lambda {
        return Err(CalibrateError::Condition(config.condition));
    }
    match Phase::of(config, done) {
        Phase::Critics => Err(CalibrateError::Untrained { done, start: config.critic_steps }),
        Phase::Joint | Phase::Actor => Ok(()),
    }
}

fn positive(text: &str) -> Result<f64, String> {
    let value = text.parse().ok().filter(|value: &f64| value.is_finite() && *value > 0.0);
    value.ok_or_else(|| "give a finite number above 0".to_owned())
}

fn leniency(text: &str) -> Result<f32, String> {
    let value = text.parse().ok().filter(|value| (0.0..=1.0).contains(value));
    value.ok_or_else(|| "give a number from 0, the strictest, to 1, the boldest".to_owned())
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        if !self.policies.is_empty() {
            writeln!(f, "leniency    lambda  cost, fitted  cost, returns")?;
        }
        for Judged { leniency, lambda, cost_fitted, cost_returns } in &self.policies {
            writeln!(f, "{leniency:>8.3} {lambda:>9.3} {cost_fitted:>13.2} {cost_returns:>14.2}")?;
        }
        write!(f, "map                 {}", self.map.display())
    }
}
