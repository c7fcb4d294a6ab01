use armor_core::units::{Cost, CostLimit};
use heapless::Vec;
use proptest::prelude::*;

use super::*;
use crate::controller::{Controller, Fault, Step};
use crate::fixture::{Fixture, SMALL, TRAINED_MAX};
use crate::policy::Policy;

const STATE: usize = 8;
const ACTION: usize = 4;
const HIDDEN: usize = 16;
const REQUEST_FRAME: usize = frame_bytes(request_bytes(STATE));
const ANSWER_FRAME: usize = frame_bytes(answer_bytes(ACTION, 16));

type Ask = Request<STATE>;
type Say<'a> = Answer<'a, ACTION>;
type Served<'a> = Endpoint<'a, STATE, ACTION, HIDDEN>;

fn cost(units: f32) -> Cost {
    Cost::from_incurred(units).unwrap()
}

fn reset(episode: u32) -> Ask {
    Ask::Reset { episode, limit: cost(5.0), seed: 7 }
}

fn observe(episode: u32, tick: u32, incurred: f32) -> Ask {
    let state = [0.1 * tick as f32, -0.5, 0.25];
    Ask::Observe { episode, tick, incurred, state: Vec::from_slice(&state).unwrap() }
}

/// Runs a check with an endpoint that was greeted, and with the fixture's policy.
fn greeted(check: impl FnOnce(Served<'_>, Policy<'_>)) {
    let fixture = Fixture::random(SMALL, 3).build();
    let image = fixture.image();
    let mut endpoint = Served::new(&image, usize::MAX).unwrap();
    assert!(matches!(endpoint.answer(&Ask::Hello { version: VERSION }), Some(Say::Hello(_))));
    check(endpoint, Policy::load(&image).unwrap());
}

fn kappa_of(answer: Option<Say<'_>>) -> f32 {
    match answer {
        Some(Say::Ready { kappa, .. } | Say::Act { kappa, .. }) => kappa.to_f32(),
        other => panic!("{other:?} has no kappa"),
    }
}

/// A frame by hand: version 1 says hello, with the CRC-32 of `00 01` as Python's
/// `zlib.crc32(b"\x00\x01").to_bytes(4, "little")` gives it, stuffed on paper.
#[test]
fn a_hello_has_these_bytes() {
    let mut buffer = [0; REQUEST_FRAME];
    let frame = encode(&Ask::Hello { version: 1 }, &mut buffer).unwrap();
    assert_eq!(frame, [0x01, 0x06, 0x01, 0x69, 0x22, 0xDE, 0x36, 0x00]);
}

proptest! {
    /// The crate `cobs` as a second implementation of what is stuffed here.
    #[test]
    fn stuffing_is_that_of_the_crate_cobs(bytes in proptest::collection::vec(prop_oneof![0..=1u8, any::<u8>()], 1..700)) {
        use super::cobs::{Stuffed, unstuff};
        let (mut buffer, mut theirs) = ([0; 800], [0; 800]);
        let mut stuffed = Stuffed::new(&mut buffer);
        for &byte in &bytes {
            prop_assert!(stuffed.push(byte).is_ok());
        }
        let frame = stuffed.finish(0).ok().unwrap();
        let (content, end) = frame.split_at(frame.len() - 1);
        prop_assert_eq!(end, [0]);
        let length = ::cobs::decode(content, &mut theirs).unwrap();
        prop_assert_eq!(&theirs[..length], bytes.as_slice());
        let length = ::cobs::encode(&bytes, &mut theirs);
        prop_assert_eq!(unstuff(&mut theirs[..length]), Some(bytes.len()));
        prop_assert_eq!(&theirs[..bytes.len()], bytes.as_slice());
    }

    #[test]
    fn damage_is_unstuffed_as_by_the_crate_cobs(bytes in proptest::collection::vec(prop_oneof![0..=4u8, any::<u8>()], 0..40)) {
        let (mut ours, mut theirs) = (bytes.clone(), bytes.clone());
        let expected = ::cobs::decode_in_place(&mut theirs).ok();
        prop_assert_eq!(super::cobs::unstuff(&mut ours), expected);
        let length = expected.unwrap_or_default();
        prop_assert_eq!(&ours[..length], &theirs[..length]);
    }
}

