//! The command-line program `armor-train`.

use std::process::ExitCode;

/// Puts what a chain remembers on huge pages, where the kernel gives them on request.
#[global_allocator]
static ALLOCATOR: mimalloc::MiMalloc = mimalloc::MiMalloc;

fn main() -> ExitCode {
    armor_train::cli::main()
}
