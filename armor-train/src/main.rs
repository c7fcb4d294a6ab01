//! The command-line program `armor-train`.

use std::process::ExitCode;

/// Matrices begin at a cache line.
#[global_allocator]
static ALLOCATOR: armor_train::allocator::CacheLines = armor_train::allocator::CacheLines;

fn main() -> ExitCode {
    armor_train::cli::main()
}
