//! What the commands answer.

use std::io::Read;

use super::*;

#[test]
fn the_shipped_recording_is_counted() {
    let bench = Bench::new();
    let stats = bench.json(&["data", "stats", &shipped(), "--limit", "5"]);
    assert_eq!((&stats["transitions"], &stats["trajectories"]), (&94_000.into(), &940.into()));
    for (key, expected) in [("p_nz", 0.363), ("p_feas", 0.130)] {
        assert!((stats[key].as_f64().unwrap() - expected).abs() < 5e-4, "{key}: {stats}");
    }
    assert_eq!(stats["cost_limit"], 5.0);
    let plain = bench.success(&["data", "stats", &shipped(), "--limit", "5"]);
    fits_a_terminal(&plain);
    let words = text(&plain.stdout);
    assert!(words.ends_with('\n') && !words.ends_with("\n\n"), "no empty line at the end");
    for number in ["94000", "940", "0.363", "0.130"] {
        assert!(words.split_whitespace().any(|word| word == number), "{number} in {words}");
    }
}

#[test]
fn a_collected_recording_is_sound_and_trains() {
    let bench = Bench::new();
    let collect = ["data", "collect", "--task", "ball-run", "--trajectories", "20", "--out"];
    let stats = bench.json(&[&collect[..], &["own.hdf5"]].concat());
    assert_eq!((&stats["transitions"], &stats["trajectories"]), (&2000.into(), &20.into()));
    fits_a_terminal(&bench.success(&[&collect[..], &["again.hdf5"]].concat()));
    assert_eq!(bench.bytes("own.hdf5"), bench.bytes("again.hdf5"));
    let report = bench.json(&["data", "check", "own.hdf5"]);
    assert_eq!(report["faults"].as_array().unwrap().len(), 0, "{report}");
    let calibration = bench.json(&["data", "calibrate", "own.hdf5", "--task", "ball-run"]);
    assert_eq!(calibration["recorded_cost_mismatches"], 0, "the plant agrees with its own recording");
    bench.success(&fit(["own.hdf5", "ball-run", "5"], "run", 2, &[]));

    let error = bench.failure(&[&collect[..], &["no/such/folder/x.hdf5"]].concat());
    assert!(error.contains("cannot write no/such/folder/x.hdf5"), "{error}");
    let error = bench.failure(&["data", "collect", "--task", "SafetyAntRun-v0", "--out", "x.hdf5"]);
    assert!(error.contains("needs its simulator"), "{error}");
    assert!(!bench.path("x.hdf5").exists());
}

#[test]
fn every_native_plant_can_be_recorded() {
    let bench = Bench::new();
    for (task, steps) in [("ball-circle", 400), ("point-circle", 1000), ("point-goal", 2000)] {
        let stats = bench.json(&["data", "collect", "--task", task, "--trajectories", "2", "--out", "own.hdf5"]);
        assert_eq!((&stats["transitions"], &stats["trajectories"]), (&steps.into(), &2.into()), "{task}");
        assert_eq!(bench.json(&["data", "check", "own.hdf5"])["faults"].as_array().unwrap().len(), 0, "{task}");
    }
}

#[test]
fn an_unfinished_episode_is_dropped_with_a_warning_or_kept_where_a_run_asks_for_it() {
    let bench = Bench::new();
    for (unfinished, transitions) in [("drop", 9), ("keep", 12)] {
        let output = bench.success(&toy(unfinished, 2, &["--set", &format!("unfinished={unfinished}")]));
        assert_eq!(text(&output.stderr).contains("are dropped"), unfinished == "drop");
        let origin: serde_json::Value =
            serde_json::from_slice(&bench.bytes(&format!("{unfinished}/provenance.json"))).unwrap();
        assert_eq!(origin["transitions"], transitions);
        let commit = origin["commit"].as_str().unwrap();
        let hash: String = commit.chars().take_while(char::is_ascii_hexdigit).collect();
        assert!(commit == "unknown" || hash.len() == 40, "{commit}");
    }
}

