//! Flights under faults, by the command line: `sweep`, `soak`, and an episode alone.

use super::*;

#[test]
fn faults_are_swept_into_a_table() {
    let bench = Bench::new();
    let arguments = ["sweep", "policy.armor", "--task", "ball-run", "--seeds", "2", "--episodes", "1"];
    let faults = ["--fault", "sensor-nan=0.5", "--fault", "brown-out", "-o", "table.md"];
    let report = bench.json(&[&arguments[..], &faults].concat());
    let rows = report["rows"].as_array().unwrap();
    assert_eq!((rows.len(), &rows[0]["fault"], &rows[1]["fault"]["kind"]), (3, &Value::Null, &"sensor-nan".into()));
    assert!(rows[1]["tally"]["noticed"]["state"].as_u64() > Some(50), "{report}");
    assert!(rows.iter().all(|row| row["episodes"] == 2 && row["tally"]["steps"] == 200));
    let table = fs::read_to_string(bench.path("table.md")).unwrap();
    assert_eq!(table.lines().count(), 2 + 3);
    assert!(table.lines().nth(3).unwrap().starts_with("| sensor-nan | 0.5 | "));
    fits_a_terminal(&bench.run(&[&arguments[..], &faults].concat()));
}

#[test]
fn hours_are_soaked() {
    let bench = Bench::new();
    let arguments = ["soak", "policy.armor", "--task", "ball-run", "--hours", "0.1", "--board", "nrf52840"];
    let report = bench.json(&arguments);
    // 360 s at 30 Hz, in whole episodes of 100 control steps.
    assert_eq!((&report["tally"]["steps"], &report["episodes"]), (&10_800.into(), &108.into()));
    assert_eq!((&report["tally"]["budget_errors"], &report["tally"]["actions_out_of_range"]), (&0.into(), &0.into()));
    assert!(report["tally"]["injected"].as_object().unwrap().len() > 15, "{report}");
    let quiet = bench.json(&[&arguments[..], &["--no-faults"]].concat());
    assert!(quiet["tally"]["injected"].as_object().unwrap().is_empty());
    fits_a_terminal(&bench.run(&arguments));
    assert!(bench.misuse(&["soak", "policy.armor", "--task", "ball-run", "--hours", "0"]).contains("above 0"));
}

/// `soak` names an episode by its number; `run --first` flies it alone.
#[test]
fn an_episode_is_flown_alone_by_its_number() {
    let bench = Bench::flashed();
    let fly = |name: &str, more: &[&str]| {
        let options = ["--seed", "3", "--fault", "sensor-noise", "--board", "nrf52840", "-o", name];
        bench.json(&[&["run", "--chip", "robot.chip", "--task", "ball-run"], &options[..], more].concat());
        let csv = fs::read_to_string(bench.path(name)).unwrap();
        let rows = csv.lines().skip(1).map(|row| row.split_once(',').unwrap().1.to_owned());
        rows.collect::<Vec<_>>()
    };
    let (both, second) =
        (fly("both.csv", &["--episodes", "2"]), fly("second.csv", &["--episodes", "1", "--first", "1"]));
    assert_eq!(both[100..], second);
    let error = bench.failure(&["run", "--chip", "robot.chip", "--task", "ball-run", "--first", "4294967295"]);
    assert!(error.contains("no episode is numbered above 4294967294"), "{error}");
}
