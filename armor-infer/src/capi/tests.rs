use super::*;
use crate::fixture::{Fixture, Parts, SMALL, TRAINED_MAX};
use armor_core::image::{ImageError, SectionKind};
use armor_core::schedule::Sampler;
use std::boxed::Box;
use std::ffi::CStr;
use std::string::String;
use std::vec::Vec;

const LIMIT: f32 = 5.0;
const SEED: u64 = 9;
const STATE: [f32; 3] = [0.5, -1.0, 2.0];

/// Memory as a C program would lay it out, one alignment longer than is needed.
#[repr(align(16))]
struct Memory([u8; ARMOR_CONTROLLER_SIZE + ARMOR_CONTROLLER_ALIGN]);

impl Memory {
    fn new() -> Box<Self> {
        Box::new(Self([0xA5; _]))
    }

    fn at(&mut self, offset: usize) -> *mut c_void {
        self.0[offset..].as_mut_ptr().cast()
    }
}

fn parts() -> Parts {
    let mut parts = Fixture::random(SMALL, 4);
    parts.set_rungs(&[(Sampler::Ddpm, 5), (Sampler::Ddim, 2)]);
    parts.record_golden(CostLimit::new(2.0).unwrap(), 77, &[[0.5; 3], [-1.0; 3]], &[0.0, 0.5]);
    parts
}

/// A policy that lives as long as C's flash does.
fn flash(parts: Parts) -> &'static [u8] {
    Box::leak(Box::new(parts.build())).image().bytes()
}

fn init(
    memory: *mut c_void,
    length: usize,
    image: (*const u8, usize),
    limit: f32,
) -> (ArmorStatus, *mut ArmorController) {
    let mut out = core::ptr::dangling_mut();
    // SAFETY: memory and image are there, or the pointers fail their checks.
    let status = unsafe { armor_controller_init(memory, length, image.0, image.1, limit, SEED, &mut out) };
    assert_eq!(status == ArmorStatus::Ok, !out.is_null());
    (status, out)
}

fn step(controller: *mut ArmorController, state: &[f32], incurred: f32, steps: usize) -> (ArmorStatus, ArmorStep) {
    let mut step = core::mem::MaybeUninit::uninit();
    // SAFETY: the controller is one that was made.
    unsafe {
        let status = armor_step_within(controller, state.as_ptr(), state.len(), incurred, steps, step.as_mut_ptr());
        (status, step.assume_init())
    }
}

#[test]
fn it_flies_with_the_bits_of_the_rust_controller() {
    let (bytes, mut memory) = (flash(parts()), Memory::new());
    let image = PolicyImage::new_checked(bytes).unwrap();
    let limit = CostLimit::new(LIMIT).unwrap();
    let mut rust = Controller::<16, 4, 16>::new(Policy::load(&image).unwrap(), limit, SEED).unwrap();
    let (status, c) = init(memory.at(0), ARMOR_CONTROLLER_SIZE, (bytes.as_ptr(), bytes.len()), LIMIT);
    assert_eq!(status, ArmorStatus::Ok);

    let nan = [f32::NAN, 0.0, 0.0];
    let steps: [(&[f32], f32, usize, ArmorStatus); 7] = [
        (&STATE, 0.0, usize::MAX, ArmorStatus::Ok),
        (&STATE, 0.5, 3, ArmorStatus::Ok),
        (&STATE, 0.25, 1, ArmorStatus::StepNoRung),
        (&STATE[..2], 0.25, 5, ArmorStatus::StepStateLength),
        (&nan, 0.25, 5, ArmorStatus::StepStateNotFinite),
        (&[3e38, 3e38, -3e38], 0.25, 5, ArmorStatus::StepActionNotFinite),
        (&STATE, -1.0, 5, ArmorStatus::StepInvalidCost),
    ];
    for (state, incurred, allowed, expected) in steps {
        let (status, answer) = step(c, state, incurred, allowed);
        let same = rust.step_within(state, incurred, allowed);
        assert_eq!(status, expected);
        assert_eq!(
            answer.action[..4].iter().map(|a| a.to_bits()).collect::<Vec<_>>(),
            same.action.map(f32::to_bits).as_slice()
        );
        assert_eq!(answer.action[4..], [0.0; 4]);
        assert_eq!(answer.kappa, same.kappa.to_f32());
        assert_eq!(answer.rung, same.rung.map_or(-1, |rung| rung as i32));
        // SAFETY: the controller is one that was made.
        assert_eq!(unsafe { armor_kappa(c) }, answer.kappa);
    }

    // SAFETY: as above.
    unsafe {
        assert_eq!(armor_new_episode(c, TRAINED_MAX + 1.0, 1), ArmorStatus::LoadLimitAboveTrainedRange);
        assert_eq!(armor_new_episode(c, f32::NAN, 1), ArmorStatus::InvalidLimit);
        assert_eq!(armor_kappa(c), 0.0);
        assert_eq!(armor_new_episode(c, 3.0, 1), ArmorStatus::Ok);
        assert_eq!(armor_kappa(c), 3.0);
    }
}

