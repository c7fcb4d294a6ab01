use armor_core::image::{HEADER_BYTES, PolicyImage, SectionKind};
use armor_core::shape::Shape;
use armor_core::units::{Cost, CostLimit};

use super::flip::flipped;
use super::*;
use crate::board::Board;
use crate::fault::FaultKind;
use crate::fixture::{BALL_RUN, Parts};
use crate::flight::{self, FlightPlan};
use crate::memory::AlignedBytes;
use crate::task::Task;

fn plan(task: &str, limit: f32) -> FlightPlan {
    let task = Task::named(task).unwrap();
    let limit = CostLimit::new(limit).unwrap();
    FlightPlan { task, limit, episodes: 2, seed: 1, rate_hz: task.rate_hz, max_steps: usize::MAX }
}

/// A device with a random policy for a task, confirmed.
fn device(task: &'static str) -> Device {
    let state = Task::named(task).unwrap().state as u16;
    let image = Parts::random(task, Shape { state, ..BALL_RUN }, 3).with_golden().bytes();
    Device::flashed(AlignedBytes::from(image.as_slice()).as_slice()).unwrap()
}

fn setup(device: &Device, plan: &FlightPlan, board: Option<&'static Board>, faults: &[&str]) -> Setup {
    let image = PolicyImage::new_checked(device.image()).unwrap();
    let faults = faults.iter().map(|fault| fault.parse().unwrap()).collect();
    Setup::new(plan, &image, board, faults)
}

/// An `stm32f407` at another clock. At 5 MHz the full chain takes about 12 ms, and the two steps 5.
fn board(clock_hz: u32) -> Option<&'static Board> {
    Some(Box::leak(Box::new(Board { clock_hz, ..*Board::named("stm32f407").unwrap() })))
}

/// Flies the plan's episodes: their control steps, and what was counted.
fn flown(plan: &FlightPlan, board: Option<&'static Board>, faults: &[&str]) -> (Vec<Vec<Record>>, Tally) {
    let mut device = device(plan.task.name);
    let setup = setup(&device, plan, board, faults);
    let mut episodes = Vec::new();
    let tallies = (0..plan.episodes).map(|index| {
        let mut records = Vec::new();
        let ended = fly(&mut device, plan, &setup, index, &mut |record| records.push(*record)).unwrap();
        episodes.push(records);
        ended.tally
    });
    let tally = tallies.sum();
    (episodes, tally)
}

/// Without faults and on this host it is the flight that scores a policy, bit for bit.
#[test]
fn a_day_without_trouble_is_a_plain_flight() {
    for task in ["ball-run", "ball-circle", "point-circle", "point-goal"] {
        for hold in [1, 2] {
            let plan = plan(task, 5.0);
            let plan = FlightPlan { rate_hz: plan.task.rate_hz / hold, ..plan };
            let (episodes, tally) = flown(&plan, None, &[]);
            let memory = device(task).memory;
            let plain = flight::fly(&PolicyImage::new_checked(memory.as_slice()).unwrap(), &plan).unwrap();
            for (records, plain) in episodes.iter().zip(&plain.episodes) {
                assert_eq!(records.len(), plain.ticks.len());
                for (record, tick) in records.iter().zip(&plain.ticks) {
                    assert_eq!((record.action, record.kappa), (tick.step.action, Some(tick.step.kappa)));
                    assert_eq!((record.reward, record.cost, record.rung), (tick.reward, tick.cost, tick.step.rung));
                }
            }
            assert_eq!(tally.policy, tally.steps);
            assert_eq!((tally.detected, tally.struck(), tally.budget_errors), (0, 0, 0));
        }
    }
}

#[test]
fn a_flight_repeats_itself_on_a_board_and_under_faults() {
    let faults = ["sensor-noise", "cost-late", "overlong", "watchdog-reset=0.01", "ram-flip", "clock-jump"];
    let plan = plan("point-circle", 20.0);
    assert_eq!(flown(&plan, board(168_000_000), &faults), flown(&plan, board(168_000_000), &faults));
    let other = FlightPlan { seed: 2, ..plan };
    assert_ne!(flown(&plan, board(168_000_000), &faults).0, flown(&other, board(168_000_000), &faults).0);
}

