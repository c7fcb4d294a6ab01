//! All that is recorded, sound but not yet split into trajectories.

use std::io::{Read, Seek};
use std::path::Path;

use super::ending::Ending;
use super::error::Fault;
use super::hdf5::{self, Source};
use super::scan::Scan;
use super::states::States;

/// The columns of a recording of `N` rows.
pub(super) struct Columns {
    pub(super) states: States,
    pub(super) action_dim: usize,
    /// Row-major, `N * A`.
    pub(super) actions: Vec<f32>,
    pub(super) rewards: Vec<f32>,
    pub(super) costs: Vec<f32>,
    /// Whether an episode ends with the row, and by what.
    pub(super) ends: Vec<Option<Ending>>,
    /// SHA-256 of the file; zeros if there is none.
    pub(super) sha256: [u8; 32],
}

impl Columns {
    /// Reads a file, or names everything that is wrong with it.
    pub(super) fn read(path: &Path) -> Result<Self, Vec<Fault>> {
        let file = std::fs::File::open(path).map_err(|error| vec![error.into()])?;
        Self::from_reader(file)
    }

    /// Reads HDF5 a block of rows at a time, so that nothing is held but the columns.
    pub(super) fn from_reader(reader: impl Read + Seek + Send + 'static) -> Result<Self, Vec<Fault>> {
        let (file, sha256) = hdf5::open(reader).map_err(|fault| vec![fault])?;
        let (sources, faults) = hdf5::sources(&file);
        let mut reading = Reading { faults, bad_values: Vec::new() };

        let [observations, next_observations, actions, rewards, costs, terminals, timeouts] = &sources;
        let number = |value| value;
        let mut states =
            reading.column(observations, number).map(|(width, observations)| States::new(width, observations));
        reading.next_observations(next_observations, states.as_mut());
        let actions = reading.column(actions, number);
        let rewards = reading.column(rewards, number);
        let costs = reading.column(costs, number);
        let flag = |value| value != 0.0;
        let terminals = reading.column(terminals, flag);
        let timeouts = reading.column(timeouts, flag);

        let Reading { mut faults, bad_values } = reading;
        faults.extend(bad_values);
        let ends = terminals.zip(timeouts).map(|((_, terminals), (_, timeouts))| ends(&terminals, &timeouts));
        faults.extend(ends.as_ref().and_then(|ends| no_end(ends)));
        match (states, actions, rewards, costs, ends) {
            (Some(states), Some((action_dim, actions)), Some((_, rewards)), Some((_, costs)), Some(ends))
                if faults.is_empty() =>
            {
                Ok(Self { states, action_dim, actions, rewards, costs, ends, sha256 })
            }
            _ => Err(faults),
        }
    }
}

/// Whether an episode ends, and by what, row by row.
pub(super) fn ends(terminals: &[bool], timeouts: &[bool]) -> Vec<Option<Ending>> {
    terminals.iter().zip(timeouts).map(|(&terminal, &timeout)| Ending::of(terminal, timeout)).collect()
}

/// The fault of rows without an end.
pub(super) fn no_end(ends: &[Option<Ending>]) -> Option<Fault> {
    (!ends.is_empty() && ends.iter().all(Option::is_none)).then_some(Fault::NoEpisodeEnd { rows: ends.len() })
}

/// What was found wrong so far: with the file, and with the values in it.
struct Reading {
    faults: Vec<Fault>,
    bad_values: Vec<Fault>,
}

impl Reading {
    /// The width and the values of a data set that can be read, `convert` made of each.
    fn column<T>(&mut self, source: &Option<Source>, convert: fn(f32) -> T) -> Option<(usize, Vec<T>)> {
        let source = source.as_ref()?;
        let mut column = Vec::new();
        let read = self.blocks(source, |_, values| {
            // Asked for once and whole: growing would hold the column twice.
            column.reserve_exact(source.len() - column.len());
            column.extend(values.iter().map(|&value| convert(value)));
        });
        read.then_some((source.width(), column))
    }

    /// Looks at the next observations, and adds them to the states unless the file is at fault.
    fn next_observations(&mut self, source: &Option<Source>, mut states: Option<&mut States>) {
        let Some(source) = source else { return };
        states.take_if(|_| !self.faults.is_empty());
        self.blocks(source, |first, values| {
            if let Some(states) = states.as_deref_mut() {
                for (row, next) in values.chunks_exact(source.width()).enumerate() {
                    states.push_next(first + row, next);
                }
            }
        });
    }

    /// Looks at all values of a data set and hands them over; false if one cannot be read.
    fn blocks(&mut self, source: &Source, mut each: impl FnMut(usize, &[f32])) -> bool {
        let mut scan = Scan::new(source.key());
        let read = source.blocks(|first, values| {
            scan.look(first, source.width(), values);
            each(first, values);
        });
        match read {
            Ok(()) => self.bad_values.extend(scan.faults()),
            Err(fault) => {
                self.faults.push(fault);
                return false;
            }
        }
        true
    }
}
