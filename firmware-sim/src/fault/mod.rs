//! Faults of the field, to be injected into a flight: each seeded, all combinable.
//!
//! On the command line a fault is `NAME` or `NAME=SEVERITY`. A severity is the
//! chance per control step that the fault strikes, but for noise, bias and a
//! slow clock, which are always there: noise and bias in standard deviations of
//! the recorded data, the clock in the share that it is slow by.

mod injector;

use std::fmt;
use std::str::FromStr;

use serde::Serialize;
use thiserror::Error;

pub(crate) use injector::Injector;

/// What may go wrong.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize)]
#[serde(rename_all = "kebab-case")]
pub enum FaultKind {
    /// A state entry is NaN.
    SensorNan,
    /// A state entry is infinite.
    SensorInfinity,
    /// All readings stay what they were for half a second of control.
    SensorStuck,
    /// A sample does not come.
    SensorDropout,
    /// Normal noise on every entry.
    SensorNoise,
    /// A constant offset on every entry.
    SensorBias,
    /// The entries come in reverse.
    SensorOrder,
    /// A cost report comes up to five control steps late.
    CostLate,
    /// A cost report does not come.
    CostLost,
    /// A cost report comes twice.
    CostDuplicate,
    /// A cost report is negative.
    CostNegative,
    /// A bit of the weights in RAM flips.
    RamFlip,
    /// A bit of an image or of the budget's journal in flash flips.
    FlashFlip,
    /// The controller's clock is slow.
    ClockSlow,
    /// The controller's clock jumps by up to ten control steps, forth or back.
    ClockJump,
    /// An action takes two to ten times as long as it should.
    Overlong,
    /// Nothing comes through the link, for up to half a second of control.
    LinkLoss,
    /// The firmware hangs until the watchdog resets it.
    WatchdogReset,
    /// Power fails for a moment, perhaps while the journal is written.
    BrownOut,
}

/// A fault and how hard it strikes.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Injection {
    /// The fault.
    pub kind: FaultKind,
    /// The chance per control step, or a size ([`FaultKind::is_constant`]).
    pub severity: f64,
}

/// Why a text is no fault.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum FaultError {
    /// No fault has the name.
    #[error("no fault is called {name}; the faults are {}", names())]
    Unknown {
        /// The name.
        name: String,
    },
    /// The severity is out of range.
    #[error("{text} is no severity of {name}; give a number above 0 and at most {most}")]
    Severity {
        /// The fault.
        name: &'static str,
        /// What was given.
        text: String,
        /// The largest severity.
        most: u32,
    },
}

impl FaultKind {
    /// Every fault.
    pub const ALL: [Self; 19] = [
        Self::SensorNan,
        Self::SensorInfinity,
        Self::SensorStuck,
        Self::SensorDropout,
        Self::SensorNoise,
        Self::SensorBias,
        Self::SensorOrder,
        Self::CostLate,
        Self::CostLost,
        Self::CostDuplicate,
        Self::CostNegative,
        Self::RamFlip,
        Self::FlashFlip,
        Self::ClockSlow,
        Self::ClockJump,
        Self::Overlong,
        Self::LinkLoss,
        Self::WatchdogReset,
        Self::BrownOut,
    ];

