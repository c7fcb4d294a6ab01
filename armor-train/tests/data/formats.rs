//! The kinds of file that occur: what h5py writes, and every type and shape of a column.

use armor_train::data::Dataset;

use crate::table::{ROWS, Table, Values};
use crate::{contents, fixture};

/// The values are the formulas of `small.py`; the last 3 of its 12 rows have no end.
#[test]
fn a_file_of_h5py_is_read_exactly() {
    let dataset = Dataset::read(&fixture("small.hdf5")).unwrap();
    let state = |t: usize| [t as f32 / 8.0, (t * t) as f32, -(t as f32)];
    assert_eq!((dataset.state_dim(), dataset.action_dim()), (3, 2));
    assert_eq!((dataset.len(), dataset.after_last_end()), (9, 3));
    for row in 0..9 {
        assert_eq!(dataset.observation(row), state(row));
        assert_eq!(dataset.next_observation(row), state(row + 1));
        assert_eq!(dataset.action(row), [row as f32 / 16.0, -(row as f32) / 16.0]);
        assert_eq!(dataset.reward(row), row as f32 / 4.0);
        assert_eq!(dataset.cost(row), if row % 3 == 0 { 1.0 } else { 0.0 });
        assert_eq!(dataset.done(row), row == 3 || row == 8);
    }
}

/// The same data in the file format of HDF5 1.10 to 1.14: other structures throughout, with checksums.
#[test]
fn a_newer_file_of_h5py_holds_the_same() {
    let [old, new] = ["small.hdf5", "small-v114.hdf5"].map(|name| Dataset::read(&fixture(name)).unwrap());
    assert_eq!(contents(&old), contents(&new));
}

/// `sha256sum small.hdf5`
#[test]
fn the_hash_is_that_of_the_file() {
    let dataset = Dataset::read(&fixture("small.hdf5")).unwrap();
    let hex: String = dataset.sha256().iter().map(|byte| format!("{byte:02x}")).collect();
    assert_eq!(hex, "be7bbf96b42e4d7632472b5cb5cfbb851a31bf0a929e8a99e4db58e7d769d114");
}

#[test]
fn flags_of_every_kind_and_shape_mean_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let read = |table: Table| {
        let dataset = Dataset::read(&table.write(folder.path(), "flags.hdf5")).unwrap();
        (0..dataset.len()).map(|row| dataset.done(row)).collect::<Vec<_>>()
    };
    let n = ROWS as u64;
    let kinds: [fn() -> Values; 5] = [
        || Values::U8(vec![0, 0, 0, 0, 0, 1]),
        || Values::I8(vec![0, 0, 0, 0, 0, 1]),
        || Values::F32(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        || Values::F64(vec![0.0, 0.0, 0.0, 0.0, 0.0, 1.0]),
        || Values::Bool(vec![false, false, false, false, false, true]),
    ];
    for kind in kinds {
        for shape in [vec![n], vec![n, 1]] {
            // The other of the two marks row 2, or 5.
            let timeouts = read(Table::sound().with("timeouts", &shape, kind()));
            assert_eq!(timeouts, [false, false, true, false, false, true]);
            let terminals = read(Table::sound().with("terminals", &shape, kind()));
            assert_eq!(terminals, [false, false, false, false, false, true]);
        }
    }
}

#[test]
fn numbers_of_every_kind_and_shape_mean_the_same() {
    let folder = tempfile::tempdir().unwrap();
    let read = |table: Table| Dataset::read(&table.write(folder.path(), "numbers.hdf5")).unwrap();
    let costs = |shape: &[u64], values| {
        let dataset = read(Table::sound().with("costs", shape, values));
        (0..dataset.len()).map(|row| dataset.cost(row)).collect::<Vec<_>>()
    };
    let expected = [1.0f32, 0.0, 0.25, 0.0, 1.0, 0.0];
    let n = ROWS as u64;
    assert_eq!(costs(&[n], Values::F32(expected.to_vec())), expected);
    assert_eq!(costs(&[n, 1], Values::F32(expected.to_vec())), expected);
    assert_eq!(costs(&[n], Values::F64(expected.map(f64::from).to_vec())), expected);
    assert_eq!(costs(&[n, 1], Values::F32BigEndian(expected.to_vec())), expected);
}
