//! Which weight each recorded action is cloned with, and under which condition.

use super::advantage::Advantages;
use super::condition::{Condition, LambdaRange};
use super::weight::AdvantageWeight;
use crate::config::Config;
use crate::sampling::Rows;

/// Leniencies at which the mean weight of the data is known.
const GRID: usize = 33;

/// Cloning by advantage weights, at one price of cost or at a price that is drawn.
#[derive(Clone, Debug)]
pub struct Cloning {
    advantages: Advantages,
    weight: AdvantageWeight,
    price: Price,
    /// What is cloned, where that is not all that was recorded.
    followed: Option<Rows>,
}

#[derive(Clone, Debug)]
enum Price {
    /// The actor is not conditioned on it.
    Fixed(f64),
    /// Drawn for each sample. A strict price has many small weights and a lenient one
    /// many large ones; divided by their mean over the data, each price has an equal say.
    Drawn { range: LambdaRange, log_means: Vec<f64> },
}

impl Cloning {
    /// The cloning that a configuration wants, by the advantages of all transitions.
    pub fn new(config: &Config, advantages: Advantages) -> Self {
        let weight = AdvantageWeight { alpha: config.advantage_temperature, cap: config.advantage_cap };
        let price = match config.condition {
            Condition::Kappa | Condition::None => Price::Fixed(config.advantage_lambda),
            Condition::Lambda => {
                let range = config.lambda_range();
                let log_mean = |place: usize| {
                    let lambda = range.lambda(place as f64 / (GRID - 1) as f64);
                    let sum: f64 = advantages.scaled.iter().map(|&pair| weight.log(pair, lambda).exp()).sum();
                    (sum / advantages.scaled.len() as f64).ln()
                };
                Price::Drawn { range, log_means: (0..GRID).map(log_mean).collect() }
            }
        };
        Self { advantages, weight, price, followed: None }
    }

    /// The same cloning of these rows alone.
    #[must_use]
    pub(crate) fn following(mut self, rows: Rows) -> Self {
        self.followed = Some(rows);
        self
    }

    /// What is cloned; none where it is all that was recorded.
    pub(crate) const fn followed(&self) -> Option<&Rows> {
        self.followed.as_ref()
    }

    /// The logarithm of the weight of transition `row`, for a leniency within 0 and 1 where the price is drawn.
    pub fn log_weight(&self, row: usize, leniency: f64) -> f64 {
        let advantages = self.advantages.scaled[row];
        match &self.price {
            Price::Fixed(lambda) => self.weight.log(advantages, *lambda),
            Price::Drawn { range, log_means } => {
                let place = leniency * (GRID - 1) as f64;
                let below = (place as usize).min(GRID - 2);
                let [low, high] = [log_means[below], log_means[below + 1]];
                let log_mean = low + (place - below as f64) * (high - low);
                self.weight.log(advantages, range.lambda(leniency)) - log_mean
            }
        }
    }

    /// The advantages behind the weights.
    pub const fn advantages(&self) -> &Advantages {
        &self.advantages
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::testing::fill;

    fn cloning(condition: Condition) -> Cloning {
        let mut config = Preset::Quick.config("own", 1.0);
        (config.condition, config.lambda_min, config.lambda_max) = (condition, 0.5, 8.0);
        let scaled: Vec<[f32; 2]> =
            fill(400, 1).chunks(2).map(|pair| [2.0 * pair[0] as f32, 2.0 * pair[1] as f32]).collect();
        Cloning::new(&config, Advantages { scaled, scales: [1.0; 2] })
    }

    #[test]
    fn a_fixed_price_is_that_of_the_configuration() {
        let cloning = cloning(Condition::None);
        for row in 0..200 {
            let expected = cloning.weight.log(cloning.advantages.scaled[row], 2.0);
            assert_eq!(cloning.log_weight(row, 0.3), expected);
        }
    }

    /// On the grid exactly, between its points nearly.
    #[test]
    fn every_price_has_an_equal_say() {
        let cloning = cloning(Condition::Lambda);
        for (leniency, tolerance) in [(0.0, 1e-12), (0.25, 1e-12), (1.0, 1e-12), (0.234, 1e-3), (0.99, 1e-3)] {
            let mean = (0..200).map(|row| cloning.log_weight(row, leniency).exp()).sum::<f64>() / 200.0;
            assert!((mean - 1.0).abs() < tolerance, "leniency {leniency}: {mean}");
        }
    }

    #[test]
    fn a_stricter_price_prefers_the_cheaper_action() {
        let cloning = cloning(Condition::Lambda);
        let by_cost = |row: &usize| (cloning.advantages.scaled[*row][1] * 1e6) as i64;
        let (cheap, dear) = ((0..200).min_by_key(by_cost).unwrap(), (0..200).max_by_key(by_cost).unwrap());
        let preference = |leniency| cloning.log_weight(cheap, leniency) - cloning.log_weight(dear, leniency);
        assert!(preference(0.0) > preference(0.5) && preference(0.5) > preference(1.0) && preference(1.0) > 0.0);
    }
}
