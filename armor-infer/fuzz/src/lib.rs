//! What the fuzzer runs, one module a target; `firmware-sim/tests/fuzz_corpus.rs`
//! runs the same on the kept corpus, in the ordinary suite.
//!
//! ```text
//! cargo install cargo-fuzz
//! cd armor-infer && cargo +nightly fuzz run TARGET
//! ```

pub mod controller;
#[allow(dead_code)]
#[path = "../../src/fixture.rs"]
mod fixture;
mod flash;
pub mod image;
mod input;
pub mod journal;
pub mod link;

// The fixture finds them at the root of its crate.
use armor_infer::{Controller, Policy};
