//! Messages of the link, version 1. `docs/link.md` gives every field its bytes.

use core::fmt;

use armor_core::image::MAX_RUNGS;
use armor_core::units::Cost;
use heapless::Vec;
use serde::{Deserialize, Serialize};

use crate::controller::Fault;

/// The version of the protocol that this code speaks.
pub const VERSION: u8 = 1;

/// Most bytes of an integer on the wire, 7 bits each.
const VARINT_U16: usize = 3;
const VARINT_U32: usize = 5;
const VARINT_U64: usize = 10;

/// What a plant asks.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Request<const STATE: usize> {
    /// Who are you? The first request of a connection.
    Hello {
        /// The version that the plant speaks.
        version: u8,
    },
    /// Start an episode: nothing else refills the budget.
    Reset {
        /// Number of the new episode: one more than the last.
        episode: u32,
        /// Cost that it may incur.
        limit: Cost,
        /// Decides the noise of its chains.
        seed: u64,
    },
    /// This is what I sense; what shall I do?
    Observe {
        /// Number of the episode.
        episode: u32,
        /// Control step of the episode, from 0.
        tick: u32,
        /// Cost that the step before incurred; 0 on the first.
        incurred: f32,
        /// State vector `[S]`.
        state: Vec<f32, STATE>,
    },
}

/// What the controller answers; text is borrowed from the image or the frame.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub enum Answer<'a, const ACTION: usize> {
    /// To [`Request::Hello`].
    #[serde(borrow)]
    Hello(Identity<'a>),
    /// To [`Request::Reset`].
    Ready {
        /// Number of the episode.
        episode: u32,
        /// The budget as it is now: the limit, at the episode's start.
        kappa: Cost,
    },
    /// To [`Request::Observe`].
    Act {
        /// Number of the episode.
        episode: u32,
        /// The control step that is answered.
        tick: u32,
        /// The budget after the incurred cost was charged.
        kappa: Cost,
        /// Which of the image's chains flew; none where the action is the fallback.
        rung: Option<u8>,
        /// Why the step was not an ordinary one.
        fault: Option<Fault>,
        /// Action vector `[A]`, within the policy's bounds.
        action: Vec<f32, ACTION>,
    },
    /// The request cannot be met; nothing has changed.
    Refused(Refusal),
}

/// Who answers.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Identity<'a> {
    /// The version that the controller speaks.
    pub version: u8,
    /// The task that the policy was trained for.
    pub task: &'a str,
    /// Entries of the state vector.
    pub state: u16,
    /// Entries of the action vector.
    pub action: u16,
    /// Calls of the denoiser of each chain, longest first.
    pub rungs: Vec<u16, MAX_RUNGS>,
    /// The largest cost limit that an episode may be given.
    pub trained_max: Cost,
    /// Number of the last episode; 0 before the first.
    pub episode: u32,
}

/// Why a request was refused.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Refusal {
    /// The plant speaks another version of the protocol.
    Version {
        /// The version that the controller speaks.
        supported: u8,
    },
    /// The first request was no [`Request::Hello`].
    NoHello,
    /// The frame was whole and held no request that this controller has room for.
    Malformed,
    /// The episode is neither the present one nor the next.
    Episode {
        /// Number of the next episode.
        next: u32,
    },
    /// A control step was left out.
    Tick {
        /// The control step that has to come next.
        next: u32,
    },
    /// The limit lies above every budget that the policy was trained with.
    Limit {
        /// The largest limit that an episode may be given.
        trained_max: Cost,
    },
}

impl fmt::Display for Refusal {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Version { supported } => {
                write!(f, "the controller speaks version {supported} of the link; use a plant of that version")
            }
            Self::NoHello => f.write_str("the controller was not greeted; say hello first"),
            Self::Malformed => f.write_str("the controller cannot read the request; check versions and state length"),
            Self::Episode { next } => write!(f, "no such episode; the next one is {next}"),
            Self::Tick { next } => write!(f, "a control step was left out; the next one is {next}"),
            Self::Limit { trained_max } => {
                write!(f, "cost limit lies above what the policy was trained with; ask for at most {trained_max}")
            }
        }
    }
}

impl core::error::Error for Refusal {}

/// The most bytes of a request with `state` entries, before it is framed.
pub const fn request_bytes(state: usize) -> usize {
    1 + 2 * VARINT_U32 + VARINT_U64 + VARINT_U32 + 4 * state
}

/// The most bytes of an answer with `action` entries and a task's name of
/// `task` bytes, before it is framed.
pub const fn answer_bytes(action: usize, task: usize) -> usize {
    let act = 1 + 3 * VARINT_U32 + 2 + 2 + VARINT_U16 + 4 * action;
    let hello = 2 + VARINT_U32 + task + 2 * VARINT_U16 + 1 + MAX_RUNGS * VARINT_U16 + 2 * VARINT_U32;
    if act > hello { act } else { hello }
}
