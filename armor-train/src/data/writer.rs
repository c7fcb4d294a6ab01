//! Writes a recording in the DSRL layout.

use hdf5_pure::FileBuilder;

use super::key::Key;
use super::recording::Recording;

/// The bytes of an HDF5 file that [`Dataset::read`](super::Dataset::read) takes; flags are one byte each.
///
/// # Errors
/// What the HDF5 library says of shapes that it cannot write.
pub fn to_hdf5(recording: &Recording) -> Result<Vec<u8>, hdf5_pure::Error> {
    let rows = recording.rewards.len() as u64;
    let mut file = FileBuilder::new();
    for key in Key::ALL {
        let data = file.create_dataset(key.name());
        let flags = |flags: &[bool]| flags.iter().map(|&flag| u8::from(flag)).collect::<Vec<u8>>();
        let (data, width) = match key {
            Key::Observations => (data.with_f32_data(&recording.observations), Some(recording.state_dim)),
            Key::NextObservations => (data.with_f32_data(&recording.next_observations), Some(recording.state_dim)),
            Key::Actions => (data.with_f32_data(&recording.actions), Some(recording.action_dim)),
            Key::Rewards => (data.with_f32_data(&recording.rewards), None),
            Key::Costs => (data.with_f32_data(&recording.costs), None),
            Key::Terminals => (data.with_u8_data(&flags(&recording.terminals)), None),
            Key::Timeouts => (data.with_u8_data(&flags(&recording.timeouts)), None),
        };
        match width {
            Some(width) => data.with_shape(&[rows, width as u64]),
            None => data.with_shape(&[rows]),
        };
    }
    file.finish()
}

#[cfg(test)]
mod tests {
    use std::io::Cursor;

    use super::*;
    use crate::data::Dataset;

    #[test]
    fn what_is_written_is_read_back() {
        let recording = Recording {
            state_dim: 2,
            action_dim: 1,
            observations: vec![0.0, 0.5, 1.0, 1.5],
            next_observations: vec![1.0, 1.5, 2.0, 2.5],
            actions: vec![-1.0, 0.25],
            rewards: vec![3.0, -4.0],
            costs: vec![0.0, 1.0],
            terminals: vec![false, false],
            timeouts: vec![false, true],
            sha256: [0; 32],
        };
        let read = Dataset::from_reader(Cursor::new(to_hdf5(&recording).unwrap())).unwrap();
        assert_eq!(Dataset::new(Recording { sha256: *read.sha256(), ..recording }).unwrap(), read);
    }
}
