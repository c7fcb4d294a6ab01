//! What a training step trains.

use crate::config::Config;

/// What a training step trains.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Phase {
    /// Critics and actor together (the paper).
    Joint,
    /// The critics alone: the first `critic_steps` steps.
    Critics,
    /// The actor alone, judged by critics that do not move any more.
    Actor,
}

impl Phase {
    /// The phase of training step `step`, counted from 0.
    pub const fn of(config: &Config, step: u64) -> Self {
        match config.critic_steps {
            0 => Self::Joint,
            critic_steps if step < critic_steps => Self::Critics,
            _ => Self::Actor,
        }
    }

    /// Whether the critics learn.
    pub fn trains_critics(self) -> bool {
        self != Self::Actor
    }

    /// Whether the actor learns, and the dual with it.
    pub fn trains_actor(self) -> bool {
        self != Self::Critics
    }

    /// How much of the phase is done at training step `step`, from 0 to 1.
    pub fn progress(config: &Config, step: u64) -> f64 {
        let [start, end] = match Self::of(config, step) {
            Self::Joint => [0, config.steps],
            Self::Critics => [0, config.critic_steps],
            Self::Actor => [config.critic_steps, config.steps],
        };
        (step - start) as f64 / (end - start) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;

    #[test]
    fn critics_come_first_and_each_phase_runs_from_0_to_1() {
        let mut config = Preset::Paper.config("own", 1.0);
        config.steps = 10;
        assert_eq!((Phase::of(&config, 0), Phase::progress(&config, 5)), (Phase::Joint, 0.5));
        config.critic_steps = 6;
        let phases = [0, 5, 6, 9].map(|step| Phase::of(&config, step));
        assert_eq!(phases, [Phase::Critics, Phase::Critics, Phase::Actor, Phase::Actor]);
        assert_eq!([0, 3, 6, 8].map(|step| Phase::progress(&config, step)), [0.0, 0.5, 0.0, 0.5]);
    }
}
