//! Recordings of mixed quality from native plants: a sweep of driving styles with
//! noise on the actions, thinned towards the statistics of the paper's Table 1.

mod style;
mod thin;

use armor_core::noise::{Noise, uniform};
use firmware_sim::plant::Plant;
use firmware_sim::task::{Task, TaskError};

use crate::data::Recording;
use crate::stream;

pub use style::{CAMPAIGNS, Campaign, Style};

/// Trajectories driven for each one kept, so that thinning has a choice.
const CHOICE: usize = 4;

/// Why nothing can be recorded.
#[derive(Debug, thiserror::Error)]
pub enum CollectError {
    /// The task has no plant here.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// No driving styles are known for the task.
    #[error("no driving styles are known for {task}; they are for {}", known())]
    NoStyles {
        /// The task.
        task: &'static str,
    },
}

fn known() -> String {
    CAMPAIGNS.iter().map(|campaign| campaign.task).collect::<Vec<_>>().join(", ")
}

/// Drives a task's campaign and keeps `trajectories` of it (the campaign's own number, if `None`).
///
/// The same seed records the same bits.
///
/// # Errors
/// [`CollectError`]
pub fn collect(task: &'static Task, trajectories: Option<usize>, seed: u64) -> Result<Recording, CollectError> {
    let mut plant = task.plant()?;
    let campaign = CAMPAIGNS
        .iter()
        .find(|campaign| campaign.task == task.name)
        .ok_or(CollectError::NoStyles { task: task.name })?;
    let wanted = trajectories.unwrap_or(campaign.trajectories);
    let noise = Noise::new(seed);
    let driven: Vec<Recording> =
        (0..CHOICE * wanted).map(|index| drive(task, campaign, plant.as_mut(), noise, index as u64)).collect();
    let costs: Vec<f64> = driven.iter().map(|one| one.costs.iter().map(|&cost| f64::from(cost)).sum()).collect();
    let steps = driven.iter().map(|one| one.costs.len()).sum::<usize>() as f64 / driven.len().max(1) as f64;
    let target = thin::Target {
        count: wanted,
        limit: f64::from(task.cost_limit),
        p_feas: campaign.p_feas,
        mean_cost: campaign.p_nz * steps,
    };
    let kept = thin::choose(&costs, &target);
    let mut all = Recording { state_dim: task.state, action_dim: task.action, ..Recording::default() };
    for index in kept {
        all.append(&driven[index]);
    }
    Ok(all)
}

/// One trajectory of a style of its own.
fn drive(task: &Task, campaign: &Campaign, plant: &mut dyn Plant, noise: Noise, index: u64) -> Recording {
    let [speed, margin, spread, low] = noise.words(stream::STYLE, index, 0);
    let within =
        |range: &std::ops::Range<f64>, word| range.start + (range.end - range.start) * f64::from(uniform(word));
    let style = Style {
        speed: within(&campaign.speed, speed),
        margin: within(&campaign.margin, margin),
        noise: within(&campaign.noise, spread),
    };
    plant.reset(index << 32 | u64::from(low));
    let mut one = Recording { state_dim: task.state, action_dim: task.action, ..Recording::default() };
    let (mut state, mut action, mut draws) = (vec![0.0; task.state], vec![0.0; task.action], vec![0.0f32; task.action]);
    plant.observe(&mut state);
    for step in 0..task.horizon {
        (campaign.drive)(style, &state, &mut action);
        stream::fill_normal(noise, stream::DRIVING, index * task.horizon as u64 + step as u64, &mut draws);
        for (action, draw) in action.iter_mut().zip(&draws) {
            *action = (*action + style.noise as f32 * draw).clamp(-1.0, 1.0);
        }
        one.observations.extend_from_slice(&state);
        let outcome = plant.step(&action);
        plant.observe(&mut state);
        one.next_observations.extend_from_slice(&state);
        one.actions.extend_from_slice(&action);
        one.rewards.push(outcome.reward as f32);
        one.costs.push(outcome.cost as f32);
        one.terminals.push(outcome.done);
        one.timeouts.push(!outcome.done && step + 1 == task.horizon);
        if outcome.done {
            break;
        }
    }
    one
}

#[cfg(test)]
mod tests {
    use armor_core::units::CostLimit;

    use super::*;
    use crate::data::{Dataset, Stats};

    #[test]
    fn ball_run_is_recorded_with_the_statistics_of_table_1() {
        let task = Task::named("ball-run").unwrap();
        let data = Dataset::new(collect(task, None, 0).unwrap()).unwrap();
        let stats = Stats::new(&data, CostLimit::new(task.cost_limit).unwrap(), 0.5);
        assert_eq!((stats.transitions, stats.trajectories), (94_000, 940));
        assert!((stats.p_nz - 0.4868).abs() < 0.005, "{}", stats.p_nz);
        assert!((stats.p_feas - 0.0447).abs() < 0.001, "{}", stats.p_feas);
        assert_eq!(data.gaps().count(), 0, "every next observation is the one that follows");
    }

    #[test]
    fn a_seed_records_the_same_bits_and_another_one_others() {
        let task = Task::named("ball-run").unwrap();
        let record = |seed| collect(task, Some(5), seed).unwrap();
        assert_eq!(record(1), record(1));
        assert_ne!(record(1), record(2));
    }

    #[test]
    fn a_task_without_plant_or_styles_is_refused() {
        let error = |task: &str| collect(Task::named(task).unwrap(), Some(1), 0).unwrap_err().to_string();
        assert!(error("SafetyAntRun-v0").contains("needs its simulator"));
        assert!(error("ball-circle").contains("no driving styles are known for ball-circle; they are for ball-run"));
    }
}
