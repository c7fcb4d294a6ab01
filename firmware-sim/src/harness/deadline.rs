//! Which rung flies: the longest that ends in time, a shorter one after an overrun.

use std::time::Duration;

/// Answers in time after which a longer rung is tried again: a second at 50 Hz.
const PATIENCE: u32 = 50;

/// The policy for deadlines.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(super) struct Deadline {
    /// Steps of each rung and the longest that it takes, longest chain first.
    rungs: Vec<(usize, Duration)>,
    /// What an answer may take.
    time: Duration,
    /// The longest rung that may fly.
    longest: usize,
    /// Answers in time since that was last changed.
    in_time: u32,
}

impl Deadline {
    /// The policy for these rungs, longest first, and an answer's `time`.
    pub(super) const fn new(rungs: Vec<(usize, Duration)>, time: Duration) -> Self {
        Self { rungs, time, longest: 0, in_time: 0 }
    }

    /// The steps of the longest rung that ends in time; 0 if there is none.
    pub(super) fn steps(&self) -> usize {
        let mut may_fly = self.rungs.iter().skip(self.longest);
        may_fly.find(|(_, worst)| *worst <= self.time).map_or(0, |&(steps, _)| steps)
    }

    /// An answer of `steps` came: after one that came late, shorter ones fly for a while.
    pub(super) fn answered(&mut self, steps: usize, is_late: bool) {
        if is_late {
            let flown = self.rungs.iter().position(|rung| rung.0 == steps).unwrap_or(self.longest);
            self.longest = (flown + 1).min(self.rungs.len().saturating_sub(1));
            self.in_time = 0;
        } else {
            self.in_time += 1;
            if self.in_time >= PATIENCE {
                self.longest = self.longest.saturating_sub(1);
                self.in_time = 0;
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn policy(time_ms: u64) -> Deadline {
        let rungs = [(20, 40), (10, 20), (5, 10), (1, 2)].map(|(steps, ms)| (steps, Duration::from_millis(ms)));
        Deadline::new(rungs.into(), Duration::from_millis(time_ms))
    }

    #[test]
    fn the_longest_rung_that_ends_in_time_flies() {
        for (time, steps) in [(100, 20), (40, 20), (39, 10), (10, 5), (2, 1), (1, 0)] {
            assert_eq!(policy(time).steps(), steps, "{time} ms");
        }
    }

    #[test]
    fn an_overrun_shortens_the_chain_and_a_good_while_lengthens_it() {
        let mut policy = policy(25);
        policy.answered(10, true);
        assert_eq!(policy.steps(), 5);
        for _ in 0..4 {
            policy.answered(policy.steps(), true);
        }
        assert_eq!(policy.steps(), 1);
        for expected in [5, 10, 10] {
            for _ in 0..PATIENCE {
                policy.answered(policy.steps(), false);
            }
            assert_eq!(policy.steps(), expected);
        }
    }
}
