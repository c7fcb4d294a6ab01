//! What a number means is in its type: cost, cost limit, remaining budget, time.
//!
//! Costs are fixed point, so that a budget adds up exactly after a million
//! charges and is the same on every machine. Rounding always favours safety:
//! an incurred cost rounds up, a limit rounds down.

use core::fmt;

use serde::{Deserialize, Serialize};

/// Fractional bits of a [`Cost`].
const FRACTION_BITS: u32 = 16;
/// One unit of cost in raw steps, `2^16`.
const ONE: f32 = (1u32 << FRACTION_BITS) as f32;

/// An amount of cost, in steps of `2^-16`, from 0 to 65535.99998.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
pub struct Cost(u32);

impl Cost {
    /// No cost.
    pub const ZERO: Self = Self(0);
    /// The largest cost that can be written down.
    pub const MAX: Self = Self(u32::MAX);

    /// The cost of one step as the robot reported it, rounded up to the next
    /// step of `2^-16` and saturated at [`Cost::MAX`].
    ///
    /// `None` where the report is no cost at all: negative, NaN or infinite.
    pub fn from_incurred(cost: f32) -> Option<Self> {
        if !cost.is_finite() || cost < 0.0 {
            return None;
        }
        // `as` saturates, and NaN is excluded above.
        Some(Self(libm::ceilf(cost * ONE) as u32))
    }

    /// The value as the networks see it: exact below 256, rounded to nearest above.
    pub fn to_f32(self) -> f32 {
        self.0 as f32 / ONE
    }

    /// What is left after `other` is taken away; zero if `other` is larger.
    pub const fn saturating_sub(self, other: Self) -> Self {
        Self(self.0.saturating_sub(other.0))
    }

    /// Both together; [`Cost::MAX`] where that is too much to write down.
    #[must_use]
    pub const fn saturating_add(self, other: Self) -> Self {
        Self(self.0.saturating_add(other.0))
    }

    /// This cost `count` times; [`Cost::MAX`] where that is too much to write down.
    #[must_use]
    pub const fn saturating_mul(self, count: u32) -> Self {
        Self(self.0.saturating_mul(count))
    }

    /// The raw count of `2^-16` steps, as it stands in images and on the wire.
    pub const fn to_raw(self) -> u32 {
        self.0
    }

    /// The inverse of [`Cost::to_raw`].
    pub const fn from_raw(raw: u32) -> Self {
        Self(raw)
    }
}

impl fmt::Display for Cost {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        fmt::Display::fmt(&self.to_f32(), f)
    }
}

/// The cost an episode may incur: `d` of Eq. 1, and the first `kappa` of section 3.5.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub struct CostLimit(Cost);

impl CostLimit {
    /// No cost at all.
    pub const ZERO: Self = Self(Cost::ZERO);

    /// A limit of `d` units of cost, rounded down to a step of `2^-16`.
    ///
    /// # Errors
    /// [`LimitError`] unless `0 <= d < 65536` and finite.
    pub fn new(d: f32) -> Result<Self, LimitError> {
        if !(0.0..65536.0).contains(&d) {
            return Err(LimitError);
        }
        Ok(Self(Cost((d * ONE) as u32)))
    }

    /// The limit that leaves `cost` to spend: how an interrupted episode goes on.
    pub const fn from_cost(cost: Cost) -> Self {
        Self(cost)
    }

    /// The limit as an amount of cost.
    pub const fn cost(self) -> Cost {
        self.0
    }
}

/// The cost limit was negative, NaN, infinite, or 65536 and more.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct LimitError;

impl fmt::Display for LimitError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str("a cost limit is a finite number from 0 to below 65536")
    }
}

impl core::error::Error for LimitError {}

/// A span of virtual time in microseconds.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, PartialOrd, Ord, Serialize, Deserialize)]
pub struct Micros(pub u64);

impl Micros {
    /// The period of a control loop that runs at `rate` Hz, rounded down;
    /// `None` if the rate is 0 or above 1 MHz.
    pub const fn period(rate: u32) -> Option<Self> {
        if rate == 0 || rate > 1_000_000 {
            return None;
        }
        Some(Self(1_000_000 / rate as u64))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_incurred_cost_rounds_up_and_a_limit_down() {
        let tiny = 1.0 / 131_072.0; // half a step
        assert_eq!(Cost::from_incurred(tiny), Some(Cost::from_raw(1)));
        assert_eq!(CostLimit::new(tiny).unwrap().cost(), Cost::ZERO);
        assert_eq!(CostLimit::new(20.0).unwrap().cost().to_f32(), 20.0);
    }

    #[test]
    fn what_is_no_cost_is_none_and_what_is_too_large_saturates() {
        for bad in [-1.0, -f32::MIN_POSITIVE, f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
            assert_eq!(Cost::from_incurred(bad), None, "{bad}");
        }
        assert_eq!(Cost::from_incurred(1e30), Some(Cost::MAX));
        assert_eq!(Cost::from_incurred(-0.0), Some(Cost::ZERO));
    }

    #[test]
    fn a_limit_is_finite_and_not_negative() {
        for bad in [-0.1, f32::NAN, f32::INFINITY, 65536.0] {
            assert_eq!(CostLimit::new(bad), Err(LimitError), "{bad}");
        }
    }

    #[test]
    fn a_rate_has_a_period() {
        assert_eq!(Micros::period(50), Some(Micros(20_000)));
        assert_eq!(Micros::period(30), Some(Micros(33_333)));
        assert_eq!(Micros::period(0), None);
    }
}
