//! `firmware-sim budgets`

use std::collections::BTreeMap;
use std::fmt;
use std::path::{Path, PathBuf};
use std::time::Duration;

use serde::Serialize;

use super::mcu::{Machines, machines};
use super::output::{CommandResult, Output};
use crate::file;
use crate::mcu::record::{self, Action, Record};
use crate::mcu::{Change, Firmware, SIZES, changes, measure};

/// Of the sizes that are recorded, those that a check counts again.
const CHECKED: [usize; 2] = [0, 2];

/// Hold the instructions of an action on emulated microcontrollers to what is
/// recorded, for each number format: a change beyond 1 % fails. Kernels in
/// assembly are compared with the portable ones on the machine before.
///
/// Random policies are counted, of the paper's size (hidden 256, 20 steps) and
/// of a smaller one (hidden 128, 5 steps). The firmware is built first where
/// its source has changed.
#[derive(Debug, clap::Args)]
pub(super) struct Budgets {
    /// The emulated board, or `all` of them.
    #[arg(long, value_name = "M", value_parser = machines, default_value = "all")]
    machine: Machines,
    /// A folder with built firmware, MACHINE-check.elf, in place of building it.
    #[arg(long, value_name = "DIR")]
    firmware: Option<PathBuf>,
    /// Record what was counted, in firmware-sim/mcu/instructions.csv, in place
    /// of comparing; the model of boards is made of it.
    #[arg(long)]
    renew: bool,
    /// Seconds that the emulator may take for an action.
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
}

/// Instructions of an action; text is 80 columns wide.
#[derive(Serialize)]
struct Row {
    machine: String,
    format: String,
    hidden: u16,
    steps: u16,
    instructions: f64,
    recorded: Option<f64>,
}

#[derive(Serialize)]
struct Report {
    actions: Vec<Row>,
}

impl Budgets {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let old = if self.renew { BTreeMap::new() } else { record::recorded().clone() };
        let sizes: Vec<_> = if self.renew { SIZES.to_vec() } else { CHECKED.map(|size| SIZES[size]).to_vec() };
        let mut counted = BTreeMap::new();
        for machine in self.machine.0 {
            output.note(format_args!("{}: firmware", machine.name));
            let firmware = match &self.firmware {
                None => Firmware::build_with_check(machine)?,
                Some(folder) => Firmware::read(&folder.join(format!("{}-check.elf", machine.name)))?,
            };
            output.note(format_args!("{}: counting", machine.name));
            counted.extend(measure(machine, &firmware, &sizes, Duration::from_secs(self.patience))?);
        }
        output.report(&Report::new(&old, &counted))?;
        if self.renew {
            return renew(counted);
        }
        match changes(&old, &counted).as_slice() {
            [] => Ok(()),
            changes => Err(refusal(changes).into()),
        }
    }
}

/// Puts what was counted among the records of the source tree.
fn renew(counted: BTreeMap<Action, Record>) -> CommandResult {
    let path = Path::new(record::FILE);
    let bytes = file::read(path)?;
    let mut records = record::parse(&String::from_utf8_lossy(&bytes)).unwrap_or_default();
    records.extend(counted);
    Ok(file::write(path, record::to_text(&records).as_bytes())?)
}

fn refusal(changes: &[Change]) -> String {
    let Change { action: Action { machine, format, hidden, steps }, recorded, counted } = &changes[0];
    let was = recorded.map_or("nothing is recorded".into(), |recorded| format!("{recorded:.0} are recorded"));
    let others = match changes.len() - 1 {
        0 => String::new(),
        others => format!(" ({others} more)"),
    };
    format!(
        "{machine}, {format}, hidden {hidden}, {steps} steps: {counted:.0} instructions, and {was}{others}; \
         if the change is meant, record it by firmware-sim budgets --renew"
    )
}

impl Report {
    fn new(old: &BTreeMap<Action, Record>, counted: &BTreeMap<Action, Record>) -> Self {
        let row = |(action, record): (&Action, &Record)| Row {
            machine: action.machine.clone(),
            format: action.format.clone(),
            hidden: action.hidden,
            steps: action.steps,
            instructions: record.instructions(),
            recorded: old.get(action).map(Record::instructions),
        };
        Self { actions: counted.iter().map(row).collect() }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "machine      format          hidden  steps  instructions    recorded    change")?;
        for Row { machine, format, hidden, steps, instructions, recorded } in &self.actions {
            write!(f, "\n{machine:<13}{format:<15}{hidden:>7}{steps:>7}{instructions:>14.0}")?;
            if let Some(recorded) = recorded {
                write!(f, "{recorded:>12.0}{:>+8.2} %", 100.0 * (instructions / recorded - 1.0))?;
            }
        }
        Ok(())
    }
}