    /// Its name on the command line.
    pub const fn name(self) -> &'static str {
        match self {
            Self::SensorNan => "sensor-nan",
            Self::SensorInfinity => "sensor-infinity",
            Self::SensorStuck => "sensor-stuck",
            Self::SensorDropout => "sensor-dropout",
            Self::SensorNoise => "sensor-noise",
            Self::SensorBias => "sensor-bias",
            Self::SensorOrder => "sensor-order",
            Self::CostLate => "cost-late",
            Self::CostLost => "cost-lost",
            Self::CostDuplicate => "cost-duplicate",
            Self::CostNegative => "cost-negative",
            Self::RamFlip => "ram-flip",
            Self::FlashFlip => "flash-flip",
            Self::ClockSlow => "clock-slow",
            Self::ClockJump => "clock-jump",
            Self::Overlong => "overlong",
            Self::LinkLoss => "link-loss",
            Self::WatchdogReset => "watchdog-reset",
            Self::BrownOut => "brown-out",
        }
    }

    /// Severities of a sweep, mild, usual and hard. The usual one is taken where none is named.
    pub const fn severities(self) -> [f64; 3] {
        match self {
            Self::SensorNoise | Self::SensorBias => [0.05, 0.2, 0.5],
            Self::ClockSlow => [0.01, 0.05, 0.2],
            Self::SensorStuck | Self::LinkLoss | Self::ClockJump => [0.002, 0.01, 0.05],
            Self::WatchdogReset | Self::BrownOut => [0.001, 0.005, 0.02],
            Self::CostNegative => [0.001, 0.01, 0.1],
            _ => [0.01, 0.05, 0.2],
        }
    }

    /// Whether it is always there, and its severity a size.
    pub const fn is_constant(self) -> bool {
        matches!(self, Self::SensorNoise | Self::SensorBias | Self::ClockSlow)
    }

    /// The largest severity.
    const fn most(self) -> u32 {
        if matches!(self, Self::SensorNoise | Self::SensorBias) { 100 } else { 1 }
    }

    /// The fault's place in [`FaultKind::ALL`].
    const fn index(self) -> u32 {
        self as u32
    }
}

impl fmt::Display for FaultKind {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(self.name())
    }
}

impl FromStr for Injection {
    type Err = FaultError;

    fn from_str(text: &str) -> Result<Self, FaultError> {
        let (name, severity) = text.split_once('=').map_or((text, None), |(name, severity)| (name, Some(severity)));
        let kind = FaultKind::ALL.into_iter().find(|kind| kind.name() == name);
        let kind = kind.ok_or_else(|| FaultError::Unknown { name: name.into() })?;
        let severity = match severity {
            None => kind.severities()[1],
            Some(text) => {
                let number = text.parse().ok().filter(|&value: &f64| value > 0.0 && value <= f64::from(kind.most()));
                let error = || FaultError::Severity { name: kind.name(), text: text.into(), most: kind.most() };
                number.ok_or_else(error)?
            }
        };
        Ok(Self { kind, severity })
    }
}

impl fmt::Display for Injection {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "{}={}", self.kind, self.severity)
    }
}

fn names() -> String {
    FaultKind::ALL.map(FaultKind::name).join(", ")
}

/// Faults that struck within a control step.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct FaultSet(u32);

impl FaultSet {
    /// Adds a fault.
    pub const fn insert(&mut self, kind: FaultKind) {
        self.0 |= 1 << kind.index();
    }

    /// The faults, in the order of [`FaultKind::ALL`].
    pub fn iter(self) -> impl Iterator<Item = FaultKind> {
        FaultKind::ALL.into_iter().filter(move |kind| self.0 & (1 << kind.index()) != 0)
    }

    /// Whether none struck.
    pub const fn is_empty(self) -> bool {
        self.0 == 0
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_fault_is_named_and_read_back() {
        for (index, kind) in (0..).zip(FaultKind::ALL) {
            assert_eq!(kind.index(), index);
            let usual: Injection = kind.name().parse().unwrap();
            assert_eq!(usual, Injection { kind, severity: kind.severities()[1] });
            for severity in kind.severities() {
                let injection = Injection { kind, severity };
                assert_eq!(injection.to_string().parse(), Ok(injection));
            }
        }
    }

    #[test]
    fn what_is_no_fault_or_no_severity_is_named() {
        let error = "sensor".parse::<Injection>().unwrap_err().to_string();
        assert!(error.contains("no fault is called sensor; the faults are sensor-nan,"), "{error}");
        for text in ["overlong=0", "overlong=-1", "overlong=1.5", "overlong=NaN", "overlong=", "overlong=often"] {
            let error = text.parse::<Injection>().unwrap_err().to_string();
            assert!(error.contains("above 0 and at most 1"), "{error}");
        }
        assert!("sensor-noise=3".parse::<Injection>().is_ok());
    }
}