/// Every fault alone, hard, on two tasks: the robot stays within its bounds and its budget,
/// and what can be noticed is.
#[test]
fn no_fault_breaks_the_budget_or_the_bounds() {
    use FaultKind::*;
    for kind in FaultKind::ALL {
        let fault = format!("{kind}={}", kind.severities()[2]);
        let [ball, point] = ["ball-run", "point-circle"]
            .map(|task| flown(&FlightPlan { episodes: 4, ..plan(task, 30.0) }, board(5_000_000), &[&fault]).1);
        for tally in [&ball, &point] {
            assert_eq!((tally.budget_errors, tally.actions_out_of_range), (0, 0), "{fault}: {tally:?}");
        }
        assert!(ball.struck() + point.struck() > 0, "{fault}");
        // No one can tell these from a robot that moves otherwise; flash is read at the next boot.
        let unnoticed = matches!(kind, SensorStuck | SensorNoise | SensorBias | SensorOrder | ClockSlow | FlashFlip);
        assert_eq!(ball.detected + point.detected > 0, !unnoticed, "{fault}: {point:?}");
    }
}

#[test]
fn no_mixture_of_faults_breaks_the_budget_or_the_bounds() {
    let all: Vec<String> = FaultKind::ALL.map(|kind| kind.name().to_owned()).into();
    for seed in 0..20 {
        // A third of the faults, another third for each seed.
        let faults: Vec<&str> = all.iter().skip(seed as usize % 3).step_by(3).map(String::as_str).collect();
        let (_, tally) = flown(&FlightPlan { seed, ..plan("point-circle", 20.0) }, board(5_000_000), &faults);
        assert_eq!((tally.budget_errors, tally.actions_out_of_range), (0, 0), "{faults:?}, seed {seed}: {tally:?}");
    }
}

/// A slow clock that hears no reports for a while, and is reset then, must not
/// have forgotten the steps of that while.
#[test]
fn a_slow_clock_without_reports_forgets_no_cost_across_a_reset() {
    let faults = ["clock-slow=0.2", "link-loss=0.05", "watchdog-reset=0.02", "overlong=0.2"];
    for seed in 0..30 {
        let plan = FlightPlan { seed, episodes: 1, ..plan("point-circle", 39.0) };
        let (_, tally) = flown(&plan, board(5_000_000), &faults);
        assert_eq!((tally.budget_errors, tally.actions_out_of_range), (0, 0), "seed {seed}: {tally:?}");
    }
}

/// A charge that takes more than a step can cost, as a report does that is no
/// cost, must be in flash before the firmware hangs or loses power.
#[test]
fn a_charge_is_remembered_by_a_firmware_that_is_reset_in_the_same_step() {
    let faults = ["cost-negative=0.02", "watchdog-reset=0.05", "brown-out=0.05"];
    let (mut resets, mut coincidences) = (0, 0);
    for seed in 0..40 {
        let plan = FlightPlan { seed, episodes: 1, ..plan("point-circle", 39.0) };
        let (episodes, tally) = flown(&plan, None, &faults);
        assert_eq!((tally.budget_errors, tally.actions_out_of_range), (0, 0), "seed {seed}: {tally:?}");
        resets += tally.notices(Notice::Reset);
        let hangs = |record: &Record| record.injected.iter().any(|kind| kind == FaultKind::WatchdogReset);
        let coincides =
            |pair: &[Record]| pair[0].kappa > pair[1].kappa && pair[1].kappa == Some(Cost::ZERO) && hangs(&pair[1]);
        coincidences += episodes.iter().flat_map(|records| records.windows(2)).filter(|pair| coincides(pair)).count();
    }
    assert!(resets > 200 && coincidences > 0, "{resets}, {coincidences}");
}

/// The same at a fraction of the plant's rate, where a control step may cost as much as two plant steps.
#[test]
fn a_controller_of_half_the_rate_forgets_no_cost_across_a_reset() {
    let faults = ["clock-slow=0.2", "link-loss=0.05", "cost-lost=0.2", "watchdog-reset=0.02", "clock-jump=0.05"];
    for seed in 0..30 {
        let plan = plan("point-circle", 39.0);
        let plan = FlightPlan { seed, episodes: 1, rate_hz: plan.task.rate_hz / 2, ..plan };
        let (_, tally) = flown(&plan, None, &faults);
        assert_eq!((tally.budget_errors, tally.actions_out_of_range), (0, 0), "seed {seed}: {tally:?}");
    }
}

