//! The validator: every fault of a file, and what is odd about a sound one.

use std::fmt;
use std::path::{Path, PathBuf};

use serde::{Serialize, Serializer};

use super::columns::Columns;
use super::dataset::Dataset;
use super::ending::Unfinished;
use super::error::Fault;
use super::moments::StateMoments;

/// What [`check`] found.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Report {
    /// The file as it was named by the caller.
    pub file: PathBuf,
    /// Transitions of whole trajectories; 0 if the file has faults.
    pub transitions: usize,
    /// Whole trajectories; 0 if the file has faults.
    pub trajectories: usize,
    /// Why the file cannot be used; empty if it can.
    #[serde(serialize_with = "with_messages")]
    pub faults: Vec<Fault>,
    /// What to know about a file that can be used; empty if it has faults.
    #[serde(serialize_with = "with_messages")]
    pub warnings: Vec<Warning>,
}

/// Something odd that does not keep a file from being used.
#[derive(Clone, Debug, PartialEq, Serialize)]
#[serde(tag = "warning", rename_all = "snake_case")]
pub enum Warning {
    /// Rows after the last end mark, which are dropped unless a run asks for them (O-1).
    UnfinishedTrajectory {
        /// How many rows.
        rows: usize,
    },
    /// Next observations that are not the observation of the row after, within a trajectory.
    NextObservationsDiffer {
        /// First row.
        row: usize,
        /// How many rows.
        count: usize,
    },
    /// State entries that never change beyond rounding.
    ConstantState {
        /// Their indices.
        entries: Vec<usize>,
    },
    /// The file name states another number of trajectories.
    NamedTrajectories {
        /// As the name says.
        named: usize,
        /// As counted.
        found: usize,
    },
    /// The file name states another largest cost return.
    NamedMaxCost {
        /// As the name says.
        named: f64,
        /// As counted.
        found: f32,
    },
}

/// Checks a file and collects all that is wrong with it.
///
/// Values are looked at in every data set that can be read, also when another
/// cannot.
pub fn check(path: &Path) -> Report {
    let file = path.to_owned();
    match Columns::read(path) {
        Err(faults) => Report { file, transitions: 0, trajectories: 0, faults, warnings: Vec::new() },
        Ok(columns) => {
            let dataset = Dataset::split(columns, Unfinished::Drop);
            Report {
                file,
                transitions: dataset.len(),
                trajectories: dataset.trajectories().len(),
                faults: Vec::new(),
                warnings: Warning::all(&dataset, path),
            }
        }
    }
}

impl Report {
    /// Whether the file can be used.
    pub fn is_sound(&self) -> bool {
        self.faults.is_empty()
    }
}

impl Warning {
    /// What is odd about the data set that was read from `path`.
    pub fn all(dataset: &Dataset, path: &Path) -> Vec<Self> {
        let mut warnings = Vec::new();
        if dataset.after_last_end() > 0 && dataset.unfinished() == Unfinished::Drop {
            warnings.push(Self::UnfinishedTrajectory { rows: dataset.after_last_end() });
        }
        if let Some(row) = dataset.gaps().next() {
            warnings.push(Self::NextObservationsDiffer { row, count: dataset.gaps().count() });
        }
        let entries = StateMoments::new(dataset).constant;
        if !entries.is_empty() {
            warnings.push(Self::ConstantState { entries });
        }
        if let Some((named_cost, named)) = named_facts(path) {
            let (found, max_cost) = (dataset.trajectories().len(), dataset.max_kappa());
            if named != found {
                warnings.push(Self::NamedTrajectories { named, found });
            }
            // The name carries a whole number, rounded either way.
            if (named_cost - f64::from(max_cost)).abs() >= 1.0 {
                warnings.push(Self::NamedMaxCost { named: named_cost, found: max_cost });
            }
        }
        warnings
    }
}

/// The largest cost return and the number of trajectories in a name of the
/// published form, `<env>-v<version>-<max cost>-<trajectories>.hdf5`.
fn named_facts(path: &Path) -> Option<(f64, usize)> {
    let stem = path.file_name()?.to_str()?.strip_suffix(".hdf5")?;
    let mut parts = stem.rsplitn(3, '-');
    let trajectories = parts.next()?.parse().ok()?;
    let max_cost = parts.next()?.parse::<u32>().ok()?;
    let (_, version) = parts.next()?.rsplit_once("-v")?;
    version.parse::<u32>().ok()?;
    Some((max_cost.into(), trajectories))
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::UnfinishedTrajectory { rows } => {
                write!(f, "the last {rows} rows belong to an episode without an end and are dropped")
            }
            Self::NextObservationsDiffer { row, count } => write!(
                f,
                "`next_observations` row {row} is not `observations` row {} ({count} such rows); both are kept",
                row + 1
            ),
            Self::ConstantState { entries } => {
                write!(f, "state entries {entries:?} never change; they tell a policy nothing")
            }
            Self::NamedTrajectories { named, found } => {
                write!(f, "the file name says {named} trajectories, the file holds {found}; it may be incomplete")
            }
            Self::NamedMaxCost { named, found } => {
                write!(f, "the file name says a largest cost return of {named}, the file's is {found}")
            }
        }
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let file = self.file.display();
        if self.is_sound() {
            writeln!(f, "{file}: sound, {} transitions in {} trajectories", self.transitions, self.trajectories)?;
        } else {
            writeln!(f, "{file}: cannot be used, faults: {}", self.faults.len())?;
        }
        for fault in &self.faults {
            writeln!(f, "  fault: {fault}")?;
        }
        for warning in &self.warnings {
            writeln!(f, "  warning: {warning}")?;
        }
        Ok(())
    }
}

/// Serialises each item with its text as `message`.
fn with_messages<T: Serialize + fmt::Display, S: Serializer>(items: &[T], serializer: S) -> Result<S::Ok, S::Error> {
    #[derive(Serialize)]
    struct WithMessage<'a, T> {
        #[serde(flatten)]
        item: &'a T,
        message: String,
    }
    serializer.collect_seq(items.iter().map(|item| WithMessage { item, message: item.to_string() }))
}