#[test]
fn the_longest_messages_fit_their_frames() {
    let mut buffer = [0; REQUEST_FRAME];
    let state = Vec::from_slice(&[f32::MIN; STATE]).unwrap();
    let longest = Ask::Observe { episode: u32::MAX, tick: u32::MAX, incurred: -1.0, state };
    encode(&longest, &mut buffer).unwrap();
    encode(&Ask::Reset { episode: u32::MAX, limit: Cost::MAX, seed: u64::MAX }, &mut buffer).unwrap();

    let mut buffer = [0; ANSWER_FRAME];
    let action = Vec::from_slice(&[f32::MIN; ACTION]).unwrap();
    let (episode, tick, kappa) = (u32::MAX, u32::MAX, Cost::MAX);
    let act = Say::Act { episode, tick, kappa, rung: Some(7), fault: Some(Fault::StateLength), action };
    encode(&act, &mut buffer).unwrap();
    let identity = Identity {
        version: VERSION,
        task: "sixteen letters.",
        state: u16::MAX,
        action: u16::MAX,
        rungs: [u16::MAX; 8].into_iter().collect(),
        trained_max: Cost::MAX,
        episode,
    };
    encode(&Say::Hello(identity), &mut buffer).unwrap();
    assert_eq!(encode(&act, &mut buffer[..9]), Err(FrameError::Full));
}

/// Numbers on the wire are the enums' order.
#[test]
fn faults_and_refusals_keep_their_numbers() {
    let faults = [Fault::StateLength, Fault::StateNotFinite, Fault::InvalidCost, Fault::NoRung, Fault::ActionNotFinite];
    for (number, fault) in (0..).zip(faults) {
        assert_eq!(postcard::to_slice(&fault, &mut [0; 4]).unwrap(), [number]);
    }
    let nothing = Cost::ZERO;
    let refusals = [
        Refusal::Version { supported: 1 },
        Refusal::NoHello,
        Refusal::Malformed,
        Refusal::Episode { next: 0 },
        Refusal::Tick { next: 0 },
        Refusal::Limit { trained_max: nothing },
    ];
    for (number, refusal) in (0..).zip(refusals) {
        assert_eq!(postcard::to_slice(&refusal, &mut [0; 8]).unwrap()[0], number);
    }
}

#[test]
fn an_episode_over_the_link_is_the_controllers_own() {
    greeted(|mut endpoint, policy| {
        let limit = CostLimit::new(5.0).unwrap();
        let mut controller = Controller::<STATE, ACTION, HIDDEN>::new(policy, limit, 7).unwrap();
        assert_eq!(kappa_of(endpoint.answer(&reset(1))), 5.0);
        for tick in 0..20 {
            let incurred = if tick == 0 { 0.0 } else { 0.5 };
            let request = observe(1, tick, incurred);
            let Ask::Observe { state, .. } = &request else { unreachable!() };
            let Step { action: expected, kappa, rung, fault } = controller.step(state, incurred);
            let Some(Say::Act { episode: 1, tick: answered, action, kappa: told, rung: flown, fault: named }) =
                endpoint.answer(&request)
            else {
                panic!("no action")
            };
            assert_eq!((answered, told, flown.map(usize::from), named), (tick, kappa, rung, fault));
            assert_eq!(action, expected.as_slice()[..SMALL.action.into()]);
        }
    });
}

#[test]
fn a_doubled_request_is_answered_again_and_changes_nothing() {
    greeted(|mut endpoint, _| {
        let ready = endpoint.answer(&reset(1));
        assert_eq!(endpoint.answer(&reset(1)), ready);
        let first = endpoint.answer(&observe(1, 0, 0.0));
        let second = endpoint.answer(&observe(1, 1, 2.0));
        for _ in 0..3 {
            assert_eq!(endpoint.answer(&observe(1, 1, 2.0)), second);
        }
        assert_eq!(kappa_of(second), 3.0);
        // A reset that comes twice does not refill the budget.
        assert_eq!(kappa_of(endpoint.answer(&reset(1))), 3.0);
        // As if nothing had come twice.
        let third = endpoint.answer(&observe(1, 2, 0.5));
        assert_eq!(kappa_of(third.clone()), 2.5);
        greeted(|mut other, _| {
            other.answer(&reset(1));
            assert_eq!(other.answer(&observe(1, 0, 0.0)), first);
            other.answer(&observe(1, 1, 2.0));
            assert_eq!(other.answer(&observe(1, 2, 0.5)), third);
        });
    });
}

#[test]
fn a_late_request_is_not_answered_and_changes_nothing() {
    greeted(|mut endpoint, _| {
        endpoint.answer(&reset(1));
        for tick in 0..3 {
            endpoint.answer(&observe(1, tick, 1.0));
        }
        assert_eq!(endpoint.answer(&observe(1, 0, 1.0)), None);
        assert_eq!(kappa_of(endpoint.answer(&observe(1, 3, 0.0))), 2.0);
        endpoint.answer(&reset(2));
        assert_eq!(endpoint.answer(&reset(1)), None);
        assert_eq!(endpoint.answer(&observe(1, 3, 0.0)), None);
        assert_eq!(kappa_of(endpoint.answer(&observe(2, 0, 0.0))), 5.0);
    });
}

