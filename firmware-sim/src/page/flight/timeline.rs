//! What flew and what broke, along an episode's time.

use std::fmt::Write;

use crate::fault::FaultKind;
use crate::harness::{Decision, Notice, Record, RobotEpisode};
use crate::page::axis::{Axis, label};

const WIDTH: f64 = 1000.0;
const LEFT: f64 = 120.0;
const RIGHT: f64 = 14.0;
const ROW: f64 = 17.0;

/// A row: its name, its class, and the control steps that it marks.
type Row = (String, &'static str, Vec<usize>);

/// Draws the timeline of an episode whose image has these chains.
pub(super) fn figure(episode: &RobotEpisode, chains: &[String], out: &mut String) {
    let records = &episode.records;
    let rows = rows(records, chains);
    let height = ROW * rows.len() as f64 + 44.0;
    let floor = height - 36.0;
    out.push_str("<figure class=\"wide\">\n<h3>What flew, and what broke</h3>\n");
    let _ = write!(out, "<svg viewBox=\"0 0 {WIDTH} {height:.0}\" role=\"img\" aria-label=\"timeline\">");
    let ends = records.last().map_or(1.0, |record| record.time.0 as f64 / 1e6);
    let step = ends / (records.len().max(2) - 1) as f64;
    let axis = Axis::exact(0.0, ends + step);
    let x = |time: f64| LEFT + axis.place(time) * (WIDTH - LEFT - RIGHT);
    for (index, (name, class, steps)) in rows.iter().enumerate() {
        let y = 4.0 + ROW * (index as f64 + 0.5);
        let _ = write!(out, "<text class=\"end\" x=\"{}\" y=\"{:.1}\">{name}</text>", LEFT - 8.0, y + 4.0);
        let mut path = String::new();
        for span in spans(steps) {
            let (from, to) = (x(span.0 as f64 * step), x(span.1 as f64 * step));
            // A single step must be seen on a long episode.
            let _ = write!(path, "M{from:.1} {y:.1}H{:.1}", to.max(from + 1.5));
        }
        let _ = write!(out, "<path class=\"{class}\" d=\"{path}\"/>");
    }
    for tick in axis.ticks(8) {
        let _ = write!(out, "<path class=\"axis\" d=\"M{:.1} {floor:.1}v4\"/>", x(tick));
        let _ =
            write!(out, "<text class=\"middle\" x=\"{:.1}\" y=\"{:.1}\">{}</text>", x(tick), floor + 16.0, label(tick));
    }
    let end = WIDTH - RIGHT;
    let _ = write!(out, "<path class=\"axis\" d=\"M{LEFT} 4V{floor:.1}H{end}\"/>");
    let _ = writeln!(out, "<text class=\"unit end\" x=\"{end}\" y=\"{:.1}\">time in s</text></svg>", height - 4.0);
    out.push_str("<figcaption>Blue: the chain whose action came to the actuators. Below, the action before was held, \
                  the fallback taken, or the controller was down; then faults that struck, and what the firmware noticed.\
                  </figcaption>\n</figure>\n");
}

fn rows(records: &[Record], chains: &[String]) -> Vec<Row> {
    let steps = |wanted: &dyn Fn(&Record) -> bool| {
        records.iter().enumerate().filter(|(_, record)| wanted(record)).map(|(step, _)| step).collect::<Vec<_>>()
    };
    let mut rows: Vec<Row> = Vec::new();
    for (rung, chain) in chains.iter().enumerate() {
        let flown = steps(&|record| record.decision == Decision::Policy && record.rung == Some(rung));
        rows.push((chain.clone(), "span", flown));
    }
    for (decision, class) in
        [(Decision::Held, "span held"), (Decision::Fallback, "span fallback"), (Decision::Down, "span down")]
    {
        rows.push((decision.name().to_owned(), class, steps(&|record| record.decision == decision)));
    }
    for kind in FaultKind::ALL {
        rows.push((kind.name().to_owned(), "span struck", steps(&|record| record.injected.iter().any(|k| k == kind))));
    }
    for notice in Notice::ALL {
        let name = format!("noticed {}", notice.name().replace('_', " "));
        rows.push((name, "span noticed", steps(&|record| record.noticed.contains(notice))));
    }
    rows.retain(|(_, _, steps)| !steps.is_empty());
    rows
}

/// Runs of steps that follow each other: the first, and the one after the last.
fn spans(steps: &[usize]) -> Vec<(usize, usize)> {
    let mut spans: Vec<(usize, usize)> = Vec::new();
    for &step in steps {
        match spans.last_mut() {
            Some(span) if span.1 == step => span.1 = step + 1,
            _ => spans.push((step, step + 1)),
        }
    }
    spans
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn steps_that_follow_each_other_are_one_span() {
        assert_eq!(spans(&[0, 1, 2, 5, 7, 8]), [(0, 3), (5, 6), (7, 9)]);
        assert_eq!(spans(&[]), []);
    }
}
