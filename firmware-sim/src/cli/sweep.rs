//! `firmware-sim sweep`

use std::fmt::{self, Write};
use std::path::PathBuf;

use serde::Serialize;

use super::output::{CommandResult, Output};
use super::subject::Subject;
use crate::fault::Injection;
use crate::file;
use crate::harness::sweep::{SweepPlan, SweepRow, injections, row};
use crate::image_file::ImageFile;

/// Fly an image under every fault at three severities, and tell what each does.
///
/// Fails if an action out of range comes to the actuators, or a budget is
/// larger than it may be.
#[derive(Debug, clap::Args)]
pub(super) struct Sweep {
    #[command(flatten)]
    subject: Subject,
    /// Seeds, each with a chip of its own.
    #[arg(long, default_value_t = 5, value_parser = clap::value_parser!(u32).range(1..))]
    seeds: u32,
    /// Episodes of a seed.
    #[arg(long, default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..))]
    episodes: u32,
    /// The first seed.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Only this fault, or this fault at this severity; as often as you like.
    #[arg(long, value_name = "NAME[=SEVERITY]")]
    fault: Vec<Injection>,
    /// Write the table to this file as well, in Markdown.
    #[arg(short, long, value_name = "FILE")]
    output: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    task: &'static str,
    board: &'static str,
    cost_limit: f32,
    rows: Vec<SweepRow>,
}

impl Sweep {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.subject.image)?;
        let image = file.image()?;
        let plan = self.subject.plan(self.seed, self.episodes)?;
        let sweep = SweepPlan { image: image.bytes(), plan, seeds: self.seeds, board: self.subject.board };
        let faults: Vec<_> = match self.fault.as_slice() {
            [] => injections().collect(),
            faults => std::iter::once(None).chain(faults.iter().copied().map(Some)).collect(),
        };
        let mut rows = Vec::new();
        for fault in faults {
            rows.push(row(&sweep, fault)?);
            if let Some(fault) = fault {
                output.note(format_args!("flew {fault}"));
            }
        }
        let (task, board) = (plan.task.name, self.subject.board_name());
        let report = Report { task, board, cost_limit: plan.limit.cost().to_f32(), rows };
        output.report(&report)?;
        if let Some(path) = &self.output {
            file::write(path, report.markdown().as_bytes())?;
        }
        let [range, budget] = report.violations();
        super::unbroken(range, budget)
    }
}

impl Report {
    /// Actions out of range, and budget errors.
    fn violations(&self) -> [u64; 2] {
        let sum = |of: fn(&SweepRow) -> u64| self.rows.iter().map(of).sum();
        [sum(|row| row.tally.actions_out_of_range), sum(|row| row.tally.budget_errors)]
    }

    fn markdown(&self) -> String {
        let mut text = String::from(
            "| fault | severity | reward | cost | episodes in limit | struck | noticed | out of range | budget errors |\n\
             |---|---|---|---|---|---|---|---|---|\n",
        );
        for row in &self.rows {
            let cells = Cells::new(row);
            // Writing to a string cannot fail.
            let _ = writeln!(
                text,
                "| {} | {} | {} | {} | {} of {} | {} | {} | {} | {} |",
                cells.fault,
                cells.severity,
                cells.reward,
                cells.cost,
                row.safe_episodes,
                row.episodes,
                row.tally.struck(),
                row.tally.detected,
                row.tally.actions_out_of_range,
                row.tally.budget_errors
            );
        }
        text
    }
}

/// What both tables write alike.
struct Cells {
    fault: &'static str,
    severity: String,
    reward: String,
    cost: String,
}

impl Cells {
    fn new(row: &SweepRow) -> Self {
        Self {
            fault: row.fault.map_or("none", |fault| fault.kind.name()),
            severity: row.fault.map_or(String::new(), |fault| fault.severity.to_string()),
            reward: format!("{:.3}", row.reward_normalized),
            cost: format!("{:.3}", row.cost_normalized),
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "{} on {}, cost limit {}; control steps struck and noticed",
            self.task, self.board, self.cost_limit
        )?;
        write!(f, "fault           severity  reward    cost    safe   struck  noticed range budget")?;
        for row in &self.rows {
            let Cells { fault, severity, reward, cost } = Cells::new(row);
            let safe = format!("{}/{}", row.safe_episodes, row.episodes);
            let tally = &row.tally;
            write!(
                f,
                "\n{fault:<16}{severity:>8}{reward:>8}{cost:>8}{safe:>8}{:>9}{:>9}{:>6}{:>7}",
                tally.struck(),
                tally.detected,
                tally.actions_out_of_range,
                tally.budget_errors
            )?;
        }
        Ok(())
    }
}
