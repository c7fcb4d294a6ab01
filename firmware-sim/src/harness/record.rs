//! What a flight tells of each control step.

use armor_core::units::{Cost, Micros};
use armor_infer::Fault;
use nalgebra::{SVector, Vector2};
use serde::Serialize;

use std::time::Duration;

use crate::fault::FaultSet;
use crate::host::ACTION;
use crate::plant::Scene;

/// A control step of the robot: a period of the wall clock, whatever the controller did in it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Record {
    /// Time of its start, since the episode's.
    pub time: Micros,
    /// The controller's budget; none before its first step.
    pub kappa: Option<Cost>,
    /// What is truly left of the limit at its end.
    pub left: Cost,
    /// Reward that it brought.
    pub reward: f64,
    /// Cost that it incurred.
    pub cost: f64,
    /// The rung that answered; none where no chain did.
    pub rung: Option<usize>,
    /// What the controller named.
    pub fault: Option<Fault>,
    /// From sample to answer, modelled; none where no chain answered.
    pub latency: Option<Duration>,
    /// What the robot did.
    pub decision: Decision,
    /// Faults that were injected.
    pub injected: FaultSet,
    /// What the firmware noticed.
    pub noticed: NoticeSet,
    /// The action at the actuators at its end.
    pub action: SVector<f32, ACTION>,
    /// Where the robot was at its end, in m.
    pub place: Vector2<f64>,
}

/// What the robot did in a control step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Decision {
    /// The policy's action.
    Policy,
    /// Its last action, held.
    #[default]
    Held,
    /// The fallback action.
    Fallback,
    /// Nothing, for the controller was being reset: the actuators' own fallback.
    Down,
}

impl Decision {
    /// Its name in telemetry.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Policy => "policy",
            Self::Held => "held",
            Self::Fallback => "fallback",
            Self::Down => "down",
        }
    }
}

/// What a firmware notices of faults.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Notice {
    /// No sample came.
    NoSample,
    /// The controller refused the state.
    State,
    /// The network's answer was not finite.
    Action,
    /// A cost report was no cost.
    InvalidCost,
    /// A cost report did not come in time.
    MissingCost,
    /// A cost report came twice, or after its time.
    StaleCost,
    /// An answer came after its deadline and was dropped.
    Late,
    /// A sample came while the answer to another was computed.
    Skipped,
    /// No rung ends in time.
    NoRung,
    /// The scrub found the weights in RAM changed.
    Weights,
    /// The controller was reset.
    Reset,
    /// A slot did not boot.
    Slot,
    /// The journal could not be written.
    Journal,
    /// The actuators waited too long for an action.
    NoAction,
}

impl Notice {
    /// Every notice.
    pub const ALL: [Self; 14] = [
        Self::NoSample,
        Self::State,
        Self::Action,
        Self::InvalidCost,
        Self::MissingCost,
        Self::StaleCost,
        Self::Late,
        Self::Skipped,
        Self::NoRung,
        Self::Weights,
        Self::Reset,
        Self::Slot,
        Self::Journal,
        Self::NoAction,
    ];

    /// Its name in telemetry.
    pub const fn name(self) -> &'static str {
        match self {
            Self::NoSample => "no_sample",
            Self::State => "state",
            Self::Action => "action",
            Self::InvalidCost => "invalid_cost",
            Self::MissingCost => "missing_cost",
            Self::StaleCost => "stale_cost",
            Self::Late => "late",
            Self::Skipped => "skipped",
            Self::NoRung => "no_rung",
            Self::Weights => "weights",
            Self::Reset => "reset",
            Self::Slot => "slot",
            Self::Journal => "journal",
            Self::NoAction => "no_action",
        }
    }

    /// The notice that a controller's fault is.
    pub(super) const fn of(fault: Fault) -> Self {
        match fault {
            Fault::StateLength => Self::NoSample,
            Fault::StateNotFinite => Self::State,
            Fault::InvalidCost => Self::InvalidCost,
            Fault::NoRung => Self::NoRung,
            Fault::ActionNotFinite => Self::Action,
        }
    }
}

/// Notices within a control step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct NoticeSet(u32);

impl NoticeSet {
    /// Adds a notice.
    pub const fn insert(&mut self, notice: Notice) {
        self.0 |= 1 << notice as u32;
    }

    /// Whether a notice is among them.
    pub const fn contains(self, notice: Notice) -> bool {
        self.0 & (1 << notice as u32) != 0
    }

    /// The notices, in the order of [`Notice::ALL`].
    pub fn iter(self) -> impl Iterator<Item = Notice> {
        Notice::ALL.into_iter().filter(move |&notice| self.contains(notice))
    }

    /// Whether nothing was noticed.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

/// An episode that a robot flew.
#[derive(Clone, Debug, PartialEq)]
pub struct RobotEpisode {
    /// Its control steps, in order; empty where they were not kept.
    pub records: Vec<Record>,
    /// What it looked like at the start.
    pub scene: Scene,
    /// The goals that were set after the first, and their radius, in m.
    pub goals: Vec<(Vector2<f64>, f64)>,
}
