//! How an episode ends, and what follows from it.

use serde::{Deserialize, Serialize};

/// How an episode of a recording ends.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Ending {
    /// By the task's own rule.
    Terminal,
    /// By the time limit.
    Timeout,
    /// Not at all: the recording stops before it does.
    Unfinished,
}

impl Ending {
    /// What a row's marks say; none where the episode goes on.
    pub(super) const fn of(terminal: bool, timeout: bool) -> Option<Self> {
        match (terminal, timeout) {
            (true, _) => Some(Self::Terminal),
            (false, true) => Some(Self::Timeout),
            (false, false) => None,
        }
    }
}

/// What becomes of the rows after the last end mark (O-1).
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Unfinished {
    /// They are left out (the paper): their cost to go is not known.
    #[default]
    Drop,
    /// They are an episode like the others, as costly as it was until then.
    Keep,
}

/// Which last steps of an episode are not followed by any value (Eq. 3, O-3).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Mask {
    /// Those that end it by the task's rule or by the time limit (the paper).
    Any,
    /// Those that end it by the task's rule alone: at the time limit the world goes on.
    Terminal,
}

impl Mask {
    /// Whether nothing follows an episode with this ending.
    pub const fn ends(self, ending: Ending) -> bool {
        match ending {
            Ending::Terminal => true,
            Ending::Timeout => matches!(self, Self::Any),
            Ending::Unfinished => false,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_terminal_ends_an_episode_for_good_and_a_timeout_only_where_it_is_taken_so() {
        for (mask, ends) in [(Mask::Any, [true, true, false]), (Mask::Terminal, [true, false, false])] {
            assert_eq!([Ending::Terminal, Ending::Timeout, Ending::Unfinished].map(|ending| mask.ends(ending)), ends);
        }
        assert_eq!(Ending::of(true, true), Some(Ending::Terminal));
        assert_eq!(Ending::of(false, false), None);
    }
}
