//! Bare-metal firmware: the controller of `armor-infer` on a microcontroller
//! under QEMU, with a policy in flash and the link on a UART.
//!
//! It is what a user's firmware is, but for semihosting: the emulator's command
//! line says what to do, and results are told as lines of a word and a number.
//!
//! | command | does | tells |
//! |---|---|---|
//! | `golden` | replays the image's golden trace | `golden_rows` |
//! | `bench STEPS ACTIONS` | actions by chains of at most STEPS, in the golden trace's states | `checksum` of their bits |
//! | `kernels ROUNDS` | compares the machine's kernels with the portable ones (`Kernel::check`); with the feature `check` only | `kernels` and the rounds |
//! | `serve STEPS ACTIONS` | answers the link (`docs/link.md`) until it gave ACTIONS, or for ever for 0 | `actions` |
//!
//! At the end: `stack_bytes`, the stack's high-water mark, or `failed` and why.
//!
//! The firmware does not hold the policy: its image is written to a slot of
//! flash of its own, as on a robot, so one firmware flies every policy within
//! its capacities.

#![no_std]
#![no_main]

mod bench;
mod console;
mod memory;
mod serve;
mod start;
mod uart;

use core::ffi::CStr;
use core::mem::MaybeUninit;

use armor_core::image::PolicyImage;
use armor_infer::link::Endpoint;
use semihosting::process::exit;

use console::{CommandLine, number, tell, tell_words};

/// The largest state vector that this firmware senses.
const STATE: usize = 96;
/// The largest action vector that it answers.
const ACTION: usize = 8;
/// The widest layer that it computes.
const HIDDEN: usize = 256;

type McuEndpoint = Endpoint<'static, STATE, ACTION, HIDDEN>;

/// Why the firmware ends before its work is done, as it tells it.
type Stop = &'static CStr;

const FAILURE: i32 = 1;

fn main() -> ! {
    let status = match run() {
        Ok(()) => 0,
        Err(stop) => {
            tell_words(stop);
            FAILURE
        }
    };
    tell(c"stack_bytes", memory::stack_high_water());
    exit(status)
}

fn run() -> Result<(), Stop> {
    let image = image()?;
    let line = CommandLine::new();
    let mut words = line.words();
    let command = words.next();
    let mut argument = || words.next().and_then(number).ok_or(c"failed arguments");
    match command {
        Some(b"golden") => {
            let rows = endpoint(image, usize::MAX)?.replay_golden(image).map_err(|_| c"failed golden")?;
            tell(c"golden_rows", rows as u32);
            Ok(())
        }
        Some(b"bench") => {
            let (steps, actions) = (argument()?, argument()?);
            bench::run(endpoint(image, steps as usize)?, image, actions)
        }
        #[cfg(feature = "check")]
        Some(b"kernels") => {
            let rounds = argument()?;
            armor_infer::Kernel::best().check(1, rounds).map_err(|_| c"failed kernels")?;
            tell(c"kernels", rounds);
            Ok(())
        }
        Some(b"serve") => {
            let (steps, actions) = (argument()?, argument()?);
            serve::run(endpoint(image, steps as usize)?, actions)
        }
        _ => Err(c"failed command"),
    }
}

/// Where the controller lies.
static mut ENDPOINT: MaybeUninit<McuEndpoint> = MaybeUninit::uninit();

/// The image in its slot, checked. The check takes more stack than any flight,
/// and so it has the memory of the controller for its stack, which is not there yet.
fn image() -> Result<&'static PolicyImage<'static>, Stop> {
    static mut IMAGE: Option<PolicyImage<'static>> = None;
    extern "C" fn check() {
        // SAFETY: `image` is called once, and there is one thread.
        unsafe { IMAGE = PolicyImage::new_checked(memory::policy_slot()).ok() }
    }
    // SAFETY: nothing else uses this memory before `endpoint` is called.
    unsafe { memory::call_on((&raw mut ENDPOINT).add(1).cast(), check) }
    // SAFETY: as of `check`, which has ended.
    unsafe { (*(&raw const IMAGE)).as_ref() }.ok_or(c"failed image")
}

/// The controller behind its link.
fn endpoint(image: &PolicyImage<'static>, steps: usize) -> Result<&'static mut McuEndpoint, Stop> {
    // SAFETY: `run` calls this once, after `image`, and there is one thread.
    let place = unsafe { &mut *(&raw mut ENDPOINT) };
    Endpoint::new_in(place, image, steps).map_err(|_| c"failed policy")
}
