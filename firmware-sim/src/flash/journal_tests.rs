//! The budget's log of [`armor_infer::journal`] on the model of the flash.

use armor_core::noise::{Noise, below};
use armor_core::units::Cost;
use armor_infer::journal::{Journal, Reserve};
use armor_infer::log::LogError;

use super::{ERASE_BYTES, FlashFault, NorModel};

const BLOCKS: usize = 2;
const REGION: std::ops::Range<u32> = 0..(BLOCKS * ERASE_BYTES) as u32;

fn cost(units: f32) -> Cost {
    Cost::from_incurred(units).unwrap()
}

fn reserve(ahead: f32) -> Reserve {
    Reserve { step: cost(1.0), ahead: cost(ahead) }
}

/// A robot's run: at each step it may begin an episode, then charges a cost of
/// at most 1, then covers the action, which it takes. It ends where the power does.
struct Robot {
    journal: Journal<NorModel>,
    kappa: Cost,
    /// Kappa less the cost of the last action, which nobody has charged yet.
    true_left: Cost,
}

impl Robot {
    fn boot(flash: NorModel, ahead: f32) -> Self {
        let journal = Journal::open(flash, REGION, reserve(ahead)).unwrap();
        let kappa = journal.remaining();
        Self { journal, kappa, true_left: kappa }
    }

    /// Flies `steps`; the limit of episodes that begin is `limit`.
    fn fly(&mut self, steps: u64, seed: u64, limit: Cost) -> Result<(), LogError<FlashFault>> {
        let noise = Noise::new(seed);
        let mut incurred = Cost::ZERO;
        for step in 0..steps {
            let [choice, amount, ..] = noise.words(1, step, 0);
            if below(choice, 40) == 0 {
                self.journal.begin(limit)?;
                (self.kappa, self.true_left) = (limit, limit);
                incurred = Cost::ZERO;
            }
            self.kappa = self.kappa.saturating_sub(incurred);
            self.journal.cover(self.kappa)?;
            incurred = Cost::from_raw(below(amount, cost(1.0).to_raw() + 1));
            self.true_left = self.kappa.saturating_sub(incurred);
        }
        Ok(())
    }
}

/// Every operation of a run that goes round the region twice: what is left
/// after the reset is never more than what was truly left, nor than the limit
/// of an episode that had not begun.
#[test]
fn a_power_cut_at_any_operation_never_refills_the_budget() {
    const STEPS: u64 = 1_200;
    let limit = cost(20.0);
    let mut whole = Robot::boot(NorModel::erased(BLOCKS), 0.5);
    whole.fly(STEPS, 7, limit).unwrap();
    let flash = whole.journal.into_flash();
    assert!(flash.wear().iter().all(|&erases| erases >= 1), "{:?}", flash.wear());
    let operations = flash.operations();

    let mut kept = 0;
    for cut in 0..operations {
        let mut robot = Robot::boot(NorModel::erased(BLOCKS), 0.5);
        let mut flash = robot.journal.into_flash();
        flash.cut_power_after(cut, cut);
        robot.journal = Journal::open(flash, REGION, reserve(0.5)).unwrap();
        assert_eq!(robot.fly(STEPS, 7, limit), Err(LogError::Flash(FlashFault::PowerCut)), "cut {cut}");
        let mut flash = robot.journal.into_flash();
        flash.restore_power();
        let after = Robot::boot(flash, 0.5);
        assert!(after.kappa <= robot.true_left, "cut {cut}: {} of {} left", after.kappa, robot.true_left);
        kept += u64::from(after.kappa > Cost::ZERO);
    }
    // Not that it were merely always empty.
    assert!(kept > operations / 2, "{kept} of {operations}");
    println!("{operations} cut points");
}

/// Cuts upon cuts: the log goes on after each, and the floor holds.
#[test]
fn a_log_survives_power_cuts_one_after_the_other() {
    let mut flash = NorModel::erased(BLOCKS);
    let mut left = Cost::ZERO;
    for round in 0..2_000u64 {
        flash.restore_power();
        let mut robot = Robot::boot(flash, 0.0);
        assert!(robot.kappa <= left, "round {round}");
        let mut inner = robot.journal.into_flash();
        inner.cut_power_after(below(Noise::new(9).words(0, round, 0)[0], 60).into(), round);
        robot.journal = Journal::open(inner, REGION, reserve(0.0)).unwrap();
        robot.fly(1_000_000, round, cost(5.0)).unwrap_err();
        left = robot.true_left;
        flash = robot.journal.into_flash();
    }
}

#[test]
fn a_damaged_log_leaves_nothing() {
    let mut robot = Robot::boot(NorModel::erased(BLOCKS), 0.0);
    assert_eq!(robot.kappa, Cost::ZERO);
    robot.journal.begin(cost(9.0)).unwrap();
    let flash = robot.journal.into_flash();
    assert_eq!(Robot::boot(flash.clone(), 0.0).kappa, cost(8.0));
    // Any flipped bit of the only record: it counts no more.
    for bit in 0..128 {
        let mut damaged = flash.clone();
        damaged.flip(bit);
        assert_eq!(Robot::boot(damaged, 0.0).kappa, Cost::ZERO, "bit {bit}");
    }
}

