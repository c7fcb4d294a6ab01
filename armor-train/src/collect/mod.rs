//! Recordings of mixed quality from native plants: a sweep of driving styles with
//! noise on the actions, thinned towards the statistics of the paper's Table 1.

mod campaign;
mod thin;

use armor_core::noise::{Noise, uniform};
use firmware_sim::plant::{Plant, Style};
use firmware_sim::task::{Task, TaskError};
use rayon::prelude::*;

use crate::data::Recording;
use crate::stream;

pub use campaign::{CAMPAIGNS, Campaign, Shares};

/// Trajectories driven for each one kept, so that thinning has a choice.
const CHOICE: usize = 4;

/// Drives a task's campaign and keeps `trajectories` of it (the campaign's own number, if `None`).
///
/// The same seed records the same bits, whatever the number of threads.
///
/// # Errors
/// [`TaskError::NotNative`]
pub fn collect(task: &'static Task, trajectories: Option<usize>, seed: u64) -> Result<Recording, TaskError> {
    let campaign = CAMPAIGNS.iter().find(|campaign| campaign.task == task.name);
    let campaign = campaign.ok_or(TaskError::NotNative { task: task.name })?;
    let wanted = trajectories.unwrap_or(campaign.trajectories);
    let noise = Noise::new(seed);
    let drive = |index: usize| Ok(drive(task, campaign, task.plant()?.as_mut(), noise, index as u64));
    let kept = match campaign.table_1 {
        None => (0..wanted).collect(),
        Some(shares) => {
            // Only what a choice needs is kept: all of them would be several times the recording.
            let outcome = |index| drive(index).map(|one: Recording| (total(&one.costs), one.costs.len()));
            let driven = (0..CHOICE * wanted).into_par_iter().map(outcome).collect::<Result<Vec<_>, TaskError>>()?;
            let steps = driven.iter().map(|(_, steps)| steps).sum::<usize>() as f64 / driven.len().max(1) as f64;
            let costs: Vec<f64> = driven.into_iter().map(|(cost, _)| cost).collect();
            let target = thin::Target {
                count: wanted,
                limit: f64::from(task.cost_limit),
                p_feas: shares.p_feas,
                mean_cost: shares.p_nz * steps,
            };
            thin::choose(&costs, &target)
        }
    };
    let mut all = Recording { state_dim: task.state, action_dim: task.action, ..Recording::default() };
    for one in kept.into_par_iter().map(drive).collect::<Result<Vec<_>, TaskError>>()? {
        all.append(&one);
    }
    Ok(all)
}

fn total(costs: &[f32]) -> f64 {
    costs.iter().map(|&cost| f64::from(cost)).sum()
}

/// One trajectory of a style of its own.
fn drive(task: &Task, campaign: &Campaign, plant: &mut dyn Plant, noise: Noise, index: u64) -> Recording {
    let within =
        |range: &std::ops::Range<f64>, word| range.start + (range.end - range.start) * f64::from(uniform(word));
    let [pace, margin, spread, low] = noise.words(stream::STYLE, index, 0);
    let [look, ..] = noise.words(stream::STYLE, index, 1);
    let style = Style {
        pace: within(&campaign.pace, pace),
        margin: within(&campaign.margin, margin),
        look: within(&campaign.look, look),
    };
    let spread = within(&campaign.noise, spread) as f32;
    plant.reset(index << 32 | u64::from(low));
    let mut one = Recording { state_dim: task.state, action_dim: task.action, ..Recording::default() };
    let (mut state, mut action, mut draws) = (vec![0.0; task.state], vec![0.0; task.action], vec![0.0f32; task.action]);
    plant.observe(&mut state);
    for step in 0..task.horizon {
        plant.pilot(&style, &mut action);
        stream::fill_normal(noise, stream::DRIVING, index * task.horizon as u64 + step as u64, &mut draws);
        for (action, draw) in action.iter_mut().zip(&draws) {
            *action = (*action + spread * draw).clamp(-1.0, 1.0);
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

    /// The statistics of so many trajectories.
    fn stats(task: &str, trajectories: Option<usize>) -> Stats {
        let task = Task::named(task).unwrap();
        let data = Dataset::new(collect(task, trajectories, 0).unwrap()).unwrap();
        assert_eq!(data.gaps().count(), 0, "every next observation is the one that follows");
        Stats::new(&data, CostLimit::new(task.cost_limit).unwrap(), 0.5)
    }

    #[test]
    fn ball_run_is_recorded_with_the_statistics_of_table_1() {
        let stats = stats("ball-run", None);
        assert_eq!((stats.transitions, stats.trajectories), (94_000, 940));
        assert!((stats.p_nz - 0.4868).abs() < 0.005, "{}", stats.p_nz);
        assert!((stats.p_feas - 0.0447).abs() < 0.001, "{}", stats.p_feas);
    }

    /// A share of so few trajectories is met to the nearest one.
    #[test]
    fn the_point_robot_is_recorded_with_the_statistics_of_table_1() {
        for (task, p_nz, p_feas) in [("point-circle", 0.2262, 0.1257), ("point-goal", 0.0307, 0.4525)] {
            let stats = stats(task, Some(60));
            assert!((stats.p_nz - p_nz).abs() < 0.01, "{task}: {}", stats.p_nz);
            assert!((stats.p_feas - p_feas).abs() < 0.01, "{task}: {}", stats.p_feas);
        }
    }

    #[test]
    fn ball_circle_is_recorded_with_good_and_bad_drivers() {
        let stats = stats("ball-circle", Some(60));
        assert!(stats.p_feas > 0.1 && stats.p_feas < 0.9, "{}", stats.p_feas);
        assert!(stats.reward_return_max > 2.0 * stats.reward_return_p5.max(1.0), "{stats}");
    }

    #[test]
    fn a_seed_records_the_same_bits_and_another_one_others() {
        let task = Task::named("ball-run").unwrap();
        let record = |seed| collect(task, Some(5), seed).unwrap();
        assert_eq!(record(1), record(1));
        assert_ne!(record(1), record(2));
    }

    #[test]
    fn every_native_task_has_a_campaign_and_another_one_is_refused() {
        let native = firmware_sim::task::TASKS.iter().filter(|task| task.plant().is_ok());
        assert!(native.map(|task| task.name).eq(CAMPAIGNS.iter().map(|campaign| campaign.task)));
        let error = collect(Task::named("SafetyAntRun-v0").unwrap(), Some(1), 0).unwrap_err().to_string();
        assert!(error.contains("needs its simulator"), "{error}");
    }
}
