//! What the programs of `bench/latency.py` share: a request is a number of
//! actions on a line, the answer one line of JSON with what each took.

use std::error::Error;
use std::io::stdin;
use std::time::Instant;

use serde_json::json;

/// Answers every request with durations in us and the last action, until the
/// asker hangs up. `act` computes one action; what it takes is measured.
pub fn serve(mut act: impl FnMut() -> Result<Vec<f32>, Box<dyn Error>>) -> Result<(), Box<dyn Error>> {
    for line in stdin().lines() {
        let (mut durations, mut action) = (Vec::new(), Vec::new());
        for _ in 0..line?.parse()? {
            let started = Instant::now();
            action = act()?;
            durations.push(started.elapsed().as_nanos() as f64 / 1000.0);
        }
        println!("{}", json!({ "us": durations, "action": action }));
    }
    Ok(())
}
