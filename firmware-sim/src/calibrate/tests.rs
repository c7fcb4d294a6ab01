use super::*;
use crate::recorded::{Recorded, ball_run_transitions};

fn calibrate(rows: &[Recorded], firsts: &[usize]) -> CalibrationReport {
    let mut calibration = Calibration::new(Task::named("ball-run").unwrap()).unwrap();
    for (i, row) in rows.iter().enumerate() {
        calibration.push(&transition(row, firsts.contains(&i))).unwrap();
    }
    calibration.report()
}

fn transition(row: &Recorded, first: bool) -> Transition<'_> {
    Transition {
        first,
        observation: &row.observation,
        action: &row.action,
        reward: row.reward,
        cost: row.cost,
        next_observation: &row.next_observation,
    }
}

/// The bounds are half a unit in the last place of what is recorded, on
/// the way in and on the way out.
#[test]
fn the_plant_follows_the_opening_of_a_recorded_episode() {
    let report = calibrate(&ball_run_transitions()[..8], &[0]);
    assert_eq!((report.transitions, report.episodes), (8, 1));
    for deviation in [&report.one_step, &report.replay] {
        let largest = deviation.observation_max_abs.iter().copied().fold(0.0, f64::max);
        assert!(largest < 2e-8, "{report}");
        assert!(deviation.reward_max_abs < 2e-6, "{report}");
        assert_eq!(deviation.cost_mismatches, 0);
    }
    assert_eq!(report.recorded_cost_mismatches, 0);
}

#[test]
fn a_replay_starts_anew_with_every_episode() {
    let rows = ball_run_transitions();
    let all_first: Vec<usize> = (0..rows.len()).collect();
    let report = calibrate(&rows, &all_first);
    assert_eq!(report.replay, report.one_step);
    let one_episode = calibrate(&rows, &[0]);
    assert!(one_episode.replay.observation_max_abs[0] > 0.1, "{one_episode}");
}

#[test]
fn what_is_wrong_with_a_recording_is_counted() {
    let mut rows = ball_run_transitions();
    rows[2].cost = 1.0;
    rows[3].reward += 0.25;
    rows[4].next_observation[1] += 0.5;
    let report = calibrate(&rows[..8], &[0]);
    assert_eq!(report.recorded_cost_mismatches, 2); // row 4 now lies outside the lines
    assert_eq!(report.one_step.cost_mismatches, 1);
    assert!((report.one_step.reward_max_abs - 0.25).abs() < 1e-5);
    assert!((report.one_step.observation_max_abs[1] - 0.5).abs() < 1e-6);
    assert!((report.one_step.observation_rms[1] - 0.5 / 8f64.sqrt()).abs() < 1e-6);
}

#[test]
fn a_row_of_another_task_is_refused() {
    let mut calibration = Calibration::new(Task::named("ball-run").unwrap()).unwrap();
    let row = ball_run_transitions().swap_remove(0);
    let short = Transition { observation: &row.observation[1..], ..transition(&row, true) };
    assert!(calibration.push(&short).is_err());
    assert_eq!(calibration.report().transitions, 0);
}

#[test]
fn the_table_fits_a_terminal() {
    let table = calibrate(&ball_run_transitions(), &[0]).to_string();
    assert!(table.lines().all(|line| line.chars().count() <= 80), "{table}");
    assert!(table.starts_with("plant of ball-run against 20 transitions, 1 episodes"));
}
