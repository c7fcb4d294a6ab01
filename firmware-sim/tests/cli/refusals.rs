//! What the commands refuse, and how.

use super::*;

#[test]
fn wrong_arguments_are_bad_usage() {
    let bench = Bench::flashed();
    bench.misuse(&[]);
    bench.misuse(&["fly"]);
    bench.misuse(&["inspect"]);
    bench.misuse(&["flash", "policy.armor"]);
    bench.misuse(&["flash", "policy.armor", "--chip", "robot.chip", "--slot", "c"]);
    assert!(bench.misuse(&["run", "--chip", "robot.chip", "--task", "ball-jump"]).contains("no task is called"));
    assert!(bench.misuse(&[&RUN[..], &["--board", "arduino"]].concat()).contains("the boards are host, stm32f407"));
    assert!(bench.misuse(&[&RUN[..], &["--fault", "sensor"]].concat()).contains("the faults are sensor-nan"));
    assert!(bench.misuse(&[&RUN[..], &["--fault", "overlong=2"]].concat()).contains("above 0 and at most 1"));
    assert!(bench.misuse(&[&RUN[..], &["-o", "flight.txt"]].concat()).contains(".csv for telemetry or .html"));
    for (option, value) in [("--limit", "-1"), ("--limit", "NaN"), ("--limit", "few"), ("--rate", "fast")] {
        assert!(bench.misuse(&[&RUN[..], &[&format!("{option}={value}")]].concat()).contains(option));
    }
    bench.misuse(&["run", "--chip", "robot.chip", "--task", "ball-run", "--episodes", "0"]);
    assert!(bench.misuse(&[&RUN[..], &["--best-of", "3"]].concat()).contains("1, 2, 4, 8 or 16"));
    bench.misuse(&["serve", "policy.armor"]);
    bench.misuse(&["serve", "policy.armor", "--stdio", "--listen", "127.0.0.1:0"]);
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
        for command in ["inspect", "bench", "flash", "trace", "serve"] {
            let options: &[&str] = match command {
                "flash" => &["--chip", "robot.chip"],
                "serve" => &["--stdio"],
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
    assert!(with(&["--transport-us", "20000"]).contains("do not fit a period of 33333 us; fly at a lower rate"));
    assert!(with(&["--limit", &(TRAINED_MAX + 1.0).to_string()]).contains("set a limit of at most 40"));
    assert!(with(&["--best-of", "4"]).contains("no critic to choose among candidates by"));
    // None of these was a flight, so the policy is still on trial.
    assert!(text(&bench.run(&RUN).stderr).contains("slot A flew its trial and is confirmed"));
    let simulator = ["run", "--chip", "robot.chip", "--task", "SafetyPointGoal1-v0"];
    assert!(bench.failure(&simulator).contains("needs its simulator: fly it by armor-train evaluate"));

    for (name, parts, message) in [
        ("other-task", Parts::random("point-goal", BALL_RUN, 1), "trained for point-goal and not for ball-run"),
        ("other-size", Parts::random("ball-run", Shape { state: 9, ..BALL_RUN }, 1), "senses 9 and moves 2 entries"),
    ] {
        bench.put(name, &parts.with_golden().bytes());
        bench.json(&["flash", name, "--chip", "other.chip"]);
        assert!(bench.failure(&["run", "--chip", "other.chip", "--task", "ball-run"]).contains(message));
        fs::remove_file(bench.path("other.chip")).unwrap();
    }
    bench.put("circle", &Parts::random("ball-circle", BALL_RUN, 1).with_golden().bytes());
    let refused = bench.failure(&["flash", "circle", "--chip", "robot.chip"]);
    assert!(refused.contains("the chip flies ball-run and the image is for ball-circle"), "{refused}");
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

#[test]
fn a_microcontroller_needs_a_machine_that_there_is_and_firmware_for_it() {
    let bench = Bench::new();
    let usage = bench.misuse(&["mcu", "policy.armor", "--machine", "mps2-an521"]);
    assert!(usage.contains("mps2-an505, mps3-an547"), "{usage}");
    let fly = ["mcu", "policy.armor", "--machine", "mps2-an386", "--firmware", "."];
    let error = bench.failure(&fly);
    assert!(error.contains("cannot read ./mps2-an386.elf"), "{error}");
    bench.put("mps2-an386.elf", b"no firmware");
    let error = bench.failure(&fly);
    assert!(error.contains("no firmware of firmware-sim/mcu") && error.contains("build.sh"), "{error}");
    let usage = bench.misuse(&["mcu", "policy.armor", "--machine", "all", "--listen", "127.0.0.1:0"]);
    assert!(usage.contains("name it"), "{usage}");
}
