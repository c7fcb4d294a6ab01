//! The C interface, whose header is `armor-infer/include/armor.h`.
//!
//! Memory is the caller's: [`ARMOR_CONTROLLER_SIZE`] bytes at
//! [`ARMOR_CONTROLLER_ALIGN`] hold a controller for policies of up to
//! [`ARMOR_STATE_MAX`] state entries, [`ARMOR_ACTION_MAX`] action entries and
//! layers of [`ARMOR_HIDDEN_MAX`] units. A null, misaligned or short argument is
//! a status like every other fault; nothing allocates, blocks or panics. What
//! cannot be checked, that a pointer which is neither null nor misaligned leads
//! to as much memory as is said, is the caller's word.
//!
//! The feature `staticlib` makes the library whole for a C linker: with a panic
//! handler, which Rust programs bring themselves and this code never reaches.

#![allow(unsafe_code)]

mod pointer;
mod status;
#[cfg(test)]
mod tests;

use core::ffi::{c_char, c_void};

use armor_core::image::{MAX_RUNGS, PolicyImage, Precision};
use armor_core::units::CostLimit;

use crate::{Controller, Policy, golden};
pub use status::{ArmorStatus, armor_status_text};

/// Most entries of a state vector.
pub const ARMOR_STATE_MAX: usize = 96;
/// Most entries of an action vector.
pub const ARMOR_ACTION_MAX: usize = 8;
/// Most units of a layer.
pub const ARMOR_HIDDEN_MAX: usize = 256;
/// Most chains of a policy.
pub const ARMOR_RUNGS_MAX: usize = 8;
/// Bytes that hold a controller on every machine.
pub const ARMOR_CONTROLLER_SIZE: usize = 6144;
/// Alignment of these bytes.
pub const ARMOR_CONTROLLER_ALIGN: usize = 16;
/// Alignment of an image in memory.
pub const ARMOR_IMAGE_ALIGN: usize = 16;

/// A controller in the caller's memory. It reads its image in place for as long
/// as it is used, and has nothing to be released.
#[repr(transparent)]
pub struct ArmorController(Inner);

type Inner = Controller<'static, ARMOR_STATE_MAX, ARMOR_ACTION_MAX, ARMOR_HIDDEN_MAX>;

const _: () = assert!(
    size_of::<ArmorController>() <= ARMOR_CONTROLLER_SIZE
        && align_of::<ArmorController>() <= ARMOR_CONTROLLER_ALIGN
        && ARMOR_IMAGE_ALIGN == armor_core::image::ALIGNMENT
        && ARMOR_RUNGS_MAX == MAX_RUNGS
);

/// The answer to a control step.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ArmorStep {
    /// What to do, within the policy's bounds; entries beyond its action dimension are 0.
    pub action: [f32; ARMOR_ACTION_MAX],
    /// The budget left after the incurred cost was charged, in units of cost.
    pub kappa: f32,
    /// Which of the policy's chains flew, from 0; -1 where the action is the fallback.
    pub rung: i32,
}

/// The number format of a policy.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum ArmorPrecision {
    /// IEEE-754 single precision.
    F32 = 0,
    /// 8-bit weights, 15-bit activations.
    Int16x8 = 1,
    /// 8-bit weights, 7-bit activations.
    Int8 = 2,
}

/// What an image says of itself.
#[derive(Clone, Copy, Debug, PartialEq)]
#[repr(C)]
pub struct ArmorInfo {
    /// The task that the policy was trained for: UTF-8 within the image, not terminated.
    pub task: *const c_char,
    /// Bytes of `task`.
    pub task_len: usize,
    /// Bytes of the image, without what follows it in memory.
    pub image_len: usize,
    /// Number format of weights and activations.
    pub precision: ArmorPrecision,
    /// Largest cost limit that the policy may be given, in units of cost.
    pub cost_limit_max: f32,
    /// Entries of the state vector.
    pub state: u16,
    /// Entries of the action vector.
    pub action: u16,
    /// Units of a hidden layer.
    pub hidden: u16,
    /// Chains of the policy.
    pub rungs: u16,
    /// Calls of the denoiser that each chain takes, longest first; 0 beyond `rungs`.
    pub rung_steps: [u16; ARMOR_RUNGS_MAX],
}

/// Checks an image and tells what it holds.
///
/// # Safety
/// `image` leads to `image_len` bytes and `info` to an `ArmorInfo`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_image_inspect(image: *const u8, image_len: usize, info: *mut ArmorInfo) -> ArmorStatus {
    ArmorStatus::of(|| {
        // SAFETY: the caller's word.
        let (info, image) = unsafe { (pointer::place(info)?, checked(image, image_len)?) };
        let (manifest, task) = (image.manifest(), image.manifest().task);
        let mut rung_steps = [0; ARMOR_RUNGS_MAX];
        for (steps, rung) in rung_steps.iter_mut().zip(&manifest.rungs) {
            *steps = rung.steps;
        }
        info.write(ArmorInfo {
            task: task.as_ptr().cast(),
            task_len: task.len(),
            image_len: image.bytes().len(),
            precision: match manifest.precision {
                Precision::F32 => ArmorPrecision::F32,
                Precision::Int16x8 => ArmorPrecision::Int16x8,
                Precision::Int8 => ArmorPrecision::Int8,
            },
            cost_limit_max: manifest.kappa.trained_max.to_f32(),
            state: manifest.shape.state,
            action: manifest.shape.action,
            hidden: manifest.shape.hidden,
            rungs: manifest.rungs.len() as u16,
            rung_steps,
        });
        Ok(())
    })
}

