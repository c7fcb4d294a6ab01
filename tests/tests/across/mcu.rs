//! The controller on emulated microcontrollers, whose firmware `tests/mcu.sh`
//! builds: on every machine the same bits as here, within small memories.

use std::net::{TcpListener, TcpStream};
use std::path::{Path, PathBuf};
use std::time::Duration;

use armor_core::image::{Layout, PolicyImage, Precision};
use armor_core::units::CostLimit;
use armor_infer::Policy;
use armor_train::export::export;
use armor_train::quantize::quantize;
use firmware_sim::host::HostController;
use firmware_sim::link::{Client, patient_socket};
use firmware_sim::mcu::{Firmware, Flashed, MACHINES, Machine, McuError, SurveyPlan, bridge, survey};
use firmware_sim::memory::AlignedBytes;

use crate::embedding;
use crate::fixture::{LIMIT, Run, config, made_up, policy};

const PATIENCE: Duration = Duration::from_secs(600);
/// What a machine may take: all of its flash, less the largest 8-bit policy of
/// the paper's tasks (state 60, hidden 256).
const FIRMWARE_BYTES: u64 = 256 * 1024 - 187_152;
const RAM_BYTES: u64 = 16 * 1024;
const STACK_BYTES: u32 = 2048;

/// A policy as wide as the loops of kernels are long, hardly trained: in single
/// precision, and in 8 bits in both layouts.
fn policies() -> [AlignedBytes; 3] {
    let (data, run) = (made_up(), Run::new());
    let mut config = config(&["hidden=64", "kappa_hidden=16", "kappa_embedding=8", "normalize_states=true"]);
    config.steps = 20;
    run.fit(&config, &data, None);
    let float = export(&run.checkpoint(), &data, None).unwrap().bytes;
    let image = PolicyImage::new_checked(float.as_slice()).unwrap();
    let int8 = |layout| quantize(&image, &data, Precision::Int8, layout).unwrap().bytes;
    let (rows, paired) = (int8(Layout::Rows), int8(Layout::Paired));
    [float, rows, paired]
}

fn built(name: &str) -> PathBuf {
    let folder = std::env::var_os("ARMOR_FIRMWARE").expect("run tests/mcu.sh");
    Path::new(&folder).join(name)
}

#[test]
#[ignore = "needs the firmware of tests/mcu.sh"]
fn mcu_every_machine_flies_as_this_host_within_its_memories() {
    let policies = policies();
    for machine in &MACHINES {
        let firmware = Firmware::read(&built(&format!("{}.elf", machine.name))).unwrap();
        assert_eq!(firmware.panics().collect::<Vec<_>>(), [""; 0], "{}", machine.name);
        for policy in &policies {
            let plan = SurveyPlan { max_steps: usize::MAX, actions: 2, seed: 3, patience: PATIENCE };
            let survey = survey(machine, &firmware, policy.as_slice(), &plan).unwrap();
            println!("{survey}\n");
            assert_eq!((survey.golden_rows, survey.steps, survey.episode_actions), (32, 20, 100), "{}", machine.name);
            assert!(survey.instructions_per_action > survey.macs_per_action as f64 / 4.0, "{}", machine.name);
            assert!(survey.stack_bytes <= STACK_BYTES, "{}: {} bytes of stack", machine.name, survey.stack_bytes);
            let ram = survey.static_ram_bytes + u64::from(survey.stack_bytes);
            assert!(ram <= RAM_BYTES, "{}: {ram} bytes of RAM", machine.name);
            assert!(survey.firmware_bytes <= FIRMWARE_BYTES, "{}: {}", machine.name, survey.firmware_bytes);
        }
    }
}

#[test]
#[ignore = "needs the firmware of tests/mcu.sh"]
fn mcu_counts_are_the_same_in_every_run() {
    let machine = Machine::named("mps2-an386").unwrap();
    let firmware = Firmware::read(&built("mps2-an386.elf")).unwrap();
    let flashed = Flashed::new(machine, &firmware, policy().exported.bytes.as_slice()).unwrap();
    let count = || firmware_sim::mcu::count(&flashed, &firmware, 5, 2, PATIENCE).unwrap();
    let first = count();
    assert_eq!(count(), first);
    let classes: f64 = first.classes.values().sum();
    let functions: f64 = first.functions.iter().map(|(_, count)| count).sum();
    assert!((classes - first.total).abs() < 1e-6 * first.total && (functions - first.total).abs() < 1e-6 * first.total);
}

