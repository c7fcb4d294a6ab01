//! The command-line program `armor-train`.

use std::process::ExitCode;

fn main() -> ExitCode {
    armor_train::cli::main()
}
