//! What the commands refuse, and how.

use super::*;

#[test]
fn wrong_arguments_are_bad_usage() {
    let bench = Bench::new();
    bench.misuse::<&str>(&[]);
    bench.misuse(&["train"]);
    bench.misuse(&["data"]);
    bench.misuse(&["data", "stats", "small.hdf5"]);
    bench.misuse(&["fit", "--data", "small.hdf5", "--task", "toy", "--limit", "1"]);
    for limit in ["-1", "NaN", "few", "65536"] {
        let said = bench.misuse(&["data", "stats", "small.hdf5", &format!("--limit={limit}")]);
        assert!(said.contains("--limit"), "{said}");
    }
    let preset = ["fit", "--data", "small.hdf5", "--task", "toy", "--limit", "1", "--out", "run", "--preset", "fast"];
    assert!(bench.misuse(&preset).contains("[possible values: paper, quick"));
    let task = ["--task", "ball-jump"];
    assert!(bench.misuse(&[&["evaluate", "run"], &task[..]].concat()).contains("no task is called ball-jump"));
    assert!(bench.misuse(&[&["data", "calibrate", "x"], &task[..]].concat()).contains("no task is called ball-jump"));
    assert!(bench.misuse(&["evaluate", "run", "--task", "ball-run", "--episodes", "0"]).contains("--episodes"));
    assert!(bench.misuse(&["export", "run", "-o", "x", "--precision", "int4"]).contains("possible values: f32"));
    assert!(bench.misuse(&["export", "run", "-o", "x", "--layout", "paired"]).contains("f32 have one layout"));
    assert_eq!(bench.names("."), ["small.hdf5"]);
}

#[test]
fn an_option_that_cannot_be_set_is_bad_usage_and_says_what_can() {
    let bench = Bench::new();
    let with = |option: &str| bench.misuse(&toy("run", 1, &["--set", option]));
    assert!(with("actor_lr=1").contains("there is no option `actor_lr`; did you mean `actor_rate`?"));
    assert!(with("eta").contains("`eta` is not of the form key=value"));
    assert!(with("eta=high").contains("option `eta` cannot be `high`"));
    assert!(with("batch=-3").contains("option `batch` cannot be `-3`"));
    assert!(with("batch=0").contains("option `batch` must be between 1 and 65536"));
    assert!(with("diffusion_steps=1").contains("option `target_steps` must be between 1 and diffusion_steps"));
    assert!(bench.misuse(&toy("run", 0, &[])).contains("must be at least 1"));
    assert!(bench.misuse(&["data", "stats", "small.hdf5", "--limit", "1", "--beta=-1"]).contains("--beta"));
    assert_eq!(bench.names("."), ["small.hdf5"]);
}

#[test]
fn a_file_of_options_that_cannot_be_used_is_named() {
    let bench = Bench::new();
    let with = |text: &str| {
        bench.put("options.toml", text.as_bytes());
        bench.misuse(&toy("run", 1, &["--config", "options.toml"]))
    };
    assert!(with("eta = 1\nbeta =").contains("options.toml: line 2 is no TOML"));
    assert!(with("actor_lr = 1").contains("there is no option `actor_lr`; did you mean `actor_rate`?"));
    assert!(with("normalize_states = \"yes\"").contains("option `normalize_states` cannot be `yes`"));
    assert!(with("weight_max = 0.1").contains("option `weight_max` must be"));
    let error = bench.failure(&toy("run", 1, &["--config", "none.toml"]));
    assert!(error.contains("cannot read none.toml"), "{error}");

    let missing = |arguments: &[&str]| bench.misuse(&[&["fit", "--out", "run"], arguments].concat());
    assert!(missing(&["--data", "small.hdf5"]).contains("--task is missing"));
    assert!(missing(&["--task", "toy"]).contains("--data is missing"));
    assert!(missing(&["--data", "small.hdf5", "--task", "toy"]).contains("--limit is missing: toy is no task"));
    assert_eq!(bench.names("."), ["options.toml", "small.hdf5"]);
}

#[test]
fn what_is_no_recording_is_named_by_every_command_that_reads_one() {
    let bench = Bench::new();
    let small = bench.bytes("small.hdf5");
    bench.put("cut.hdf5", &small[..small.len() / 2]);
    bench.put("text.hdf5", b"t,x\n0,1\n");
    bench.put("empty.hdf5", b"");
    for (name, message) in [
        ("none.hdf5", "no such file; name an HDF5 file in the DSRL layout"),
        ("cut.hdf5", "cut short: 10744 bytes of 21488; copy or download it again"),
        ("text.hdf5", "not an HDF5 file (8 bytes without the signature)"),
        ("empty.hdf5", "not an HDF5 file (0 bytes without the signature)"),
    ] {
        for arguments in [
            vec!["data", "stats", name, "--limit", "1"],
            vec!["data", "calibrate", name, "--task", "ball-run"],
            vec!["fit", "--data", name, "--task", "toy", "--limit", "1", "--out", "run"],
            vec!["quickstart", "--data", name, "--out", "run"],
        ] {
            let error = bench.failure(&arguments);
            assert!(error.starts_with(&format!("error: {name}: {message}")), "{arguments:?}: {error}");
        }
        let check = bench.run(&["data", "check", name]);
        assert!(text(&check.stdout).contains(message) && check.status.code() == Some(1));
    }
    assert!(!bench.path("run").exists());
}

