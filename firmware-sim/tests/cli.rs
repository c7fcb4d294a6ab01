//! The command line, as a shell sees it.

#[path = "../src/fixture.rs"]
mod fixture;

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

#[test]
fn an_image_is_inspected() {
    let bench = Bench::new();
    let report = bench.json(&["inspect", "policy.armor"]);
    assert_eq!(report["task"], "ball-run");
    assert_eq!(report["image_bytes"], fixture::ball_run(1).len());
    assert_eq!((&report["state"], &report["hidden"]), (&7.into(), &16.into()));
    assert_eq!(report["rungs"][1]["sampler"], "DDIM");
    // Shape::macs_once() + 5 * macs_per_step() of the fixture, by hand.
    assert_eq!(report["rungs"][0]["macs_per_action"], (4 + 16 + 12 + 10 * 16) + 5 * (32 + 512 + 32));
    assert_eq!(report["sections"].as_array().unwrap().len(), SectionKind::ALL.len());
    fits_a_terminal(&bench.run(&["inspect", "policy.armor"]));
}

#[test]
fn a_good_image_is_verified_and_a_bad_one_is_not() {
    let bench = Bench::new();
    let report = bench.json(&["verify", "policy.armor"]);
    assert_eq!((&report["passed"], &report["golden_rows"]), (&true.into(), &GOLDEN_ROWS.into()));
    assert!(report["agreement_max_abs"].as_f64().unwrap() <= 1e-4);
    fits_a_terminal(&bench.run(&["verify", "policy.armor"]));

    let mut parts = Parts::random("ball-run", BALL_RUN, 1).with_golden();
    *parts.section(SectionKind::Golden).last_mut().unwrap() ^= 1;
    bench.put("foreign.armor", &parts.bytes());
    let output = bench.run(&["verify", "foreign.armor", "--json"]);
    assert_eq!((output.status.code(), &object(&output)["passed"]), (Some(1), &false.into()));
    assert!(text(&output.stderr).ends_with("failed 1 of 7 checks; do not fly it\n"));
}

#[test]
fn a_chain_is_traced_with_every_number() {
    let bench = Bench::new();
    bench.put("state.json", b"[0.1, 0.2, 0.3, 0.4, 0.5, 0.6, 0]");
    let arguments = ["trace", "policy.armor", "--state", "state.json", "--kappa", "2.5", "--seed", "9"];
    let report = bench.json(&arguments);
    assert_eq!((&report["kappa"], &report["seed"]), (&2.5.into(), &9.into()));
    let steps = report["steps"].as_array().unwrap();
    assert_eq!(steps.iter().map(|step| step["n"].as_u64().unwrap()).collect::<Vec<_>>(), [5, 4, 3, 2, 1]);
    for key in ["eps", "x0", "noise", "action"] {
        assert!(steps.iter().all(|step| step[key].as_array().unwrap().len() == 2), "{key}");
    }
    assert_eq!(steps[4]["action"], report["action"]);
    assert!(report["agreement_max_abs"].as_f64().unwrap() < 2e-5);
    // Without --json the same object, spread over lines.
    let plain: Value = serde_json::from_str(&text(&bench.run(&arguments).stdout)).unwrap();
    assert_eq!(plain, report);

    bench.put("short.txt", b"1 2 3");
    let short = ["trace", "policy.armor", "--state", "short.txt", "--kappa", "2.5", "--seed", "9"];
    assert!(bench.failure(&short).contains("short.txt holds 3 numbers and the policy senses 7"));
}

