//! What the commands answer.

use super::*;

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
    // All but the optional budget map and critic.
    assert_eq!(report["sections"].as_array().unwrap().len(), SectionKind::ALL.len() - 2);
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
    bench.json(&RUN);
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

/// On a board, under faults: the page, telemetry of every control step, and nothing that must not be.
#[test]
fn a_board_flies_under_faults_and_the_page_is_written() {
    let bench = Bench::flashed();
    let options = ["--board", "stm32f407", "--fault", "sensor-nan=0.1", "--fault", "watchdog-reset=0.02"];
    let files = ["-o", "flight.csv", "-o", "flight.html"];
    let report = bench.json(&[&RUN[..], &options, &files].concat());
    assert_eq!((&report["board"], &report["page"]), (&"stm32f407".into(), &"flight.html".into()));
    let tally = &report["tally"];
    assert_eq!((&tally["budget_errors"], &tally["actions_out_of_range"]), (&0.into(), &0.into()));
    assert!(
        tally["injected"]["sensor-nan"].as_u64() > Some(0) && tally["noticed"]["reset"].as_u64() > Some(0),
        "{tally}"
    );
    let csv = fs::read_to_string(bench.path("flight.csv")).unwrap();
    assert_eq!(csv.lines().count(), 1 + 200);
    assert!(csv.lines().next().unwrap().starts_with("episode,tick,time_us,kappa,left,"));
    assert!(fs::read_to_string(bench.path("flight.html")).unwrap().ends_with("</html>\n"));
    fits_a_terminal(&bench.run(&[&RUN[..], &options].concat()));
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
    bench.json(&RUN);
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
    assert_eq!((&row["precision"], &row["kernel"]), (&"f32".into(), &"portable".into()));
    assert_eq!((&row["steps"], &row["macs_per_action"]), (&5.into(), &(192 + 5 * 576).into()));
    assert!(row["actions_per_second"].as_f64().unwrap() > 0.0);
    fits_a_terminal(&bench.run(&["bench", "policy.armor"]));
}

#[test]
fn round_trips_over_the_link_are_timed() {
    let bench = Bench::new();
    let report = bench.json(&["bench", "policy.armor", "--link"]);
    let rows: Vec<_> = report["link"].as_array().unwrap().iter().map(|row| (&row["line"], &row["steps"])).collect();
    let [tcp, stdio] = ["tcp", "stdio"].map(Value::from);
    assert_eq!(rows, [(&tcp, &5.into()), (&stdio, &5.into()), (&tcp, &2.into()), (&stdio, &2.into())]);
    assert!(report["link"].as_array().unwrap().iter().all(|row| row["latency_us_p50"].as_f64().unwrap() > 0.0));
}

/// The hello of docs/link.md; the plant leaves after it.
#[test]
fn a_plant_is_served_on_standard_streams() {
    let bench = Bench::new();
    let mut child = bench.command(&["serve", "policy.armor", "--stdio"]);
    let mut child = child.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
    let hello = [0x01, 0x06, 0x01, 0x69, 0x22, 0xDE, 0x36, 0x00];
    std::io::Write::write_all(&mut child.stdin.take().unwrap(), &hello).unwrap();
    let output = child.wait_with_output().unwrap();
    assert_eq!(output.status.code(), Some(0));
    assert!(output.stdout.windows(8).any(|window| window == b"ball-run"));
    assert_eq!(output.stdout.iter().position(|&byte| byte == 0), Some(output.stdout.len() - 1));
    assert!(text(&output.stderr).ends_with("plant left after 0 episodes, 0 actions, 0 faults\n"));
}

#[test]
fn help_fits_a_terminal() {
    let bench = Bench::new();
    for command in ["inspect", "verify", "trace", "flash", "run", "sweep", "soak", "bench", "serve"] {
        let output = bench.run(&[command, "--help"]);
        assert_eq!(output.status.code(), Some(0));
        fits_a_terminal(&output);
    }
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

#[test]
fn the_best_of_several_actions_flies_by_the_images_critic() {
    let bench = Bench::new();
    bench.put("policy.armor", &Parts::random("ball-run", BALL_RUN, 1).with_golden().with_critic(1).bytes());
    bench.json(&["flash", "policy.armor", "--chip", "robot.chip"]);
    let flown = |options: &[&str]| bench.json(&[&RUN[..], options].concat())["reward"].as_f64().unwrap();
    let plain = flown(&[]);
    assert_eq!(flown(&["--best-of", "1"]), plain);
    assert_ne!(flown(&["--best-of", "4"]), plain);
    let checks = bench.json(&["verify", "policy.armor"]);
    assert_eq!(checks["passed"], true, "{checks}");
    assert!(checks["checks"].as_array().unwrap().iter().any(|check| check["name"] == "best of candidates"));
}
