//! Every fault, by a file that has it; the whole report of a file with several.

use std::path::Path;

use armor_train::data::{Dataset, Fault, Key, Report, Warning, check};
use tempfile::TempDir;

use crate::fixture;
use crate::table::{ROWS, Table, Values};

const N: u64 = ROWS as u64;

/// The one fault of a table, from the reader and from the validator alike.
#[track_caller]
fn fault(table: Table) -> Fault {
    let folder = TempDir::new().unwrap();
    fault_of(&table.write(folder.path(), "spoilt.hdf5"))
}

#[track_caller]
fn fault_of(path: &Path) -> Fault {
    let error = Dataset::read(path).unwrap_err();
    assert_eq!(error.file, path);
    assert!(error.to_string().starts_with(&format!("{}: ", path.display())));
    let report = check(path);
    assert!(!report.is_sound());
    assert_eq!(report.faults, std::slice::from_ref(&error.fault));
    error.fault
}

fn report(table: Table, name: &str) -> Report {
    let folder = TempDir::new().unwrap();
    check(&table.write(folder.path(), name))
}

#[test]
fn a_sound_file_has_neither_fault_nor_warning() {
    let report = report(Table::sound(), "sound.hdf5");
    assert!(report.is_sound());
    assert_eq!((report.faults, report.warnings), (vec![], vec![]));
    assert_eq!((report.transitions, report.trajectories), (6, 2));
}

#[test]
fn a_file_that_is_not_there() {
    assert_eq!(fault_of(Path::new("no/such/file.hdf5")), Fault::NotFound);
}

#[test]
fn a_folder_cannot_be_read() {
    let folder = TempDir::new().unwrap();
    assert!(matches!(fault_of(folder.path()), Fault::Unreadable { .. }));
}

#[test]
fn a_file_of_another_format() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("observations.csv");
    std::fs::write(&path, "t,x\n0,1\n").unwrap();
    assert_eq!(fault_of(&path), Fault::NotHdf5 { bytes: 8 });
    std::fs::write(&path, "").unwrap();
    assert_eq!(fault_of(&path), Fault::NotHdf5 { bytes: 0 });
}

#[test]
fn a_missing_data_set_is_named_with_those_that_are_there() {
    for key in Key::ALL {
        let Fault::MissingKey { key: missing, mut present } = fault(Table::sound().without(key.name())) else {
            panic!("{key}");
        };
        assert_eq!(missing, key);
        let mut expected: Vec<_> = Key::ALL.into_iter().filter(|&other| other != key).map(Key::name).collect();
        present.sort();
        expected.sort();
        assert_eq!(present, expected);
    }
}

#[test]
fn a_group_is_no_data_set() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("group.hdf5");
    let mut file = Table::sound().without("observations").build();
    let mut group = file.create_group("observations");
    group.create_dataset("camera").with_f32_data(&[0.0; ROWS]);
    file.add_group(group.finish());
    file.write(&path).unwrap();
    assert!(matches!(fault_of(&path), Fault::MissingKey { key: Key::Observations, .. }));
}

#[test]
fn a_shape_that_is_no_row_per_transition() {
    let zeros = |count: u64| Values::F32(vec![0.0; count as usize]);
    for (key, shape) in [
        (Key::Observations, vec![N * 3]),
        (Key::Observations, vec![N, 1025]),
        (Key::Actions, vec![N, 2, 1]),
        (Key::Actions, vec![N, 65]),
        (Key::Rewards, vec![N, 2]),
        (Key::Costs, vec![1, N]),
    ] {
        let table = Table::sound().with(key.name(), &shape, zeros(shape.iter().product()));
        assert_eq!(fault(table), Fault::WrongShape { key, shape });
    }
}

#[test]
fn a_type_that_is_no_number_or_no_flag() {
    let text = Table::sound().with("rewards", &[N], Values::Text(vec!["a"; ROWS]));
    assert!(matches!(fault(text), Fault::UnsupportedType { key: Key::Rewards, .. }));
    let whole = Table::sound().with("costs", &[N], Values::I32(vec![0; ROWS]));
    assert_eq!(fault(whole), Fault::UnsupportedType { key: Key::Costs, found: "i32".to_owned() });
    let wide = Table::sound().with("timeouts", &[N], Values::I32(vec![1; ROWS]));
    assert_eq!(fault(wide), Fault::UnsupportedType { key: Key::Timeouts, found: "i32".to_owned() });
}

/// One byte a value, and two in the base type: it has no meaning, and the HDF5 library never writes it.
#[test]
fn an_enumeration_that_contradicts_itself() {
    let table = Table::sound().with("timeouts", &[N], Values::TornEnum(vec![0; ROWS]));
    let reason = "`timeouts` claims 6 values but holds 3".to_owned();
    assert_eq!(fault(table), Fault::Damaged { reason });
}

