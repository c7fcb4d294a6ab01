//! When and how faults strike: drawn from a seed, by place and time alone.

use armor_core::noise::{Noise, below, uniform};

use super::{FaultKind, FaultSet, Injection};

/// Control steps that stuck sensors and a lost link last at most.
const LONGEST: u32 = 25;

/// The faults of an episode.
#[derive(Clone, Debug)]
pub(crate) struct Injector {
    severities: [Option<f64>; FaultKind::ALL.len()],
    noise: Noise,
    /// The control step.
    tick: u64,
    stuck_until: u64,
    /// The readings that stuck sensors show.
    stuck: Vec<f32>,
    link_lost_until: u64,
    /// What struck in this control step.
    struck: FaultSet,
}

impl Injector {
    /// Faults of an episode with this seed; of several of a kind the last counts.
    pub(crate) fn new(injections: &[Injection], seed: u64) -> Self {
        let mut severities = [None; FaultKind::ALL.len()];
        for injection in injections {
            severities[injection.kind.index() as usize] = Some(injection.severity);
        }
        Self {
            severities,
            noise: Noise::new(seed),
            tick: 0,
            stuck_until: 0,
            stuck: Vec::new(),
            link_lost_until: 0,
            struck: FaultSet::default(),
        }
    }

    /// Goes on to a control step.
    pub(crate) fn begin(&mut self, tick: u64) {
        self.tick = tick;
        if self.strikes(FaultKind::LinkLoss) {
            self.link_lost_until = tick + 1 + u64::from(below(self.word(FaultKind::LinkLoss, 1), LONGEST));
        }
    }

    /// What struck since this was last asked.
    pub(crate) fn take_struck(&mut self) -> FaultSet {
        std::mem::take(&mut self.struck)
    }

    /// The share by which the controller's clock is slow.
    pub(crate) fn slowness(&mut self) -> f64 {
        let Some(slowness) = self.severity(FaultKind::ClockSlow) else { return 0.0 };
        self.struck.insert(FaultKind::ClockSlow);
        slowness
    }

    /// By how many control steps the controller's clock jumps now, forth or back.
    pub(crate) fn clock_jump(&mut self) -> i32 {
        if !self.strikes(FaultKind::ClockJump) {
            return 0;
        }
        let steps = 1 + below(self.word(FaultKind::ClockJump, 1), 10) as i32;
        if self.word(FaultKind::ClockJump, 2).is_multiple_of(2) { steps } else { -steps }
    }

    /// How many times as long as it should an action takes.
    pub(crate) fn stretch(&mut self) -> f64 {
        match self.strikes(FaultKind::Overlong) {
            true => 2.0 + 8.0 * f64::from(uniform(self.word(FaultKind::Overlong, 1))),
            false => 1.0,
        }
    }

    /// Whether the link is down.
    pub(crate) fn link_is_lost(&mut self) -> bool {
        let is_lost = self.tick < self.link_lost_until;
        if is_lost {
            self.struck.insert(FaultKind::LinkLoss);
        }
        is_lost
    }

    /// A sample on its way: changed in place, or lost. `factors` are 1 over
    /// the standard deviations of its entries.
    pub(crate) fn sense(&mut self, state: &mut [f32], factors: &[f32]) -> Option<()> {
        self.disturb(state, factors);
        if self.strikes(FaultKind::SensorStuck) {
            self.stuck_until = self.tick + 1 + u64::from(below(self.word(FaultKind::SensorStuck, 1), LONGEST));
            self.stuck = state.to_vec();
        }
        if self.tick < self.stuck_until {
            self.struck.insert(FaultKind::SensorStuck);
            state.copy_from_slice(&self.stuck);
        }
        if self.strikes(FaultKind::SensorOrder) {
            state.reverse();
        }
        for (kind, value) in [(FaultKind::SensorNan, f32::NAN), (FaultKind::SensorInfinity, f32::INFINITY)] {
            if self.strikes(kind) {
                let entry = below(self.word(kind, 1), state.len() as u32) as usize;
                state[entry] = value;
            }
        }
        let is_lost = self.strikes(FaultKind::SensorDropout);
        (!self.link_is_lost() && !is_lost).then_some(())
    }

