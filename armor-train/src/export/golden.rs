//! The golden trace: recorded states and costs, flown by the controller.

use armor_core::units::CostLimit;
use armor_infer::Policy;
use firmware_sim::host::HostController;

use super::ExportError;
use crate::data::Dataset;

/// Control steps of a golden trace.
const ROWS: usize = 32;
/// Rows before the first cost, so that the budget is seen full and falling.
const LEAD: usize = 8;

/// Flies `policy` over a stretch of the data's costliest trajectory; returns
/// the words of the golden section.
pub(crate) fn record(policy: Policy<'_>, data: &Dataset, limit: CostLimit, seed: u64) -> Result<Vec<u32>, ExportError> {
    let costliest = data.trajectories().iter().max_by(|a, b| a.cost_return.total_cmp(&b.cost_return));
    let rows = costliest.ok_or(ExportError::NoTrajectory)?.rows.clone();
    let first_cost = rows.clone().find(|&row| data.cost(row) > 0.0).unwrap_or(rows.start);
    let start = first_cost.saturating_sub(LEAD).max(rows.start);
    let stretch = start..rows.end.min(start + ROWS);

    let costs = stretch.clone().scan(0.0, |next, row| Some(std::mem::replace(next, data.cost(row))));
    fly_golden(policy, limit, seed, stretch.map(|row| data.observation(row)).zip(costs))
}

/// Flies `policy` over states `[S]` and the costs that the steps before incurred; returns the words
/// of the golden section.
pub(crate) fn fly_golden<S: AsRef<[f32]>>(
    policy: Policy<'_>,
    limit: CostLimit,
    seed: u64,
    rows: impl Iterator<Item = (S, f32)>,
) -> Result<Vec<u32>, ExportError> {
    let mut controller = HostController::new(policy, limit, seed)?;
    let mut words = vec![seed as u32, (seed >> 32) as u32, limit.cost().to_raw(), 0];
    for (state, incurred) in rows {
        let state = state.as_ref();
        let step = controller.step(state, incurred);
        if let Some(fault) = step.fault {
            return Err(ExportError::Fault(fault));
        }
        words.extend(state.iter().map(|value| value.to_bits()));
        words.extend([incurred.to_bits(), step.kappa.to_raw()]);
        words.extend(step.action.iter().take(policy.shape().action.into()).map(|value| value.to_bits()));
        words[3] += 1;
    }
    Ok(words)
}
