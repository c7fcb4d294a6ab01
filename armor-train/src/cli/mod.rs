//! The command line: `armor-train COMMAND`.

mod calibrate;
mod data;
mod evaluate;
mod export;
mod fit;
mod flyer;
mod import;
mod options;
mod progress;
mod quickstart;
mod report;
mod run_folder;
mod study;

use std::fmt::Display;
use std::process::ExitCode;

use clap::error::ErrorKind;
use clap::{CommandFactory, Parser, Subcommand};
use firmware_sim::cli::output::{self, Output};

/// Learn a safe robot policy from recorded data, and export it for a microcontroller.
#[derive(Debug, Parser)]
#[command(name = "armor-train", version, max_term_width = 80)]
struct Cli {
    /// Print one JSON object as the last line of stdout, and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Quickstart(quickstart::Quickstart),
    #[command(subcommand)]
    Data(data::Data),
    Fit(fit::Fit),
    Options(options::Options),
    Calibrate(calibrate::Calibrate),
    Export(export::Export),
    Import(import::Import),
    Evaluate(evaluate::Evaluate),
    Report(report::Report),
    Study(study::Study),
}

/// Runs the command of the process's arguments.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let output = Output::new(cli.json);
    output::exit(match cli.command {
        Command::Quickstart(command) => command.run(output),
        Command::Data(command) => command.run(output),
        Command::Fit(command) => command.run(output),
        Command::Options(command) => command.run(output),
        Command::Calibrate(command) => command.run(output),
        Command::Export(command) => command.run(output),
        Command::Import(command) => command.run(output),
        Command::Evaluate(command) => command.run(output),
        Command::Report(command) => command.run(output),
        Command::Study(command) => command.run(output),
    })
}

/// Ends the process as clap does on bad usage, where clap itself could not see it.
fn misuse(error: &dyn Display) -> ! {
    Cli::command().error(ErrorKind::ValueValidation, error).exit()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