#[test]
fn memory_that_is_null_misaligned_or_short_is_a_status() {
    let (bytes, mut memory) = (flash(parts()), Memory::new());
    let (pointer, length) = (bytes.as_ptr(), bytes.len());
    let image = (pointer, length);
    let null = core::ptr::null_mut();
    let mut made = |offset: usize, length: usize| init(memory.at(offset), length, image, LIMIT).0;
    for short in [0, 1, ARMOR_CONTROLLER_SIZE - 1] {
        assert_eq!(made(0, short), ArmorStatus::MemoryTooSmall);
    }
    for offset in 1..ARMOR_CONTROLLER_ALIGN {
        assert_eq!(made(offset, ARMOR_CONTROLLER_SIZE), ArmorStatus::MisalignedPointer);
    }
    assert_eq!(made(0, ARMOR_CONTROLLER_SIZE), ArmorStatus::Ok);
    assert_eq!(made(ARMOR_CONTROLLER_ALIGN, ARMOR_CONTROLLER_SIZE), ArmorStatus::Ok);

    let (memory, size) = (memory.at(0), ARMOR_CONTROLLER_SIZE);
    assert_eq!(init(null, size, image, LIMIT).0, ArmorStatus::NullPointer);
    assert_eq!(init(memory, size, (core::ptr::null(), length), LIMIT).0, ArmorStatus::NullPointer);
    assert_eq!(init(memory, size, (core::ptr::null(), 0), LIMIT).0, ArmorStatus::ImageTruncated);
    assert_eq!(init(memory, size, (pointer.wrapping_add(4), length - 4), LIMIT).0, ArmorStatus::ImageMisaligned);
    let controller = init(memory, size, image, LIMIT).1;

    let (mut answer, mut info) = (core::mem::MaybeUninit::uninit(), core::mem::MaybeUninit::uninit());
    // SAFETY: what is neither null nor misaligned is there.
    unsafe {
        let no_out = core::ptr::null_mut();
        assert_eq!(armor_controller_init(memory, size, pointer, length, LIMIT, 1, no_out), ArmorStatus::NullPointer);
        assert_eq!(armor_image_inspect(pointer, length, core::ptr::null_mut()), ArmorStatus::NullPointer);
        assert_eq!(armor_image_inspect(core::ptr::null(), length, info.as_mut_ptr()), ArmorStatus::NullPointer);
        assert_eq!(armor_new_episode(core::ptr::null_mut(), 1.0, 1), ArmorStatus::NullPointer);
        assert_eq!(armor_kappa(core::ptr::null()), 0.0);
        let (state, count) = (STATE.as_ptr(), STATE.len());
        let no_controller = core::ptr::null_mut();
        assert_eq!(armor_step(no_controller, state, count, 1.0, answer.as_mut_ptr()), ArmorStatus::NullPointer);
        assert_eq!(armor_step(controller, state, count, 1.0, core::ptr::null_mut()), ArmorStatus::NullPointer);
        assert_eq!(armor_kappa(controller), LIMIT);

        // There is room for an answer, so there is one, and the cost is charged.
        let crooked = state.wrapping_byte_add(1);
        for (state, expected) in
            [(core::ptr::null(), ArmorStatus::NullPointer), (crooked, ArmorStatus::MisalignedPointer)]
        {
            assert_eq!(armor_step(controller, state, count, 1.0, answer.as_mut_ptr()), expected);
            assert_eq!((answer.assume_init().rung, answer.assume_init().action), (-1, [0.0; ARMOR_ACTION_MAX]));
        }
        assert_eq!(armor_kappa(controller), LIMIT - 2.0);
    }
}

