//! The controller as a task of an async executor, here embassy's on the host: it
//! owns its robot, and other tasks run between its steps.
//!
//!     cargo run --release -p armor-infer --example embassy_loop -- policy.armor

mod robot;

use std::sync::atomic::{AtomicUsize, Ordering};

use embassy_executor::Spawner;
use embassy_time::{Duration, Ticker};
use robot::Robot;

const PERIOD: Duration = Duration::from_millis(10);
/// What the other task has done so far.
static BEATS: AtomicUsize = AtomicUsize::new(0);

#[embassy_executor::task]
async fn control(mut robot: Robot) {
    let mut ticker = Ticker::every(PERIOD);
    for tick in 0..robot.ticks() {
        let (state, incurred) = robot.sense(tick);
        let step = robot.controller.step(state, incurred);
        if let Some(fault) = step.fault {
            eprintln!("tick {tick}: {fault}");
        }
        robot.act(tick, &step);
        ticker.next().await;
    }
    let beats = BEATS.load(Ordering::Relaxed);
    println!("embassy_loop: {} steps, bit for bit; kappa {}", robot.ticks(), robot.controller.kappa());
    println!("embassy_loop: the other task ran {beats} times meanwhile");
    // Firmware never ends.
    std::process::exit(if beats > 0 { 0 } else { 1 });
}

#[embassy_executor::task]
async fn heartbeat() {
    let mut ticker = Ticker::every(PERIOD / 4);
    loop {
        BEATS.fetch_add(1, Ordering::Relaxed);
        ticker.next().await;
    }
}

#[embassy_executor::main]
async fn main(spawner: Spawner) {
    match Robot::boot() {
        Ok(robot) => {
            spawner.spawn(control(robot).unwrap());
            spawner.spawn(heartbeat().unwrap());
        }
        Err(error) => {
            eprintln!("{error}");
            std::process::exit(1);
        }
    }
}