/// `small.py` wrote it in the format of HDF5 2.0.
#[test]
fn a_file_format_that_is_newer_than_the_reader() {
    let report = check(&fixture("newer.hdf5"));
    assert_eq!(report.faults.len(), 7);
    for (fault, key) in report.faults.iter().zip(Key::ALL) {
        let reason = format!("`{key}`: HDF5 format error: invalid data layout version: 5");
        assert_eq!(*fault, Fault::Unsupported { reason });
    }
}

/// `small.py` wrote seven data sets of 2^40 rows and no values.
#[test]
fn more_rows_than_the_file_can_hold() {
    let report = check(&fixture("claims.hdf5"));
    assert_eq!(report.faults.len(), 7);
    for fault in report.faults {
        assert!(fault.to_string().contains("more than the file can hold"), "{fault}");
    }
}

#[test]
fn the_data_set_of_another_length_is_the_one_that_is_named() {
    for key in [Key::Observations, Key::Actions, Key::Rewards, Key::Timeouts] {
        let (shape, count) = match key {
            Key::Observations => (vec![N - 1, 3], 15),
            Key::Actions => (vec![N - 1, 2], 10),
            _ => (vec![N - 1], 5),
        };
        let table = Table::sound().with(key.name(), &shape, Values::F32(vec![0.0; count]));
        assert_eq!(fault(table), Fault::LengthsDiffer { key, rows: N - 1, expected: N });
    }
}

#[test]
fn states_and_next_states_of_different_width() {
    let table = Table::sound().with("next_observations", &[N, 2], Values::F32(vec![0.0; 2 * ROWS]));
    assert_eq!(fault(table), Fault::WidthsDiffer { observations: 3, next_observations: 2 });
}

#[test]
fn no_transitions() {
    let table = Key::ALL.into_iter().fold(Table::sound(), |table, key| {
        let shape: &[u64] = match key {
            Key::Observations | Key::NextObservations => &[0, 3],
            Key::Actions => &[0, 2],
            _ => &[0],
        };
        table.with(key.name(), shape, Values::F32(vec![]))
    });
    assert_eq!(fault(table), Fault::Empty);
}

#[test]
fn a_value_that_is_not_finite_is_found_in_its_row() {
    for bad in [f32::NAN, f32::INFINITY, f32::NEG_INFINITY] {
        for (key, width) in
            [(Key::Observations, 3), (Key::NextObservations, 3), (Key::Actions, 2), (Key::Rewards, 1), (Key::Costs, 1)]
        {
            let mut values = vec![0.0; width * ROWS];
            values[width * 5 - 1] = bad;
            values[width * 5] = bad;
            let shape = if width == 1 { vec![N] } else { vec![N, width as u64] };
            let table = Table::sound().with(key.name(), &shape, Values::F32(values));
            assert_eq!(fault(table), Fault::NotFinite { key, row: 4, count: 2 });
        }
        let table = Table::sound().with_column("timeouts", &[0.0, bad, 0.0, 0.0, 0.0, 1.0]);
        assert_eq!(fault(table), Fault::NotFinite { key: Key::Timeouts, row: 1, count: 1 });
    }
    let mut beyond = vec![0.0; ROWS];
    beyond[3] = 1e300;
    let table = Table::sound().with("rewards", &[N], Values::F64(beyond));
    assert_eq!(fault(table), Fault::NotFinite { key: Key::Rewards, row: 3, count: 1 });
}

#[test]
fn a_cost_that_no_budget_can_count() {
    let table = Table::sound().with_column("costs", &[0.0, 0.0, -1.0, 0.0, -2.0, 0.0]);
    assert_eq!(fault(table), Fault::CostOutOfRange { row: 2, value: -1.0, count: 2 });
    let table = Table::sound().with_column("costs", &[0.0, 65536.0, 1e9, 0.0, 0.0, 0.0]);
    assert_eq!(fault(table), Fault::CostOutOfRange { row: 2, value: 1e9, count: 1 });
}

#[test]
fn an_action_is_clipped_within_rounding_and_refused_beyond() {
    let actions = |entry: f32| {
        let mut values = vec![0.0; 2 * ROWS];
        values[7] = entry;
        Table::sound().with("actions", &[N, 2], Values::F32(values))
    };
    for bad in [1.0011, -1.0011, 7.0] {
        assert_eq!(fault(actions(bad)), Fault::ActionOutOfRange { row: 3, value: bad, count: 1 });
    }
    let folder = TempDir::new().unwrap();
    for (recorded, kept) in [(1.0009, 1.0), (-1.0009, -1.0), (0.75, 0.75)] {
        let dataset = Dataset::read(&actions(recorded).write(folder.path(), "actions.hdf5")).unwrap();
        assert_eq!(dataset.action(3), [0.0, kept]);
    }
}

