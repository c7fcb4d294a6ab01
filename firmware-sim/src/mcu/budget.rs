//! Instructions of an action, held to what is recorded.

use std::collections::BTreeMap;
use std::time::Duration;

use armor_core::image::{Layout, Precision};

use super::count::count;
use super::emulator::Flashed;
use super::error::McuError;
use super::firmware::Firmware;
use super::machine::Machine;
use super::record::{Action, Record, format_name};
use crate::host;
use crate::sized;

/// How far an action's instructions may be from their record, as a share.
pub const TOLERANCE: f64 = 0.01;
/// Width of the hidden layers and calls of the denoiser of the actions that are
/// counted: the paper's size, the one that flew as well, and what tells their
/// layers, steps and beginnings apart.
/// The last is for a test of the model that the others make.
pub const SIZES: [(u16, u16); 6] = [(256, 20), (128, 20), (128, 5), (64, 5), (64, 1), (256, 5)];

/// Compares a machine's kernels with the portable ones, 300 rounds of each.
const KERNELS: &str = "kernels 300";

/// An action whose instructions are not what is recorded.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// The action.
    pub action: Action,
    /// Instructions that are recorded; none where the action is new.
    pub recorded: Option<f64>,
    /// Instructions that were counted.
    pub counted: f64,
}

/// The number formats that are counted on a machine: pairs of rows are read by
/// the 16-bit SIMD of some.
fn formats(machine: &Machine) -> Vec<(Precision, Layout)> {
    let mut formats =
        vec![(Precision::F32, Layout::Rows), (Precision::Int16x8, Layout::Rows), (Precision::Int8, Layout::Rows)];
    if machine.has_dsp() {
        formats.extend([(Precision::Int16x8, Layout::Paired), (Precision::Int8, Layout::Paired)]);
    }
    formats
}

/// Checks the kernels of a machine, then counts its actions of `sizes`.
///
/// # Errors
/// [`McuError`]; among them that a kernel's bits differ from the portable one's.
pub fn measure(
    machine: &'static Machine,
    firmware: &Firmware,
    sizes: &[(u16, u16)],
    patience: Duration,
) -> Result<BTreeMap<Action, Record>, McuError> {
    let mut records = BTreeMap::new();
    for (precision, layout) in formats(machine) {
        for &(hidden, steps) in sizes {
            let bytes = sized::policy(sized::shape(hidden), precision, layout);
            let flyable = host::check(bytes.as_slice())?;
            let flashed = Flashed::new(machine, firmware, flyable.image.bytes())?;
            if records.is_empty() && machine.has_dsp() {
                flashed.run(KERNELS, patience)?;
            }
            let counted = count(&flashed, firmware, steps.into(), 1, patience)?;
            let action =
                Action { machine: machine.name.into(), format: format_name(precision, layout).into(), hidden, steps };
            let record = Record { classes: counted.classes, loaded_registers: counted.loaded_registers };
            records.insert(action, record);
        }
    }
    Ok(records)
}

/// The actions whose instructions are off their record by more than [`TOLERANCE`].
pub fn changes(recorded: &BTreeMap<Action, Record>, counted: &BTreeMap<Action, Record>) -> Vec<Change> {
    let mut changes = Vec::new();
    for (action, record) in counted {
        let counted = record.instructions();
        let recorded = recorded.get(action).map(Record::instructions);
        if recorded.is_none_or(|recorded| (counted / recorded - 1.0).abs() > TOLERANCE) {
            changes.push(Change { action: action.clone(), recorded, counted });
        }
    }
    changes
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::mcu::Class;

    fn counted(instructions: f64) -> BTreeMap<Action, Record> {
        let action = Action { machine: "m".into(), format: "f32".into(), hidden: 1, steps: 1 };
        let classes = BTreeMap::from([(Class::Load, 0.25 * instructions), (Class::Integer, 0.75 * instructions)]);
        BTreeMap::from([(action, Record { classes, loaded_registers: 0.0 })])
    }

    #[test]
    fn a_change_beyond_one_per_cent_either_way_is_named_and_so_is_a_new_action() {
        let recorded = counted(1000.0);
        for instructions in [991.0, 1000.0, 1009.0] {
            assert_eq!(changes(&recorded, &counted(instructions)), []);
        }
        for instructions in [989.0, 1011.0] {
            let [change] = &changes(&recorded, &counted(instructions))[..] else { panic!("{instructions}") };
            assert_eq!((change.recorded, change.counted), (Some(1000.0), instructions));
        }
        assert_eq!(changes(&BTreeMap::new(), &counted(1.0))[0].recorded, None);
    }
}