#[test]
fn an_image_tells_what_it_holds() {
    let bytes = flash(parts());
    let mut info = core::mem::MaybeUninit::uninit();
    // SAFETY: image and room are there.
    let info = unsafe {
        assert_eq!(armor_image_inspect(bytes.as_ptr(), bytes.len(), info.as_mut_ptr()), ArmorStatus::Ok);
        info.assume_init()
    };
    // SAFETY: the task lies in the image.
    let task = unsafe { core::slice::from_raw_parts(info.task.cast::<u8>(), info.task_len) };
    assert_eq!(task, b"fixture");
    assert_eq!((info.state, info.action, info.hidden, info.precision), (3, 2, 8, ArmorPrecision::F32));
    assert_eq!((info.image_len, info.cost_limit_max), (bytes.len(), TRAINED_MAX));
    assert_eq!((info.rungs, info.rung_steps), (2, [5, 2, 0, 0, 0, 0, 0, 0]));
}

#[test]
fn the_golden_trace_is_replayed_and_a_wrong_one_found() {
    let row = 4;
    let outcome = |word: Option<usize>| {
        let (mut parts, mut memory) = (parts(), Memory::new());
        if let Some(word) = word {
            parts.section(SectionKind::Golden)[row + word] ^= 1;
        }
        let bytes = flash(parts);
        // SAFETY: memory and image are there.
        unsafe { armor_golden_replay(memory.at(0), ARMOR_CONTROLLER_SIZE, bytes.as_ptr(), bytes.len()) }
    };
    assert_eq!(outcome(None), ArmorStatus::Ok);
    assert_eq!(outcome(Some(4)), ArmorStatus::GoldenKappa);
    assert_eq!(outcome(Some(5)), ArmorStatus::GoldenAction);
}

/// Whatever is wrong with an image, C hears the same name as Rust.
#[test]
fn a_damaged_image_is_named() {
    let bytes = flash(parts());
    let mut copy = std::vec![0u128; bytes.len().div_ceil(16)];
    let mut memory = Memory::new();
    let length = bytes.len();
    for (at, flip) in (0..length).step_by(7).map(|at| (at, 0x10u8)).chain([(0, 0)]) {
        // SAFETY: a u128 is 16 bytes.
        let bytes_of =
            |words: &mut [u128]| unsafe { core::slice::from_raw_parts_mut(words.as_mut_ptr().cast::<u8>(), length) };
        let damaged = bytes_of(&mut copy);
        damaged.copy_from_slice(bytes);
        damaged[at] ^= flip;
        let expected = PolicyImage::new_checked(damaged).err().map_or(ArmorStatus::Ok, ImageError::into);
        assert_eq!(expected == ArmorStatus::Ok, flip == 0);
        let image = (damaged.as_ptr(), damaged.len());
        assert_eq!(init(memory.at(0), ARMOR_CONTROLLER_SIZE, image, LIMIT).0, expected);
    }
}

#[test]
fn every_status_has_a_number_and_a_text_of_its_own() {
    // SAFETY: the text is a C string.
    let text = |status: i32| unsafe { CStr::from_ptr(armor_status_text(status)) }.to_str().unwrap();
    let all = ArmorStatus::ALL;
    let texts: Vec<String> = all.iter().map(|&status| text(status as i32).into()).collect();
    for (i, one) in texts.iter().enumerate() {
        assert!(one.is_ascii() && !one.is_empty());
        assert!(!texts[..i].contains(one), "{one}");
    }
    assert!(all.is_sorted_by(|one, next| (*one as i32) < *next as i32));
    for unknown in [-1, 5, i32::MAX, i32::MIN] {
        assert_eq!(text(unknown), "no status of this library");
    }
}
