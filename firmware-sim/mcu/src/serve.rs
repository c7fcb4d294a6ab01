//! The controller's side of the link, on the UART.

use armor_infer::link::{Answer, Receiver, answer_bytes, encode, frame_bytes, request_bytes};

use crate::console::tell;
use crate::uart::Uart;
use crate::{ACTION, McuEndpoint, STATE, Stop};

/// The longest task's name that is answered.
const TASK_BYTES: usize = 64;

/// What the link needs beside the controller; too large for the stack.
struct Frames {
    receiver: Receiver<{ frame_bytes(request_bytes(STATE)) }>,
    answer: [u8; frame_bytes(answer_bytes(ACTION, TASK_BYTES))],
}

/// Answers requests until `actions` were given; for ever, if that is 0.
pub(crate) fn run(endpoint: &mut McuEndpoint, actions: u32) -> Result<(), Stop> {
    static mut FRAMES: Frames =
        Frames { receiver: Receiver::new(), answer: [0; frame_bytes(answer_bytes(ACTION, TASK_BYTES))] };
    // SAFETY: called once, and there is one thread.
    let frames = unsafe { &mut *(&raw mut FRAMES) };
    let mut uart = Uart::new();
    let mut given = 0;
    while given < actions || actions == 0 {
        let byte = uart.read().ok_or(c"failed idle")?;
        let Some(answer) = frames.receiver.push(byte).and_then(|frame| endpoint.receive(frame)) else { continue };
        let frame = encode(&answer, &mut frames.answer).map_err(|_| c"failed answer")?;
        if !uart.write(frame) {
            return Err(c"failed line");
        }
        given = given.wrapping_add(matches!(answer, Answer::Act { .. }).into());
    }
    tell(c"actions", given);
    Ok(())
}
