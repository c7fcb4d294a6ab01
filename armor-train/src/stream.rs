//! Which stream of the counter-based noise serves what, so that no two uses
//! share a draw and a resumed run repeats the draws of one never stopped.

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
/// Noise of behaviour cloning; the tick is the sample (step times batch, plus its place).
pub(crate) const CLONING: u32 = 6;
/// Chain of the next actions, one stream a stage; the tick is the sample.
pub(crate) const TARGET_CHAIN: u32 = 0x100;
/// Chain of the policy's actions, one stream a stage; the tick is the sample.
pub(crate) const POLICY_CHAIN: u32 = 0x200;
/// Perturbed actions, one stream a perturbation; the tick is the refresh times rows, plus the row.
pub(crate) const PERTURBATION: u32 = 0x400;
