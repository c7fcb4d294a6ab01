//! What the tests of several plants share.

use std::fmt::Debug;

use super::{Plant, Style};
use crate::task::Task;

/// What a plant's sensors say.
pub(super) fn observed<const STATE: usize>(plant: &impl Plant) -> [f32; STATE] {
    let mut state = [0.0; STATE];
    plant.observe(&mut state);
    state
}

/// The farthest start of 1000 seeds, as `extent` measures it; each is the same
/// again by its seed, whatever came in between.
pub(super) fn farthest_start<P: Plant + Copy + PartialEq + Debug>(mut plant: P, extent: impl Fn(&P) -> f64) -> f64 {
    let starts = (0..1000).map(|seed| {
        plant.reset(seed);
        let first = plant;
        plant.step(&[1.0, 1.0]);
        plant.reset(seed);
        assert_eq!(plant, first);
        extent(&first)
    });
    starts.fold(0.0, f64::max)
}

/// Mean of 20 episodes of a script: normalised reward, and cost.
pub(super) fn scripted(task: &str, style: Style) -> (f64, f64) {
    let task = Task::named(task).unwrap();
    let mut plant = task.plant().unwrap();
    let (mut rewards, mut costs) = (0.0, 0.0);
    let mut action = vec![0.0; task.action];
    for seed in 0..20 {
        plant.reset(seed);
        for _ in 0..task.horizon {
            plant.pilot(&style, &mut action);
            let outcome = plant.step(&action);
            rewards += outcome.reward;
            costs += outcome.cost;
        }
    }
    (task.reward_normalized(rewards / 20.0), costs / 20.0)
}
