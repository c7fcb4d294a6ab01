//! Which of a critic's twins is believed.

use serde::{Deserialize, Serialize};

use super::Task;
use crate::nn::Scalar;

/// What is made of the two estimates of a task (O-15, O-19).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Twins {
    /// The worse one: the smaller reward, the larger cost (the paper's targets).
    Pessimistic,
    /// The smaller one, of costs too (CCAC).
    Minimum,
    /// Their mean.
    Mean,
    /// Either, drawn anew for each training step (Diffusion-QL).
    Random,
}

/// [`Twins`], with the draw behind [`Twins::Random`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Pick {
    /// What is made of the two.
    pub twins: Twins,
    /// Whether the draw fell on the second.
    pub second: bool,
}

impl Pick {
    /// The worse twin.
    pub const PESSIMISTIC: Self = Self { twins: Twins::Pessimistic, second: false };

    /// The weights of two estimates of a task; they add up to 1.
    pub fn weights<T: Scalar>(self, task: Task, [one, two]: [T; 2]) -> [T; 2] {
        let first = match self.twins {
            Twins::Pessimistic => task.is_worse(one, two),
            Twins::Minimum => one <= two,
            Twins::Mean => return [T::of(0.5); 2],
            Twins::Random => !self.second,
        };
        if first { [T::one(), T::zero()] } else { [T::zero(), T::one()] }
    }

    /// The estimate that is believed.
    pub fn value<T: Scalar>(self, task: Task, twins: [T; 2]) -> T {
        let [one, two] = self.weights(task, twins);
        one * twins[0] + two * twins[1]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_believed_estimate_of_each_task() {
        let value = |twins, second, task| Pick { twins, second }.value(task, [3.0, 1.0]);
        for second in [false, true] {
            assert_eq!(Task::ALL.map(|task| value(Twins::Pessimistic, second, task)), [1.0, 3.0, 3.0]);
            assert_eq!(Task::ALL.map(|task| value(Twins::Minimum, second, task)), [1.0; 3]);
            assert_eq!(Task::ALL.map(|task| value(Twins::Mean, second, task)), [2.0; 3]);
            assert_eq!(Task::ALL.map(|task| value(Twins::Random, second, task)), [if second { 1.0 } else { 3.0 }; 3]);
        }
    }
}