#[test]
fn a_sound_file_passes_the_check_and_a_faulty_one_is_told_why() {
    let bench = Bench::new();
    let report = bench.json(&["data", "check", "small.hdf5"]);
    assert_eq!((&report["transitions"], &report["trajectories"]), (&9.into(), &2.into()));
    assert_eq!(report["faults"].as_array().unwrap().len(), 0);
    assert_eq!(report["warnings"][0]["warning"], "unfinished_trajectory");

    // The report is printed and the command fails: a script may look at either.
    bench.put("notes.txt", b"no recording at all");
    let output = bench.run(&["data", "check", "notes.txt", "--json"]);
    assert!(error(&output).contains("notes.txt cannot be used"));
    let report = object(&output);
    assert_eq!(report["faults"][0]["fault"], "not_hdf5");
    assert!(report["faults"][0]["message"].as_str().unwrap().starts_with("not an HDF5 file (19 bytes"));
    let plain = bench.run(&["data", "check", "notes.txt"]);
    assert!(text(&plain.stdout).contains("fault: not an HDF5 file") && plain.status.code() == Some(1));
}

/// Rewards to the rounding of the recording, costs exactly.
#[test]
fn the_native_plant_is_held_against_the_recording() {
    let bench = Bench::new();
    let report = bench.json(&["data", "calibrate", &shipped(), "--task", "ball-run"]);
    assert_eq!((&report["transitions"], &report["episodes"]), (&94_000.into(), &940.into()));
    assert_eq!(report["recorded_cost_mismatches"], 0);
    for way in ["one_step", "replay"] {
        assert_eq!(report[way]["cost_mismatches"], 0, "{way}");
        assert!(report[way]["reward_max_abs"].as_f64().unwrap() < 1e-5, "{way}: {report}");
        assert_eq!(report[way]["observation_max_abs"].as_array().unwrap().len(), 7);
    }
    fits_a_terminal(&bench.success(&["data", "calibrate", &shipped(), "--task", "ball-run"]));
}

#[test]
fn a_run_is_trained_exported_and_scored() {
    let bench = Bench::new();
    let report = bench.json(&ball_run("run", 5));
    assert_eq!((&report["out"], &report["steps"]), (&"run".into(), &5.into()));
    assert!(report["seconds"].is_number());
    let files = ["alarms.log", "checkpoint.postcard", "config.toml", "metrics.csv", "provenance.json", "speed.csv"];
    assert_eq!(bench.names("run"), files);
    let config = text(&bench.bytes("run/config.toml"));
    for line in ["preset = \"paper\"", "hidden = 8", "limit = 5.0", "steps = 5", "seed = 0"] {
        assert!(config.lines().any(|other| other == line), "{line} in {config}");
    }

    let report = bench.json(&["export", "run", "-o", "policy.armor"]);
    assert_eq!((&report["image"], &report["precision"]), (&"policy.armor".into(), &"f32".into()));
    assert_eq!((&report["image_bytes"], &report["steps"]), (&bench.bytes("policy.armor").len().into(), &5.into()));
    assert!(report["agreement_max_abs"].as_f64().unwrap() <= 1e-4, "{report}");
    assert_eq!(report["agreement_samples"], 1024);

    // What is scored is what is deployed: the run's folder and its image fly alike.
    let evaluate = |policy: &str, more: &[&str]| {
        let arguments = ["evaluate", policy, "--task", "ball-run", "--episodes", "2", "--seed", "7"];
        let mut report = bench.json(&[&arguments[..], more].concat());
        for flight in report["flights"].as_array_mut().unwrap() {
            for key in ["latency_us_p50", "latency_us_p99", "latency_us_max", "deadline_misses"] {
                assert!(flight.as_object_mut().unwrap().remove(key).unwrap().is_number(), "{key}");
            }
        }
        report
    };
    let image = evaluate("policy.armor", &["--limit", "2,5"]);
    assert_eq!(image["flights"], evaluate("run", &["--limit", "2,5"])["flights"]);
    assert_eq!((&image["flights"][0]["cost_limit"], &image["flights"][1]["cost_limit"]), (&2.0.into(), &5.0.into()));
    let flight = &image["flights"][1];
    assert_eq!((&flight["episodes"], &flight["actions"], &flight["faults"]), (&2.into(), &200.into(), &0.into()));
    for key in ["reward_normalized", "cost_normalized", "reward_std", "safe_episodes"] {
        assert!(flight[key].is_number(), "{key}: {flight}");
    }
    // Without a limit it is the paper's.
    assert_eq!(&evaluate("policy.armor", &[])["flights"][0], flight);

    for arguments in [
        &["export", "run", "-o", "again.armor"][..],
        &["evaluate", "again.armor", "--task", "ball-run", "--episodes", "1"],
    ] {
        fits_a_terminal(&bench.success(arguments));
    }
    assert_eq!(bench.bytes("again.armor"), bench.bytes("policy.armor"));
    assert_eq!(bench.json(&["export", "run", "--release", "7", "-o", "seventh.armor"])["release"], 7);
    let seventh = firmware_sim::memory::AlignedBytes::read(&bench.path("seventh.armor")).unwrap();
    assert_eq!(armor_core::image::PolicyImage::new_checked(seventh.as_slice()).unwrap().manifest().release, 7);
}