#[test]
fn an_image_is_flashed_and_flown() {
    let bench = Bench::new();
    let flashed = bench.json(&["flash", "policy.armor", "--chip", "robot.chip"]);
    assert_eq!((&flashed["slot"], &flashed["golden_rows"]), (&"a".into(), &GOLDEN_ROWS.into()));
    let named = bench.json(&["flash", "policy.armor", "--chip", "robot.chip", "--slot", "b"]);
    assert_eq!(named["slot"], "b");

    let report = bench.json(&[&RUN[..], &["--limit", "5", "-o", "flight.csv"]].concat());
    assert_eq!((&report["episodes"], &report["actions"], &report["slot"]), (&2.into(), &200.into(), &"b".into()));
    for key in
        ["reward_normalized", "cost_normalized", "reward_std", "latency_us_p50", "latency_us_p99", "latency_us_max"]
    {
        assert!(report[key].is_number(), "{key}: {report}");
    }
    assert_eq!((&report["faults"], &report["cost_limit"]), (&0.into(), &5.0.into()));
    let csv = fs::read_to_string(bench.path("flight.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 200);
    fits_a_terminal(&bench.run(&RUN));
}

#[test]
fn a_flight_is_repeated_by_its_seed() {
    let bench = Bench::flashed();
    let fly = |name: &str, seed: &str| {
        bench.json(&[&RUN[..7], &["--seed", seed, "-o", name]].concat());
        fs::read(bench.path(name)).unwrap()
    };
    assert_eq!(fly("one.csv", "3"), fly("two.csv", "3"));
    assert_ne!(fly("one.csv", "3"), fly("three.csv", "4"));
}

#[test]
fn a_damaged_slot_gives_way_and_the_reason_is_told() {
    let bench = Bench::flashed();
    bench.json(&["flash", "policy.armor", "--chip", "robot.chip"]);
    let mut chip = fs::read(bench.path("robot.chip")).unwrap();
    let last_image = chip.windows(4).rposition(|window| window == b"ARMR").unwrap();
    chip[last_image + 40] ^= 1;
    bench.put("robot.chip", &chip);
    let output = bench.run(&[&RUN[..], &["--json"]].concat());
    assert_eq!(object(&output)["slot"], "a");
    assert!(text(&output.stderr).contains("slot B passed over: image is damaged"));
}

#[test]
fn actions_are_timed() {
    let bench = Bench::new();
    let report = bench.json(&["bench", "policy.armor"]);
    let row = &report["rungs"][0];
    assert_eq!((&row["steps"], &row["macs_per_action"]), (&5.into(), &(192 + 5 * 576).into()));
    assert!(row["actions_per_second"].as_f64().unwrap() > 0.0);
    fits_a_terminal(&bench.run(&["bench", "policy.armor"]));
}

#[test]
fn wrong_arguments_are_bad_usage() {
    let bench = Bench::flashed();
    bench.misuse(&[]);
    bench.misuse(&["fly"]);
    bench.misuse(&["inspect"]);
    bench.misuse(&["flash", "policy.armor"]);
    bench.misuse(&["flash", "policy.armor", "--chip", "robot.chip", "--slot", "c"]);
    assert!(bench.misuse(&["run", "--chip", "robot.chip", "--task", "ball-jump"]).contains("no task is called"));
    assert!(bench.misuse(&[&RUN[..], &["--board", "mps2-an386"]].concat()).contains("possible values: host"));
    for (option, value) in [("--limit", "-1"), ("--limit", "NaN"), ("--limit", "few"), ("--rate", "fast")] {
        assert!(bench.misuse(&[&RUN[..], &[&format!("{option}={value}")]].concat()).contains(option));
    }
    bench.misuse(&["run", "--chip", "robot.chip", "--task", "ball-run", "--episodes", "0"]);
}

#[test]
fn help_fits_a_terminal() {
    let bench = Bench::new();
    for command in ["inspect", "verify", "trace", "flash", "run", "bench"] {
        let output = bench.run(&[command, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        fits_a_terminal(&output);
    }
}

#[test]
fn what_is_no_whole_image_is_refused_by_every_command_that_takes_one() {
    let bench = Bench::new();
    let image = fixture::ball_run(1);
    bench.put("cut.armor", &image[..image.len() - 4]);
    bench.put("other.armor", b"#!/bin/sh\necho this is no image at all\n");
    bench.put("empty.armor", b"");
    bench.put("state.txt", b"0 0 0 0 0 0 0");
    for (name, message) in [
        ("cut.armor", "image is cut short"),
        ("other.armor", "not a policy image"),
        ("empty.armor", "image is cut short"),
        ("none.armor", "cannot read none.armor"),
    ] {
        for command in ["inspect", "bench", "flash", "trace"] {
            let options: &[&str] = match command {
                "flash" => &["--chip", "robot.chip"],
                "trace" => &["--state", "state.txt", "--kappa", "1", "--seed", "1"],
                _ => &[],
            };
            let error = bench.failure(&[&[command, name], options].concat());
            assert!(error.contains(message) && error.contains(name), "{error}");
        }
    }
    assert!(!bench.path("robot.chip").exists());
    let output = bench.run(&["verify", "cut.armor"]);
    assert_eq!(output.status.code(), Some(1));
    assert!(text(&output.stdout).starts_with("FAIL  image"));
}

#[test]
fn a_flight_that_does_not_fit_is_refused() {
    let bench = Bench::flashed();
    let with = |options: &[&str]| bench.failure(&[&RUN[..], options].concat());
    assert!(with(&["--rate", "7"]).contains("30 Hz or a whole fraction, not at 7"));
    assert!(with(&["--limit", &(TRAINED_MAX + 1.0).to_string()]).contains("set a limit of at most 40"));
    let simulator = ["run", "--chip", "robot.chip", "--task", "SafetyPointGoal1-v0"];
    assert!(bench.failure(&simulator).contains("only native tasks fly so far; use ball-run"));

    for (name, parts, message) in [
        ("other-task", Parts::random("point-goal", BALL_RUN, 1), "trained for point-goal and not for ball-run"),
        ("other-size", Parts::random("ball-run", Shape { state: 9, ..BALL_RUN }, 1), "senses 9 and moves 2 entries"),
    ] {
        bench.put(name, &parts.with_golden().bytes());
        bench.json(&["flash", name, "--chip", "robot.chip"]);
        assert!(bench.failure(&RUN).contains(message));
    }
}

#[test]
fn what_is_no_chip_is_refused() {
    let bench = Bench::flashed();
    let whole = fs::read(bench.path("robot.chip")).unwrap();
    let refused = |bytes: &[u8]| {
        bench.put("robot.chip", bytes);
        bench.failure(&RUN)
    };
    assert!(refused(&whole[..whole.len() / 2]).contains("it was cut"));
    assert!(refused(&fixture::ball_run(1)).contains("not a chip file"));
    assert!(bench.failure(&["flash", "policy.armor", "--chip", "policy.armor"]).contains("not a chip file"));
    fs::remove_file(bench.path("robot.chip")).unwrap();
    assert!(bench.failure(&RUN).contains("cannot read robot.chip"));
}

#[test]
fn a_file_that_cannot_be_written_is_named_and_nothing_is_left_behind() {
    let bench = Bench::flashed();
    let before = fs::read_dir(bench.folder.path()).unwrap().count();
    let error = bench.failure(&[&RUN[..], &["-o", "no/such/folder/flight.csv"]].concat());
    assert!(error.contains("cannot write no/such/folder/flight.csv"), "{error}");
    assert_eq!(fs::read_dir(bench.folder.path()).unwrap().count(), before);
}

/// A pipe whose reader has gone before the result comes.
#[test]
fn a_reader_that_left_is_no_panic() {
    let bench = Bench::new();
    for arguments in [&["inspect", "policy.armor"][..], &["bench", "policy.armor", "--json"], &["run", "--help"]] {
        let mut child = bench.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let mut stderr = String::new();
        child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
}

#[test]
fn a_chip_is_written_with_the_permissions_of_any_new_file() {
    let bench = Bench::flashed();
    let permissions = |path: &Path| fs::metadata(path).unwrap().permissions();
    assert_eq!(permissions(&bench.path("robot.chip")), permissions(&bench.path("policy.armor")));
}