/// Whatever bit of the newest record decays, in whatever state of an episode:
/// no more is left than truly is.
#[test]
fn a_decayed_record_never_refills_the_budget() {
    let mut robot = Robot::boot(NorModel::erased(BLOCKS), 0.5);
    let mut kept = 0;
    for round in 0..40u64 {
        // Limits that rise and fall.
        let limit = cost(6.0 + 12.0 * (round % 3) as f32);
        robot.journal.begin(limit).unwrap();
        (robot.kappa, robot.true_left) = (limit, limit);
        for _ in 0..round % 7 {
            robot.kappa = robot.kappa.saturating_sub(cost(1.0));
            robot.journal.cover(robot.kappa).unwrap();
        }
        let flash = robot.journal.into_flash();
        let newest = newest(&flash);
        for bit in 0..128 {
            let mut decayed = flash.clone();
            decayed.flip(8 * newest + bit);
            let left = Robot::boot(decayed, 0.5).kappa;
            assert!(
                left <= robot.kappa.saturating_sub(cost(1.0)),
                "round {round}, bit {bit}: {left} of {}",
                robot.kappa
            );
            kept += u32::from(left > Cost::ZERO);
        }
        robot.journal = Journal::open(flash, REGION, reserve(0.5)).unwrap();
    }
    assert!(kept > 40 * 128 / 2, "{kept}");
}

/// However many records have decayed, and whatever a power cut has left: a
/// floor that was covered is not forgotten for a higher one.
#[test]
fn both_copies_of_a_floor_may_decay() {
    let written = |units: &[f32]| {
        let mut journal = Journal::open(NorModel::erased(BLOCKS), REGION, reserve(0.0)).unwrap();
        journal.begin(cost(20.0)).unwrap();
        for &kappa in units {
            journal.cover(cost(kappa)).unwrap();
        }
        journal
    };
    let flash = written(&[18.0, 3.0]).into_flash();
    let newest = newest(&flash);
    for (first, second) in (0..128).zip((0..128).rev()) {
        let mut decayed = flash.clone();
        decayed.flip(8 * newest + first);
        assert_eq!(Robot::boot(decayed.clone(), 0.0).kappa, cost(2.0));
        decayed.flip(8 * (newest - 16) + second);
        assert_eq!(Robot::boot(decayed, 0.0).kappa, Cost::ZERO);
    }
    // Power is cut in the second copy, and the first decays.
    for word in 0..4 {
        let mut flash = written(&[18.0]).into_flash();
        flash.cut_power_after(4 + word, word);
        let mut journal = Journal::open(flash, REGION, reserve(0.0)).unwrap();
        assert_eq!(journal.cover(cost(3.0)), Err(LogError::Flash(FlashFault::PowerCut)));
        let mut flash = journal.into_flash();
        flash.restore_power();
        assert_eq!(Robot::boot(flash.clone(), 0.0).kappa, cost(2.0));
        flash.flip(8 * 16 * 3 + 50);
        assert_eq!(Robot::boot(flash, 0.0).kappa, Cost::ZERO, "word {word}");
    }
}

/// What a step is to charge is in flash before the step: a report that is no cost takes all.
#[test]
fn a_charge_is_written_ahead() {
    for (incurred, left) in [(1.5, 17.5), (0.0, 19.0), (-1.0, 0.0), (f32::NAN, 0.0), (30.0, 0.0)] {
        let mut journal = Journal::open(NorModel::erased(BLOCKS), REGION, reserve(0.0)).unwrap();
        journal.begin(cost(20.0)).unwrap();
        journal.charge(cost(20.0), incurred).unwrap();
        assert_eq!(Robot::boot(journal.into_flash(), 0.0).kappa, cost(left), "{incurred}");
    }
}

/// Offset of the record with the highest sequence.
fn newest(flash: &NorModel) -> usize {
    let sequence = |at: &usize| u32::from_le_bytes(*flash.bytes()[*at..].first_chunk().unwrap());
    let written = (0..BLOCKS * ERASE_BYTES).step_by(16).filter(|at| sequence(at) != u32::MAX);
    written.max_by_key(sequence).unwrap()
}

#[test]
fn only_a_beginning_raises_the_floor_and_small_costs_share_records() {
    let mut journal = Journal::open(NorModel::erased(BLOCKS), REGION, reserve(4.0)).unwrap();
    journal.begin(cost(20.0)).unwrap();
    assert_eq!(journal.remaining(), cost(15.0));
    for tenths in (0..=200).rev() {
        journal.cover(cost(tenths as f32 / 10.0)).unwrap();
        assert!(journal.remaining() <= cost(tenths as f32 / 10.0).saturating_sub(cost(1.0)));
    }
    journal.cover(cost(20.0)).unwrap();
    assert_eq!(journal.remaining(), Cost::ZERO);
    // A record of the beginning, then 20 units in steps of 4 and a bit, two records for each; four words a record.
    assert_eq!(journal.into_flash().operations(), 4 * (1 + 2 * 4));
}

#[test]
fn a_region_that_is_no_two_blocks_is_refused() {
    let open = |region| Journal::open(NorModel::erased(3), region, reserve(0.0)).map(drop);
    let block = ERASE_BYTES as u32;
    for region in [0..block, 16..16 + 2 * block, 0..2 * block + 16, block..4 * block, 2 * block..0] {
        assert_eq!(open(region.clone()), Err(LogError::Region), "{region:?}");
    }
    assert_eq!(open(block..3 * block), Ok(()));
}
