//! Recordings longer than what is decoded at a time, stored in chunks that are
//! compressed, as h5py does.

use std::io::Cursor;

use armor_train::data::{Dataset, Fault, Key};
use hdf5_pure::FileBuilder;

/// Rows, in trajectories of [`EPISODE`], and entries of a state: two blocks and a part.
const ROWS: usize = 300_000;
const EPISODE: usize = 1000;
const WIDTH: usize = 8;

fn state(row: usize) -> [f32; WIDTH] {
    std::array::from_fn(|entry| (row % 512) as f32 + entry as f32)
}

/// A recording whose next states follow on, but for the row `gap`; `chunks` are rows of a chunk of
/// observations and next observations.
fn read(gap: usize, odd: f32, chunks: [u64; 2]) -> Result<Dataset, Fault> {
    let mut nexts: Vec<f32> = (1..=ROWS).flat_map(state).collect();
    nexts[gap * WIDTH] = odd;
    let (n, width) = (ROWS as u64, WIDTH as u64);
    let mut file = FileBuilder::new();
    let observations: Vec<f32> = (0..ROWS).flat_map(state).collect();
    for (name, values, rows) in [("observations", &observations, chunks[0]), ("next_observations", &nexts, chunks[1])] {
        let data = file.create_dataset(name).with_f32_data(values).with_shape(&[n, width]);
        data.with_chunks(&[rows, 5]).with_deflate(1);
    }
    file.create_dataset("actions").with_f32_data(&vec![0.5; ROWS]).with_shape(&[n, 1]);
    file.create_dataset("rewards").with_f32_data(&(0..ROWS).map(|row| row as f32).collect::<Vec<_>>());
    file.create_dataset("costs").with_f32_data(&vec![0.0; ROWS]);
    file.create_dataset("terminals").with_u8_data(&vec![0; ROWS]);
    let ends: Vec<u8> = (1..=ROWS).map(|row| u8::from(row.is_multiple_of(EPISODE))).collect();
    file.create_dataset("timeouts").with_u8_data(&ends);
    Dataset::from_reader(Cursor::new(file.finish().unwrap()))
}

#[test]
fn a_long_recording_is_read_alike_whatever_its_chunks() {
    // Chunks that divide a block, that do not, and one that is longer than a block.
    for chunks in [[1024, 1024], [1000, 777], [200_000, 33]] {
        let dataset = read(250_001, -1.0, chunks).unwrap();
        assert_eq!((dataset.len(), dataset.trajectories().len()), (ROWS, ROWS / EPISODE));
        assert_eq!(dataset.gaps().collect::<Vec<_>>(), [250_001]);
        for row in 0..ROWS {
            let mut next = state(row + 1);
            if row == 250_001 {
                next[0] = -1.0;
            }
            assert_eq!((dataset.observation(row), dataset.next_observation(row)), (&state(row)[..], &next[..]));
            assert_eq!(dataset.reward(row), row as f32);
        }
    }
}

#[test]
fn a_bad_value_behind_the_first_block_is_found_in_its_row() {
    let fault = read(299_998, f32::NAN, [1000, 777]).unwrap_err();
    assert_eq!(fault, Fault::NotFinite { key: Key::NextObservations, row: 299_998, count: 1 });
}