/// The image is whole, so it is the firmware that refuses.
#[test]
#[ignore = "needs the firmware of tests/mcu.sh"]
fn mcu_a_command_that_is_none_is_named_and_a_slow_one_is_stopped() {
    let machine = Machine::named("mps2-an386").unwrap();
    let firmware = Firmware::read(&built("mps2-an386.elf")).unwrap();
    let flashed = Flashed::new(machine, &firmware, policy().exported.bytes.as_slice()).unwrap();
    let error = flashed.run("fly", PATIENCE).unwrap_err();
    assert_eq!(error.to_string(), "mps2-an386 failed: command");
    let error = flashed.run("serve 20 0", Duration::from_millis(100)).unwrap_err();
    assert!(matches!(error, McuError::Late { .. }), "{error}");
    let broken = Flashed::new(machine, &firmware, &[0; 64]).unwrap();
    assert_eq!(broken.run("golden", PATIENCE).unwrap_err().to_string(), "mps2-an386 failed: image");
}

/// `firmware-sim mcu --listen`: a plant that connects flies the machine, which ends when it leaves.
#[test]
#[ignore = "needs the firmware of tests/mcu.sh"]
fn mcu_a_plant_that_connects_has_the_machine_until_it_leaves() {
    let machine = Machine::named("mps2-an386").unwrap();
    let firmware = Firmware::read(&built("mps2-an386.elf")).unwrap();
    let bytes = policy().exported.bytes.as_slice();
    let flashed = Flashed::new(machine, &firmware, bytes).unwrap();
    let image = PolicyImage::new_checked(bytes).unwrap();
    let (limit, seed) = (CostLimit::new(LIMIT).unwrap(), 5);
    let mut host = HostController::new(Policy::load(&image).unwrap(), limit, seed).unwrap();

    let plants = TcpListener::bind("127.0.0.1:0").unwrap();
    let address = plants.local_addr().unwrap();
    std::thread::scope(|scope| {
        let bridged = scope.spawn(|| bridge(&flashed, u32::MAX, &plants));
        let mut plant = Client::new(patient_socket(TcpStream::connect(address).unwrap(), PATIENCE).unwrap());
        assert_eq!(plant.hello().unwrap().state, image.sections().state_mean.len());
        plant.reset(limit.cost(), seed).unwrap();
        for (row, incurred) in image.sections().golden.rows().zip([0.0, 0.0, 1.0, 2.0]) {
            let (theirs, ours) = (plant.step(row.state, incurred).unwrap(), host.step(row.state, incurred));
            let bits = |action: &[f32]| action.iter().map(|entry| entry.to_bits()).collect::<Vec<_>>();
            assert_eq!(bits(&theirs.action), bits(&ours.action.as_slice()[..theirs.action.len()]));
            assert_eq!(theirs.kappa, ours.kappa);
        }
        drop(plant);
        bridged.join().unwrap().unwrap();
    });
}

#[test]
#[ignore = "needs the firmware of tests/mcu.sh"]
fn mcu_firmware_in_c_gives_the_bits_of_the_rust_controller() {
    let machine = Machine::named("mps2-an386").unwrap();
    let firmware = Firmware::read(&built("c.elf")).unwrap();
    assert_eq!(firmware.panics().collect::<Vec<_>>(), [""; 0]);
    let bytes = policy().exported.bytes.as_slice();
    let printed = Flashed::new(machine, &firmware, bytes).unwrap().start("", &[]).unwrap().console(PATIENCE).unwrap();
    let (flight, stack) = printed.split_once("stack_bytes ").unwrap();
    println!("C firmware: {} bytes of flash, {stack} bytes of stack", firmware.flash_bytes);
    assert!(firmware.flash_bytes <= FIRMWARE_BYTES, "{}", firmware.flash_bytes);
    embedding::assert_flown_as_here(flight, bytes);
}
