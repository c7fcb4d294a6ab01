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

    let mut controller = HostController::new(policy, limit, seed)?;
    let header = [seed as u32, (seed >> 32) as u32, limit.cost().to_raw(), stretch.len() as u32];
    let mut words = header.to_vec();
    let mut incurred = 0.0f32;
    for row in stretch {
        let state = data.observation(row);
        let step = controller.step(state, incurred);
        if let Some(fault) = step.fault {
            return Err(ExportError::Fault(fault));
        }
        words.extend(state.iter().map(|value| value.to_bits()));
        words.extend([incurred.to_bits(), step.kappa.to_raw()]);
        words.extend(step.action.iter().take(data.action_dim()).map(|value| value.to_bits()));
        incurred = data.cost(row);
    }
    Ok(words)
}
