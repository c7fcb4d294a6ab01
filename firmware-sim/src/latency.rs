//! How long the controller took: on this host, or on the model of a board.

use std::fmt;
use std::time::Duration;

use hdrhistogram::Histogram;
use serde::Serialize;

/// What the histogram tells apart, in ns: 1 to a minute, to three digits.
const RANGE_NS: (u64, u64) = (1, 60_000_000_000);
const DIGITS: u8 = 3;
/// Each bar of the printed histogram covers durations up to 1.5 times those of the one above.
const BAR_FACTOR: f64 = 1.5;
/// Width of the longest bar.
const BAR_WIDTH: u64 = 50;

/// A histogram of durations.
#[derive(Clone, Debug, PartialEq)]
pub struct Latency(Histogram<u64>);

/// Quantiles of a histogram; 0 where nothing was recorded.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct Quantiles {
    /// Median in us.
    pub latency_us_p50: f64,
    /// 99th percentile in us.
    pub latency_us_p99: f64,
    /// Largest in us.
    pub latency_us_max: f64,
}

impl FromIterator<Duration> for Latency {
    /// Takes durations beyond a minute for a minute.
    fn from_iter<I: IntoIterator<Item = Duration>>(durations: I) -> Self {
        let (low, high) = RANGE_NS;
        let mut histogram = Histogram::new_with_bounds(low, high, DIGITS).expect("the bounds are constant and valid");
        for duration in durations {
            histogram.saturating_record(u64::try_from(duration.as_nanos()).unwrap_or(u64::MAX));
        }
        Self(histogram)
    }
}

impl std::iter::Sum for Latency {
    /// All durations of several histograms.
    fn sum<I: Iterator<Item = Self>>(histograms: I) -> Self {
        histograms.fold(Self::from_iter([]), |Self(mut sum), Self(part)| {
            // The same bounds on both sides: nothing of one can lie outside the other.
            sum += part;
            Self(sum)
        })
    }
}

impl Latency {
    /// Ranges of durations, each up to `factor` times those of the one before,
    /// with what they hold: low and high end in us, and count. Empty ones are left out.
    pub fn bars(&self, factor: f64) -> impl Iterator<Item = (f64, f64, u64)> {
        let mut low = 0.0;
        let bars = self.0.iter_log(1, factor).map(move |bar| {
            let high = us(bar.value_iterated_to());
            (std::mem::replace(&mut low, high), high, bar.count_since_last_iteration())
        });
        bars.filter(|bar| bar.2 > 0)
    }

    /// Median, 99th percentile and maximum.
    pub fn quantiles(&self) -> Quantiles {
        Quantiles {
            latency_us_p50: us(self.0.value_at_quantile(0.5)),
            latency_us_p99: us(self.0.value_at_quantile(0.99)),
            latency_us_max: us(self.0.max()),
        }
    }
}

fn us(ns: u64) -> f64 {
    ns as f64 / 1000.0
}

/// One bar a line, 80 columns wide; ranges without durations are left out.
impl fmt::Display for Latency {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let most = self.bars(BAR_FACTOR).map(|bar| bar.2).max().unwrap_or(1);
        for (_, high, count) in self.bars(BAR_FACTOR) {
            let length = (count * BAR_WIDTH).div_ceil(most) as usize;
            writeln!(f, "<= {high:>10.1} us {:<50} {count:>10}", "#".repeat(length))?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn quantiles_of_a_known_distribution() {
        let latency: Latency = (1..=1000).map(Duration::from_micros).collect();
        let Quantiles { latency_us_p50, latency_us_p99, latency_us_max } = latency.quantiles();
        for (actual, expected) in [(latency_us_p50, 500.0), (latency_us_p99, 990.0), (latency_us_max, 1000.0)] {
            assert!((actual / expected - 1.0).abs() < 1e-3, "{actual} is not {expected}");
        }
    }

    #[test]
    fn a_sum_holds_the_durations_of_all() {
        let parts = [vec![1, 2], vec![3], vec![]].map(|us| us.into_iter().map(Duration::from_micros).collect());
        let all: Latency = [1, 2, 3].map(Duration::from_micros).into_iter().collect();
        assert_eq!(parts.into_iter().sum::<Latency>(), all);
    }

    #[test]
    fn nothing_recorded_is_zero_and_what_is_too_long_is_a_minute() {
        assert_eq!(Latency::from_iter([]).quantiles(), Quantiles::default());
        let latency = Latency::from_iter([Duration::MAX, Duration::ZERO]);
        assert!((latency.quantiles().latency_us_max / 60e6 - 1.0).abs() < 1e-3);
    }

    #[test]
    fn bars_hold_every_duration_and_fit_a_terminal() {
        let durations = (0..10_000u64).map(|i| Duration::from_nanos(1 + i * i * i));
        let text = durations.collect::<Latency>().to_string();
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
        let counts = text.lines().map(|line| line.rsplit(' ').next().unwrap().parse::<u64>().unwrap());
        assert_eq!(counts.sum::<u64>(), 10_000);
        assert!(text.contains(&"#".repeat(50)) && !text.contains(&"#".repeat(51)));
    }
}
