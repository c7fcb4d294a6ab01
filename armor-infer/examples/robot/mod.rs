//! A robot for the examples: what it senses is the episode that the image's
//! golden trace recorded, so what it must do is known to the bit.

use std::error::Error;

use armor_core::image::{ALIGNMENT, GoldenRow, PolicyImage};
use armor_core::units::CostLimit;
use armor_infer::{Controller, Policy, Step, golden};

/// The largest policy that this firmware flies.
pub(crate) const STATE: usize = 96;
pub(crate) const ACTION: usize = 8;
pub(crate) const HIDDEN: usize = 256;

/// A robot and the controller of the policy that it was given.
pub(crate) struct Robot {
    pub(crate) controller: Controller<'static, STATE, ACTION, HIDDEN>,
    rows: Vec<GoldenRow<'static>>,
}

impl Robot {
    /// The robot of the image that the first argument names. In firmware the
    /// image is a `static` in flash; here it stays in memory for good.
    pub(crate) fn boot() -> Result<Self, Box<dyn Error>> {
        let path = std::env::args().nth(1).ok_or("usage: give the path of a policy image")?;
        let file = std::fs::read(path)?;
        let memory = Box::leak(vec![0u8; file.len() + ALIGNMENT].into_boxed_slice());
        let start = memory.as_ptr().align_offset(ALIGNMENT);
        memory[start..start + file.len()].copy_from_slice(&file);

        let image = PolicyImage::new_checked(&memory[start..])?;
        golden::replay::<STATE, ACTION, HIDDEN>(&image)?;
        let trace = &image.sections().golden;
        let limit = CostLimit::from_cost(trace.limit);
        let controller = Controller::new(Policy::load(&image)?, limit, trace.seed)?;
        Ok(Self { controller, rows: trace.rows().collect() })
    }

    /// Control steps until the robot is done.
    pub(crate) fn ticks(&self) -> usize {
        self.rows.len()
    }

    /// The state, and the cost that the last action incurred.
    pub(crate) fn sense(&self, tick: usize) -> (&'static [f32], f32) {
        (self.rows[tick].state, self.rows[tick].incurred)
    }

    /// Does an action; panics where it is not the one that was recorded.
    pub(crate) fn act(&self, tick: usize, step: &Step<ACTION>) {
        let expected = self.rows[tick].action.iter().map(|value| value.to_bits());
        assert!(step.action.iter().map(|value| value.to_bits()).zip(expected).all(|(a, b)| a == b), "tick {tick}");
    }
}
