//! What only holds across crates: `tests/across/` proves it, and this library is empty.
//!
//! What holds within a crate is tested there, beside the code or in its
//! `tests` folder; `run.sh` runs all of it, `mcu.sh` the proof that the
//! controller needs neither a standard library nor an allocator.

#![forbid(unsafe_code)]
