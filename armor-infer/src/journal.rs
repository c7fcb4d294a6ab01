//! The budget's log in flash: a reset or a power cut never refills it.
//!
//! What a reset leaves unknown is the cost of the action that was under way.
//! So the log does not hold kappa itself but a *floor* below it, and no charge
//! takes effect unless what it leaves, less the worst cost of a step, is at
//! least the floor on flash: the floor is written *ahead* of the step. After a
//! reset the floor is what is left: the interrupted action is charged as the
//! worst, and nothing is ever given back, wherever the power failed or the
//! firmware hung. Where no record is valid, nothing is left.
//!
//! A floor is written twice, so that one record may decay. Where both have, or
//! one has and power was cut in the other, two places in a row are unreadable,
//! and nothing is left. Of an episode's beginning there is one record, and where
//! that decays, the floor of the episode before counts, which is no higher.
//!
//! Floors fall in steps of a *reserve*: the larger it is, the fewer records are
//! written and the more an interrupted episode forfeits. Two records are written
//! for each reserve of cost that is incurred, and one for each episode, whose
//! number it holds beside the floor.

use core::ops::Range;

use armor_core::units::Cost;
use embedded_storage::nor_flash::NorFlash;

use crate::log::{Log, LogError};

/// Records of a floor.
const COPIES: u32 = 2;

/// How far below kappa a floor lies.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Reserve {
    /// The largest cost that one step can incur.
    pub step: Cost,
    /// What a floor leaves beyond that, to be incurred before the next record.
    pub ahead: Cost,
}

/// The log of a budget in a region of a flash.
#[derive(Debug)]
pub struct Journal<F> {
    log: Log<F>,
    reserve: Reserve,
    floor: Cost,
    episode: u32,
}

impl<F: NorFlash> Journal<F> {
    /// Finds the log in `region`, in bytes of the flash, after a reset. What is
    /// left of the interrupted episode is [`Journal::remaining`].
    ///
    /// # Errors
    /// [`LogError`]
    pub fn open(flash: F, region: Range<u32>, reserve: Reserve) -> Result<Self, LogError<F::Error>> {
        let log = Log::open(flash, region)?;
        let [floor, episode] = log.latest().unwrap_or_default();
        // A floor below this one may have been written, and lost.
        let floor = if log.unreadable() < COPIES { floor } else { 0 };
        Ok(Self { log, reserve, floor: Cost::from_raw(floor), episode })
    }

    /// What the log leaves of the budget: a floor below kappa while an episode
    /// runs, and after a reset all that may still be incurred.
    pub const fn remaining(&self) -> Cost {
        self.floor
    }

    /// Number of the episode, from 1; 0 before the first.
    pub const fn episode(&self) -> u32 {
        self.episode
    }

    /// Starts an episode with a budget of `kappa`: the only way to raise the
    /// floor. Until this returns, the episode before has not ended.
    ///
    /// # Errors
    /// [`LogError::Flash`]; no action may be taken then.
    pub fn begin(&mut self, kappa: Cost) -> Result<(), LogError<F::Error>> {
        let floor = self.floor_below(kappa);
        // Were the record of the beginning to decay, the floor before it would count.
        if floor < self.floor {
            self.append_twice(floor)?;
        }
        self.append(floor, self.episode.wrapping_add(1))
    }

    /// To be called before every control step, with the budget before it and
    /// the cost that it is to charge: [`Journal::cover`] for what that leaves.
    ///
    /// # Errors
    /// As there.
    pub fn charge(&mut self, kappa: Cost, incurred: f32) -> Result<(), LogError<F::Error>> {
        // A report that is no cost takes the whole budget.
        self.cover(Cost::from_incurred(incurred).map_or(Cost::ZERO, |cost| kappa.saturating_sub(cost)))
    }

    /// To be called with the kappa that a control step will leave, before the
    /// step and its action are taken: writes the floor where the one on flash
    /// does not cover them.
    ///
    /// # Errors
    /// [`LogError::Flash`]; no action of the policy must be taken then.
    pub fn cover(&mut self, kappa: Cost) -> Result<(), LogError<F::Error>> {
        if self.floor <= kappa.saturating_sub(self.reserve.step) {
            return Ok(());
        }
        self.append_twice(self.floor_below(kappa))
    }

    /// Gives the flash back.
    pub fn into_flash(self) -> F {
        self.log.into_flash()
    }

    /// The floor that leaves the whole reserve.
    const fn floor_below(&self, kappa: Cost) -> Cost {
        kappa.saturating_sub(self.reserve.step).saturating_sub(self.reserve.ahead)
    }

    /// Lowers the floor of the episode under way.
    fn append_twice(&mut self, floor: Cost) -> Result<(), LogError<F::Error>> {
        self.append(floor, self.episode)?;
        self.append(floor, self.episode)
    }

    fn append(&mut self, floor: Cost, episode: u32) -> Result<(), LogError<F::Error>> {
        self.log.append([floor.to_raw(), episode])?;
        (self.floor, self.episode) = (floor, episode);
        Ok(())
    }
}
