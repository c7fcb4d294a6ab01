use std::collections::BTreeSet;
use std::fs;
use std::os::unix::fs::PermissionsExt;
use std::path::{Path, PathBuf};

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use tempfile::TempDir;

use super::*;
use crate::fixture::{BALL_RUN, Parts, TRAINED_MAX};
use crate::flight::{FlightError, FlightPlan};
use crate::memory::AlignedBytes;
use crate::task::Task;

/// An environment whose Python is a shell script.
fn scripted(script: &str) -> (TempDir, Environment) {
    let folder = tempfile::tempdir().unwrap();
    let python = folder.path().join("bin").join("python");
    fs::create_dir(folder.path().join("bin")).unwrap();
    fs::write(&python, format!("#!/bin/sh\n{script}\n")).unwrap();
    fs::set_permissions(&python, fs::Permissions::from_mode(0o755)).unwrap();
    let environment = Environment::open(folder.path(), |note| panic!("it is there: {note}")).unwrap();
    (folder, environment)
}

fn plan(task: &str, limit: f32) -> FlightPlan {
    let task = Task::named(task).unwrap();
    let limit = CostLimit::new(limit).unwrap();
    FlightPlan { task, limit, episodes: 2, seed: 1, rate_hz: task.rate_hz, max_steps: usize::MAX }
}

/// Flies a ball-run policy in an environment whose Python is `script`.
fn refused(script: &str, plan: &FlightPlan) -> SimulatorError {
    let (_folder, environment) = scripted(script);
    let memory = AlignedBytes::from(Parts::random("SafetyBallRun-v0", BALL_RUN, 1).bytes().as_slice());
    fly(&PolicyImage::new_checked(memory.as_slice()).unwrap(), plan, &environment, |_| {}).unwrap_err()
}

#[test]
fn a_simulator_that_fails_is_told_of_in_its_own_words() {
    let plan = plan("SafetyBallRun-v0", 5.0);
    let error = refused("echo 'error: No module named mujoco; install it' >&2; exit 1", &plan);
    assert_eq!(error.to_string(), "the simulator of SafetyBallRun-v0 failed: No module named mujoco; install it");
    let error = refused("exit 3", &plan);
    assert_eq!(error.to_string(), "the simulator of SafetyBallRun-v0 failed: exit status: 3");
    let error = refused("kill -9 $$", &plan);
    assert_eq!(error.to_string(), "the simulator of SafetyBallRun-v0 failed: signal: 9 (SIGKILL)");
    assert!(matches!(refused("exit 0", &plan), SimulatorError::Lost { .. }));
    assert!(matches!(
        refused("echo '{\"episode\": 0, \"rewards\": [], \"costs\": [], \"goals\": 0}'", &plan),
        SimulatorError::Lost { .. }
    ));
}

#[test]
fn what_cannot_fly_is_refused_before_a_simulator_starts() {
    let unused = "echo started >&2; exit 1";
    assert!(matches!(refused(unused, &plan("ball-run", 5.0)), SimulatorError::Native { task: "ball-run" }));
    let other = refused(unused, &plan("SafetyCarGoal1-v0", 5.0));
    assert!(matches!(other, SimulatorError::Flight(FlightError::WrongTask { .. })), "{other}");
    let greedy = refused(unused, &plan("SafetyBallRun-v0", TRAINED_MAX + 1.0));
    assert!(matches!(greedy, SimulatorError::Flight(FlightError::Load(_))), "{greedy}");
    let slow = refused(unused, &FlightPlan { rate_hz: 15, ..plan("SafetyBallRun-v0", 5.0) });
    assert!(matches!(slow, SimulatorError::Flight(FlightError::Rate { rate: 15, .. })), "{slow}");
}

/// A command that makes environments of itself as Python does, with a pip of its own.
fn python(folder: &Path, pip: &str) -> String {
    let path = folder.join("python3");
    let script = format!(
        "#!/bin/sh\ncase \"$2\" in venv) mkdir -p \"$3/bin\" && cp \"$0\" \"$3/bin/python\";; pip) {pip};; esac\n"
    );
    fs::write(&path, script).unwrap();
    fs::set_permissions(&path, fs::Permissions::from_mode(0o755)).unwrap();
    path.display().to_string()
}

#[test]
fn an_environment_is_made_once_and_anew_where_that_was_interrupted() {
    let folder = tempfile::tempdir().unwrap();
    let python = python(folder.path(), "echo pip >> $(dirname $0)/../log");
    let environment = folder.path().join("cache").join("simulators");
    let part = environment.with_extension("part");
    fs::create_dir_all(&part).unwrap();
    fs::write(part.join("half"), "of it").unwrap();

    let mut notes = 0;
    for _ in 0..2 {
        Environment::open_with(&environment, &["no-such-python", &python], |_| notes += 1).unwrap();
    }
    assert_eq!(notes, 1);
    assert!(!part.exists() && !environment.join("half").exists());
    assert_eq!(fs::read_to_string(environment.join("log")).unwrap(), "pip\n");
    assert!(fs::read_to_string(environment.join("simulators.txt")).unwrap().contains("\nmujoco==2.3.3\n"));
}

#[test]
fn an_environment_that_cannot_be_made_is_not_there_and_the_command_to_make_it_is_told() {
    let folder = tempfile::tempdir().unwrap();
    let environment = folder.path().join("simulators");
    let refused = |python: &str| Environment::open_with(&environment, &[python], |_| {}).unwrap_err().to_string();
    let offline = refused(&python(folder.path(), "echo Retrying; echo; echo no network >&2; exit 1"));
    for message in [offline, refused("no-such-python")] {
        assert!(message.contains("pip install --no-deps -r firmware-sim/python/simulators.txt"), "{message}");
        assert!(message.contains("no network") || message.contains("CPython 3.10 or 3.11"), "{message}");
        assert!(!environment.exists());
    }
}

#[test]
fn the_package_is_carried_along_whole() {
    let source = Path::new(env!("CARGO_MANIFEST_DIR")).join("python/src/armor_plant");
    let names = |folder: &Path| -> BTreeSet<PathBuf> {
        let entries = fs::read_dir(folder).unwrap().map(|entry| PathBuf::from(entry.unwrap().file_name()));
        entries.filter(|name| name != Path::new("__pycache__")).collect()
    };
    let unpacked = package::unpack().unwrap();
    let copy = unpacked.path().join("armor_plant");
    assert_eq!(names(&copy), names(&source));
    for name in names(&source) {
        assert_eq!(fs::read(copy.join(&name)).unwrap(), fs::read(source.join(&name)).unwrap(), "{}", name.display());
    }
}

#[test]
fn every_episode_is_flown_once_by_as_many_simulators_as_help() {
    for (episodes, workers, expected) in [(1, 2, 1), (20, 2, 2), (7, 3, 3), (2, 64, 2), (5, 0, 1)] {
        let shares: Vec<_> = flight::shares(episodes, workers).collect();
        assert_eq!(shares.len(), expected);
        assert!(shares.iter().all(|share| !share.is_empty()));
        assert!(shares.into_iter().flatten().eq(0..episodes));
    }
}
