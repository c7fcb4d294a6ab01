//! `firmware-sim`: inspect, verify, flash and fly ARMOR policy images.

#![forbid(unsafe_code)]

use std::process::ExitCode;

fn main() -> ExitCode {
    firmware_sim::cli::main()
}
