//! A chart as SVG.

use std::fmt::Write;

use super::axis::{Axis, label};
use super::chart::{Chart, Layer};

/// Size of the drawing, in units that are pixels on a phone.
const SIZE: [f64; 2] = [400.0, 236.0];
/// Room for labels: left, right, top, bottom.
const MARGINS: [f64; 4] = [48.0, 14.0, 22.0, 36.0];
/// More points than this a curve does not show: two for each unit of width.
const COLUMNS: usize = 340;

/// Draws a chart; a legend and a title are the page's.
pub fn svg(chart: &Chart<'_>) -> String {
    let [width, height] = SIZE;
    let mut out = format!("<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"{}\">", chart.title);
    let last = chart.steps.last().copied().unwrap_or(0.0);
    let numbers = chart.layers.iter().flat_map(Layer::values);
    let upright = match chart.ends {
        Some([low, high]) => Some(Axis::exact(low, high)),
        None => Axis::over(chart.scale, numbers),
    };
    match upright {
        Some(upright) => Frame { across: Axis::exact(0.0, last), upright }.draw(chart, &mut out),
        None => {
            let _ = write!(
                out,
                "<text x=\"{}\" y=\"{}\" class=\"middle\">no value to draw</text>",
                width / 2.0,
                height / 2.0
            );
        }
    }
    out + "</svg>"
}

struct Frame {
    across: Axis,
    upright: Axis,
}

impl Frame {
    fn x(&self, step: f64) -> f64 {
        let [left, right, ..] = MARGINS;
        left + self.across.place(step) * (SIZE[0] - left - right)
    }

    fn y(&self, value: f64) -> f64 {
        let [.., top, bottom] = MARGINS;
        let bottom = SIZE[1] - bottom;
        // A number of a fixed axis may lie beyond its ends.
        bottom - self.upright.place(value).clamp(0.0, 1.0) * (bottom - top)
    }

    fn draw(&self, chart: &Chart<'_>, out: &mut String) {
        self.axes(chart, out);
        for layer in &chart.layers {
            self.layer(layer, chart, out);
        }
    }

    /// Writing to a string cannot fail, here and below.
    fn axes(&self, chart: &Chart<'_>, out: &mut String) {
        let [left, right, top, bottom] = MARGINS;
        let (end, floor) = (SIZE[0] - right, SIZE[1] - bottom);
        for tick in self.upright.ticks(5) {
            let y = self.y(tick);
            let _ = write!(out, "<path class=\"grid\" d=\"M{left} {y:.1}H{end}\"/>");
            let _ = write!(out, "<text class=\"end\" x=\"{}\" y=\"{:.1}\">{}</text>", left - 5.0, y + 4.0, label(tick));
        }
        for tick in self.across.ticks(5) {
            let x = self.x(tick);
            let _ = write!(out, "<path class=\"axis\" d=\"M{x:.1} {floor}v4\"/>");
            let _ = write!(out, "<text class=\"middle\" x=\"{x:.1}\" y=\"{}\">{}</text>", floor + 16.0, label(tick));
        }
        let _ = write!(out, "<path class=\"axis\" d=\"M{left} {top}V{floor}H{end}\"/>");
        let _ = write!(out, "<text class=\"unit\" x=\"4\" y=\"11\">{}</text>", chart.unit);
        let _ = write!(out, "<text class=\"unit end\" x=\"{end}\" y=\"{}\">{}</text>", SIZE[1] - 4.0, chart.across);
    }

    fn layer(&self, layer: &Layer<'_>, chart: &Chart<'_>, out: &mut String) {
        let [left, right, ..] = MARGINS;
        let end = SIZE[0] - right;
        let class = layer.class();
        let path = match layer {
            Layer::Line { values, .. } => self.line(&thinned(chart, values)),
            Layer::Dots { values, .. } => {
                let dot = |(step, value)| format!("M{:.1} {:.1}h0", self.x(step), self.y(value));
                points(chart, values).map(dot).collect()
            }
            Layer::Area { low, high, .. } => {
                let (low, high) = (extremes(chart, low, f64::min), extremes(chart, high, f64::max));
                let back = low.into_iter().rev();
                self.line(&high.into_iter().chain(back).collect::<Vec<_>>())
            }
            Layer::Band { low, high, .. } => {
                format!("M{left} {:.1}H{end}V{:.1}H{left}Z", self.y(*high), self.y(*low))
            }
            Layer::Level { at, .. } => format!("M{left} {:.1}H{end}", self.y(*at)),
        };
        if !path.is_empty() {
            let _ = write!(out, "<path class=\"{class}\" d=\"{path}\"/>");
        }
    }

    fn line(&self, points: &[(f64, f64)]) -> String {
        let mut path = String::new();
        for &(step, value) in points {
            let command = if path.is_empty() { 'M' } else { 'L' };
            let _ = write!(path, "{command}{:.1} {:.1}", self.x(step), self.y(value));
        }
        if points.len() == 1 {
            // A single point is drawn as a short dash.
            path.push_str("h-6");
        }
        path
    }
}

