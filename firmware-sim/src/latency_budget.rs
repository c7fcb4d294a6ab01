//! A latency budget as a test of your own: this image, on this board, at this
//! rate, meets its deadline with this margin.
//!
//! ```no_run
//! use firmware_sim::latency_budget::LatencyBudget;
//! use firmware_sim::memory::AlignedBytes;
//!
//! #[test]
//! fn the_policy_keeps_up_with_the_robot() {
//!     let image = AlignedBytes::read("policy.armor".as_ref()).unwrap();
//!     LatencyBudget::new(image.as_slice()).board("stm32h743").rate_hz(50).margin(0.2).assert();
//! }
//! ```
//!
//! The longest chain must end in time, or the longest of at most
//! [`LatencyBudget::max_steps`]. Nothing is timed: instructions and cycles are
//! those of the board's model ([`crate::board`]), so the test says the same on
//! every machine, however busy.

use std::fmt;
use std::time::Duration;

use armor_core::image::{ImageError, PolicyImage};
use armor_core::schedule::Sampler;
use armor_infer::{LoadError, Policy};
use thiserror::Error;

use crate::board::model::Modelled;
use crate::board::{Board, DoesNotFit, UnknownBoard};
use crate::host::HostController;

/// A latency budget in the making.
#[derive(Clone, Copy, Debug, PartialEq)]
#[must_use = "a budget is checked by assert or check"]
pub struct LatencyBudget<'a> {
    image: &'a [u8],
    board: &'a str,
    rate_hz: u32,
    margin: f64,
    max_steps: usize,
}

/// A budget that is met, and the figures behind it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Met {
    /// The rung that flies.
    pub rung: usize,
    /// What its action takes.
    pub action: Modelled,
    /// What it may take.
    pub budget: Duration,
}

/// Why a budget is not met.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum NotMet {
    /// The bytes are no image.
    #[error("{0}")]
    Image(ImageError),
    /// The controller refuses the policy.
    #[error("{0}")]
    Load(LoadError),
    /// No board has the name.
    #[error(transparent)]
    Board(#[from] UnknownBoard),
    /// The image or the controller does not fit the board.
    #[error(transparent)]
    Fit(#[from] DoesNotFit),
    /// The rate is 0, or the margin not between 0 and 1.
    #[error("a rate is at least 1 Hz and a margin at least 0 and below 1; correct rate_hz or margin")]
    Range,
    /// No chain is short enough.
    #[error("the shortest chain of the image takes more than {max_steps} steps; raise max_steps")]
    NoRung {
        /// The steps that were allowed.
        max_steps: usize,
    },
    /// The action takes too long.
    #[error("{0}")]
    Slow(Box<Slow>),
}

/// An action that takes too long.
#[derive(Clone, Debug, PartialEq)]
pub struct Slow {
    board: &'static Board,
    rate_hz: u32,
    margin: f64,
    chain: String,
    action: Modelled,
    budget: Duration,
    /// Steps and the longest time of the longest chain that would do.
    shorter: Option<(usize, Duration)>,
}

impl<'a> LatencyBudget<'a> {
    /// The budget of an image, whose bytes start at a multiple of 16; on an
    /// `stm32f407` at 50 Hz with a margin of a tenth, until told otherwise.
    pub const fn new(image: &'a [u8]) -> Self {
        Self { image, board: "stm32f407", rate_hz: 50, margin: 0.1, max_steps: usize::MAX }
    }

    /// On this board ([`crate::board::BOARDS`]).
    pub const fn board(self, name: &'a str) -> Self {
        Self { board: name, ..self }
    }

    /// At this control rate.
    pub const fn rate_hz(self, rate_hz: u32) -> Self {
        Self { rate_hz, ..self }
    }

    /// With this share of the period to spare, for all else that a firmware does.
    pub const fn margin(self, margin: f64) -> Self {
        Self { margin, ..self }
    }

    /// By chains of at most this many steps.
    pub const fn max_steps(self, max_steps: usize) -> Self {
        Self { max_steps, ..self }
    }

    /// Whether the budget is met.
    ///
    /// # Errors
    /// [`NotMet`]
    pub fn check(self) -> Result<Met, NotMet> {
        if self.rate_hz == 0 || !(0.0..1.0).contains(&self.margin) {
            return Err(NotMet::Range);
        }
        let image = PolicyImage::new_checked(self.image).map_err(NotMet::Image)?;
        let policy = Policy::load(&image).map_err(NotMet::Load)?;
        let board = Board::named(self.board)?;
        board.check_fit(image.bytes().len(), HostController::RAM_BYTES)?;
        let budget = Duration::from_secs_f64((1.0 - self.margin) / f64::from(self.rate_hz));
        let no_rung = NotMet::NoRung { max_steps: self.max_steps };
        let rung = policy.rung_within(self.max_steps).ok_or(no_rung.clone())?;
        let action = board.action(&image, rung).ok_or(no_rung)?;
        if action.worst <= budget {
            return Ok(Met { rung, action, budget });
        }
        let worst = |rung| board.action(&image, rung).map(|action| action.worst);
        let shorter = policy.rungs().enumerate().find_map(|(rung, steps)| {
            let worst = worst(rung)?;
            (worst <= budget).then_some((steps, worst))
        });
        let flown = image.manifest().rungs[rung];
        let sampler = match flown.sampler {
            Sampler::Ddpm => "DDPM",
            Sampler::Ddim => "DDIM",
        };
        let chain = format!("{sampler} {}", flown.steps);
        let Self { rate_hz, margin, .. } = self;
        Err(NotMet::Slow(Box::new(Slow { board, rate_hz, margin, chain, action, budget, shorter })))
    }

    /// Panics where the budget is not met, for a test to fail, with the
    /// numbers and what to do.
    ///
    /// # Panics
    /// Where [`LatencyBudget::check`] is an error.
    #[track_caller]
    pub fn assert(self) {
        if let Err(error) = self.check() {
            panic!("latency budget: {error}");
        }
    }
}

impl fmt::Display for Slow {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { board, rate_hz, chain, action, budget, .. } = self;
        let ms = |time: Duration| time.as_secs_f64() * 1e3;
        write!(
            f,
            "an action of {chain} takes up to {:.2} ms on {} (modelled: {:.2} M instructions, {:.2} M cycles at {} MHz, \
             jitter {:.0} %), and {rate_hz} Hz with a margin of {:.0} % leaves {:.2} ms; ",
            ms(action.worst),
            board.name,
            action.instructions / 1e6,
            action.cycles / 1e6,
            board.clock_hz / 1_000_000,
            100.0 * board.jitter,
            100.0 * self.margin,
            ms(*budget),
        )?;
        if let Some((steps, worst)) = self.shorter {
            write!(f, "allow a shorter chain with max_steps({steps}), which takes {:.2} ms, or ", ms(worst))?;
        }
        let rate = ((1.0 - self.margin) / action.worst.as_secs_f64()).floor();
        write!(f, "export in integers, fly at {rate} Hz or less, or choose a faster board")
    }
}
