//! `armor-train study`

use std::fmt;
use std::path::{Path, PathBuf};

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use firmware_sim::cli::output::{CommandResult, Output};
use firmware_sim::file;
use firmware_sim::flight::FlightPlan;
use firmware_sim::task::Task;
use serde::Serialize;

use super::fit::{absolute, train};
use super::flyer::Flyer;
use crate::data::Dataset;
use crate::export::export;
use crate::run::{Checkpoint, METRICS_FILE, Outcome, Table};
use crate::study::{ABLATION, Flown, Row, Run, Score, Study as Definition, markdown};

/// The studies that ship with the project.
const SHIPPED: [(&str, &str); 5] = [
    ("ablation", ABLATION),
    ("options-ball-run", include_str!("../../studies/options-ball-run.toml")),
    ("options-point-circle", include_str!("../../studies/options-point-circle.toml")),
    ("real-ball-run", include_str!("../../studies/real-ball-run.toml")),
    ("real-point-circle", include_str!("../../studies/real-point-circle.toml")),
];
/// The table within the study's folder.
const TABLE_FILE: &str = "table.md";

/// Train and fly the variants of a study, and compare them in a table.
///
/// Every run is an ordinary one: its folder holds its configuration, metrics,
/// checkpoint and scores. Stopped and started again, a study goes on where it
/// was; runs that are done are not repeated.
#[derive(Debug, clap::Args)]
pub(super) struct Study {
    /// A TOML file, or a study that ships with the project: ablation,
    /// options-ball-run, options-point-circle, real-ball-run, real-point-circle.
    name: String,
    /// An HDF5 file in the DSRL layout.
    #[arg(long, value_name = "H5")]
    data: PathBuf,
    /// Folder of the study.
    #[arg(long, value_name = "DIR")]
    out: PathBuf,
}

#[derive(Serialize)]
struct Report {
    title: String,
    out: PathBuf,
    rows: Vec<ReportRow>,
    #[serde(skip)]
    table: String,
}

#[derive(Serialize)]
struct ReportRow {
    variant: String,
    scores: Vec<Score>,
}

impl Study {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let (file, text) = self.definition().unwrap_or_else(|error| super::misuse(&error));
        let study = Definition::parse(&file, &text)?;
        let runs = study.runs(&absolute(&self.data))?;
        let mut data: Option<Dataset> = None;
        let flyer = Flyer::of(Task::named(&study.task)?, output)?;
        let mut rows: Vec<Row> = Vec::new();
        for (index, run) in runs.iter().enumerate() {
            let label = format!("{}/{} {}", index + 1, runs.len(), run.folder.display());
            data.take_if(|data| data.unfinished() != run.config.unfinished);
            let data = match &mut data {
                Some(data) => data,
                none => none.insert(super::data::read(&self.data, run.config.unfinished, output)?),
            };
            let score = self.score((&study, &flyer), run, &label, data, output)?;
            match rows.last_mut().filter(|row| row.variant == run.variant) {
                Some(row) => row.scores.push(score),
                None => rows.push(Row { variant: run.variant.clone(), scores: vec![score] }),
            }
            file::write(&self.out.join(TABLE_FILE), markdown(&study, &rows).as_bytes())?;
        }
        let table = markdown(&study, &rows);
        let rows = rows.into_iter().map(|Row { variant, scores }| ReportRow { variant, scores }).collect();
        output.report(&Report { title: study.title, out: self.out, rows, table })
    }

    /// The file's name, and its text.
    fn definition(&self) -> Result<(PathBuf, String), String> {
        let shipped = SHIPPED.iter().find(|(name, _)| *name == self.name);
        if let Some((name, text)) = shipped {
            return Ok((PathBuf::from(name), (*text).to_owned()));
        }
        let path = PathBuf::from(&self.name);
        match file::read(&path) {
            Ok(bytes) => Ok((path, String::from_utf8_lossy(&bytes).into_owned())),
            Err(error) => {
                let names = SHIPPED.map(|(name, _)| name).join(", ");
                Err(format!("no study is called {}, and {error}; the studies are {names}", self.name))
            }
        }
    }

    /// Trains, exports and flies a run, unless that is done already.
    fn score(
        &self,
        (study, flyer): (&Definition, &Flyer),
        run: &Run,
        label: &str,
        data: &Dataset,
        output: Output,
    ) -> Result<Score, Box<dyn std::error::Error>> {
        let folder = self.out.join(&run.folder);
        let flights = format!("{} episodes within {:?}, columns {:?}", study.episodes, study.max_steps, study.columns);
        let of = Score::of(&run.config, data.sha256(), &flights);
        if let Some(score) = Score::read(&folder, &of) {
            return Ok(score);
        }
        let resume = folder.join(Checkpoint::FILE).exists();
        if let Outcome::Stopped(step) = train(label, &run.config, data, &folder, resume, output)? {
            return Err(format!("stopped and saved {label} at step {step}; the same command goes on").into());
        }
        let exported = export(&Checkpoint::read(&folder)?, data, None)?;
        let score = Score {
            of,
            flights: fly_all((study, flyer), run, exported.bytes.as_slice(), output)?,
            columns: last_row(&folder, &study.columns)?,
        };
        score.write(&folder)?;
        for flown in &score.flights {
            let Flown { max_steps, reward_normalized, cost_normalized } = flown;
            output.note(format_args!(
                "{label} within {max_steps} steps: reward {reward_normalized:.3}, cost {cost_normalized:.2}"
            ));
        }
        Ok(score)
    }
}

/// A flight for each of the study's `max_steps`.
fn fly_all(
    (study, flyer): (&Definition, &Flyer),
    run: &Run,
    bytes: &[u8],
    output: Output,
) -> Result<Vec<Flown>, Box<dyn std::error::Error>> {
    let image = PolicyImage::new_checked(bytes)?;
    let task = Task::named(&study.task)?;
    let limit = CostLimit::new(run.config.limit as f32)?;
    let flights = study.max_steps.iter().map(|&max_steps| {
        let (episodes, seed) = (study.episodes, run.config.seed);
        let plan = FlightPlan { task, limit, episodes, seed, rate_hz: task.rate_hz, max_steps };
        Ok(Flown::new(max_steps, &flyer.fly(&image, &plan, 1, output)?.summary))
    });
    flights.collect()
}

/// Columns of the last row of a run's metrics.
fn last_row(folder: &Path, columns: &[String]) -> Result<Vec<f64>, Box<dyn std::error::Error>> {
    let path = folder.join(METRICS_FILE);
    let table = Table::parse(&String::from_utf8_lossy(&file::read(&path)?));
    let rows = table.rows().map_err(|line| crate::run::RunError::Row { path, line })?;
    let last = rows.last().cloned().unwrap_or_default();
    let value = |column: &String| {
        let place = table.names().position(|name| name == column);
        place.and_then(|place| last.get(place).copied()).unwrap_or(f64::NAN)
    };
    Ok(columns.iter().map(value).collect())
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}\n\n{}", self.title, self.table)?;
        write!(f, "runs and table.md   {}", self.out.display())
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_variants_of_every_shipped_study_can_be_trained_and_differ() {
        for (name, text) in SHIPPED {
            let study = Definition::parse(Path::new(name), text).unwrap();
            let runs = study.runs("data.hdf5").unwrap_or_else(|error| panic!("{name}: {error}"));
            for (index, run) in runs.iter().enumerate() {
                assert!(runs[..index].iter().all(|other| other.config != run.config), "{name}: {}", run.variant);
            }
        }
    }
}