#[test]
fn data_of_another_robot_is_refused_before_anything_is_written() {
    let bench = Bench::new();
    for arguments in [
        fit(["small.hdf5", "ball-run", "5"], "run", 1, &[]),
        ["quickstart", "--data", "small.hdf5", "--out", "run"].map(str::to_owned).into(),
        ["data", "calibrate", "small.hdf5", "--task", "ball-run"].map(str::to_owned).into(),
    ] {
        let error = bench.failure(&arguments);
        assert!(error.contains("3 state and 2 action entries"), "{error}");
        assert!(error.contains("7 and 2; name the task that was recorded"), "{error}");
    }
    assert!(!bench.path("run").exists());
}

/// What no controller of this host could fly must not be trained for days first.
#[test]
fn a_network_that_could_not_be_exported_is_not_trained() {
    let bench = Bench::new();
    for (option, what) in
        [("hidden=513", "513 `hidden` units"), ("kappa_embedding=600", "600 `kappa_embedding` entries")]
    {
        let error = bench.failure(&toy("run", 1, &["--set", option]));
        assert!(error.contains(&format!("a policy with {what} could not be exported; 512 is the most")), "{error}");
    }
    assert!(!bench.path("run").exists());
}

#[test]
fn a_folder_with_a_run_is_not_overwritten() {
    let bench = Bench::new();
    bench.success(&toy("run", 2, &[]));
    let before = bench.bytes("run/checkpoint.postcard");
    let error = bench.failure(&toy("run", 3, &[]));
    assert!(error.ends_with("run already holds a run; add --resume to go on with it, or choose another --out"));
    assert_eq!(bench.bytes("run/checkpoint.postcard"), before);
    assert!(text(&bench.bytes("run/config.toml")).contains("steps = 2"));

    bench.put("file", b"");
    assert!(bench.failure(&toy("file", 2, &[])).contains("cannot make the folder file"));
}

#[test]
fn only_the_same_run_is_resumed() {
    let bench = Bench::new();
    let error = bench.failure(&toy("run", 2, &["--resume"]));
    assert!(error.ends_with("run holds no checkpoint; leave out --resume to start a run there"), "{error}");
    assert!(!bench.path("run").exists(), "nothing was started");

    bench.success(&toy("run", 2, &[]));
    let before = (bench.bytes("run/checkpoint.postcard"), bench.bytes("run/config.toml"));
    for (more, key) in
        [(&["--set", "beta=0.7"][..], "beta"), (&["--set", "hidden=9"], "hidden"), (&["--seed", "1"], "seed")]
    {
        let error = bench.failure(&toy("run", 4, &[&["--resume"], more].concat()));
        let expected = format!("run has another `{key}`; resume it with the options it was started with");
        assert!(error.ends_with(&expected), "{error}");
    }
    let error = bench.failure(&fit(["small.hdf5", "top", "1"], "run", 4, &["--resume"]));
    assert!(error.contains("another `task`"), "{error}");
    // The same data sets in a file with another hash.
    let mut other = bench.bytes("small.hdf5");
    other.extend(b"\0");
    bench.put("other.hdf5", &other);
    let error = bench.failure(&fit(["other.hdf5", "toy", "1"], "run", 4, &["--resume"]));
    assert!(error.contains("started with other data"), "{error}");
    let error = bench.failure(&toy("run", 1, &["--resume"]));
    assert!(error.contains("has done 2 steps"), "{error}");
    assert_eq!((bench.bytes("run/checkpoint.postcard"), bench.bytes("run/config.toml")), before);
    assert_eq!(bench.json(&toy("run", 2, &["--resume"]))["steps"], 2, "nothing is left to do, and that is no failure");
}

/// The rates of the steps done followed the length that the run had then.
#[test]
fn a_run_with_falling_rates_keeps_its_length() {
    let bench = Bench::new();
    bench.success(&toy("run", 2, &["--set", "final_rate=0.1"]));
    let error = bench.failure(&toy("run", 4, &["--set", "final_rate=0.1", "--resume"]));
    assert!(error.contains("another `steps`"), "{error}");
}

