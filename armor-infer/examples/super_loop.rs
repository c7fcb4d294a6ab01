//! The controller in a plain loop at a fixed rate: sense, step, act, wait.
//!
//!     cargo run --release -p armor-infer --example super_loop -- policy.armor

mod robot;

use std::error::Error;
use std::time::{Duration, Instant};

use robot::Robot;

const PERIOD: Duration = Duration::from_millis(10);

fn main() -> Result<(), Box<dyn Error>> {
    let mut robot = Robot::boot()?;
    let start = Instant::now();
    for tick in 0..robot.ticks() {
        let (state, incurred) = robot.sense(tick);
        let step = robot.controller.step(state, incurred);
        if let Some(fault) = step.fault {
            eprintln!("tick {tick}: {fault}");
        }
        robot.act(tick, &step);
        std::thread::sleep((start + PERIOD * (tick as u32 + 1)).saturating_duration_since(Instant::now()));
    }
    println!("super_loop: {} steps, bit for bit; kappa {}", robot.ticks(), robot.controller.kappa());
    Ok(())
}
