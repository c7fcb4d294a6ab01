//! Studies: several variants of a training run, each with several seeds, flown and compared.
//!
//! A study is a TOML file. `base` holds the options of every run, and each
//! variant's `set` what it changes:
//!
//! ```toml
//! title = "Does relabelling help?"
//! task = "ball-run"               # what the policies fly
//! seeds = [0, 1]                  # of training
//! episodes = 20                   # of each flight
//! max_steps = [20, 5]             # a flight for each: calls of the denoiser an action may take
//! columns = ["cloning_loss"]      # of metrics.csv, from its last row
//!
//! [base]
//! preset = "quick"
//!
//! [[variant]]
//! name = "quick"
//!
//! [[variant]]
//! name = "half of the samples relabelled"
//! set = { relabel_share = 0.5 }
//! ```

mod score;
mod table;

use std::collections::HashSet;
use std::path::{Path, PathBuf};

use firmware_sim::task::{Task, TaskError};
use serde::Deserialize;

use crate::config::{Config, ConfigError, Given};
use crate::run::COLUMNS;

pub use score::{Flown, Score};
pub use table::{Row, markdown};

/// The variants of the paper's ablation (section 4.5).
pub const ABLATION: &str = include_str!("../../studies/ablation.toml");

/// A study as its file says it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Study {
    /// What it asks.
    pub title: String,
    /// The task that the policies are trained for and fly.
    pub task: String,
    /// Training seeds.
    pub seeds: Vec<u32>,
    /// Episodes of a flight.
    pub episodes: u32,
    /// Calls of the denoiser that an action may take, a flight for each.
    pub max_steps: Vec<usize>,
    /// Columns of `metrics.csv` to report from its last row.
    #[serde(default)]
    pub columns: Vec<String>,
    /// Options of every run.
    #[serde(default)]
    pub base: toml::Table,
    /// What is compared.
    #[serde(rename = "variant")]
    pub variants: Vec<Variant>,
}

/// One of the things that a study compares.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    /// Its name in the table.
    pub name: String,
    /// Options that it changes.
    #[serde(default)]
    pub set: toml::Table,
}

/// A training run of a study.
#[derive(Clone, Debug, PartialEq)]
pub struct Run {
    /// Name of the variant.
    pub variant: String,
    /// Its configuration.
    pub config: Config,
    /// Folder within the study's.
    pub folder: PathBuf,
}

/// Why a study cannot be run.
#[derive(Debug, thiserror::Error)]
pub enum StudyError {
    /// The file is no study.
    #[error("{} is no study: {reason}", file.display())]
    NotAStudy {
        /// The file.
        file: PathBuf,
        /// What is wrong.
        reason: String,
    },
    /// A list that must not be empty is.
    #[error("{} has no `{key}`; give at least one", file.display())]
    Empty {
        /// The file.
        file: PathBuf,
        /// The list.
        key: &'static str,
    },
    /// A variant cannot be trained.
    #[error("variant `{variant}`: {error}")]
    Variant {
        /// Its name.
        variant: String,
        /// What is wrong.
        error: ConfigError,
    },
    /// Two variants would share a folder.
    #[error("two variants are called `{name}`, or nearly so; give each a name of its own")]
    SameName {
        /// Name of the second.
        name: String,
    },
    /// A column that no run measures.
    #[error("metrics.csv has no column `{column}`; docs/metrics.md lists them")]
    Column {
        /// Its name.
        column: String,
    },
    /// The task has no plant here.
    #[error(transparent)]
    Task(#[from] TaskError),
}

impl Study {
    /// The study in the text of a file.
    ///
    /// # Errors
    /// [`StudyError`]; variants are looked at by [`Study::runs`].
    pub fn parse(file: &Path, text: &str) -> Result<Self, StudyError> {
        let not_a_study = |error: toml::de::Error| StudyError::NotAStudy {
            file: file.into(),
            reason: error.to_string().trim_end().replace('\n', " "),
        };
        let study: Self = toml::from_str(text).map_err(not_a_study)?;
        for (key, empty) in [
            ("seeds", study.seeds.is_empty()),
            ("max_steps", study.max_steps.is_empty()),
            ("variant", study.variants.is_empty()),
            ("episodes", study.episodes == 0),
        ] {
            if empty {
                return Err(StudyError::Empty { file: file.into(), key });
            }
        }
        Task::named(&study.task)?;
        let known = |column: &&String| COLUMNS.iter().any(|other| other.name == **column);
        match study.columns.iter().find(|column| !known(column)) {
            Some(column) => Err(StudyError::Column { column: column.clone() }),
            None => Ok(study),
        }
    }

