//! What `sweep` and `soak` fly: the arguments that they share.

use std::path::PathBuf;

use armor_core::units::CostLimit;

use super::BoardChoice;
use crate::flight::FlightPlan;
use crate::summary::HOST;
use crate::task::Task;

/// An image, a task, and what computes the actions.
#[derive(Debug, clap::Args)]
pub(super) struct Subject {
    /// The policy image.
    pub(super) image: PathBuf,
    /// The task to fly.
    #[arg(long, value_parser = super::task)]
    pub(super) task: &'static Task,
    /// What computes the actions: this host, at once, or a board, by its model.
    #[arg(long, default_value = HOST, value_parser = super::board)]
    pub(super) board: BoardChoice,
    /// Cost that an episode may incur; the paper's limit for the task, if not given.
    #[arg(long, value_name = "D", value_parser = super::limit)]
    limit: Option<CostLimit>,
    /// Calls of the denoiser that an action may take; no limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
}

impl Subject {
    /// Flights of this at the task's own rate.
    ///
    /// # Errors
    /// Where the task has no plant here, or its limit is none.
    pub(super) fn plan(&self, seed: u64, episodes: u32) -> Result<FlightPlan, Box<dyn std::error::Error>> {
        let task = self.task;
        task.plant()?;
        let limit = self.limit.map_or_else(|| CostLimit::new(task.cost_limit), Ok)?;
        Ok(FlightPlan { task, limit, episodes, seed, rate_hz: task.rate_hz, max_steps: self.max_steps })
    }

    /// The name of what computes the actions.
    pub(super) fn board_name(&self) -> &'static str {
        self.board.map_or(HOST, |board| board.name)
    }
}
