//! Which stream of the counter-based noise serves what, so that no two uses
//! share a draw and a resumed run repeats the draws of one never stopped.

use armor_core::noise::{Noise, below};

use crate::nn::Scalar;

/// Initial weights; the tick is the network.
pub(crate) const INITIALISE: u32 = 1;
/// Rows of a batch; the tick is the training step.
pub(crate) const ROWS: u32 = 2;
/// Noise levels of behaviour cloning; the tick is the training step.
pub(crate) const LEVELS: u32 = 3;
/// Order of the tasks in gradient surgery; the tick is the training step.
pub(crate) const SURGERY: u32 = 4;
/// Shuffle of the data into mini-batches; the tick is the training step.
pub(crate) const SHUFFLE: u32 = 5;
/// Whether a sample's budget is relabelled; the tick is the training step.
pub(crate) const BUDGET: u32 = 7;
/// The budget it is relabelled with; the tick is the training step.
pub(crate) const RELABEL: u32 = 8;
/// Leniency that a sample is cloned under; the tick is the training step.
pub(crate) const LENIENCY: u32 = 9;
/// Which twin of a critic is asked, where that is random; the tick is the training step.
pub(crate) const TWINS: u32 = 15;
/// Trajectory that a row is drawn from, where rows are drawn so; the tick is the training step.
pub(crate) const TRAJECTORIES: u32 = 16;
/// Bin of trajectories that it is drawn from; the tick is the training step.
pub(crate) const BINS: u32 = 17;
/// Noise put on recorded rewards; the tick is the row.
pub(crate) const REWARD_NOISE: u32 = 18;
/// Recorded costs that are misread; the tick is the row.
pub(crate) const COST_ERRORS: u32 = 19;
/// Noise on the states that an actor is cloned from; the tick is the sample.
pub(crate) const STATE_NOISE: u32 = 20;
/// Driving style of a collected trajectory, and its start; the tick is the trajectory.
pub(crate) const STYLE: u32 = 13;
/// Noise on collected actions; the tick is the control step.
pub(crate) const DRIVING: u32 = 14;
/// Noise of behaviour cloning; the tick is the sample (step times batch, plus its place).
pub(crate) const CLONING: u32 = 6;
/// Chain of the next actions, one stream a stage; the tick is the sample.
pub(crate) const TARGET_CHAIN: u32 = 0x100;
/// Chain of the policy's actions, one stream a stage; the tick is the sample.
pub(crate) const POLICY_CHAIN: u32 = 0x200;
/// Initial weights of an evaluation of policies.
pub(crate) const EVALUATION_START: u32 = 10;
/// Rows of a batch of it; the tick is its step.
pub(crate) const EVALUATION_ROWS: u32 = 11;
/// Leniencies of a batch of it; the tick is its step.
pub(crate) const EVALUATION_LENIENCY: u32 = 12;
/// Chain of its actions, one stream a stage; the tick is the sample.
pub(crate) const EVALUATION_CHAIN: u32 = 0x300;
/// Perturbed actions, one stream a perturbation; the tick is the refresh times rows, plus the row.
pub(crate) const PERTURBATION: u32 = 0x400;

/// Standard normal draws of a stream and tick, as the controller would draw them.
pub(crate) fn fill_normal<T: Scalar>(noise: Noise, stream: u32, tick: u64, out: &mut [T]) {
    each_normal(noise, stream, tick, out, |value, draw| *value = T::of_f32(draw));
}

/// Adds `spread` times the draws of [`fill_normal`] to `out`.
pub(crate) fn add_normal<T: Scalar>(noise: Noise, stream: u32, tick: u64, spread: f64, out: &mut [T]) {
    each_normal(noise, stream, tick, out, |value, draw| *value += T::of(spread * f64::from(draw)));
}

/// Meets each number with its draw.
fn each_normal<T>(noise: Noise, stream: u32, tick: u64, out: &mut [T], meet: impl Fn(&mut T, f32)) {
    for (block, four) in (0..).zip(out.chunks_mut(4)) {
        four.iter_mut().zip(noise.normals(stream, tick, block)).for_each(|(value, draw)| meet(value, draw));
    }
}

/// The numbers below `len` in a random order (Fisher and Yates).
pub(crate) fn shuffled(len: u32, noise: Noise, tick: u64) -> Vec<u32> {
    let mut order: Vec<u32> = (0..len).collect();
    for last in (1..len).rev() {
        let [word, ..] = noise.words(SHUFFLE, tick, last);
        order.swap(last as usize, below(word, last + 1) as usize);
    }
    order
}
