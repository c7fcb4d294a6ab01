//! What a run's folder holds, read for its report.

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};

use firmware_sim::file::{self, FileError};

use crate::config::Config;
use crate::run::{ALARMS_FILE, COLUMNS, CONFIG_FILE, METRICS_FILE, Provenance, SPEED_COLUMNS, SPEED_FILE, Table};

/// Why a folder gives no report.
#[derive(Debug, thiserror::Error)]
pub enum ReportError {
    /// The folder is not that of a run.
    #[error("{} holds no {METRICS_FILE}; name the folder of a run, the --out of `armor-train fit`", folder.display())]
    NotARun {
        /// The folder.
        folder: PathBuf,
    },
    /// The run is younger than its first row.
    #[error("the run in {} has no row of metrics yet; the first comes after 100 steps", folder.display())]
    NoRows {
        /// The folder.
        folder: PathBuf,
    },
    /// A table of another version.
    #[error("{} has no column `{column}`; make the report with the version that made the run", path.display())]
    Column {
        /// The table.
        path: PathBuf,
        /// The first column that is missing.
        column: &'static str,
    },
    /// A line that is no row of numbers.
    #[error("line {line} of {} is no row of numbers; restore the file, or delete the line", path.display())]
    Row {
        /// The table.
        path: PathBuf,
        /// The line, counted from 1.
        line: usize,
    },
    /// A file that should say where the run comes from does not.
    #[error("{} cannot be understood: {reason}; make the report with the version that made the run", path.display())]
    Origin {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        reason: String,
    },
    /// A file could not be read.
    #[error(transparent)]
    File(#[from] FileError),
}

/// Columns of a table by name.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Curves(BTreeMap<&'static str, Vec<f64>>);

impl Curves {
    fn read(path: &Path, columns: impl Iterator<Item = &'static str>) -> Result<Self, ReportError> {
        let table = Table::parse(&text(path)?);
        let rows = table.rows().map_err(|line| ReportError::Row { path: path.into(), line })?;
        let column = |name: &'static str| {
            let place = table.names().position(|other| other == name);
            let place = place.ok_or(ReportError::Column { path: path.into(), column: name })?;
            Ok((name, rows.iter().map(|row| row[place]).collect()))
        };
        Ok(Self(columns.map(column).collect::<Result<_, ReportError>>()?))
    }

    /// The numbers of a column; none if there is no such column.
    pub fn get(&self, column: &str) -> &[f64] {
        self.0.get(column).map_or(&[], Vec::as_slice)
    }
}

/// A run as its folder tells it.
#[derive(Clone, Debug)]
pub struct RunFolder {
    /// The folder's name.
    pub name: String,
    /// `config.toml`.
    pub config: Config,
    /// `provenance.json`.
    pub provenance: Provenance,
    /// `metrics.csv`, at least one row.
    pub metrics: Curves,
    /// `speed.csv`.
    pub speed: Curves,
    /// `alarms.log`, line by line.
    pub alarms: Vec<String>,
}

impl RunFolder {
    /// Reads a folder.
    ///
    /// # Errors
    /// [`ReportError`]
    pub fn read(folder: &Path) -> Result<Self, ReportError> {
        let metrics_path = folder.join(METRICS_FILE);
        if !metrics_path.exists() {
            return Err(ReportError::NotARun { folder: folder.into() });
        }
        let metrics = Curves::read(&metrics_path, COLUMNS.iter().map(|column| column.name))?;
        if metrics.get("step").is_empty() {
            return Err(ReportError::NoRows { folder: folder.into() });
        }
        let config_path = folder.join(CONFIG_FILE);
        let config = toml::from_str(&text(&config_path)?)
            .map_err(|error| ReportError::Origin { path: config_path, reason: error.message().to_owned() })?;
        let provenance_path = folder.join(Provenance::FILE);
        let provenance = serde_json::from_str(&text(&provenance_path)?)
            .map_err(|error| ReportError::Origin { path: provenance_path, reason: error.to_string() })?;
        Ok(Self {
            name: name(folder),
            config,
            provenance,
            metrics,
            speed: Curves::read(&folder.join(SPEED_FILE), SPEED_COLUMNS.iter().map(|(name, ..)| *name))?,
            alarms: text(&folder.join(ALARMS_FILE))?.lines().map(str::to_owned).collect(),
        })
    }

    /// Training steps of the last row.
    pub fn steps(&self) -> u64 {
        self.metrics.get("step").last().map_or(0, |&step| step as u64)
    }
}

/// The last part of a folder's path, also where it is given as `.`.
fn name(folder: &Path) -> String {
    let absolute = std::path::absolute(folder).unwrap_or_else(|_| folder.into());
    absolute.file_name().unwrap_or(absolute.as_os_str()).to_string_lossy().into_owned()
}

fn text(path: &Path) -> Result<String, FileError> {
    Ok(String::from_utf8_lossy(&file::read(path)?).into_owned())
}
