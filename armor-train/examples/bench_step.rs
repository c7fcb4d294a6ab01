//! Our side of `bench/train_step.sh`: full training steps at the paper's sizes, on request.
//!
//! Reads one request a line from standard input and answers each with one line
//! once it is done; the asker reads the clocks.
//!
//! | request | does | answers |
//! |---|---|---|
//! | `steps N` | `N` training steps | the critic's losses of the last |
//! | `products N` | `N` single-threaded products of 1024 x 1024 matrices by `matrixmultiply` | an entry of the result |
//!
//! `RAYON_NUM_THREADS` sets the number of threads.

use std::error::Error;
use std::io::stdin;

use armor_core::noise::Noise;
use armor_train::config::Preset;
use armor_train::data::{Dataset, Recording};
use armor_train::learner::Learner;
use nalgebra::DMatrix;

/// That of the program `armor-train`.
#[global_allocator]
static ALLOCATOR: armor_train::allocator::CacheLines = armor_train::allocator::CacheLines;

/// The sizes of `bench/train_step.py`.
const STATE: usize = 60;
const ACTION: usize = 2;
/// Rows of the synthetic recording, in episodes of 100.
const ROWS: usize = 20_000;
const EPISODE: usize = 100;

fn main() -> Result<(), Box<dyn Error>> {
    let data = Dataset::new(recording())?;
    let mut learner = Learner::<f32>::new(Preset::Paper.config("bench", 5.0), &data);
    let square = DMatrix::from_vec(1024, 1024, normals(8, 1024 * 1024));
    let mut product = square.clone();
    for line in stdin().lines() {
        match line?.split_once(' ') {
            Some(("steps", count)) => {
                let mut losses = [0.0; 3];
                for _ in 0..count.parse()? {
                    losses = learner.step().critic.map_or([0.0; 3], |critic| critic.losses);
                }
                println!("{losses:?}");
            }
            Some(("products", count)) => {
                for _ in 0..count.parse()? {
                    square.mul_to(&square, &mut product);
                }
                println!("{}", product[(1, 2)]);
            }
            _ => return Err("a request is `steps N` or `products N`".into()),
        }
    }
    Ok(())
}

/// Standard normal states, actions within the bounds, a cost in one row of ten.
fn recording() -> Recording {
    let actions = normals(3, ROWS * ACTION).into_iter().map(|action| action.clamp(-1.0, 1.0)).collect();
    Recording {
        state_dim: STATE,
        action_dim: ACTION,
        observations: normals(1, ROWS * STATE),
        next_observations: normals(2, ROWS * STATE),
        actions,
        rewards: normals(4, ROWS),
        costs: (0..ROWS).map(|row| if row % 10 == 0 { 1.0 } else { 0.0 }).collect(),
        terminals: vec![false; ROWS],
        timeouts: (1..=ROWS).map(|row| row % EPISODE == 0).collect(),
        sha256: [0; 32],
    }
}

fn normals(stream: u32, len: usize) -> Vec<f32> {
    let mut draws = vec![0.0; len];
    Noise::new(0).fill_normal(stream, 0, &mut draws);
    draws
}
