//! The command line: `firmware-sim COMMAND`.

mod bench;
mod boards;
mod budgets;
mod flash;
mod inspect;
mod mcu;
pub mod output;
mod round_trip;
mod run;
mod serve;
mod soak;
mod subject;
mod sweep;
mod trace;
mod verify;

use std::process::ExitCode;

use armor_core::schedule::Sampler;
use armor_core::units::CostLimit;
use clap::{Parser, Subcommand};

use crate::board::{Board, UnknownBoard};
use crate::host::CANDIDATES;
use crate::summary::HOST;
use crate::task::{Task, TaskError};
use output::{CommandResult, Output};

/// Inspect, verify, flash and fly ARMOR policy images.
#[derive(Debug, Parser)]
#[command(name = "firmware-sim", version, max_term_width = 80)]
struct Cli {
    /// Print one JSON object as the last line of stdout, and nothing else there.
    #[arg(long, global = true)]
    json: bool,
    #[command(subcommand)]
    command: Command,
}

#[derive(Debug, Subcommand)]
enum Command {
    Inspect(inspect::Inspect),
    Verify(verify::Verify),
    Trace(trace::Trace),
    Flash(flash::Flash),
    Run(run::Run),
    Sweep(sweep::Sweep),
    Soak(soak::Soak),
    Bench(bench::Bench),
    Serve(serve::Serve),
    Mcu(mcu::Mcu),
    Budgets(budgets::Budgets),
}

/// Runs the command of the process's arguments.
pub fn main() -> ExitCode {
    let cli = Cli::parse();
    let output = Output::new(cli.json);
    output::exit(match cli.command {
        Command::Inspect(command) => command.run(output),
        Command::Verify(command) => command.run(output),
        Command::Trace(command) => command.run(output),
        Command::Flash(command) => command.run(output),
        Command::Run(command) => command.run(output),
        Command::Sweep(command) => command.run(output),
        Command::Soak(command) => command.run(output),
        Command::Bench(command) => command.run(output),
        Command::Serve(command) => command.run(output),
        Command::Mcu(command) => command.run(output),
        Command::Budgets(command) => command.run(output),
    })
}

/// What computes the actions: this host, or a board.
type BoardChoice = Option<&'static Board>;

/// A board's name as an argument.
fn board(name: &str) -> Result<BoardChoice, UnknownBoard> {
    if name == HOST { Ok(None) } else { Board::named(name).map(Some) }
}

/// A task's name as an argument.
fn task(name: &str) -> Result<&'static Task, TaskError> {
    Task::named(name)
}

/// A cost limit as an argument.
///
/// # Errors
/// What is wrong with the text, for clap to show.
pub fn limit(text: &str) -> Result<CostLimit, Box<dyn std::error::Error + Send + Sync>> {
    Ok(CostLimit::new(text.parse()?)?)
}

/// A number of candidates as an argument.
///
/// # Errors
/// What is wrong with the text, for clap to show.
pub fn candidates(text: &str) -> Result<u8, Box<dyn std::error::Error + Send + Sync>> {
    let candidates = text.parse()?;
    if !CANDIDATES.contains(&candidates) {
        return Err("the best of 1, 2, 4, 8 or 16 candidates can be taken".into());
    }
    Ok(candidates)
}

/// A failure where anything was found that no fault may bring about.
fn unbroken(actions_out_of_range: u64, budget_errors: u64) -> CommandResult {
    match (actions_out_of_range, budget_errors) {
        (0, 0) => Ok(()),
        (range, budget) => {
            Err(format!("{range} actions out of range and {budget} budget errors; do not fly this, report it").into())
        }
    }
}

/// A sampler as reports write it.
const fn sampler_name(sampler: Sampler) -> &'static str {
    match sampler {
        Sampler::Ddpm => "DDPM",
        Sampler::Ddim => "DDIM",
    }
}

#[cfg(test)]
mod tests {
    use clap::CommandFactory;

    use super::*;

    #[test]
    fn the_command_line_is_consistent() {
        Cli::command().debug_assert();
    }
}
