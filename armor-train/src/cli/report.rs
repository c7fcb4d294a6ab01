//! `armor-train report`

use std::fmt;
use std::path::PathBuf;

use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use serde::Serialize;

use crate::report::{RunFolder, page};

/// Draw what a run measured: one page of HTML that needs nothing but itself.
///
/// The run may still be training; its metrics are written every 100 steps.
#[derive(Debug, clap::Args)]
pub(super) struct Report {
    /// Folder of a run.
    dir: PathBuf,
    /// The page to write.
    #[arg(short, long, value_name = "FILE.html")]
    output: PathBuf,
}

#[derive(Serialize)]
struct Written {
    page: PathBuf,
    page_bytes: usize,
    steps: u64,
    alarms: usize,
}

impl Report {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let run = RunFolder::read(&self.dir)?;
        let page = page(&run);
        file::write(&self.output, page.as_bytes())?;
        output.report(&Written {
            page: self.output,
            page_bytes: page.len(),
            steps: run.steps(),
            alarms: run.alarms.len(),
        })
    }
}

impl fmt::Display for Written {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "page                {}", self.page.display())?;
        writeln!(f, "size                {:>10} bytes", self.page_bytes)?;
        writeln!(f, "trained             {:>10} steps", self.steps)?;
        write!(f, "alarms              {:>10}", self.alarms)
    }
}
