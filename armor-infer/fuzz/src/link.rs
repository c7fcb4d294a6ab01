//! The link: noise on the line, frames of any content, and requests in any order.

use armor_core::image::PolicyImage;
use armor_core::units::Cost;
use armor_infer::link::{
    Answer, Endpoint, Receiver, Request, answer_bytes, decode, encode, frame_bytes, request_bytes,
};
use serde::ser::SerializeTuple;
use serde::{Serialize, Serializer};

use crate::image::{ACTION, HIDDEN, STATE, images};
use crate::input::{Aligned, Input};

const REQUEST_FRAME: usize = frame_bytes(request_bytes(STATE));
const ANSWER_FRAME: usize = frame_bytes(answer_bytes(ACTION, 16));

/// Whatever comes, every answer fits its frame, episodes only go up, and
/// within one kappa only falls and actions keep their bounds.
pub fn run(data: &[u8]) {
    let mut input = Input(data);
    let memory = Aligned::from(images()[0].as_slice());
    let image = PolicyImage::new_checked(memory.as_slice()).expect("a good image");
    let mut endpoint = Endpoint::<STATE, ACTION, HIDDEN>::new(&image, usize::MAX).expect("it fits");
    let mut receiver = Receiver::<REQUEST_FRAME>::new();
    let mut last = (0, Cost::MAX);
    while !input.is_empty() {
        let mut frame = [0; REQUEST_FRAME];
        let sent = match input.byte() % 4 {
            0 => {
                let length = input.byte().into();
                input.slice(length)
            }
            1 => {
                let length = input.byte().into();
                encode(&Raw(input.slice(length)), &mut frame).unwrap_or_default()
            }
            _ => encode(&request(&mut input), &mut frame).expect("every request fits"),
        };
        // As the other side would read it: no message, or one.
        let _ = decode::<Answer<'_, ACTION>>(&mut sent.to_vec());
        for &byte in sent {
            let answer = receiver.push(byte).and_then(|frame| endpoint.receive(frame));
            last = answer.map_or(last, |answer| check(&image, last, &answer));
        }
    }
}

/// The episode and kappa of an answer, or those before.
fn check(image: &PolicyImage<'_>, last: (u32, Cost), answer: &Answer<'_, ACTION>) -> (u32, Cost) {
    let mut frame = [0; ANSWER_FRAME];
    let mut sent = encode(answer, &mut frame).expect("every answer fits").to_vec();
    assert_eq!(decode::<Answer<'_, ACTION>>(&mut sent).as_ref(), Ok(answer));
    let (episode, kappa) = match answer {
        Answer::Ready { episode, kappa } => (*episode, *kappa),
        Answer::Act { episode, kappa, action, .. } => {
            assert!(action.iter().all(|entry| (-1.0..=1.0).contains(entry)), "{answer:?}");
            (*episode, *kappa)
        }
        Answer::Hello(_) | Answer::Refused(_) => return last,
    };
    assert!(kappa <= image.manifest().kappa.trained_max, "{answer:?}");
    assert!(episode > last.0 || (episode == last.0 && kappa <= last.1), "{answer:?} after {last:?}");
    (episode, kappa)
}

/// A request with numbers that are often the next ones.
fn request(input: &mut Input<'_>) -> Request<STATE> {
    match input.byte() % 3 {
        0 => Request::Hello { version: input.byte() % 3 },
        1 => Request::Reset {
            episode: (input.byte() % 8).into(),
            limit: Cost::from_raw(input.word() >> 4),
            seed: input.byte().into(),
        },
        _ => Request::Observe {
            episode: (input.byte() % 8).into(),
            tick: (input.byte() % 16).into(),
            incurred: input.float(),
            state: (0..input.byte() % 5).map(|_| input.float()).collect(),
        },
    }
}

/// Bytes as they are, without a length in front.
struct Raw<'a>(&'a [u8]);

impl Serialize for Raw<'_> {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        let mut tuple = serializer.serialize_tuple(self.0.len())?;
        for byte in self.0 {
            tuple.serialize_element(byte)?;
        }
        tuple.end()
    }
}
