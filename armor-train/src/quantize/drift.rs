//! How far an integer policy is from the one in single precision.

use std::fmt;

use armor_core::image::Quality;
use armor_core::noise::{Noise, below};
use armor_core::units::{Cost, CostLimit};
use armor_infer::Policy;
use firmware_sim::host::HostController;
use serde::Serialize;

use crate::data::Dataset;
use crate::export::{AGREEMENT_SAMPLES, Agreement, ExportError};

/// The largest change of a rung's mean normalised reward that is accepted.
pub const REWARD_BOUND: f32 = 0.02;
/// The largest rise of a rung's mean normalised cost that is accepted.
pub const COST_BOUND: f32 = 0.1;

/// The flights of both policies, rung by rung.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
#[serde(transparent)]
pub struct Drift(pub Vec<RungDrift>);

/// Flights of one rung in single precision and in integers, from the same
/// starts with the same noise; rewards and costs are normalised means (Eq. 17).
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct RungDrift {
    /// Which rung flew, from 0.
    pub rung: u8,
    /// Reward in single precision.
    pub float_reward_normalized: f32,
    /// Reward in integers.
    pub reward_normalized: f32,
    /// Cost in single precision.
    pub float_cost_normalized: f32,
    /// Cost in integers.
    pub cost_normalized: f32,
}

impl Drift {
    pub(super) fn new(float: &[Quality], integer: &[Quality]) -> Self {
        // A choice by the critic may fall otherwise for the least difference.
        let plain = |flights: &[Quality]| flights.iter().copied().filter(|flight| flight.candidates == 1).collect();
        let (float, integer): (Vec<_>, Vec<_>) = (plain(float), plain(integer));
        let pairs = float.iter().zip(&integer);
        Self(
            pairs
                .map(|(float, integer)| RungDrift {
                    rung: integer.rung,
                    float_reward_normalized: float.reward_normalized,
                    reward_normalized: integer.reward_normalized,
                    float_cost_normalized: float.cost_normalized,
                    cost_normalized: integer.cost_normalized,
                })
                .collect(),
        )
    }

    /// The first rung that moved by more than [`REWARD_BOUND`] or [`COST_BOUND`].
    pub fn beyond_bounds(&self) -> Option<&RungDrift> {
        self.0.iter().find(|rung| rung.is_beyond_bounds())
    }
}

impl RungDrift {
    fn is_beyond_bounds(&self) -> bool {
        let reward = (self.reward_normalized - self.float_reward_normalized).abs();
        let cost = self.cost_normalized - self.float_cost_normalized;
        // A NaN is beyond every bound.
        !(reward <= REWARD_BOUND && cost <= COST_BOUND)
    }
}

impl fmt::Display for RungDrift {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "rung {}: reward {:.3} to {:.3}, cost {:.3} to {:.3} (normalised)",
            self.rung,
            self.float_reward_normalized,
            self.reward_normalized,
            self.float_cost_normalized,
            self.cost_normalized
        )
    }
}

/// Compares the first actions of two policies over random recorded states and
/// budgets; sample `i` takes its noise from seed `i`.
pub(super) fn agreement(float: Policy<'_>, integer: Policy<'_>, data: &Dataset) -> Result<Agreement, ExportError> {
    let mut differences = Vec::new();
    for sample in 0..AGREEMENT_SAMPLES as u64 {
        let row = below(Noise::new(sample).words(u32::MAX, 0, 0)[0], data.len() as u32) as usize;
        let limit = CostLimit::from_cost(Cost::from_incurred(data.kappa(row)).unwrap_or(Cost::MAX));
        let action = |policy| -> Result<_, ExportError> {
            Ok(HostController::new(policy, limit, sample)?.step(data.observation(row), 0.0).action)
        };
        let (float, integer) = (action(float)?, action(integer)?);
        differences.extend(float.iter().zip(&integer).take(data.action_dim()).map(|(a, b)| (a - b).abs()));
    }
    Ok(Agreement::new(&differences, AGREEMENT_SAMPLES))
}

#[cfg(test)]
mod tests {
    use super::*;

    fn flown(rung: u8, reward_normalized: f32, cost_normalized: f32) -> Quality {
        Quality {
            rung,
            limit: Cost::from_raw(5 << 16),
            candidates: 1,
            episodes: 20,
            reward_normalized,
            cost_normalized,
        }
    }

    #[test]
    fn a_rung_whose_reward_moves_or_whose_cost_rises_is_found() {
        let float = [flown(0, 0.5, 0.5), flown(1, 0.25, 0.5)];
        let beyond = |reward, cost| {
            Drift::new(&float, &[float[0], flown(1, reward, cost)]).beyond_bounds().map(|rung| rung.rung)
        };
        assert_eq!(beyond(0.25, 0.5), None);
        for (reward, cost) in [(0.26, 0.5), (0.24, 0.5), (0.25, 0.59), (0.25, 0.0)] {
            assert_eq!(beyond(reward, cost), None, "{reward}, {cost}");
        }
        for (reward, cost) in [(0.28, 0.5), (0.22, 0.5), (0.25, 0.61), (f32::NAN, 0.5), (0.25, f32::NAN)] {
            assert_eq!(beyond(reward, cost), Some(1), "{reward}, {cost}");
        }
    }
}