/// Whatever the policy's distribution is, the image flies it, and an independent program in f64 agrees.
#[test]
fn every_kind_of_policy_flies() {
    let bench = Bench::new();
    let gaussian = ["policy=gaussian", "diffusion_steps=1", "target_steps=1"];
    for (name, options, rungs) in [
        ("gaussian", &gaussian[..], 1),
        ("cosine", &["noise_schedule=cosine", "diffusion_steps=20"], 5),
        ("beta", &["reverse_variance=beta", "temperature=0.5"], 3),
        ("unclipped", &["x0_clip=last_step"], 3),
    ] {
        let set = options.iter().flat_map(|option| ["--set".to_owned(), (*option).to_owned()]);
        bench.success(&ball_run(name, 20).into_iter().chain(set).collect::<Vec<_>>());
        let image = format!("{name}.armor");
        let report = bench.json(&["export", name, "-o", &image]);
        assert!(report["agreement_max_abs"].as_f64().unwrap() <= 1e-4, "{report}");
        let bytes = firmware_sim::memory::AlignedBytes::read(&bench.path(&image)).unwrap();
        assert_eq!(firmware_sim::verify::verify(bytes.as_slice(), 0).failures(), 0, "{name}");
        let policy = armor_core::image::PolicyImage::new_checked(bytes.as_slice()).unwrap();
        assert_eq!(policy.manifest().rungs.len(), rungs);
        let flights = bench.json(&["evaluate", &image, "--task", "ball-run", "--episodes", "2"]);
        assert_eq!(flights["flights"][0]["faults"], 0);
    }
}

#[test]
fn a_policy_is_exported_in_integers_with_what_they_change() {
    let bench = Bench::new();
    bench.success(&ball_run("run", 5));
    for precision in ["int16x8", "int8"] {
        let image = format!("{precision}.armor");
        // Five training steps make no policy to be kept, so whatever it does is accepted.
        let export = ["export", "run", "--precision", precision, "--accept-drift", "-o", &image];
        let report = bench.json(&export);
        assert_eq!((&report["precision"], &report["agreement_samples"]), (&precision.into(), &1024.into()));
        assert!(report["agreement_rms"].as_f64().unwrap() > 0.0, "{report}");
        let drift = report["drift"].as_array().unwrap();
        assert_eq!(drift[0]["rung"], 0);
        assert!(drift.iter().all(|rung| rung["float_reward_normalized"].is_number()), "{report}");
        let bytes = firmware_sim::memory::AlignedBytes::read(&bench.path(&image)).unwrap();
        assert_eq!(firmware_sim::verify::verify(bytes.as_slice(), 0).failures(), 0, "{precision}");
        fits_a_terminal(&bench.success(&export));
    }

    // A task without a native plant is compared on its recorded states alone.
    bench.success(&toy("toy", 2, &[]));
    let report = bench.json(&["export", "toy", "--precision", "int8", "-o", "toy.armor"]);
    assert_eq!(report["drift"], serde_json::json!([]));
}

#[test]
fn a_task_of_the_users_own_is_trained_and_exported_in_any_size() {
    let bench = Bench::new();
    fits_a_terminal(&bench.success(&toy("run", 2, &[])));
    bench.json(&["export", "run", "-o", "toy.armor"]);
    let error = bench.failure(&["evaluate", "toy.armor", "--task", "ball-run"]);
    assert!(error.contains("trained for toy and not for ball-run"), "{error}");
}

