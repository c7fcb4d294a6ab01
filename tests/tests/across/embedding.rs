//! The controller in other programs, which `tests/embedding.sh` builds: the
//! same bits as here.

use std::ffi::OsString;
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use armor_infer::{Controller, Policy};
use firmware_sim::memory::AlignedBytes;

use crate::fixture::{self, LIMIT, Run};

const STATE: usize = 7;
const SEED: u64 = 11;

/// A program that the script has built, and an image for it.
fn program(variable: &str, name: &str) -> (PathBuf, PathBuf, Run) {
    let built: OsString = std::env::var_os(variable).expect("run tests/embedding.sh");
    let run = Run::new();
    let image = run.path("policy.armor");
    fs::write(&image, fixture::policy().exported.bytes.as_slice()).unwrap();
    (Path::new(&built).join(name), image, run)
}

fn output(command: &mut Command) -> String {
    let output = command.output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    String::from_utf8(output.stdout).unwrap()
}

#[test]
#[ignore = "needs the C program of tests/embedding.sh"]
fn embedding_in_c_gives_the_bits_of_the_rust_controller() {
    let (fly, path, _run) = program("ARMOR_C", "fly");
    let printed = output(Command::new(fly).arg(&path).args([LIMIT.to_string(), SEED.to_string()]));

    assert_flown_as_here(&printed, AlignedBytes::read(&path).unwrap().as_slice());
}

/// Whether what a C program printed of an episode with an image is what this
/// host's controller answers to the same states and costs.
pub(crate) fn assert_flown_as_here(printed: &str, bytes: &[u8]) {
    let image = PolicyImage::new_checked(bytes).unwrap();
    let limit = CostLimit::new(LIMIT).unwrap();
    let mut controller = Controller::<STATE, 2, 16>::new(Policy::load(&image).unwrap(), limit, SEED).unwrap();
    let (mut steps, mut costly) = (0, 0);
    for line in printed.lines() {
        let words: Vec<&str> = line.split_whitespace().collect();
        let bits = |word: &str| f32::from_bits(u32::from_str_radix(word, 16).unwrap());
        let numbers: Vec<f32> = words[..STATE + 2].iter().map(|word| bits(word)).collect();
        let (state, incurred, kappa) = (&numbers[..STATE], numbers[STATE], numbers[STATE + 1]);
        let step = controller.step(state, incurred);
        let action: Vec<u32> = words[STATE + 3..].iter().map(|word| bits(word).to_bits()).collect();
        assert_eq!(step.action.map(f32::to_bits).as_slice(), action, "step {steps}");
        assert_eq!((step.kappa.to_f32(), step.rung), (kappa, Some(words[STATE + 2].parse().unwrap())), "step {steps}");
        steps += 1;
        costly += usize::from(incurred > 0.0);
    }
    assert_eq!(steps, 100);
    // The budget was at work.
    assert!(costly > 0);
}

#[test]
#[ignore = "needs the examples of tests/embedding.sh"]
fn embedding_in_a_plain_and_in_an_async_loop_replays_the_trace() {
    for name in ["super_loop", "embassy_loop"] {
        let (example, image, _run) = program("ARMOR_EXAMPLES", name);
        let printed = output(Command::new(example).arg(&image));
        assert!(printed.starts_with(&format!("{name}: 32 steps, bit for bit")), "{printed}");
    }
}