    /// All its runs on recorded data, variant by variant.
    ///
    /// # Errors
    /// [`StudyError::Variant`] and [`StudyError::SameName`], before anything is trained.
    pub fn runs(&self, data: &str) -> Result<Vec<Run>, StudyError> {
        let mut folders = HashSet::new();
        let mut runs = Vec::new();
        for variant in &self.variants {
            let folder = slug(&variant.name);
            if !folders.insert(folder.clone()) {
                return Err(StudyError::SameName { name: variant.name.clone() });
            }
            for &seed in &self.seeds {
                let config = self.config(variant, data, seed);
                let config = config.map_err(|error| StudyError::Variant { variant: variant.name.clone(), error })?;
                let folder = Path::new(&folder).join(format!("seed-{seed}"));
                runs.push(Run { variant: variant.name.clone(), config, folder });
            }
        }
        Ok(runs)
    }

    fn config(&self, variant: &Variant, data: &str, seed: u32) -> Result<Config, ConfigError> {
        let mut given = Given::default();
        for (key, value) in self.base.iter().chain(&variant.set) {
            given.insert(key, value.clone());
        }
        given.insert("data", data);
        given.insert("task", self.task.as_str());
        given.insert("seed", i64::from(seed));
        let config = given.config()?;
        config.check()?;
        Ok(config)
    }
}

/// A folder's name: letters and digits of a variant's name, with dashes between.
fn slug(name: &str) -> String {
    let words = name.split(|c: char| !c.is_ascii_alphanumeric()).filter(|word| !word.is_empty());
    words.map(str::to_ascii_lowercase).collect::<Vec<_>>().join("-")
}

#[cfg(test)]
mod tests {
    use super::*;

    const TEXT: &str = r#"
        title = "?"
        task = "ball-run"
        seeds = [3, 4]
        episodes = 2
        max_steps = [5]
        columns = ["cloning_loss"]
        [base]
        steps = 10
        eta = 0.25
        [[variant]]
        name = "as it is"
        [[variant]]
        name = "eta 2, relabelled (A)"
        set = { eta = 2.0, relabel_share = 0.5 }
    "#;

    fn parse(text: &str) -> Result<Study, StudyError> {
        Study::parse(Path::new("s.toml"), text)
    }

    #[test]
    fn a_variant_changes_the_base_and_each_run_has_a_folder() {
        let runs = parse(TEXT).unwrap().runs("x.hdf5").unwrap();
        let seen: Vec<_> =
            runs.iter().map(|run| (run.folder.to_str().unwrap(), run.config.eta, run.config.seed)).collect();
        let expected = [
            ("as-it-is/seed-3", 0.25, 3),
            ("as-it-is/seed-4", 0.25, 4),
            ("eta-2-relabelled-a/seed-3", 2.0, 3),
            ("eta-2-relabelled-a/seed-4", 2.0, 4),
        ];
        assert_eq!(seen, expected);
        assert!(
            runs.iter().all(|run| run.config.steps == 10 && run.config.limit == 5.0 && run.config.data == "x.hdf5")
        );
    }

    /// Each differs from the full method, and from every other.
    #[test]
    fn the_papers_ablation_has_eight_variants_that_differ() {
        let study = parse(ABLATION).unwrap();
        assert_eq!(study.variants.len(), 8);
        let configs: Vec<_> = study.variants.iter().map(|variant| study.config(variant, "x", 0).unwrap()).collect();
        for (place, config) in configs.iter().enumerate() {
            assert!(!configs[..place].contains(config), "{}", study.variants[place].name);
        }
        assert_eq!(
            configs[7],
            crate::config::Config { data: "x".to_owned(), ..crate::config::Preset::Quick.config("ball-run", 5.0) }
        );
    }

    #[test]
    fn what_cannot_be_run_is_named_before_anything_is_trained() {
        let error = |from: &str, to: &str| {
            let study = parse(&TEXT.replace(from, to)).and_then(|study| study.runs("x").map(drop));
            study.unwrap_err().to_string()
        };
        assert_eq!(error("[3, 4]", "[]"), "s.toml has no `seeds`; give at least one");
        assert!(error("\"ball-run\"", "\"ball-jump\"").contains("ball-jump"));
        assert!(error("cloning_loss", "cloning").contains("metrics.csv has no column `cloning`"));
        assert!(
            error("eta = 2.0", "etta = 2.0").starts_with("variant `eta 2, relabelled (A)`: there is no option `etta`")
        );
        assert!(error("relabel_share = 0.5", "relabel_share = 2").contains("`relabel_share`"));
        assert!(error("eta 2, relabelled (A)", "As it is!").contains("two variants are called `As it is!`"));
        assert!(error("episodes", "episode").starts_with("s.toml is no study: "));
    }
}
