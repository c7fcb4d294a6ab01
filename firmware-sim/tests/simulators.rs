//! An untrained policy flies an episode of each task of the paper, and of
//! ball-circle, in its simulator. `tests/link.sh` runs this; it installs the simulators first.

#[path = "../src/fixture.rs"]
#[expect(dead_code, reason = "other tests use the rest")]
mod fixture;

use std::fs;
use std::io::{BufRead, BufReader};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::shape::Shape;
use armor_core::units::CostLimit;
use firmware_sim::flight::{Episode, FlightPlan};
use firmware_sim::memory::AlignedBytes;
use firmware_sim::simulator::{Environment, fly};
use firmware_sim::task::Task;
use fixture::{BALL_RUN, Parts};

/// Episodes of a small policy with random weights, apart from host time.
fn flown(name: &str, limit: f32, episodes: u32) -> Vec<Episode> {
    let task = Task::named(name).unwrap();
    let environment = Environment::open(&Environment::folder().unwrap(), |note| eprintln!("{note}")).unwrap();
    let shape = Shape { state: task.state as u16, action: task.action as u16, ..BALL_RUN };
    let memory = AlignedBytes::from(Parts::random(task.name, shape, 1).bytes().as_slice());
    let image = PolicyImage::new_checked(memory.as_slice()).unwrap();
    let limit = CostLimit::new(limit).unwrap();
    let plan = FlightPlan { task, limit, episodes, seed: 3, rate_hz: task.rate_hz, max_steps: usize::MAX };
    let mut flight = fly(&image, &plan, &environment, |_| {}).unwrap();
    for tick in flight.episodes.iter_mut().flat_map(|episode| &mut episode.ticks) {
        tick.latency = Duration::ZERO;
    }
    flight.episodes
}

/// Right sizes, bounded actions, and kappa as section 3.5 of the paper says:
/// the limit, less each cost that was incurred, and not below zero.
fn an_episode_is_right(name: &str) {
    let task = Task::named(name).unwrap();
    let episodes = flown(name, task.cost_limit, 1);
    let ticks = &episodes[0].ticks;
    let may_end_early = matches!(name, "SafetyAntVelocity-v1" | "SafetyWalker2dVelocity-v1");
    assert!(ticks.len() == task.horizon || (may_end_early && (1..task.horizon).contains(&ticks.len())));
    let mut kappa = f64::from(task.cost_limit);
    for tick in ticks {
        assert_eq!((f64::from(tick.step.kappa.to_f32()), tick.step.fault, tick.step.rung), (kappa, None, Some(0)));
        kappa = (kappa - tick.cost).max(0.0);
        assert!(tick.step.action.iter().all(|entry| (-1.0..=1.0).contains(entry)));
        // The policy moves its own entries, and nothing beyond them.
        let entries = &tick.step.action.as_slice()[..task.action];
        assert!(entries.iter().any(|&entry| entry != 0.0));
        assert!(tick.step.action.as_slice()[task.action..].iter().all(|&entry| entry == 0.0));
        assert!(tick.reward.is_finite() && (tick.cost == 0.0 || tick.cost == 1.0));
    }
}

macro_rules! episodes {
    ($($test:ident: $name:literal),* $(,)?) => {
        $(#[test]
        #[ignore = "needs the simulators: tests/link.sh"]
        fn $test() {
            an_episode_is_right($name);
        })*
    };
}

episodes! {
    ant_run: "SafetyAntRun-v0",
    ball_run: "SafetyBallRun-v0",
    drone_run: "SafetyDroneRun-v0",
    ant_velocity: "SafetyAntVelocity-v1",
    walker_velocity: "SafetyWalker2dVelocity-v1",
    half_cheetah_velocity: "SafetyHalfCheetahVelocity-v1",
    point_circle: "SafetyPointCircle1-v0",
    point_goal: "SafetyPointGoal1-v0",
    point_push: "SafetyPointPush1-v0",
    point_button: "SafetyPointButton1-v0",
    car_circle: "SafetyCarCircle1-v0",
    car_goal: "SafetyCarGoal1-v0",
    car_push: "SafetyCarPush1-v0",
    car_button: "SafetyCarButton1-v0",
    ball_circle: "SafetyBallCircle-v0",
}

