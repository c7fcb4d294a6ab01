//! Why a simulator cannot fly.

use std::io;
use std::path::PathBuf;

use thiserror::Error;

use super::environment::Environment;
use crate::file::FileError;
use crate::flight::FlightError;

/// Why a simulator cannot fly a policy.
#[derive(Debug, Error)]
pub enum SimulatorError {
    /// Image, task, limit or rate do not go together.
    #[error(transparent)]
    Flight(#[from] FlightError),
    /// The task has a native plant.
    #[error("{task} is flown by this program's own plant and needs no simulator")]
    Native {
        /// The task.
        task: &'static str,
    },
    /// There is no place for the environment.
    #[error("there is no home folder to keep the simulators in; name a folder in {}", Environment::VARIABLE)]
    NoHome,
    /// There is no Python that the simulators run on.
    #[error(
        "the simulators run on CPython 3.10 or 3.11, and neither is in the PATH; install one (apt-get install python3 python3-venv on Debian 12), or make an environment by hand and name its folder in {variable}: python3 -m venv DIR && DIR/bin/pip install --no-deps -r firmware-sim/python/simulators.txt",
        variable = Environment::VARIABLE
    )]
    NoPython,
    /// A step of making the environment failed.
    #[error(
        "cannot make the simulators' environment: {command} said {said}; mend that and try again, or make one by hand and name its folder in {variable}: python3 -m venv DIR && DIR/bin/pip install --no-deps -r firmware-sim/python/simulators.txt",
        variable = Environment::VARIABLE
    )]
    Setup {
        /// What was run.
        command: String,
        /// The last line that it printed.
        said: String,
    },
    /// A file of the environment cannot be written.
    #[error(transparent)]
    File(#[from] FileError),
    /// A folder or process of the environment cannot be used.
    #[error("cannot {action} {}: {source}", path.display())]
    System {
        /// What was tried.
        action: &'static str,
        /// With which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The simulator ended with an error.
    #[error("the simulator of {task} failed: {said}{remedy}", remedy = remedy(.said))]
    Failed {
        /// The task.
        task: &'static str,
        /// The last line that it printed.
        said: String,
    },
    /// The line between controller and simulator broke.
    #[error("the simulator of {task} was lost: {said}")]
    Lost {
        /// The task.
        task: &'static str,
        /// What happened to the line.
        said: String,
    },
}

impl SimulatorError {
    /// Names a file in an error of the system.
    pub(super) fn system(action: &'static str, path: impl Into<PathBuf>) -> impl FnOnce(io::Error) -> Self {
        let path = path.into();
        move |source| Self::System { action, path, source }
    }
}

/// What to do about a package that the environment lacks, unless that is said already.
fn remedy(said: &str) -> &'static str {
    if said.contains("No module named") && !said.contains("install") {
        "; install the simulators in that environment: pip install --no-deps -r firmware-sim/python/simulators.txt"
    } else {
        ""
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_package_is_answered_with_the_command_that_installs_it_once() {
        let message = |said: &str| SimulatorError::Failed { task: "SafetyBallRun-v0", said: said.into() }.to_string();
        let command = "pip install --no-deps -r firmware-sim/python/simulators.txt";
        assert!(message("ModuleNotFoundError: No module named 'numpy'").ends_with(command));
        let told = format!("No module named 'mujoco'; install the simulators: {command}");
        assert_eq!(message(&told), format!("the simulator of SafetyBallRun-v0 failed: {told}"));
        assert_eq!(message("stopped"), "the simulator of SafetyBallRun-v0 failed: stopped");
    }
}
