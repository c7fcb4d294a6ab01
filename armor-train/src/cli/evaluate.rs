//! `armor-train evaluate`

use std::fmt;
use std::path::PathBuf;

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::flight::FlightPlan;
use firmware_sim::summary::FlightSummary;
use firmware_sim::task::Task;
use serde::Serialize;

use super::flyer::Flyer;

/// Fly a policy on a task and report normalised reward and cost (Eq. 17).
///
/// What flies is the image that would be deployed, on the same controller. A
/// task of a simulator is flown there, over the link; the simulators are
/// installed on first use, in a folder of the user's cache or in the one that
/// ARMOR_SIMULATORS names.
#[derive(Debug, clap::Args)]
pub(super) struct Evaluate {
    /// Folder of a run, or an image.
    policy: PathBuf,
    /// The task to fly.
    #[arg(long, value_parser = Task::named)]
    task: &'static Task,
    /// Cost limits, as in 5,10,20; the paper's limit for the task, if not given.
    #[arg(long, value_name = "D", value_delimiter = ',', value_parser = firmware_sim::cli::limit)]
    limit: Vec<CostLimit>,
    /// Calls of the denoiser that an action may take, which picks the rung; no
    /// limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
    /// Candidates for each action, of which the policy's critic takes the best:
    /// 1, 2, 4, 8 or 16. Of an image it must be exported with --critic.
    #[arg(long, value_name = "K", default_value_t = 1, value_parser = firmware_sim::cli::candidates)]
    best_of: u8,
    /// Episodes at each limit.
    #[arg(long, default_value_t = 20, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// Decides the starts and the noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// The run's recorded data, if it was moved.
    #[arg(long)]
    data: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    policy: PathBuf,
    best_of: u8,
    flights: Vec<FlightSummary>,
}

impl Evaluate {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let task = self.task;
        let with_critic = self.best_of > 1;
        let bytes = super::run_folder::image(&self.policy, self.data.as_ref(), with_critic, output)?;
        let image = PolicyImage::new_checked(bytes.as_slice())
            .map_err(|error| format!("{}: {error}", self.policy.display()))?;
        let flyer = Flyer::of(task, output)?;
        let limits = if self.limit.is_empty() { vec![CostLimit::new(task.cost_limit)?] } else { self.limit };
        let mut flights = Vec::new();
        for limit in limits {
            let plan = FlightPlan {
                task,
                limit,
                episodes: self.episodes,
                seed: self.seed,
                rate_hz: task.rate_hz,
                max_steps: self.max_steps,
            };
            flights.push(flyer.fly(&image, &plan, self.best_of, output)?.summary);
        }
        output.report(&Report { policy: self.policy, best_of: self.best_of, flights })
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "policy              {}", self.policy.display())?;
        if self.best_of > 1 {
            write!(f, "\nactions             best of {} by the critic", self.best_of)?;
        }
        for flight in &self.flights {
            write!(f, "\n\n{flight}")?;
        }
        Ok(())
    }
}