    /// Noise of this control step, and the bias of the whole episode.
    fn disturb(&mut self, state: &mut [f32], factors: &[f32]) {
        for (kind, tick) in [(FaultKind::SensorNoise, self.tick), (FaultKind::SensorBias, 0)] {
            let Some(severity) = self.severity(kind) else { continue };
            self.struck.insert(kind);
            let mut draws = vec![0.0; state.len()];
            self.noise.fill_normal(kind.index(), tick, &mut draws);
            for ((entry, draw), factor) in state.iter_mut().zip(draws).zip(factors) {
                // An entry that never changes has no deviation.
                if *factor != 0.0 {
                    *entry += severity as f32 * draw / factor;
                }
            }
        }
    }

    /// The severity of a fault that is there.
    fn severity(&self, kind: FaultKind) -> Option<f64> {
        self.severities[kind.index() as usize]
    }

    /// Whether a fault strikes in this control step.
    pub(crate) fn strikes(&mut self, kind: FaultKind) -> bool {
        let Some(severity) = self.severity(kind) else { return false };
        let strikes = f64::from(uniform(self.word(kind, 0))) < severity;
        if strikes {
            self.struck.insert(kind);
        }
        strikes
    }

    /// A draw of a fault in this control step.
    pub(crate) fn word(&self, kind: FaultKind, draw: u32) -> u32 {
        self.noise.words(100 + kind.index(), self.tick, draw)[0]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn injector(text: &str, seed: u64) -> Injector {
        Injector::new(&[text.parse().unwrap()], seed)
    }

    #[test]
    fn a_fault_strikes_as_often_as_its_severity_says_and_where_its_seed_says() {
        let strikes = |seed| {
            let mut injector = injector("overlong=0.05", seed);
            let strikes = (0..100_000).filter(|&tick| {
                injector.begin(tick);
                injector.strikes(FaultKind::Overlong)
            });
            strikes.collect::<Vec<u64>>()
        };
        let once = strikes(1);
        // Five standard deviations of a binomial: 5 sqrt(1e5 0.05 0.95) = 345.
        assert!(once.len().abs_diff(5000) < 345, "{}", once.len());
        assert_eq!(once, strikes(1));
        assert_ne!(once, strikes(2));
    }

    #[test]
    fn sensors_show_what_their_fault_says() {
        let healthy = [0.5, -1.0, 2.0];
        let sensed = |text: &str, tick| {
            let mut injector = injector(text, 3);
            injector.begin(tick);
            let mut state = healthy;
            injector.sense(&mut state, &[1.0; 3]).map(|()| state)
        };
        assert!(sensed("sensor-nan=1", 0).unwrap().iter().any(|entry| entry.is_nan()));
        assert!(sensed("sensor-infinity=1", 0).unwrap().contains(&f32::INFINITY));
        assert_eq!(sensed("sensor-order=1", 0), Some([2.0, -1.0, 0.5]));
        assert_eq!(sensed("sensor-dropout=1", 0), None);
        assert_eq!(sensed("link-loss=1", 0), None);
        assert_ne!(sensed("sensor-bias=0.5", 0), Some(healthy));
        assert_eq!(sensed("sensor-bias=0.5", 0), sensed("sensor-bias=0.5", 9));
        assert_ne!(sensed("sensor-noise=0.5", 0), sensed("sensor-noise=0.5", 9));
        assert_eq!(sensed("cost-lost=1", 0), Some(healthy));
    }

    #[test]
    fn stuck_sensors_show_one_reading_for_a_while() {
        let mut injector = injector("sensor-stuck=0.02", 1);
        let mut longest = 0;
        let mut run = 0;
        for tick in 0..1000 {
            injector.begin(tick);
            let mut state = [tick as f32];
            injector.sense(&mut state, &[1.0]).unwrap();
            run = if state == [tick as f32] { 0 } else { run + 1 };
            longest = longest.max(run);
            assert_eq!(injector.take_struck().is_empty(), tick >= injector.stuck_until);
        }
        assert!((5..=2 * LONGEST).contains(&longest), "{longest}");
    }
}
