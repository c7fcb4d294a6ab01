//! The link on this host: the controller serves a plant over TCP or a process's
//! standard streams. `docs/link.md` is the protocol, `armor_infer::link` its core.
//!
//! | here | says |
//! |---|---|
//! | `serve.rs` | requests from a line, answers to it, until the plant leaves or falls silent |
//! | `line.rs` | streams that do not wait for ever |
//! | `client.rs` | the plant's side: ask, and ask again where no answer comes |

mod client;
mod line;
mod serve;

pub use client::{Client, ClientError};
pub use line::{PatientPipe, patient_socket};
pub use serve::{HostEndpoint, ServeError, Served, serve};

use armor_infer::link::{answer_bytes, frame_bytes, request_bytes};

use crate::host::{ACTION, STATE};

/// The longest task's name that the host answers.
const TASK_BYTES: usize = 256;
/// The longest frame that a host's plant sends.
const REQUEST_FRAME: usize = frame_bytes(request_bytes(STATE));
/// The longest frame that the host's controller answers.
const ANSWER_FRAME: usize = frame_bytes(answer_bytes(ACTION, TASK_BYTES));

#[cfg(test)]
mod tests;
