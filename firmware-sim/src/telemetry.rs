//! Telemetry: a line of CSV a control step.

use std::fmt::Write;

use armor_infer::Fault;

use crate::flight::Flight;

/// The telemetry of a flight: a header, then a line a control step.
///
/// `time_us` is virtual time since the episode's start, `kappa` the budget
/// before the step, `rung` the chain that flew, empty where the action is
/// the fallback, `fault` empty on an ordinary step. Numbers are written in the shortest digits that give them back.
pub fn csv(flight: &Flight, action_dim: usize) -> String {
    let mut text = String::from("episode,tick,time_us,kappa,reward,cost,rung,fault");
    for entry in 0..action_dim {
        text.push_str(&format!(",action_{entry}"));
    }
    text.push('\n');
    for (number, episode) in flight.episodes.iter().enumerate() {
        for (index, tick) in episode.ticks.iter().enumerate() {
            let fault = tick.step.fault.map_or("", name);
            let (time, kappa) = (tick.time.0, tick.step.kappa);
            let rung = tick.step.rung.map_or_else(String::new, |rung| rung.to_string());
            // Writing to a string cannot fail.
            let _ = write!(text, "{number},{index},{time},{kappa},{},{},{rung},{fault}", tick.reward, tick.cost);
            for value in tick.step.action.iter().take(action_dim) {
                let _ = write!(text, ",{value}");
            }
            text.push('\n');
        }
    }
    text
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
