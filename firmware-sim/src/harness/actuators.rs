//! Actuators hold an action until another comes, and fall back by themselves
//! where none comes for [`PATIENCE`] control steps.

use std::time::Duration;

use nalgebra::SVector;

use super::record::Decision;
use crate::host::ACTION;

/// Control steps without an action after which the actuators fall back.
const PATIENCE: u32 = 4;

/// An action at the actuators.
pub(super) type Action = SVector<f32, ACTION>;

/// What the actuators do.
pub(super) struct Actuators {
    fallback: Action,
    /// The action at the start of the plant's step, and the one that has come since.
    held: Action,
    action: Action,
    /// When that came.
    since: Duration,
    arrived: Option<Decision>,
    has_given_up: bool,
}

impl Actuators {
    /// Actuators at their fallback.
    pub(super) const fn new(fallback: Action) -> Self {
        Self { fallback, held: fallback, action: fallback, since: Duration::ZERO, arrived: None, has_given_up: false }
    }

    /// When the last action came.
    pub(super) const fn since(&self) -> Duration {
        self.since
    }

    /// The action at the end of the plant's step.
    pub(super) const fn action(&self) -> Action {
        self.action
    }

    /// The actions at the start and at the end of the plant's step.
    pub(super) const fn of_step(&self) -> [&Action; 2] {
        [&self.held, &self.action]
    }

    /// An action came.
    pub(super) const fn arrive(&mut self, action: Action, now: Duration, decision: Decision) {
        (self.action, self.since) = (action, now);
        (self.arrived, self.has_given_up) = (Some(decision), false);
    }

    /// The plant's step ended at `now`; whether the actuators have just given up
    /// waiting for an action, at so much time a control step.
    pub(super) fn end_step(&mut self, now: Duration, control_step: Duration) -> bool {
        self.held = self.action;
        let gives_up = now - self.since > control_step * PATIENCE && !self.has_given_up;
        if gives_up {
            self.action = self.fallback;
            self.has_given_up = true;
        }
        gives_up
    }

    /// What came in the control step that ends, or what the actuators did by themselves.
    pub(super) fn take_decision(&mut self) -> Decision {
        match self.arrived.take() {
            Some(decision) => decision,
            None if self.has_given_up => Decision::Fallback,
            None => Decision::Held,
        }
    }
}