#[test]
fn a_request_out_of_order_is_refused_with_the_one_that_is_due() {
    greeted(|mut endpoint, _| {
        let refused = |endpoint: &mut Served<'_>, request| match endpoint.answer(&request) {
            Some(Say::Refused(refusal)) => refusal,
            other => panic!("{other:?} is no refusal"),
        };
        assert_eq!(refused(&mut endpoint, observe(0, 0, 0.0)), Refusal::Episode { next: 1 });
        assert_eq!(refused(&mut endpoint, observe(1, 0, 0.0)), Refusal::Episode { next: 1 });
        assert_eq!(refused(&mut endpoint, reset(0)), Refusal::Episode { next: 1 });
        assert_eq!(refused(&mut endpoint, reset(2)), Refusal::Episode { next: 1 });
        let greedy = Ask::Reset { episode: 1, limit: cost(TRAINED_MAX + 1.0), seed: 0 };
        assert_eq!(refused(&mut endpoint, greedy), Refusal::Limit { trained_max: cost(TRAINED_MAX) });
        endpoint.answer(&reset(1));
        assert_eq!(refused(&mut endpoint, observe(1, 1, 0.0)), Refusal::Tick { next: 0 });
        assert_eq!(refused(&mut endpoint, observe(1, u32::MAX, 0.0)), Refusal::Tick { next: 0 });
        assert_eq!(kappa_of(endpoint.answer(&observe(1, 0, 0.0))), 5.0);
    });
}

#[test]
fn nothing_but_hello_is_answered_first_and_no_other_version() {
    let fixture = Fixture::random(SMALL, 3).build();
    let mut endpoint = Served::new(&fixture.image(), usize::MAX).unwrap();
    assert_eq!(endpoint.answer(&reset(1)), Some(Say::Refused(Refusal::NoHello)));
    let version = Some(Say::Refused(Refusal::Version { supported: 1 }));
    assert_eq!(endpoint.answer(&Ask::Hello { version: 2 }), version);
    assert_eq!(endpoint.answer(&observe(1, 0, 0.0)), Some(Say::Refused(Refusal::NoHello)));
    let Some(Say::Hello(identity)) = endpoint.answer(&Ask::Hello { version: 1 }) else { panic!() };
    assert_eq!((identity.task, identity.state, identity.action, identity.episode), ("fixture", 3, 2, 0));
    assert_eq!((identity.rungs.as_slice(), identity.trained_max), (&[5][..], cost(TRAINED_MAX)));
}

#[test]
fn a_plant_that_greets_again_goes_on_with_the_budget_that_is_left() {
    greeted(|mut endpoint, _| {
        endpoint.answer(&reset(1));
        endpoint.answer(&observe(1, 0, 4.0));
        let Some(Say::Hello(identity)) = endpoint.answer(&Ask::Hello { version: 1 }) else { panic!() };
        assert_eq!(identity.episode, 1);
        assert_eq!(kappa_of(endpoint.answer(&observe(1, 1, 0.0))), 1.0);
    });
}

#[test]
fn what_the_robot_reports_wrongly_is_a_fault_and_never_a_refusal() {
    greeted(|mut endpoint, _| {
        endpoint.answer(&reset(1));
        let state = Vec::from_slice(&[f32::NAN, 0.0, 0.0]).unwrap();
        let blind = Ask::Observe { episode: 1, tick: 0, incurred: 0.0, state };
        assert!(matches!(endpoint.answer(&blind), Some(Say::Act { fault: Some(Fault::StateNotFinite), .. })));
        let short = Ask::Observe { episode: 1, tick: 1, incurred: 0.0, state: Vec::new() };
        assert!(matches!(endpoint.answer(&short), Some(Say::Act { fault: Some(Fault::StateLength), rung: None, .. })));
        let answer = endpoint.answer(&observe(1, 2, f32::NAN));
        assert!(matches!(answer, Some(Say::Act { fault: Some(Fault::InvalidCost), kappa: Cost::ZERO, .. })));
    });
}

#[test]
fn a_request_that_is_whole_but_unknown_is_refused() {
    greeted(|mut endpoint, _| {
        let mut buffer = [0; 256];
        let too_long =
            Request::<32>::Observe { episode: 1, tick: 0, incurred: 0.0, state: Vec::from_slice(&[0.0; 32]).unwrap() };
        let length = encode(&too_long, &mut buffer).unwrap().len();
        assert_eq!(endpoint.receive(&mut buffer[..length]), Some(Say::Refused(Refusal::Malformed)));
        let length = encode(&9u8, &mut buffer).unwrap().len();
        assert_eq!(endpoint.receive(&mut buffer[..length]), Some(Say::Refused(Refusal::Malformed)));
        // A hello with a byte too many.
        let length = encode(&[0u8, 1, 1], &mut buffer).unwrap().len();
        assert_eq!(endpoint.receive(&mut buffer[..length]), Some(Say::Refused(Refusal::Malformed)));
    });
}

