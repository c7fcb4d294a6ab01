//! What actions take in instructions, as the emulator counted them: the numbers
//! behind the model of boards, and the budgets that a change is held to.

use std::collections::BTreeMap;
use std::fmt::Write;
use std::sync::LazyLock;

use armor_core::image::{Layout, Precision};

use super::class::Class;

/// Where the records are kept.
pub const FILE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mcu/instructions.csv");
/// The records of this build.
const RECORDED: &str = include_str!("../../mcu/instructions.csv");

/// An action of a sized policy ([`crate::sized`]) on a machine.
#[derive(Clone, Debug, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub struct Action {
    /// The machine.
    pub machine: String,
    /// Number format and order of the weights, as `int8 paired`.
    pub format: String,
    /// Width of the hidden layers.
    pub hidden: u16,
    /// Calls of the denoiser.
    pub steps: u16,
}

/// What an action took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// Instructions, by class.
    pub classes: BTreeMap<Class, f64>,
    /// Registers that the loads of several registers loaded.
    pub loaded_registers: f64,
}

impl Record {
    /// Instructions in all.
    pub fn instructions(&self) -> f64 {
        self.classes.values().sum()
    }
}

/// The name of a number format, as in [`Action::format`].
pub fn format_name(precision: Precision, layout: Layout) -> &'static str {
    match (precision, layout) {
        (Precision::F32, _) => "f32",
        (Precision::Int16x8, Layout::Rows) => "int16x8 rows",
        (Precision::Int16x8, Layout::Paired) => "int16x8 paired",
        (Precision::Int8, Layout::Rows) => "int8 rows",
        (Precision::Int8, Layout::Paired) => "int8 paired",
    }
}

/// The records that this program was built with.
///
/// # Panics
/// Where they are not what [`to_text`] writes; a test reads them.
pub fn recorded() -> &'static BTreeMap<Action, Record> {
    static RECORDS: LazyLock<BTreeMap<Action, Record>> =
        LazyLock::new(|| parse(RECORDED).expect("the records are written by this program"));
    &RECORDS
}

/// Reads records; none if a line is not one.
pub fn parse(text: &str) -> Option<BTreeMap<Action, Record>> {
    let mut lines = text.lines();
    lines.next()?;
    lines.map(line).collect()
}

fn line(line: &str) -> Option<(Action, Record)> {
    let mut cells = line.split(',');
    let mut next = || cells.next();
    let action = Action {
        machine: next()?.into(),
        format: next()?.into(),
        hidden: next()?.parse().ok()?,
        steps: next()?.parse().ok()?,
    };
    // The sum of the classes, for readers.
    next()?.parse::<f64>().ok()?;
    let loaded_registers = next()?.parse().ok()?;
    let classes = Class::ALL.iter().map(|class| Some((*class, next()?.parse().ok()?))).collect::<Option<_>>()?;
    Some((action, Record { classes, loaded_registers }))
}

/// Writes records: a line an action.
pub fn to_text(records: &BTreeMap<Action, Record>) -> String {
    let names = Class::ALL.map(|class| class.name().replace(' ', "_").to_lowercase());
    let mut text = format!("machine,format,hidden,steps,instructions,loaded_registers,{}\n", names.join(","));
    for (Action { machine, format, hidden, steps }, record) in records {
        let total = record.instructions();
        // Writing to a string cannot fail.
        let _ = write!(text, "{machine},{format},{hidden},{steps},{total:.0},{:.0}", record.loaded_registers);
        for class in Class::ALL {
            let _ = write!(text, ",{:.0}", record.classes.get(&class).copied().unwrap_or_default());
        }
        text.push('\n');
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn what_is_recorded_reads_and_writes_back() {
        let records = recorded();
        assert!(!records.is_empty());
        assert_eq!(to_text(records).lines().count(), records.len() + 1);
        for (action, record) in parse(&to_text(records)).unwrap() {
            assert_eq!(record, records[&action], "{action:?}");
        }
        assert_eq!(parse("header\nmps2-an386,f32,256"), None);
    }
}
