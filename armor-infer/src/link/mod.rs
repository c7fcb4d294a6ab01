//! The link: a robot or its simulator asks, the controller answers.
//!
//! `docs/link.md` is the normative protocol, version [`VERSION`]. The same
//! bytes pass over a UART, a TCP connection, or a process's standard streams.
//!
//! | here | says |
//! |---|---|
//! | `frame.rs`, `cobs.rs` | one message, its CRC-32, COBS, a zero at the end |
//! | `message.rs` | what is asked and answered, in postcard |
//! | `endpoint.rs` | the controller's side: a request in, an answer out |
//!
//! Nothing here waits: bytes are pushed in as they come, so that a peer that
//! is slow, silent or broken cannot hold up the loop that the endpoint is part
//! of. Nor does anything here allocate or panic, whatever the bytes are.
//!
//! Words: the *plant* is whatever asks; a *request* is what it sends, an
//! *answer* what comes back; a request is *doubled* if it is the last one
//! again, and *late* if a newer one was answered.

mod cobs;
mod endpoint;
mod frame;
mod message;

pub use endpoint::Endpoint;
pub use frame::{CHECKSUM_BYTES, FrameError, Receiver, decode, encode, frame_bytes};
pub use message::{Answer, Identity, Refusal, Request, VERSION, answer_bytes, request_bytes};

#[cfg(test)]
mod tests;
