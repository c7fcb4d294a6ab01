//! Policies of the paper's largest size (state 60, action 2, hidden 256, 20
//! steps) for `firmware-sim bench`: one in each precision and layout, without and
//! with its critic. What an action takes does not depend on the weights, so they
//! are trained only until actions lie within their bounds, where other runtimes
//! can be compared (`bench/latency.py`). STATE and HIDDEN make it another size.
//!
//! ```text
//! cargo run --release -p armor-train --example sized_policies -- FOLDER [STATE HIDDEN]
//! ```

use std::error::Error;
use std::path::PathBuf;

use armor_core::image::{Layout, PolicyImage, Precision};
use armor_core::noise::Noise;
use armor_train::config::Preset;
use armor_train::data::{Dataset, Recording};
use armor_train::export::{export, with_critic};
use armor_train::quantize::quantize;
use armor_train::run::{Checkpoint, Watch, Window, fit};

const ACTION: usize = 2;
/// Rows of the synthetic recording, in episodes of 100.
const ROWS: usize = 2000;
const EPISODE: usize = 100;
/// Steps of the training, and rows in each.
const STEPS: u64 = 400;
const BATCH: usize = 64;

fn main() -> Result<(), Box<dyn Error>> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let folder = PathBuf::from(arguments.first().ok_or("name a folder")?);
    let size = |at: usize, usual: usize| arguments.get(at).map_or(Ok(usual), |size| size.parse());
    let (state, hidden) = (size(1, 60)?, size(2, 256)?);
    let data = Dataset::new(recording(state))?;
    let mut config = Preset::Paper.config("bench", 5.0);
    (config.steps, config.batch, config.hidden) = (STEPS, BATCH, hidden);
    let run = folder.join("run");
    fit(&config, &data, &run, false, &mut Unwatched)?;
    let checkpoint = Checkpoint::read(&run)?;
    let exported = export(&checkpoint, &data, None)?;
    let float = PolicyImage::new_checked(exported.bytes.as_slice())?;
    let write = |name: &str, bytes: &[u8]| -> Result<(), Box<dyn Error>> {
        std::fs::write(folder.join(format!("{name}.armor")), bytes)?;
        let critic = with_critic(&PolicyImage::new_checked(bytes)?, &checkpoint)?;
        Ok(std::fs::write(folder.join(format!("{name}-critic.armor")), critic.as_slice())?)
    };
    write("f32", exported.bytes.as_slice())?;
    for (precision, layout, name) in [
        (Precision::Int16x8, Layout::Rows, "int16x8"),
        (Precision::Int16x8, Layout::Paired, "int16x8-paired"),
        (Precision::Int8, Layout::Rows, "int8"),
        (Precision::Int8, Layout::Paired, "int8-paired"),
    ] {
        write(name, quantize(&float, &data, precision, layout)?.bytes.as_slice())?;
    }
    Ok(())
}

struct Unwatched;

impl Watch for Unwatched {
    fn step(&mut self, _: u64, _: &Window) {}

    fn wants_stop(&self) -> bool {
        false
    }
}

fn recording(state_dim: usize) -> Recording {
    let normals = |stream: u32, count: usize| {
        let mut values = vec![0.0; count];
        Noise::new(1).fill_normal(stream, 0, &mut values);
        values
    };
    Recording {
        state_dim,
        action_dim: ACTION,
        sha256: [0; 32],
        observations: normals(0, ROWS * state_dim),
        next_observations: normals(1, ROWS * state_dim),
        actions: normals(2, ROWS * ACTION).into_iter().map(|value| value.clamp(-1.0, 1.0)).collect(),
        rewards: normals(3, ROWS),
        costs: normals(4, ROWS).into_iter().map(|value| if value > 1.0 { 1.0 } else { 0.0 }).collect(),
        terminals: vec![false; ROWS],
        timeouts: (0..ROWS).map(|row| (row + 1) % EPISODE == 0).collect(),
    }
}