#[test]
fn a_flag_between_yes_and_no() {
    let table = Table::sound().with_column("terminals", &[0.0, 0.0, 1.0, 0.5, 0.0, 0.0]);
    assert_eq!(fault(table), Fault::InvalidFlag { key: Key::Terminals, row: 3, value: 0.5, count: 1 });
    let table = Table::sound().with("timeouts", &[N], Values::I8(vec![0, -1, 0, 0, 2, 1]));
    assert_eq!(fault(table), Fault::InvalidFlag { key: Key::Timeouts, row: 1, value: -1.0, count: 2 });
}

#[test]
fn no_episode_end() {
    let none = || Values::Bool(vec![false; ROWS]);
    let table = Table::sound().with("terminals", &[N], none()).with("timeouts", &[N], none());
    assert_eq!(fault(table), Fault::NoEpisodeEnd { rows: ROWS });
}

#[test]
fn the_report_names_every_fault_at_once() {
    let table = Table::sound()
        .without("next_observations")
        .with_column("rewards", &[0.0, f32::NAN, 0.0, 0.0, f32::NAN, 0.0])
        .with_column("costs", &[-1.0, f32::INFINITY, 0.0, 0.0, 0.0, 0.0])
        .with("actions", &[2, 3], Values::F32(vec![9.0; 6]))
        .with("timeouts", &[N], Values::I32(vec![1; ROWS]));
    let report = report(table, "SafetyBallRun-v0-80-940.hdf5");
    let [missing, rest @ ..] = &report.faults[..] else { panic!("{report}") };
    assert!(matches!(missing, Fault::MissingKey { key: Key::NextObservations, .. }));
    assert_eq!(
        rest,
        [
            Fault::UnsupportedType { key: Key::Timeouts, found: "i32".to_owned() },
            Fault::LengthsDiffer { key: Key::Actions, rows: 2, expected: N },
            Fault::NotFinite { key: Key::Rewards, row: 1, count: 2 },
            Fault::NotFinite { key: Key::Costs, row: 1, count: 1 },
            Fault::CostOutOfRange { row: 0, value: -1.0, count: 1 },
        ]
    );
    assert_eq!(report.warnings, []);
    assert_eq!(report.to_string().lines().count(), 7);
}

#[test]
fn a_report_is_plain_json() {
    let report = report(Table::sound().with_column("costs", &[0.0, -1.0, 0.0, 0.0, 0.0, 0.0]), "spoilt.hdf5");
    let json = serde_json::to_value(&report).unwrap();
    assert_eq!(
        json["faults"],
        serde_json::json!([{
            "fault": "cost_out_of_range", "row": 1, "value": -1.0, "count": 1,
            "message": "`costs` row 1 is -1 (1 in all); a cost is at least 0 and at most 65536",
        }])
    );
}

#[test]
fn what_a_sound_file_is_warned_of() {
    let file = fixture("small.hdf5");
    assert_eq!(check(&file).warnings, [Warning::UnfinishedTrajectory { rows: 3 }]);

    let next = (1..=ROWS).flat_map(|t| [t as f32 / 8.0, (t * t) as f32, -(t as f32)]).collect();
    let table = Table::sound().with("next_observations", &[N, 3], Values::F32(next));
    // Rows 2 and 5 end a trajectory: whatever follows them is right.
    assert_eq!(report(table, "gaps.hdf5").warnings, [Warning::NextObservationsDiffer { row: 0, count: 4 }]);

    let mut observations: Vec<f32> = (0..3 * ROWS).map(|entry| entry as f32).collect();
    observations.chunks_mut(3).for_each(|state| state[1] = 9.81);
    let next = [&observations[3..], &[1.0, 2.0, 3.0]].concat();
    let table = Table::sound().with("observations", &[N, 3], Values::F32(observations)).with(
        "next_observations",
        &[N, 3],
        Values::F32(next),
    );
    assert_eq!(report(table, "constant.hdf5").warnings, [Warning::ConstantState { entries: vec![1] }]);
}

/// The sound table has 2 trajectories; the larger cost return is 3.
#[test]
fn a_file_name_of_the_published_form_is_held_to_its_facts() {
    let warnings = |name| report(Table::sound(), name).warnings;
    assert_eq!(warnings("SafetyBallRun-v0-3-2.hdf5"), []);
    for other in ["my-run-80-940.hdf5", "my-video-80-940.hdf5", "SafetyBallRun-v0-80.hdf5"] {
        assert_eq!(warnings(other), [], "{other}");
    }
    assert_eq!(
        warnings("SafetyBallRun-v0-80-940.hdf5"),
        [Warning::NamedTrajectories { named: 940, found: 2 }, Warning::NamedMaxCost { named: 80.0, found: 3.0 },]
    );
}
