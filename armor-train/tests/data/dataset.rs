//! What a data set makes of any recording.

use armor_train::data::{Dataset, Fault, Key, Recording, StateMoments};
use proptest::prelude::*;

/// A recording with ends and gaps where the flags say, and states that are all different.
fn recording(ends: &[(bool, bool)], gaps: &[bool], costs: &[f32]) -> Recording {
    let rows = ends.len();
    let state = |t: usize| [t as f32, -0.25 * t as f32];
    let next = |t: usize| if gaps[t] { [-1.0, t as f32] } else { state(t + 1) };
    Recording {
        state_dim: 2,
        action_dim: 1,
        observations: (0..rows).flat_map(state).collect(),
        next_observations: (0..rows).flat_map(next).collect(),
        actions: (0..rows).map(|t| t as f32 / rows as f32).collect(),
        rewards: (0..rows).map(|t| t as f32).collect(),
        costs: costs.to_vec(),
        terminals: ends.iter().map(|end| end.0).collect(),
        timeouts: ends.iter().map(|end| end.1).collect(),
        sha256: [7; 32],
    }
}

fn rows() -> impl Strategy<Value = Vec<((bool, bool), bool, f32)>> {
    let end = (prop::bool::weighted(0.1), prop::bool::weighted(0.1));
    let cost = prop_oneof![Just(0.0f32), Just(1.0), (0u8..8).prop_map(|eighths| f32::from(eighths) / 8.0)];
    prop::collection::vec((end, prop::bool::weighted(0.2), cost), 1..80)
}

proptest! {
    /// Section 3.1 and O-1 to O-3, by their definitions on the raw columns.
    #[test]
    fn a_data_set_is_its_recording_split_at_the_ends(rows in rows()) {
        let ends: Vec<_> = rows.iter().map(|row| row.0).collect();
        let gaps: Vec<_> = rows.iter().map(|row| row.1).collect();
        let costs: Vec<_> = rows.iter().map(|row| row.2).collect();
        let recording = recording(&ends, &gaps, &costs);
        let end_rows: Vec<_> = (0..ends.len()).filter(|&row| ends[row].0 || ends[row].1).collect();
        let Ok(dataset) = Dataset::new(recording.clone()) else {
            prop_assert_eq!(Dataset::new(recording).unwrap_err(), Fault::NoEpisodeEnd { rows: rows.len() });
            prop_assert!(end_rows.is_empty());
            return Ok(());
        };
        let kept = end_rows[end_rows.len() - 1] + 1;
        prop_assert_eq!(dataset.len(), kept);
        prop_assert_eq!(dataset.after_last_end(), rows.len() - kept);
        prop_assert_eq!(dataset.trajectories().len(), end_rows.len());
        prop_assert_eq!(dataset.sha256(), &[7; 32]);
        for row in 0..kept {
            let end = end_rows.iter().copied().find(|&end| end >= row).unwrap();
            let start = end_rows.iter().copied().rfind(|&end| end < row).map_or(0, |end| end + 1);
            prop_assert_eq!(dataset.observation(row), &recording.observations[2 * row..2 * row + 2]);
            prop_assert_eq!(dataset.next_observation(row), &recording.next_observations[2 * row..2 * row + 2]);
            prop_assert_eq!(dataset.action(row), &recording.actions[row..row + 1]);
            prop_assert_eq!(dataset.reward(row), recording.rewards[row]);
            prop_assert_eq!(dataset.cost(row), costs[row]);
            prop_assert_eq!(dataset.done(row), row == end);
            prop_assert_eq!(dataset.kappa(row), costs[row..=end].iter().sum::<f32>());
            prop_assert_eq!(dataset.kappa_next(row), costs[row + 1..=end].iter().sum::<f32>());
            prop_assert_eq!(dataset.trajectory_cost(row), costs[start..=end].iter().sum::<f32>());
            let trajectory = &dataset.trajectories()[dataset.trajectory(row)];
            prop_assert_eq!(&trajectory.rows, &(start..end + 1));
            prop_assert_eq!(trajectory.reward_return, (start..=end).map(|row| row as f64).sum::<f64>());
        }
        let expected_gaps: Vec<_> = (0..kept).filter(|row| gaps[*row] && !end_rows.contains(row)).collect();
        prop_assert_eq!(dataset.gaps().collect::<Vec<_>>(), expected_gaps);
    }
}

#[test]
fn costs_that_are_no_binary_fractions_add_up_to_rounding() {
    let ends: Vec<_> = (1..=1000).map(|row| (row == 1000, false)).collect();
    let dataset = Dataset::new(recording(&ends, &[false; 1000], &[0.1; 1000])).unwrap();
    assert_eq!(dataset.max_kappa(), 100.0);
    for row in 0..dataset.len() {
        let exact = f64::from(0.1f32) * (1000 - row) as f64;
        assert_eq!(dataset.kappa(row), exact as f32, "row {row}");
        assert_eq!(dataset.kappa_next(row), if row == 999 { 0.0 } else { dataset.kappa(row + 1) });
    }
}

#[test]
fn a_recording_put_together_wrongly_is_refused() {
    let sound = || recording(&[(false, false), (true, false)], &[false; 2], &[0.0; 2]);
    assert!(Dataset::new(sound()).is_ok());
    let refused = |spoil: fn(&mut Recording)| {
        let mut recording = sound();
        spoil(&mut recording);
        Dataset::new(recording).unwrap_err()
    };
    assert_eq!(refused(|r| r.costs.clear()), Fault::LengthsDiffer { key: Key::Costs, rows: 0, expected: 2 });
    assert_eq!(
        refused(|r| r.observations.truncate(3)),
        Fault::WrongShape { key: Key::Observations, shape: vec![2, 2] }
    );
    assert_eq!(refused(|r| r.action_dim = 0), Fault::WrongShape { key: Key::Actions, shape: vec![2, 0] });
    let too_wide = |r: &mut Recording| (r.action_dim, r.actions) = (65, vec![0.0; 130]);
    assert_eq!(refused(too_wide), Fault::WrongShape { key: Key::Actions, shape: vec![2, 65] });
    assert_eq!(refused(|r| r.rewards[1] = f32::NAN), Fault::NotFinite { key: Key::Rewards, row: 1, count: 1 });
    assert_eq!(refused(|r| r.terminals.fill(false)), Fault::NoEpisodeEnd { rows: 2 });
    assert_eq!(Dataset::new(Recording { state_dim: 1, action_dim: 1, ..Recording::default() }), Err(Fault::Empty));
}

/// Population moments of 0, 1, .., 4: mean 2, variance 2; an entry that varies by rounding only keeps factor 1.
#[test]
fn moments_leave_constant_entries_alone() {
    let mut recording = recording(
        &[(false, false), (false, false), (false, false), (false, false), (true, false)],
        &[false; 5],
        &[0.0; 5],
    );
    for (row, state) in recording.observations.chunks_mut(2).enumerate() {
        state[1] = 1000.0 + row as f32 / 16384.0; // a step of f32
    }
    let moments = StateMoments::new(&Dataset::new(recording).unwrap());
    assert_eq!(moments.constant, [1]);
    assert_eq!((moments.mean[0], moments.std[0]), (2.0, 2f32.sqrt()));
    assert_eq!(moments.std[1], 1.0);
    assert!((moments.mean[1] - 1000.0).abs() < 1e-3);
}
