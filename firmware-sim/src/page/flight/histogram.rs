//! Latencies against the deadline.

use std::fmt::Write;

use crate::latency::Latency;
use crate::page::axis::{Axis, Scale, label};

const SIZE: [f64; 2] = [400.0, 236.0];
const MARGINS: [f64; 4] = [48.0, 14.0, 22.0, 36.0];
/// Each bar's end over its start.
const FACTOR: f64 = 1.15;

/// Draws a histogram; `deadline` in us, `whose` latency it is.
pub(super) fn figure(latency: &Latency, deadline: f64, whose: &str, out: &mut String) {
    let [width, height] = SIZE;
    let _ = write!(
        out,
        "<figure>\n<h3>Latency</h3>\n<ul class=\"legend\"><li><svg viewBox=\"0 0 18 10\" \
         aria-hidden=\"true\"><path class=\"bar\" d=\"M0 0H18V10H0Z\"/></svg>answers</li><li><svg viewBox=\"0 0 18 10\" \
         aria-hidden=\"true\"><path class=\"dead\" d=\"M0 5H18\"/></svg>period, the deadline</li></ul>\n"
    );
    let _ = write!(out, "<svg viewBox=\"0 0 {width} {height}\" role=\"img\" aria-label=\"latency\">");
    let bars: Vec<_> = latency.bars(FACTOR).collect();
    let most = bars.iter().map(|bar| bar.2).max().unwrap_or(0);
    // A microsecond, if the host measured nothing longer.
    let ends = bars.iter().flat_map(|bar| [bar.0.max(0.1), bar.1]).chain([deadline]);
    if let (Some(axis), 1..) = (Axis::over(Scale::Log, ends), most) {
        draw(&axis, &bars, most, deadline, out);
    } else {
        let _ =
            write!(out, "<text x=\"{}\" y=\"{}\" class=\"middle\">no value to draw</text>", width / 2.0, height / 2.0);
    }
    let _ = write!(out, "</svg>\n<figcaption>{whose}, from a sample to its answer.</figcaption>\n</figure>\n");
}

fn draw(across: &Axis, bars: &[(f64, f64, u64)], most: u64, deadline: f64, out: &mut String) {
    let [left, right, top, bottom] = MARGINS;
    let (end, floor) = (SIZE[0] - right, SIZE[1] - bottom);
    let x = |us: f64| left + across.place(us) * (end - left);
    let upright = Axis::exact(0.0, 1.05 * most as f64);
    let y = |count: f64| floor - upright.place(count) * (floor - top);
    for tick in upright.ticks(5) {
        let _ = write!(out, "<path class=\"grid\" d=\"M{left} {:.1}H{end}\"/>", y(tick));
        let _ =
            write!(out, "<text class=\"end\" x=\"{}\" y=\"{:.1}\">{}</text>", left - 5.0, y(tick) + 4.0, label(tick));
    }
    for tick in across.ticks(5) {
        let _ = write!(out, "<path class=\"axis\" d=\"M{:.1} {floor}v4\"/>", x(tick));
        let _ =
            write!(out, "<text class=\"middle\" x=\"{:.1}\" y=\"{}\">{}</text>", x(tick), floor + 16.0, label(tick));
    }
    for &(low, high, count) in bars {
        let (from, to) = (x(low.max(0.1)), x(high));
        let _ = write!(
            out,
            "<path class=\"bar\" d=\"M{from:.1} {floor}V{:.1}H{:.1}V{floor}Z\"/>",
            y(count as f64),
            to.max(from + 1.0)
        );
    }
    let _ = write!(out, "<path class=\"dead\" d=\"M{:.1} {floor}V{top}\"/>", x(deadline));
    let _ = write!(out, "<path class=\"axis\" d=\"M{left} {top}V{floor}H{end}\"/>");
    let _ = write!(out, "<text class=\"unit\" x=\"4\" y=\"11\">answers</text>");
    let _ = write!(out, "<text class=\"unit end\" x=\"{end}\" y=\"{}\">us, by ratios</text>", SIZE[1] - 4.0);
}
