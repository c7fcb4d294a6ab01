//! The command line, as a shell sees it.

mod drift;
mod quickstart;
mod refusals;
mod reports;
mod stops;

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Command, Output, Stdio};

use serde_json::Value;
use tempfile::TempDir;

/// Networks small enough for a test.
const TINY: [&str; 13] = [
    "batch=8",
    "hidden=8",
    "trunk=8",
    "head=4",
    "dual_hidden=4",
    "kappa_hidden=4",
    "kappa_embedding=4",
    "time_code=4",
    "time_hidden=4",
    "time_embedding=4",
    "diffusion_steps=4",
    "target_steps=2",
    "perturbations=2",
];

/// A folder with a small recording in it: 9 transitions in two episodes, three
/// state entries, costs 2 and 1.
struct Bench {
    folder: TempDir,
}

impl Bench {
    fn new() -> Self {
        let bench = Self { folder: tempfile::tempdir().unwrap() };
        bench.put("small.hdf5", include_bytes!("../data/small.hdf5"));
        bench
    }

    fn path(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn put(&self, name: &str, bytes: &[u8]) {
        fs::write(self.path(name), bytes).unwrap();
    }

    fn bytes(&self, name: &str) -> Vec<u8> {
        fs::read(self.path(name)).unwrap()
    }

    /// All names in the folder, hidden ones too.
    fn names(&self, folder: &str) -> Vec<String> {
        let entries = fs::read_dir(self.path(folder)).unwrap();
        let mut names: Vec<_> = entries.map(|entry| entry.unwrap().file_name().into_string().unwrap()).collect();
        names.sort();
        names
    }

    fn command<S: AsRef<str>>(&self, arguments: &[S]) -> Command {
        let mut command = Command::new(env!("CARGO_BIN_EXE_armor-train"));
        command.current_dir(self.folder.path()).args(arguments.iter().map(AsRef::as_ref)).stdin(Stdio::null());
        command
    }

    fn run<S: AsRef<str>>(&self, arguments: &[S]) -> Output {
        self.command(arguments).output().unwrap()
    }

    /// Runs and expects success.
    #[track_caller]
    fn success<S: AsRef<str>>(&self, arguments: &[S]) -> Output {
        let output = self.run(arguments);
        assert_eq!(output.status.code(), Some(0), "{}", text(&output.stderr));
        output
    }

    /// Runs with `--json`: stdout must be one line with one object.
    #[track_caller]
    fn json<S: AsRef<str>>(&self, arguments: &[S]) -> Value {
        let arguments: Vec<&str> = arguments.iter().map(AsRef::as_ref).chain(["--json"]).collect();
        object(&self.success(&arguments))
    }

    /// Runs and expects exit code 1 and one line; the line.
    #[track_caller]
    fn failure<S: AsRef<str>>(&self, arguments: &[S]) -> String {
        let output = self.run(arguments);
        assert!(output.stdout.is_empty());
        error(&output)
    }

    /// Runs and expects exit code 2; what it says on stderr.
    #[track_caller]
    fn misuse<S: AsRef<str>>(&self, arguments: &[S]) -> String {
        let output = self.run(arguments);
        let stderr = text(&output.stderr);
        assert_eq!(output.status.code(), Some(2), "{stderr}");
        assert!(output.stdout.is_empty());
        assert!(!stderr.contains("panicked"), "{stderr}");
        stderr
    }
}

/// The recording that ships with the project.
fn shipped() -> String {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/ball-run-bullet.hdf5").display().to_string()
}

/// A run of tiny networks on the small recording, and more arguments.
fn toy(out: &str, steps: u64, more: &[&str]) -> Vec<String> {
    fit(["small.hdf5", "toy", "1"], out, steps, more)
}

/// A run of tiny networks on the shipped recording, and more arguments.
fn ball_run(out: &str, steps: u64) -> Vec<String> {
    fit([&shipped(), "ball-run", "5"], out, steps, &[])
}

fn fit([data, task, limit]: [&str; 3], out: &str, steps: u64, more: &[&str]) -> Vec<String> {
    let steps = steps.to_string();
    let arguments =
        ["fit", "--data", data, "--task", task, "--limit", limit, "--preset", "paper", "--steps", &steps, "--out", out];
    let options = TINY.iter().flat_map(|option| ["--set", option]);
    arguments.into_iter().chain(options).chain(more.iter().copied()).map(str::to_owned).collect()
}

fn text(bytes: &[u8]) -> String {
    String::from_utf8(bytes.to_vec()).unwrap()
}

/// The one JSON object on the one line of stdout.
#[track_caller]
fn object(output: &Output) -> Value {
    let stdout = text(&output.stdout);
    assert_eq!(stdout.lines().count(), 1, "{stdout}");
    let value: Value = serde_json::from_str(&stdout).unwrap();
    assert!(value.is_object());
    value
}

/// The one error line of a failure, which is the last line of stderr.
#[track_caller]
fn error(output: &Output) -> String {
    let stderr = text(&output.stderr);
    assert_eq!(output.status.code(), Some(1), "{stderr}");
    assert_eq!(stderr.lines().filter(|line| line.starts_with("error: ")).count(), 1, "{stderr}");
    assert!(!stderr.contains("panicked"), "{stderr}");
    let last = stderr.lines().last().unwrap();
    assert!(last.starts_with("error: "), "{stderr}");
    last.to_owned()
}

/// Results and help fit a terminal of 80 columns; notes on stderr carry paths and may be longer.
#[track_caller]
fn fits_a_terminal(output: &Output) {
    for line in text(&output.stdout).lines() {
        assert!(line.chars().count() <= 80, "{line}");
    }
}