/// Proves that this machine computes what the exporting one computed: flies the
/// image's own trace and compares every bit. Takes `memory` as
/// `armor_controller_init` does, and leaves it free. A policy whose trace does
/// not replay must not fly.
///
/// # Safety
/// `memory` leads to `memory_len` bytes of nobody else's, `image` to `image_len` bytes.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_golden_replay(
    memory: *mut c_void,
    memory_len: usize,
    image: *const u8,
    image_len: usize,
) -> ArmorStatus {
    ArmorStatus::of(|| {
        // SAFETY: the caller's word.
        let (memory, image) = unsafe { (pointer::room(memory, memory_len)?, checked(image, image_len)?) };
        let trace = &image.sections().golden;
        let limit = CostLimit::from_cost(trace.limit);
        golden::replay_on(Controller::new_in(memory, Policy::load(&image)?, limit, trace.seed)?, trace)?;
        Ok(())
    })
}

/// Makes a controller in `memory` and points `out` to it, at the start of an
/// episode that may incur `cost_limit` units of cost; `seed` decides the noise.
/// Where it fails, `out` is null, which every other function answers with a status.
///
/// # Safety
/// `memory` leads to `memory_len` bytes of nobody else's, `image` to `image_len`
/// bytes that stay as they are, both for as long as the controller is used;
/// `out` leads to a pointer.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_controller_init(
    memory: *mut c_void,
    memory_len: usize,
    image: *const u8,
    image_len: usize,
    cost_limit: f32,
    seed: u64,
    out: *mut *mut ArmorController,
) -> ArmorStatus {
    ArmorStatus::of(|| {
        // SAFETY: the caller's word.
        let out = unsafe { pointer::place(out)? }.write(core::ptr::null_mut());
        // SAFETY: as above.
        let (memory, image) = unsafe { (pointer::room(memory, memory_len)?, checked(image, image_len)?) };
        let controller = Controller::new_in(memory, Policy::load(&image)?, CostLimit::new(cost_limit)?, seed)?;
        *out = core::ptr::from_mut(controller).cast();
        Ok(())
    })
}

/// Starts a new episode: the only way to refill the budget. Where it fails, the
/// episode before goes on.
///
/// # Safety
/// `controller` is null or what `armor_controller_init` gave.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_new_episode(
    controller: *mut ArmorController,
    cost_limit: f32,
    seed: u64,
) -> ArmorStatus {
    ArmorStatus::of(|| {
        // SAFETY: the caller's word.
        let controller = unsafe { pointer::exclusive(controller)? };
        controller.0.new_episode(CostLimit::new(cost_limit)?, seed)?;
        Ok(())
    })
}

/// One control step by the policy's longest chain: charges `incurred`, the cost
/// of the step before (0 on the first), then answers `state` with an action.
///
/// `step` is filled whatever the status is, unless `controller` or `step` itself
/// is null or misaligned: a fault takes the fallback action, but for
/// ARMOR_STATUS_STEP_INVALID_COST, which charges the whole budget and acts.
///
/// # Safety
/// `controller` is null or what `armor_controller_init` gave, `state` leads to
/// `state_len` numbers and `step` to an `ArmorStep`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_step(
    controller: *mut ArmorController,
    state: *const f32,
    state_len: usize,
    incurred: f32,
    step: *mut ArmorStep,
) -> ArmorStatus {
    // SAFETY: the caller's word.
    unsafe { armor_step_within(controller, state, state_len, incurred, usize::MAX, step) }
}

/// As `armor_step`, by the longest chain of at most `max_steps` calls of the
/// denoiser: the caller knows how many its deadline leaves time for.
///
/// # Safety
/// As of `armor_step`.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_step_within(
    controller: *mut ArmorController,
    state: *const f32,
    state_len: usize,
    incurred: f32,
    max_steps: usize,
    step: *mut ArmorStep,
) -> ArmorStatus {
    ArmorStatus::of(|| {
        // SAFETY: the caller's word.
        let (controller, step) = unsafe { (pointer::exclusive(controller)?, pointer::place(step)?) };
        // SAFETY: the caller's word. No state at all is one of the wrong length:
        // its cost is charged, and the fallback action answers it.
        let state = unsafe { pointer::slice(state, state_len) };
        let answer = controller.0.step_within(state.unwrap_or_default(), incurred, max_steps);
        step.write(ArmorStep {
            action: answer.action.data.0[0],
            kappa: answer.kappa.to_f32(),
            rung: answer.rung.map_or(-1, |rung| rung as i32),
        });
        state?;
        answer.fault.map_or(Ok(()), |fault| Err(fault.into()))
    })
}

/// What is left of the budget, in units of cost; 0 of no controller.
///
/// # Safety
/// `controller` is null or what `armor_controller_init` gave.
#[unsafe(no_mangle)]
pub unsafe extern "C" fn armor_kappa(controller: *const ArmorController) -> f32 {
    // SAFETY: the caller's word.
    unsafe { pointer::shared(controller) }.map_or(0.0, |controller| controller.0.kappa().to_f32())
}

/// The image of these bytes.
///
/// # Safety
/// `image` leads to `length` bytes that stay as they are while the image is used.
unsafe fn checked(image: *const u8, length: usize) -> Result<PolicyImage<'static>, ArmorStatus> {
    // SAFETY: the caller's word.
    Ok(PolicyImage::new_checked(unsafe { pointer::slice(image, length)? })?)
}

/// A static library needs a panic handler to link, though nothing here panics.
#[cfg(all(feature = "staticlib", not(feature = "std"), not(test)))]
#[panic_handler]
fn halt(_: &core::panic::PanicInfo<'_>) -> ! {
    loop {
        core::hint::spin_loop();
    }
}
