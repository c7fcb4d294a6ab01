//! Calls all that a controller's firmware calls, on inputs that the compiler
//! knows nothing of. `tests/no-panic.sh` looks for panics in what is linked.
//!
//! Left out is text (`Display`): `core` formats numbers with checks of its own,
//! so firmware that prints errors contains those.
#![no_std]
#![no_main]

mod flash;

use core::hint::black_box;
use core::panic::PanicInfo;

use armor_core::image::{PolicyImage, SectionKind};
use armor_core::units::{Cost, CostLimit};
use armor_infer::journal::{Journal, Reserve};
use armor_infer::link::{Answer, Endpoint, Receiver, Request, answer_bytes, decode, encode, frame_bytes, request_bytes};
use armor_infer::{BestOf, Controller, Kernel, Policy, golden};
use flash::Flash;

const STATE: usize = 60;
const ACTION: usize = 2;
const HIDDEN: usize = 256;

static IMAGE: [u8; 4096] = [0; 4096];

/// Where the program starts.
#[unsafe(no_mangle)]
pub extern "C" fn entry() -> ! {
    let bytes: &[u8] = black_box(&IMAGE);
    if let Ok(image) = PolicyImage::new_checked(black_box(bytes)) {
        let image = black_box(image);
        black_box((image.bytes(), image.manifest(), image.sections()));
        black_box(image.words(black_box(SectionKind::Golden)));
        fly(&image);
        choose(&image);
        serve(&image);
        let _ = black_box(golden::replay::<STATE, ACTION, HIDDEN>(&image));
    }
    keep();
    #[cfg(feature = "deliberate")]
    black_box(bytes[black_box(4096)]);
    loop {}
}

fn fly(image: &PolicyImage<'static>) {
    let Ok(policy) = Policy::load(image) else { return };
    let policy = black_box(policy.with_kernel(Kernel::best()));
    black_box((policy.kernel().name(), policy.shape(), policy.trained_max(), policy.rung_within(black_box(5))));
    for steps in policy.rungs() {
        black_box(steps);
    }
    let Ok(limit) = CostLimit::new(black_box(20.0)) else { return };
    let Ok(controller) = Controller::<STATE, ACTION, HIDDEN>::new(policy, limit, black_box(1)) else { return };
    let mut controller = black_box(controller);
    let state: &[f32] = black_box(&[0.0; STATE]);
    black_box(controller.step(state, black_box(0.0)));
    black_box(controller.step_within(state, black_box(0.0), black_box(5)));
    black_box((controller.new_episode(limit, black_box(2)).is_ok(), controller.kappa()));
}

fn choose(image: &PolicyImage<'static>) {
    black_box(image.critic());
    let Ok(limit) = CostLimit::new(black_box(20.0)) else { return };
    let Ok(controller) = BestOf::<STATE, ACTION, HIDDEN, 4>::new(image, limit, black_box(1)) else { return };
    let mut controller = black_box(controller);
    let state: &[f32] = black_box(&[0.0; STATE]);
    black_box(controller.step(state, black_box(0.0)));
    black_box(controller.step_within(state, black_box(0.0), black_box(5)));
    black_box((controller.new_episode(limit, black_box(2)).is_ok(), controller.kappa()));
}

fn serve(image: &PolicyImage<'static>) {
    const REQUEST: usize = frame_bytes(request_bytes(STATE));
    const ANSWER: usize = frame_bytes(answer_bytes(ACTION, 32));
    let Ok(endpoint) = Endpoint::<STATE, ACTION, HIDDEN>::new(image, black_box(20)) else { return };
    let mut endpoint = black_box(endpoint);
    let mut receiver = black_box(Receiver::<REQUEST>::new());
    let mut out = [0; ANSWER];
    if let Some(answer) = receiver.push(black_box(0)).and_then(|frame| endpoint.receive(frame)) {
        black_box(encode(&answer, &mut out).is_ok());
    }
    // The other side: a robot asks from a microcontroller, too.
    let mut request = [0; REQUEST];
    let observe = black_box(Request::<STATE>::Hello { version: 1 });
    black_box(encode(&observe, &mut request).is_ok());
    black_box(endpoint.answer(&observe));
    black_box(decode::<Answer<'_, ACTION>>(black_box(&mut out)).is_ok());
}

fn keep() {
    let reserve = Reserve { step: Cost::from_raw(black_box(1)), ahead: Cost::from_raw(black_box(1)) };
    let Ok(mut journal) = Journal::open(black_box(Flash::erased()), black_box(0..8192), reserve) else { return };
    let kappa = black_box(Cost::MAX);
    black_box((journal.begin(kappa).is_ok(), journal.cover(kappa).is_ok()));
    black_box((journal.remaining(), journal.episode(), journal.into_flash()));
}

#[panic_handler]
fn panic(_: &PanicInfo<'_>) -> ! {
    loop {}
}
