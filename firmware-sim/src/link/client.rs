//! The plant's side: ask, and ask again where no answer comes.

use std::io::{self, ErrorKind, Read, Write};

use armor_core::units::Cost;
use armor_infer::link::{Answer, FrameError, Receiver, Refusal, Request, VERSION, decode, encode};
use heapless::Vec;
use thiserror::Error;

use super::{ANSWER_FRAME, REQUEST_FRAME};
use crate::host::{ACTION, STATE};

/// Times that a request is sent before the controller is given up.
const TRIES: usize = 4;

/// A plant's end of a line whose reads give up after a while.
#[derive(Debug)]
pub struct Client<L> {
    line: L,
    receiver: Receiver<ANSWER_FRAME>,
    episode: u32,
    tick: u32,
}

/// Why a controller could not be asked.
#[derive(Debug, Error)]
pub enum ClientError {
    /// The line broke.
    #[error("the line to the controller broke: {0}")]
    Line(#[from] io::Error),
    /// The other side hung up.
    #[error("the controller hung up")]
    Left,
    /// No answer came, however often it was asked.
    #[error("the controller does not answer; {TRIES} requests were sent")]
    Silent,
    /// The controller refused.
    #[error("{0}")]
    Refused(Refusal),
    /// The state has more entries than a frame holds.
    #[error("a state has at most {STATE} entries")]
    State,
    /// The request fits no frame.
    #[error("{0}")]
    Frame(FrameError),
}

/// What the controller answered to an observation.
#[derive(Clone, Debug, PartialEq)]
pub struct Action {
    /// The budget after the incurred cost was charged.
    pub kappa: Cost,
    /// Action vector.
    pub action: Vec<f32, ACTION>,
}

/// Who the controller is, as far as a plant of this crate wants to know.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Controller {
    /// The task that its policy was trained for.
    pub task: String,
    /// Entries of the state vector.
    pub state: usize,
}

impl<L: Read + Write> Client<L> {
    /// A plant that has not said hello.
    pub const fn new(line: L) -> Self {
        Self { line, receiver: Receiver::new(), episode: 0, tick: 0 }
    }

    /// Says hello.
    ///
    /// # Errors
    /// [`ClientError`]
    pub fn hello(&mut self) -> Result<Controller, ClientError> {
        let (who, episode) = self.ask(&Request::Hello { version: VERSION }, |answer| match answer {
            Answer::Hello(it) => Some((Controller { task: it.task.into(), state: it.state.into() }, it.episode)),
            _ => None,
        })?;
        self.episode = episode;
        Ok(who)
    }

    /// Starts an episode; returns the budget.
    ///
    /// # Errors
    /// [`ClientError`]
    pub fn reset(&mut self, limit: Cost, seed: u64) -> Result<Cost, ClientError> {
        let next = self.episode.saturating_add(1);
        let kappa = self.ask(&Request::Reset { episode: next, limit, seed }, |answer| match answer {
            Answer::Ready { episode, kappa } if episode == next => Some(kappa),
            _ => None,
        })?;
        (self.episode, self.tick) = (next, 0);
        Ok(kappa)
    }

    /// A control step: what is sensed and the cost of the step before, for an action.
    ///
    /// # Errors
    /// [`ClientError`]
    pub fn step(&mut self, state: &[f32], incurred: f32) -> Result<Action, ClientError> {
        let state = Vec::from_slice(state).map_err(|_| ClientError::State)?;
        let asked = (self.episode, self.tick);
        let request = Request::Observe { episode: asked.0, tick: asked.1, incurred, state };
        let action = self.ask(&request, |answer| match answer {
            Answer::Act { episode, tick, kappa, action, .. } if (episode, tick) == asked => {
                Some(Action { kappa, action })
            }
            _ => None,
        })?;
        self.tick += 1;
        Ok(action)
    }

    /// Sends a request until `accept` takes an answer; answers to older
    /// requests are passed over.
    fn ask<T>(
        &mut self,
        request: &Request<STATE>,
        accept: impl Fn(Answer<'_, ACTION>) -> Option<T>,
    ) -> Result<T, ClientError> {
        let mut buffer = [0; REQUEST_FRAME];
        let frame = encode(request, &mut buffer).map_err(ClientError::Frame)?;
        let mut chunk = [0; ANSWER_FRAME];
        for attempt in 0..TRIES {
            if attempt > 0 {
                // Ends what may have come of the last one, so that this one stands alone.
                self.line.write_all(&[0])?;
            }
            self.line.write_all(frame)?;
            self.line.flush()?;
            loop {
                let length = match self.line.read(&mut chunk) {
                    Ok(0) => return Err(ClientError::Left),
                    Ok(length) => length,
                    Err(error) if error.kind() == ErrorKind::Interrupted => continue,
                    Err(error) if matches!(error.kind(), ErrorKind::TimedOut | ErrorKind::WouldBlock) => break,
                    Err(error) => return Err(error.into()),
                };
                for &byte in &chunk[..length] {
                    let Some(frame) = self.receiver.push(byte) else { continue };
                    match decode(frame) {
                        Ok(Answer::Refused(refusal)) => return Err(ClientError::Refused(refusal)),
                        Ok(answer) => {
                            if let Some(accepted) = accept(answer) {
                                return Ok(accepted);
                            }
                        }
                        Err(_) => {}
                    }
                }
            }
        }
        Err(ClientError::Silent)
    }
}
