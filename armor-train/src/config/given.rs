//! Options that a user gives: in a file, one by one, by the flags of `fit`.

use std::path::Path;

use firmware_sim::task::Task;

use super::assign::parse_assignment;
use super::{Config, ConfigError, Preset};

/// Options by name, on top of a preset and the task's own; what is given later wins.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Given(toml::Table);

impl Given {
    /// All options of the text of a TOML file, such as a run's `config.toml`.
    ///
    /// # Errors
    /// [`ConfigError::NotToml`]; whether keys and values are good shows in [`Given::config`].
    pub fn file(&mut self, path: &Path, text: &str) -> Result<(), ConfigError> {
        let table: toml::Table = text.parse().map_err(|error: toml::de::Error| {
            let before = error.span().and_then(|span| text.get(..span.start)).unwrap_or_default();
            ConfigError::NotToml {
                file: path.into(),
                line: before.matches('\n').count() + 1,
                reason: error.message().replace('\n', ", "),
            }
        })?;
        self.0.extend(table);
        Ok(())
    }

    /// One option as `key=value`.
    ///
    /// # Errors
    /// [`ConfigError::NotAnAssignment`]
    pub fn set(&mut self, assignment: &str) -> Result<(), ConfigError> {
        let (key, value) = parse_assignment(assignment)?;
        self.insert(key, value);
        Ok(())
    }

    /// One option.
    pub fn insert(&mut self, key: &str, value: impl Into<toml::Value>) {
        self.0.insert(key.to_owned(), value.into());
    }

    /// The configuration: what is not given is the preset's (`quick` if none is
    /// given), and a missing limit is the paper's for the task.
    ///
    /// # Errors
    /// [`ConfigError`] with the first option that is missing, unknown or of the wrong kind.
    pub fn config(&self) -> Result<Config, ConfigError> {
        let mut names = Preset::Quick.config("", 0.0);
        for key in ["preset", "task", "data"] {
            match self.0.get(key) {
                Some(value) => names.replace(key, value.clone())?,
                None if key == "preset" => {}
                None => return Err(ConfigError::Missing { key }),
            }
        }
        let limit = match Task::named(&names.task) {
            Ok(task) => f64::from(task.cost_limit),
            Err(_) if self.0.contains_key("limit") => 0.0,
            Err(_) => return Err(ConfigError::NoLimit { task: names.task }),
        };
        let mut config = names.preset.config(&names.task, limit);
        for (key, value) in &self.0 {
            config.replace(key, value.clone())?;
        }
        Ok(config)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn given(text: &str) -> Given {
        let mut given = Given::default();
        given.file(Path::new("run.toml"), text).unwrap();
        given
    }

    #[test]
    fn a_file_may_hold_any_of_the_options_and_what_comes_later_wins() {
        let mut given = given("preset = \"paper\"\ntask = \"toy\"\ndata = \"x.hdf5\"\nlimit = 3\neta = 2\nbeta = 7");
        given.set("eta=0.5").unwrap();
        given.insert("seed", 9);
        let config = given.config().unwrap();
        assert_eq!((config.preset, config.batch, config.limit), (Preset::Paper, 512, 3.0));
        assert_eq!((config.eta, config.beta, config.seed), (0.5, 7.0, 9));
    }

    #[test]
    fn a_saved_configuration_is_taken_up_whole() {
        let mut config = Preset::Quick.config("toy", 2.5);
        (config.data, config.sigma, config.seed) = ("x.hdf5".to_owned(), 0.3, 5);
        assert_eq!(given(&config.options().to_string()).config().unwrap(), config);
    }

    #[test]
    fn a_task_of_the_paper_brings_its_limit_and_another_needs_one() {
        let limit = |task: &str| given(&format!("data = \"x\"\ntask = \"{task}\"")).config().map(|config| config.limit);
        assert_eq!(limit("ball-run").unwrap(), 5.0);
        assert_eq!(limit("SafetyWalker2dVelocity-v1").unwrap(), 10.0);
        assert_eq!(limit("SafetyPointGoal1-v0").unwrap(), 20.0);
        assert!(limit("toy").unwrap_err().to_string().contains("--limit"));
        let own = given("data = \"x\"\ntask = \"ball-run\"\nlimit = 8").config().unwrap();
        assert_eq!(own.limit, 8.0);
    }

    #[test]
    fn bad_files_are_named_by_key_or_line() {
        let error = |text: &str| {
            let mut given = Given::default();
            given.file(Path::new("run.toml"), text).and_then(|()| given.config()).unwrap_err().to_string()
        };
        let names = "data = \"x\"\ntask = \"ball-run\"\n";
        assert!(error(&format!("{names}eta = ")).starts_with("run.toml: line 3 is no TOML: "));
        assert!(error(&format!("{names}actor_lr = 1")).contains("no option `actor_lr`; did you mean `actor_rate`"));
        assert!(error(&format!("{names}batch = \"many\"")).starts_with("option `batch` cannot be `many`"));
        assert!(error(&format!("{names}preset = \"fast\"")).starts_with("option `preset` cannot be `fast`"));
        assert!(error("task = \"ball-run\"").contains("--data"));
        assert!(error("data = \"x\"").contains("--task"));
    }
}
