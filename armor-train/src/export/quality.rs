//! The quality card: how a policy flies on its task's native plant.

use armor_core::image::{MAX_RUNGS, PolicyImage, Quality};
use armor_core::units::CostLimit;
use firmware_sim::flight::{FlightPlan, fly_best_of};
use firmware_sim::task::Task;
use heapless::Vec as FixedVec;

use super::ExportError;

/// Episodes of a flight, as in the paper (Table 3).
const EPISODES: u16 = 20;
/// Numbers of candidates that the best is taken of.
const CANDIDATES: [u8; 2] = [4, 16];

/// How each rung flies; empty where the task has no native plant.
pub(crate) fn quality(
    image: &PolicyImage<'_>,
    limit: CostLimit,
    seed: u64,
) -> Result<FixedVec<Quality, MAX_RUNGS>, ExportError> {
    let rungs = 0..image.manifest().rungs.len();
    rungs.filter_map(|rung| flown(image, (rung, 1), limit, seed).transpose()).collect()
}

/// How the longest rung flies where the critic chooses; empty where there is no native plant.
pub(super) fn quality_best_of(
    image: &PolicyImage<'_>,
    limit: CostLimit,
    seed: u64,
) -> Result<Vec<Quality>, ExportError> {
    CANDIDATES.iter().filter_map(|&count| flown(image, (0, count), limit, seed).transpose()).collect()
}

fn flown(
    image: &PolicyImage<'_>,
    (rung, candidates): (usize, u8),
    limit: CostLimit,
    seed: u64,
) -> Result<Option<Quality>, ExportError> {
    let native = Task::named(image.manifest().task).ok().filter(|task| task.plant().is_ok());
    let (Some(task), Some(chain)) = (native, image.manifest().rungs.get(rung)) else { return Ok(None) };
    let max_steps = chain.steps.into();
    let plan = FlightPlan { task, limit, episodes: EPISODES.into(), seed, rate_hz: task.rate_hz, max_steps };
    let summary = fly_best_of(image, &plan, candidates)?.summary;
    Ok(Some(Quality {
        rung: rung as u8,
        limit: limit.cost(),
        candidates,
        episodes: EPISODES,
        reward_normalized: summary.reward_normalized as f32,
        cost_normalized: summary.cost_normalized as f32,
    }))
}
