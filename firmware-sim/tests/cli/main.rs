//! The command line, as a shell sees it.

mod answers;
mod faults;
#[path = "../../src/fixture.rs"]
mod fixture;
mod refusals;

use std::fs;
use std::io::Read;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use armor_core::image::SectionKind;
use armor_core::shape::Shape;
use fixture::{BALL_RUN, GOLDEN_ROWS, Parts, TRAINED_MAX};
use serde_json::Value;
use tempfile::TempDir;

/// A folder with an image in it.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        bench.put("policy.armor", &fixture::ball_run(1));
        bench
    }

    /// A folder with a flashed chip, too.
    fn flashed() -> Self {
        let bench = Self::new();
        bench.json(&["flash", "policy.armor", "--chip", "robot.chip"]);
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap();
    }

    fn command(&self, arguments: &[&str]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_firmware-sim"));
        command.current_dir(self.folder.path()).args(arguments).stdin(Stdio::null());
        command
    }

    fn run(&self, arguments: &[&str]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs with `--json`: stdout must be one line with one object.
    #[track_caller]
    fn json(&self, arguments: &[&str]) -> Value {
        let output = self.run(&[arguments, &["--json"]].concat());
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        object(&output)
    }

    /// Runs and expects exit code 1 and one line; the line.
    #[track_caller]
    fn failure(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(1), "{stderr}");
        assert!(output.stdout.is_empty());
        let last = stderr.lines().last().unwrap().to_string();
        assert_eq!(stderr.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{stderr}");
        assert!(last.starts_with("error: "), "{stderr}");
        last
    }

    /// Runs and expects exit code 2; what clap says.
    #[track_caller]
    fn misuse(&self, arguments: &[&str]) -> String {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(2), "{}", text(&output.stderr));
        assert!(output.stdout.is_empty());
        text(&output.stderr)
    }
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

#[track_caller]
fn object(output: &Output) -> Value {
    let stdout = text(&output.stdout);
    assert_eq!(stdout.lines().count(), 1, "{stdout}");
    let value: Value = serde_json::from_str(&stdout).unwrap();
    assert!(value.is_object());
    value
}

#[track_caller]
fn fits_a_terminal(output: &Output) {
    for line in text(&output.stdout).lines().chain(text(&output.stderr).lines()) {
        assert!(line.chars().count() <= 80, "{line}");
    }
}

const RUN: [&str; 9] = ["run", "--chip", "robot.chip", "--task", "ball-run", "--episodes", "2", "--seed", "3"];