#[test]
fn a_damaged_checkpoint_is_named_and_nothing_is_exported() {
    let bench = Bench::new();
    bench.success(&toy("run", 2, &[]));
    let whole = bench.bytes("run/checkpoint.postcard");
    let mut flipped = whole.clone();
    flipped[whole.len() / 2] ^= 1;
    for damaged in [&flipped[..], &whole[..whole.len() - 1], b""] {
        bench.put("run/checkpoint.postcard", damaged);
        for arguments in [
            ["export", "run", "-o", "toy.armor"].map(str::to_owned).to_vec(),
            ["evaluate", "run", "--task", "ball-run"].map(str::to_owned).to_vec(),
            toy("run", 4, &["--resume"]),
        ] {
            let error = bench.failure(&arguments);
            assert!(error.contains("checkpoint.postcard is no whole checkpoint of this version"), "{error}");
        }
    }
    fs::remove_file(bench.path("run/checkpoint.postcard")).unwrap();
    assert!(bench.failure(&["export", "run", "-o", "toy.armor"]).contains("run holds no run; name the folder"));
    assert!(bench.failure(&["export", "nowhere", "-o", "toy.armor"]).contains("nowhere holds no run; name the folder"));
    assert_eq!(bench.names("."), ["run", "small.hdf5"]);
}

#[test]
fn an_image_that_cannot_be_written_leaves_nothing_behind() {
    let bench = Bench::new();
    bench.success(&toy("run", 2, &[]));
    fs::create_dir(bench.path("taken")).unwrap();
    for place in ["no/such/folder/toy.armor", "taken", "small.hdf5/toy.armor"] {
        let error = bench.failure(&["export", "run", "-o", place]);
        assert!(error.starts_with(&format!("error: cannot write {place}: ")), "{error}");
    }
    assert_eq!(bench.names("."), ["run", "small.hdf5", "taken"]);
    assert_eq!(bench.names("taken"), [""; 0]);
}

#[test]
fn a_simulator_that_cannot_be_installed_is_told_of_with_the_command_to_do_so() {
    let bench = Bench::new();
    bench.success(&ball_run("run", 1));
    let mut command = bench.command(&["evaluate", "run", "--task", "SafetyBallRun-v0"]);
    // No Python is found on an empty path.
    let output = command.env("PATH", "").env("ARMOR_SIMULATORS", bench.path("simulators")).output().unwrap();
    let told = error(&output);
    assert!(told.contains("pip install --no-deps -r firmware-sim/python/simulators.txt"), "{told}");
    assert!(text(&output.stderr).contains("installing the simulators in"));
    assert!(!bench.path("simulators").exists());
}

#[test]
fn a_policy_flies_its_own_native_task_within_the_limits_it_was_trained_with() {
    let bench = Bench::new();
    bench.success(&ball_run("run", 1));
    bench.success(&["export", "run", "-o", "policy.armor"]);
    let refused = |policy: &str, more: &[&str]| bench.failure(&[&["evaluate", policy, "--task"], more].concat());
    let error = refused("policy.armor", &["ball-run", "--limit", "5,81"]);
    assert!(error.contains("cost limit 81 lies above what the policy was trained with; set a limit of at most 80"));

    let image = bench.bytes("policy.armor");
    let mut flipped = image.clone();
    flipped[image.len() / 2] ^= 1;
    for (bytes, message) in [
        (&flipped[..], "image is damaged: its checksum is wrong"),
        (&image[..image.len() - 4], "image is cut short"),
        (b"", "image is cut short"),
        (b"#!/bin/sh\necho this is no image at all\n", "not a policy image"),
    ] {
        bench.put("policy.armor", bytes);
        let error = refused("policy.armor", &["ball-run"]);
        assert!(error.starts_with("error: policy.armor: ") && error.contains(message), "{error}");
    }
    assert!(refused("none.armor", &["ball-run"]).contains("none.armor"));
}

#[test]
fn a_policy_that_cannot_be_imported_is_named_and_nothing_is_written() {
    let bench = Bench::new();
    let interchange = std::path::Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/interchange");
    let whole = std::fs::read(interchange.join("policy.safetensors")).unwrap();
    bench.put("cut.safetensors", &whole[..whole.len() / 2]);
    bench.put("policy.toml", b"task = \"elsewhere\"\nsteps = 20\n");
    let tensors = interchange.join("policy.safetensors").display().to_string();
    let description = interchange.join("policy.toml").display().to_string();
    let import = |tensors: &str, description: &str| {
        bench.failure(&["import", tensors, "--description", description, "-o", "x.armor"])
    };
    assert!(import("cut.safetensors", &description).contains("cut.safetensors: no safetensors file"));
    assert!(import("none.safetensors", &description).contains("cannot read none.safetensors"));
    assert!(import(&tensors, "policy.toml").contains("missing field `cost_limit_max`"));
    bench.misuse(&["import", "cut.safetensors", "-o", "x.armor"]);
    assert_eq!(bench.names("."), ["cut.safetensors", "policy.toml", "small.hdf5"]);
}
