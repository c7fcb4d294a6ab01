//! Telemetry: a line of CSV a control step.

use std::fmt::Write;

use armor_infer::Fault;

use crate::harness::Record;

/// The telemetry of a flight, episode by episode: a header, then a line a control step.
///
/// | column | says |
/// |---|---|
/// | `episode`, `tick` | from 0 |
/// | `time_us` | virtual time since the episode's start |
/// | `kappa` | the controller's budget, empty before its first step |
/// | `left` | what is truly left of the limit at the step's end |
/// | `reward`, `cost` | what the step brought |
/// | `rung` | the chain that answered, empty where none did |
/// | `fault` | what the controller named, empty on an ordinary step |
/// | `latency_us` | from sample to answer, modelled; 0 on the host, empty where no chain answered |
/// | `decision` | `policy`, `held`, `fallback` or `down` |
/// | `injected`, `noticed` | faults that struck, and what the firmware noticed, names with spaces between |
/// | `x`, `y` | where the robot was at the step's end, in m |
/// | `action_...` | the action at the actuators then |
///
/// Numbers are written in the shortest digits that give them back.
pub fn csv(episodes: &[Vec<Record>], action_dim: usize) -> String {
    let mut text =
        String::from("episode,tick,time_us,kappa,left,reward,cost,rung,fault,latency_us,decision,injected,noticed,x,y");
    for entry in 0..action_dim {
        // Writing to a string cannot fail, here and below.
        let _ = write!(text, ",action_{entry}");
    }
    text.push('\n');
    for (number, records) in episodes.iter().enumerate() {
        for (tick, record) in records.iter().enumerate() {
            line(number, tick, record, action_dim, &mut text);
        }
    }
    text
}

fn line(episode: usize, tick: usize, record: &Record, action_dim: usize, text: &mut String) {
    let Record { time, left, reward, cost, place, .. } = record;
    let or_empty = |value: Option<String>| value.unwrap_or_default();
    let kappa = or_empty(record.kappa.map(|kappa| kappa.to_string()));
    let rung = or_empty(record.rung.map(|rung| rung.to_string()));
    let fault = record.fault.map_or("", name);
    let latency = or_empty(record.latency.map(|latency| (latency.as_nanos() as f64 / 1e3).to_string()));
    let injected: Vec<&str> = record.injected.iter().map(|kind| kind.name()).collect();
    let noticed: Vec<&str> = record.noticed.iter().map(|notice| notice.name()).collect();
    let _ = write!(
        text,
        "{episode},{tick},{},{kappa},{left},{reward},{cost},{rung},{fault},{latency},{},{},{},{},{}",
        time.0,
        record.decision.name(),
        injected.join(" "),
        noticed.join(" "),
        place.x,
        place.y
    );
    for value in record.action.iter().take(action_dim) {
        let _ = write!(text, ",{value}");
    }
    text.push('\n');
}

/// A fault as telemetry writes it.
fn name(fault: Fault) -> &'static str {
    match fault {
        Fault::StateLength => "state_length",
        Fault::StateNotFinite => "state_not_finite",
        Fault::InvalidCost => "invalid_cost",
        Fault::NoRung => "no_rung",
        Fault::ActionNotFinite => "action_not_finite",
    }
}

#[cfg(test)]
mod tests {
    use std::time::Duration;

    use armor_core::units::{Cost, Micros};
    use nalgebra::Vector2;

    use super::*;
    use crate::fault::FaultKind;
    use crate::harness::{Decision, Notice};

    #[test]
    fn a_control_step_is_a_line_under_its_header() {
        let mut record = Record {
            time: Micros(20_000),
            kappa: Some(Cost::from_raw(3 << 15)),
            left: Cost::from_raw(2 << 16),
            reward: 0.1,
            cost: 1.0,
            rung: Some(1),
            fault: Some(Fault::InvalidCost),
            latency: Some(Duration::from_nanos(1234)),
            decision: Decision::Held,
            injected: Default::default(),
            noticed: Default::default(),
            action: Default::default(),
            place: Vector2::new(-1.5, 0.25),
        };
        record.injected.insert(FaultKind::CostNegative);
        record.injected.insert(FaultKind::Overlong);
        record.noticed.insert(Notice::InvalidCost);
        record.action[1] = 0.1;
        let text = csv(&[vec![], vec![record]], 2);
        let lines: Vec<&str> = text.lines().collect();
        assert!(lines[0].ends_with(",x,y,action_0,action_1"));
        let expected =
            "1,0,20000,1.5,2,0.1,1,1,invalid_cost,1.234,held,cost-negative overlong,invalid_cost,-1.5,0.25,0,0.1";
        assert_eq!(lines[1..], [expected]);
        assert_eq!(lines[0].split(',').count(), expected.split(',').count());
    }
}