/// After each reset the budget is what the journal kept: less than before, and
/// not nothing while the limit allows a reset.
#[test]
fn a_reset_in_mid_episode_restores_the_budget_from_flash() {
    for fault in ["watchdog-reset=0.004", "brown-out=0.004"] {
        let plan = FlightPlan { episodes: 40, ..plan("ball-run", 39.0) };
        let (episodes, tally) = flown(&plan, None, &[fault]);
        assert!(tally.notices(Notice::Reset) > 0, "{fault}");
        let mut kept = 0;
        for records in &episodes {
            let kappas: Vec<_> = records.iter().filter_map(|record| record.kappa).collect();
            assert!(kappas.is_sorted_by(|before, after| before >= after));
            let was_reset = |record: &Record| record.noticed.contains(Notice::Reset);
            for at in records.iter().enumerate().filter(|(_, record)| was_reset(record)).map(|(at, _)| at) {
                let after =
                    records[at..].iter().find(|record| record.rung.is_some() && record.kappa < records[at].kappa);
                kept += u32::from(after.is_some_and(|record| record.kappa > Some(Cost::ZERO)));
            }
        }
        assert!(kept > 0, "{fault}");
    }
}

#[test]
fn a_slow_board_flies_a_shorter_chain_and_one_too_slow_falls_back() {
    let rungs = |clock_hz| {
        let plan = FlightPlan { episodes: 1, ..plan("point-circle", 20.0) };
        let mut device = device("point-circle");
        let setup = setup(&device, &plan, board(clock_hz), &[]);
        let mut rungs = Vec::new();
        fly(&mut device, &plan, &setup, 0, &mut |record| rungs.push((record.rung, record.decision))).unwrap();
        rungs.dedup();
        rungs
    };
    assert_eq!(rungs(168_000_000), [(Some(0), Decision::Policy)]);
    assert_eq!(rungs(2_500_000), [(Some(1), Decision::Policy)]);
    assert_eq!(rungs(100_000), [(None, Decision::Fallback)]);
}

#[test]
fn an_overrun_is_late_and_shortens_the_chain() {
    let plan = FlightPlan { episodes: 1, ..plan("point-circle", 20.0) };
    // Two to ten times 12 ms do not fit 20.
    let mut device = device("point-circle");
    let setup = setup(&device, &plan, board(5_000_000), &["overlong=0.02"]);
    let mut records = Vec::new();
    let ended = fly(&mut device, &plan, &setup, 0, &mut |record| records.push(*record)).unwrap();
    assert!(ended.tally.notices(Notice::Late) > 0, "{:?}", ended.tally);
    let late = records.iter().position(|record| record.noticed.contains(Notice::Late)).unwrap();
    let next = records[late + 1..].iter().find_map(|record| record.rung);
    assert_eq!(next, Some(1));
    assert!(records.last().unwrap().rung.is_some());
}

#[test]
fn a_flipped_bit_in_ram_is_scrubbed_and_flash_brings_the_weights_back() {
    let (_, tally) = flown(&plan("point-circle", 20.0), None, &["ram-flip=0.02"]);
    assert!(tally.notices(Notice::Weights) > 0 && tally.notices(Notice::Reset) > 0, "{tally:?}");
    assert!(tally.policy > tally.steps / 2);
}

#[test]
fn a_sealed_flip_is_one_bit_of_the_weights() {
    let memory = device("ball-run").memory;
    for draw in [0, 1 << 20, u32::MAX] {
        let other = flipped(&memory, draw);
        let differs = |(a, b): (&u8, &u8)| (a ^ b).count_ones();
        let bits: u32 =
            memory.as_slice()[HEADER_BYTES..].iter().zip(&other.as_slice()[HEADER_BYTES..]).map(differs).sum();
        assert_eq!(bits, 1);
        match PolicyImage::new_checked(other.as_slice()) {
            Ok(image) => assert_eq!(image.words(SectionKind::Golden), {
                PolicyImage::new_checked(memory.as_slice()).unwrap().words(SectionKind::Golden)
            }),
            Err(error) => assert!(!error.to_string().contains("damaged"), "{error}"),
        }
    }
}