/// The points of a curve that has a place on the axis: of many, the lowest and the highest of each group.
fn thinned(chart: &Chart<'_>, values: &[f64]) -> Vec<(f64, f64)> {
    let points: Vec<_> = points(chart, values).collect();
    let group = points.len().div_ceil(COLUMNS / 2).max(1);
    if group <= 2 {
        return points;
    }
    let ends = |group: &[(f64, f64)]| {
        let by_value = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
        let low = group.iter().min_by(by_value).copied();
        let high = group.iter().max_by(by_value).copied();
        if low.map(|point| point.0) < high.map(|point| point.0) { [low, high] } else { [high, low] }
    };
    points.chunks(group).flat_map(ends).flatten().collect()
}

/// An edge of an area: of many points, the outermost of each group.
fn extremes(chart: &Chart<'_>, values: &[f64], choose: fn(f64, f64) -> f64) -> Vec<(f64, f64)> {
    let points: Vec<_> = points(chart, values).collect();
    let group = points.len().div_ceil(COLUMNS).max(1);
    let outermost = |group: &[(f64, f64)]| group.iter().copied().reduce(|a, b| (b.0, choose(a.1, b.1)));
    points.chunks(group).filter_map(outermost).collect()
}

fn points(chart: &Chart<'_>, values: &[f64]) -> impl Iterator<Item = (f64, f64)> {
    let scale = chart.scale;
    chart.steps.iter().copied().zip(values.iter().copied()).filter(move |&(_, value)| scale.holds(value))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::page::axis::Scale;

    fn chart<'a>(steps: &'a [f64], layers: Vec<Layer<'a>>) -> Chart<'a> {
        Chart {
            title: "t",
            across: "steps",
            unit: "u",
            scale: Scale::Linear,
            ends: None,
            steps,
            layers,
            caption: String::new(),
        }
    }

    fn line(values: &[f64]) -> Layer<'_> {
        Layer::Line { label: String::new(), colour: 0, values }
    }

    /// The places of a path's points.
    fn path(svg: &str, class: &str) -> Vec<[f64; 2]> {
        let start = svg.split(&format!("class=\"{class}\" d=\"M")).nth(1).unwrap();
        let points = start.split('"').next().unwrap().split('L');
        points.map(|point| point.split_once(' ').map(|(x, y)| [x, y].map(|v| v.parse().unwrap())).unwrap()).collect()
    }

    #[test]
    fn a_line_rises_from_left_to_right_within_its_frame() {
        let drawn = path(&svg(&chart(&[100.0, 200.0, 300.0], vec![line(&[1.0, 2.0, 4.0])])), "line c0");
        let [left, right, top, bottom] = MARGINS;
        assert_eq!(drawn.len(), 3);
        assert!((drawn[2][0] - (SIZE[0] - right)).abs() < 0.06);
        assert!((drawn[0][0] - (left + (SIZE[0] - left - right) / 3.0)).abs() < 0.06);
        assert!(drawn.windows(2).all(|pair| pair[0][0] < pair[1][0] && pair[0][1] > pair[1][1]));
        assert!(drawn.iter().all(|[_, y]| (top..=SIZE[1] - bottom).contains(y)));
        assert!((2.0 * (drawn[0][1] - drawn[1][1]) - (drawn[1][1] - drawn[2][1])).abs() < 0.3);
    }

    #[test]
    fn many_points_are_thinned_but_keep_every_peak() {
        let steps: Vec<f64> = (1..=10_000).map(f64::from).collect();
        let mut values = vec![0.0; steps.len()];
        (values[1234], values[7777]) = (5.0, -5.0);
        let drawn = path(&svg(&chart(&steps, vec![line(&values)])), "line c0");
        assert!(drawn.len() <= 2 * COLUMNS);
        let heights = || drawn.iter().map(|point| point[1]);
        let (highest, lowest) = (heights().fold(f64::MAX, f64::min), heights().fold(0.0, f64::max));
        assert!(lowest - highest > 0.9 * (SIZE[1] - MARGINS[2] - MARGINS[3]), "{highest} {lowest}");
        assert!(drawn.windows(2).all(|pair| pair[0][0] <= pair[1][0]));
    }

    #[test]
    fn numbers_without_a_place_are_skipped_and_a_chart_of_none_says_so() {
        let steps = [1.0, 2.0, 3.0];
        let drawn = svg(&chart(&steps, vec![line(&[1.0, f64::NAN, 2.0])]));
        assert_eq!(path(&drawn, "line c0").len(), 2);
        assert!(!drawn.contains("NaN"));
        let empty = Chart { scale: Scale::Log, ..chart(&steps, vec![line(&[0.0; 3])]) };
        assert!(svg(&empty).contains("no value to draw"));
    }

    #[test]
    fn an_area_goes_along_one_edge_and_back_along_the_other() {
        let (low, high) = ([0.0, 1.0], [2.0, 3.0]);
        let layers = vec![Layer::Area { label: String::new(), colour: 1, low: &low, high: &high }];
        let drawn = path(&svg(&chart(&[1.0, 2.0], layers)), "area c1");
        assert_eq!(drawn.len(), 4);
        assert_eq!((drawn[0][0], drawn[1][0]), (drawn[3][0], drawn[2][0]));
        assert!(drawn[0][1] < drawn[3][1] && drawn[1][1] < drawn[2][1]);
    }
}