/// A run's own configuration starts the same run again; `--set` and flags go on top of it.
#[test]
fn a_run_is_repeated_from_its_configuration() {
    let bench = Bench::new();
    bench.success(&toy("run", 3, &["--set", "eta=0.5"]));
    let again = ["fit", "--config", "run/config.toml", "--out"];
    bench.success(&[&again[..], &["again"]].concat());
    for file in ["config.toml", "checkpoint.postcard", "metrics.csv"] {
        assert_eq!(bench.bytes(&format!("again/{file}")), bench.bytes(&format!("run/{file}")), "{file}");
    }
    bench.success(&[&again[..], &["other", "--set", "eta=0.25", "--set", "steps=9", "--steps", "2"]].concat());
    let config = text(&bench.bytes("other/config.toml"));
    for line in ["preset = \"paper\"", "hidden = 8", "eta = 0.25", "steps = 2", "limit = 1.0"] {
        assert!(config.lines().any(|other| other == line), "{line} in {config}");
    }
}

#[test]
fn the_options_are_listed_with_their_meaning() {
    let bench = Bench::new();
    let plain = bench.success(&["options"]);
    fits_a_terminal(&plain);
    assert!(text(&plain.stdout).contains("\n  batch = 512 (paper), 256 (quick), 256 (tuned)\n"));
    let listed = bench.json(&["options"]);
    bench.success(&toy("run", 1, &[]));
    let config: toml::Table = text(&bench.bytes("run/config.toml")).parse().unwrap();
    let keys: Vec<&str> = listed["options"].as_array().unwrap().iter().map(|o| o["key"].as_str().unwrap()).collect();
    assert_eq!(keys.len(), config.len());
    assert!(config.keys().all(|key| keys.contains(&key.as_str())));
}

#[test]
fn a_run_is_drawn_as_one_page() {
    let bench = Bench::new();
    bench.success(&toy("run", 200, &[]));
    let report = bench.success(&["report", "run", "-o", "page.html"]);
    fits_a_terminal(&report);
    let page = text(&bench.bytes("page.html"));
    assert!(page.starts_with("<!doctype html>") && page.trim_end().ends_with("</html>"));
    assert!(page.contains("<svg") && !page.contains("http"), "it draws, and asks nobody");
    assert!(bench.failure(&["report", "nowhere", "-o", "page.html"]).contains("nowhere"));
}

#[test]
fn a_run_finds_its_data_where_it_was_moved_to() {
    let bench = Bench::new();
    bench.success(&toy("run", 2, &[]));
    fs::create_dir(bench.path("archive")).unwrap();
    fs::rename(bench.path("small.hdf5"), bench.path("archive/moved.hdf5")).unwrap();
    let error = bench.failure(&["export", "run", "-o", "toy.armor"]);
    assert!(error.contains("no such file") && error.contains("--data"), "{error}");
    assert!(!bench.path("toy.armor").exists());
    bench.json(&["export", "run", "-o", "toy.armor", "--data", "archive/moved.hdf5"]);
    // A run goes on with it, too.
    let resumed = fit(["archive/moved.hdf5", "toy", "1"], "run", 4, &["--resume"]);
    assert_eq!(bench.json(&resumed)["steps"], 4);
}

#[test]
fn help_fits_a_terminal() {
    let bench = Bench::new();
    for command in [
        &[][..],
        &["quickstart"],
        &["data"],
        &["data", "stats"],
        &["data", "check"],
        &["data", "calibrate"],
        &["data", "collect"],
        &["fit"],
        &["options"],
        &["report"],
        &["export"],
        &["evaluate"],
    ] {
        for help in ["-h", "--help"] {
            let output = bench.success(&[command, &[help]].concat());
            assert!(text(&output.stdout).contains("Usage: armor-train"));
            fits_a_terminal(&output);
        }
    }
}

/// A pipe whose reader has gone before the result comes.
#[test]
fn a_reader_that_left_is_no_panic() {
    let bench = Bench::new();
    for arguments in [&["data", "check", "small.hdf5"][..], &["data", "check", "small.hdf5", "--json"], &["--help"]] {
        let mut child = bench.command(arguments).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        drop(child.stdout.take());
        let mut stderr = String::new();
        child.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        assert_eq!(child.wait().unwrap().code(), Some(0), "{stderr}");
        assert!(!stderr.contains("panicked"), "{stderr}");
    }
}
