//! Axes: from numbers to places, with ticks at round numbers.

/// How numbers are laid out along an axis.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Scale {
    /// Equal differences are equally far.
    Linear,
    /// Equal ratios are equally far; only positive numbers have a place.
    Log,
}

/// An axis over a range of numbers.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Axis {
    scale: Scale,
    /// Ends, as logarithms to base 10 on a logarithmic axis.
    ends: [f64; 2],
}

impl Scale {
    /// Whether a number has a place on an axis of this scale.
    pub fn holds(self, value: f64) -> bool {
        value.is_finite() && (self == Self::Linear || value > 0.0)
    }

    fn apply(self, value: f64) -> f64 {
        if self == Self::Log { value.log10() } else { value }
    }
}

impl Axis {
    /// The axis from the smallest to the largest of some numbers, with a margin
    /// of 4 %; none if no number has a place on it.
    pub fn over(scale: Scale, values: impl Iterator<Item = f64>) -> Option<Self> {
        let places = values.filter(|&value| scale.holds(value)).map(|value| scale.apply(value));
        let [low, high] =
            places.fold([f64::INFINITY, f64::NEG_INFINITY], |[low, high], place| [low.min(place), high.max(place)]);
        if low > high {
            return None;
        }
        // A constant needs some room around it.
        let margin = if high > low { 0.04 * (high - low) } else { (0.1 * high.abs()).max(0.1) };
        Some(Self { scale, ends: [low - margin, high + margin] })
    }

    /// The linear axis with these very ends.
    pub fn exact(low: f64, high: f64) -> Self {
        Self { scale: Scale::Linear, ends: [low, if high > low { high } else { low + 1.0 }] }
    }

    /// Where a number lies, from 0 at the low end to 1 at the high end.
    pub fn place(&self, value: f64) -> f64 {
        let [low, high] = self.ends;
        (self.scale.apply(value) - low) / (high - low)
    }

    /// About `count` round numbers along the axis.
    pub fn ticks(&self, count: usize) -> Vec<f64> {
        let [low, high] = self.ends;
        let span = high - low;
        if self.scale == Scale::Log && span >= 0.7 {
            // Within few decades powers of ten alone are too sparse.
            let steps: &[f64] = match span {
                ..1.7 => &[1.0, 2.0, 5.0],
                ..3.0 => &[1.0, 3.0],
                _ => &[1.0],
            };
            let stride = (span / count as f64).ceil();
            let decades = multiples(low.floor(), high, stride).map(|exponent| 10f64.powi(exponent as i32));
            let ticks = decades.flat_map(|decade| steps.iter().map(move |step| step * decade));
            return ticks.filter(|&tick| (0.0..=1.0).contains(&self.place(tick))).collect();
        }
        let [low, high] = if self.scale == Scale::Log { self.ends.map(|end| 10f64.powf(end)) } else { self.ends };
        let rough = (high - low) / count as f64;
        let power = 10f64.powf(rough.log10().floor());
        let factor = [1.0, 2.0, 5.0].into_iter().find(|factor| factor * power >= rough).unwrap_or(10.0);
        multiples(low, high, factor * power).collect()
    }
}

/// The multiples of `stride` between two numbers.
fn multiples(low: f64, high: f64, stride: f64) -> impl Iterator<Item = f64> {
    // Rounding must not lose a tick at the very end.
    let (first, last) = ((low / stride - 1e-9).ceil() as i64, (high / stride + 1e-9).floor() as i64);
    (first..=last).map(move |multiple| multiple as f64 * stride)
}

/// A number as a label: three significant digits, `12k`, or a power of ten.
pub fn label(value: f64) -> String {
    let size = value.abs();
    if size == 0.0 {
        return "0".to_owned();
    }
    if !(1e-3..1e9).contains(&size) {
        let exponent = size.log10().floor() as i32;
        let mantissa = trim(format!("{:.1}", value / 10f64.powi(exponent)));
        let power = format!("10{}", superscript(exponent));
        return match mantissa.as_str() {
            "1" => power,
            _ => format!("{mantissa}·{power}"),
        };
    }
    for (unit, name) in [(1e6, "M"), (1e3, "k")] {
        // 1000 is short enough as it is.
        if size >= unit && size > 1e3 {
            return trim(significant(value / unit)) + name;
        }
    }
    trim(significant(value))
}

fn significant(value: f64) -> String {
    let digits = (2 - value.abs().log10().floor() as i32).clamp(0, 6) as usize;
    format!("{value:.digits$}").replace('-', "\u{2212}")
}

fn trim(number: String) -> String {
    if number.contains('.') { number.trim_end_matches('0').trim_end_matches('.').to_owned() } else { number }
}

fn superscript(exponent: i32) -> String {
    let raise = |digit: char| match digit {
        '-' => '⁻',
        '1' => '¹',
        '2' => '²',
        '3' => '³',
        digit => char::from_u32('⁰' as u32 + digit.to_digit(10).unwrap_or(0)).unwrap_or(digit),
    };
    exponent.to_string().chars().map(raise).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn ticks_are_round_and_within_the_axis() {
        assert_eq!(Axis::exact(0.0, 9000.0).ticks(5), [0.0, 2000.0, 4000.0, 6000.0, 8000.0]);
        assert_eq!(Axis::exact(0.0, 1.0).ticks(5).len(), 6);
        let log = Axis::over(Scale::Log, [2e-9, 148.4].into_iter()).unwrap();
        assert_eq!(
            log.ticks(6).iter().map(|&tick| label(tick)).collect::<Vec<_>>(),
            ["10⁻⁸", "10⁻⁶", "10⁻⁴", "0.01", "1", "100"]
        );
        let decade = Axis::over(Scale::Log, [0.015, 0.45].into_iter()).unwrap();
        assert_eq!(decade.ticks(5), [0.02, 0.05, 0.1, 0.2, 0.5]);
        let narrow = Axis::over(Scale::Log, [0.3, 0.9].into_iter()).unwrap();
        assert!(narrow.ticks(5).len() >= 3);
    }

    #[test]
    fn every_tick_of_every_axis_lies_on_it() {
        for scale in [Scale::Linear, Scale::Log] {
            for exponent in -12..12 {
                for (low, ratio) in [(0.7, 1.0), (1.0, 1.001), (3.3, 2.0), (1.0, 1e5)] {
                    let low = low * 10f64.powi(exponent);
                    let axis = Axis::over(scale, [low, low * ratio].into_iter()).unwrap();
                    let ticks = axis.ticks(5);
                    assert!((2..=12).contains(&ticks.len()), "{axis:?}: {ticks:?}");
                    assert!(ticks.iter().all(|&tick| (-1e-6..=1.0 + 1e-6).contains(&axis.place(tick))));
                }
            }
        }
    }

    #[test]
    fn what_has_no_place_is_left_out() {
        assert_eq!(Axis::over(Scale::Log, [0.0, -1.0, f64::NAN].into_iter()), None);
        let axis = Axis::over(Scale::Linear, [f64::INFINITY, 1.0, 3.0].into_iter()).unwrap();
        assert!((axis.place(2.0) - 0.5).abs() < 1e-12);
    }

    #[test]
    fn labels_are_short() {
        for (value, expected) in [
            (0.0, "0"),
            (0.25, "0.25"),
            (-2.5, "−2.5"),
            (1000.0, "1000"),
            (9000.0, "9k"),
            (200_000.0, "200k"),
            (1_500_000.0, "1.5M"),
            (1e-9, "10⁻⁹"),
            (2.06e-9, "2.1·10⁻⁹"),
            (148.413, "148"),
        ] {
            assert_eq!(label(value), expected);
        }
    }
}