/// Every bit of a frame, and every length that it can be cut to.
#[test]
fn no_flipped_bit_and_no_cut_passes_for_a_message() {
    let mut buffer = [0; REQUEST_FRAME];
    let length = encode(&observe(3, 70_000, 1.0), &mut buffer).unwrap().len();
    let frame = &buffer[..length];
    let received = |bytes: &[u8]| {
        let mut receiver = Receiver::<REQUEST_FRAME>::new();
        bytes.iter().filter(|&&byte| receiver.push(byte).is_some_and(|frame| decode::<Ask>(frame).is_ok())).count()
    };
    assert_eq!(received(frame), 1);
    for bit in 0..8 * (length - 1) {
        let mut damaged = buffer;
        damaged[bit / 8] ^= 1 << (bit % 8);
        assert_eq!(received(&damaged[..length]), 0, "bit {bit}");
    }
    for cut in 0..length - 1 {
        let mut cut_short = frame[..cut].to_vec();
        cut_short.push(0);
        assert_eq!(received(&cut_short), 0, "cut to {cut}");
        // The next frame is found all the same.
        cut_short.extend_from_slice(frame);
        assert_eq!(received(&cut_short), 1, "after a cut to {cut}");
    }
    // Two frames whose border was lost are lost; the third is not.
    let merged = [&frame[..length - 1], frame, frame].concat();
    assert_eq!(received(&merged), 1);
}

#[test]
fn a_frame_that_is_too_long_is_passed_over() {
    let mut receiver = Receiver::<4>::new();
    let mut frames = std::vec::Vec::new();
    for byte in [1, 2, 3, 4, 5, 0, 0, 6, 7, 8, 9, 0, 6, 0] {
        frames.extend(receiver.push(byte).map(|frame| frame.to_vec()));
    }
    assert_eq!(frames, [&[6, 7, 8, 9][..], &[6]]);
}

proptest! {
    #[test]
    fn what_is_encoded_is_decoded(
        ids in any::<(u32, u32, u64)>(),
        raw in any::<u32>(),
        state in proptest::collection::vec(any::<f32>(), 0..=STATE),
    ) {
        let (episode, tick, seed) = ids;
        let state = Vec::from_slice(&state).unwrap();
        let requests = [
            Ask::Hello { version: tick as u8 },
            Ask::Reset { episode, limit: Cost::from_raw(raw), seed },
            Ask::Observe { episode, tick, incurred: raw as f32, state },
        ];
        for request in requests {
            let mut buffer = [0; REQUEST_FRAME];
            let mut frame = encode(&request, &mut buffer).unwrap().to_vec();
            prop_assert_eq!(frame.iter().position(|&byte| byte == 0), Some(frame.len() - 1));
            prop_assert_eq!(decode::<Ask>(&mut frame), Ok(request));
        }
    }

    /// A content with runs of more than 254 bytes without a zero.
    #[test]
    fn long_contents_are_stuffed_and_found(content in proptest::collection::vec(0u8..3, 0..40), run in 200usize..600) {
        let content = [&content[..], &[1u8; 600][..run], &content[..]].concat();
        let mut buffer = [0; 1024];
        let frame = encode(&content.as_slice(), &mut buffer).unwrap();
        prop_assert!(frame.len() <= frame_bytes(content.len() + 2));
        let mut receiver = Receiver::<1024>::new();
        let mut found = None;
        for &byte in frame {
            found = receiver.push(byte).map(|frame| decode::<&[u8]>(frame).unwrap().to_vec());
        }
        prop_assert_eq!(found, Some(content));
    }

    /// A content without a zero of about 254 bytes, its checksum among them.
    #[test]
    fn a_run_that_ends_the_content_fits_its_frame(byte in 1u8.., length in 240usize..260) {
        let mut buffer = [0; 1024];
        let content = [byte; 260];
        let frame = encode(&&content[..length], &mut buffer).unwrap();
        prop_assert!(frame.len() <= frame_bytes(length + 2));
    }

    #[test]
    fn no_noise_on_the_line_changes_the_budget(noise in proptest::collection::vec(any::<u8>(), 0..2000)) {
        greeted(|mut endpoint, _| {
            endpoint.answer(&reset(1));
            let mut receiver = Receiver::<REQUEST_FRAME>::new();
            for byte in noise.into_iter().chain([0]) {
                if let Some(frame) = receiver.push(byte) {
                    assert_eq!(endpoint.receive(frame), None);
                }
            }
            assert_eq!(kappa_of(endpoint.answer(&observe(1, 0, 0.0))), 5.0);
        });
    }
}
