//! The controller serves a plant, until the plant leaves or falls silent.

use std::io::{self, ErrorKind, Read, Write};
use std::time::{Duration, Instant};

use armor_infer::link::{Answer, Endpoint, FrameError, Receiver, encode};
use thiserror::Error;

use super::{ANSWER_FRAME, REQUEST_FRAME};
use crate::host::{ACTION, HIDDEN, STATE};

/// The host's controller behind a link.
pub type HostEndpoint<'a> = Endpoint<'a, STATE, ACTION, HIDDEN>;

/// An answer of the host's controller, and the time from request to answer,
/// without the line's.
pub type Served<'a> = (Answer<'a, ACTION>, Duration);

/// Why serving ended before the plant left.
#[derive(Debug, Error)]
pub enum ServeError {
    /// No request came in time.
    #[error("the plant asked nothing for {} s; it was let go", patience.as_secs_f32())]
    Silent {
        /// What was waited for a request.
        patience: Duration,
    },
    /// The plant does not take its answers, or the line broke.
    #[error("the line to the plant broke: {0}")]
    Line(#[from] io::Error),
    /// The image's task has a name too long for the link.
    #[error("the answer does not fit a frame: {0}")]
    Answer(FrameError),
}

/// Answers the requests of a line until it ends; `witness` sees each answer
/// before it is sent.
///
/// Whatever comes, a plant has `patience` for its next request; the line's own
/// reads and writes must not wait longer than that.
///
/// # Errors
/// [`ServeError`]
pub fn serve<'a>(
    line: &mut (impl Read + Write),
    endpoint: &mut HostEndpoint<'a>,
    patience: Duration,
    mut witness: impl FnMut(Served<'a>),
) -> Result<(), ServeError> {
    let mut receiver = Receiver::<REQUEST_FRAME>::new();
    let mut chunk = [0; REQUEST_FRAME];
    let mut buffer = [0; ANSWER_FRAME];
    let mut answered = Instant::now();
    loop {
        let length = match line.read(&mut chunk) {
            Ok(0) => return Ok(()),
            Ok(length) => length,
            Err(error) if error.kind() == ErrorKind::Interrupted => 0,
            Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => {
                return Err(ServeError::Silent { patience });
            }
            Err(error) if error.kind() == ErrorKind::ConnectionReset => return Ok(()),
            Err(error) => return Err(error.into()),
        };
        for &byte in &chunk[..length] {
            let Some(frame) = receiver.push(byte) else { continue };
            let started = Instant::now();
            let Some(answer) = endpoint.receive(frame) else { continue };
            let latency = started.elapsed();
            line.write_all(encode(&answer, &mut buffer).map_err(ServeError::Answer)?)?;
            answered = Instant::now();
            witness((answer, latency));
        }
        if answered.elapsed() > patience {
            return Err(ServeError::Silent { patience });
        }
    }
}
