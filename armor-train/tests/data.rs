//! Recorded data: the shipped file's numbers, every fault by a file that has
//! it, damaged files, and what a data set makes of any recording.

#[path = "data/blocks.rs"]
mod blocks;
#[path = "data/damage.rs"]
mod damage;
#[path = "data/dataset.rs"]
mod dataset;
#[path = "data/faults.rs"]
mod faults;
#[path = "data/formats.rs"]
mod formats;
#[path = "data/shipped.rs"]
mod shipped;
#[path = "data/table.rs"]
mod table;

use std::path::{Path, PathBuf};

use armor_train::data::Dataset;

/// A file of this folder's fixtures.
fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/data").join(name)
}

/// The recording that ships with the project.
fn shipped_file() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/ball-run-bullet.hdf5")
}

/// State, next state and action; reward and cost; the end mark.
type Row<'a> = ([&'a [f32]; 3], [f32; 2], bool);

/// All that a data set holds but the hash.
fn contents(dataset: &Dataset) -> Vec<Row<'_>> {
    let row = |row| {
        let vectors = [dataset.observation(row), dataset.next_observation(row), dataset.action(row)];
        (vectors, [dataset.reward(row), dataset.cost(row)], dataset.done(row))
    };
    (0..dataset.len()).map(row).collect()
}