/// Three episodes are shared out over simulators in another way than one.
#[test]
#[ignore = "needs the simulators: tests/link.sh"]
fn an_episode_is_decided_by_seed_and_number_however_many_are_flown() {
    for name in ["SafetyBallRun-v0", "SafetyPointCircle1-v0"] {
        let three = flown(name, 5.0, 3);
        assert_eq!(flown(name, 5.0, 3), three);
        assert_eq!(flown(name, 5.0, 1), three[..1]);
        assert_ne!(three[1], three[2]);
    }
}

/// The budget runs out, and stays out.
#[test]
#[ignore = "needs the simulators: tests/link.sh"]
fn a_budget_that_is_spent_stays_at_zero() {
    let episodes = flown("SafetyBallRun-v0", 1.5, 4);
    let spent = episodes.iter().filter(|episode| episode.cost() > 2.0).collect::<Vec<_>>();
    assert!(!spent.is_empty(), "no episode of the untrained policy costs more than 2; choose another seed");
    for episode in spent {
        assert_eq!(episode.kappas().last().map(|kappa| kappa.to_f32()), Some(0.0));
        assert!(episode.kappas().collect::<Vec<_>>().is_sorted_by(|before, after| before >= after));
    }
}

/// An episode of the point robot in MuJoCo, flown by a controller of another
/// process: its rewards and costs as the plant prints them, and its recording.
fn recorded_with(controller: &[&str], folder: &Path) -> (String, Vec<u8>) {
    let mut controller = Command::new(env!("CARGO_BIN_EXE_firmware-sim"))
        .current_dir(folder)
        .args(controller)
        .args(["--listen", "127.0.0.1:0"])
        .stderr(Stdio::piped())
        .spawn()
        .unwrap();
    let mut said = BufReader::new(controller.stderr.take().unwrap()).lines().map_while(Result::ok);
    let address = said.find_map(|line| line.strip_prefix("listening at ").map(str::to_owned)).unwrap();
    let environment = Environment::open(&Environment::folder().unwrap(), |note| eprintln!("{note}")).unwrap();
    let flown = Command::new(environment.python())
        .env("PYTHONPATH", concat!(env!("CARGO_MANIFEST_DIR"), "/python/src"))
        .current_dir(folder)
        .args(["-m", "armor_plant", "SafetyPointCircle1-v0", "--connect", &address, "--each", "--episodes", "1"])
        .args(["--seed", "7", "--record", "flown.hdf5"])
        .output();
    // `serve` waits for other plants.
    let _ = controller.kill();
    controller.wait().unwrap();
    let flown = flown.unwrap();
    assert!(flown.status.success(), "{}", String::from_utf8_lossy(&flown.stderr));
    // What follows is the time it took.
    let told = String::from_utf8(flown.stdout).unwrap().lines().next().unwrap().to_owned();
    (told, fs::read(folder.join("flown.hdf5")).unwrap())
}

/// Hardware in the loop: 500 steps of MuJoCo, where an action that differs in a
/// bit would end in another place.
#[test]
#[ignore = "needs the simulators and QEMU: tests/mcu.sh"]
fn emulated_cortex_m4_flies_mujoco_as_this_host_does() {
    let task = Task::named("SafetyPointCircle1-v0").unwrap();
    let shape = Shape { state: task.state as u16, action: task.action as u16, ..BALL_RUN };
    let folder = tempfile::tempdir().unwrap();
    fs::write(folder.path().join("policy.armor"), Parts::random(task.name, shape, 1).with_golden().bytes()).unwrap();
    let host = recorded_with(&["serve", "policy.armor"], folder.path());
    let machine = recorded_with(&["mcu", "policy.armor", "--machine", "mps2-an386"], folder.path());
    assert!(host.0.contains("\"episode\": 0"), "{}", host.0);
    assert!(host == machine, "the emulated controller flew otherwise than the host's");
}
