//! The whole line by one command, with training cut to a few steps.

use super::*;

const FILES: [&str; 8] = [
    "alarms.log",
    "checkpoint.postcard",
    "chip.bin",
    "config.toml",
    "metrics.csv",
    "policy.armor",
    "provenance.json",
    "speed.csv",
];

#[test]
fn it_makes_every_promised_figure_and_file_and_goes_on_where_it_was() {
    let bench = Bench::new();
    let report = bench.json(&["quickstart", "--steps", "20", "--seeds", "0,1", "--out", "quick"]);
    assert_eq!((&report["data"]["transitions"], &report["data"]["trajectories"]), (&94_000.into(), &940.into()));
    assert_eq!((&report["plant"]["task"], &report["out"]), (&"ball-run".into(), &"quick".into()));
    let seeds = report["seeds"].as_array().unwrap();
    assert_eq!(seeds.len(), 2);
    for (number, seed) in seeds.iter().enumerate() {
        assert_eq!((&seed["training_seed"], &seed["cost_limit"]), (&number.into(), &5.0.into()));
        assert_eq!((&seed["episodes"], &seed["actions"], &seed["faults"]), (&20.into(), &2000.into(), &0.into()));
        for key in ["reward_normalized", "cost_normalized", "train_seconds", "latency_us_p50", "latency_us_p99"] {
            assert!(seed[key].is_number(), "{key}: {seed}");
        }
        assert!(seed["agreement_max_abs"].as_f64().unwrap() <= 1e-4, "{seed}");
        assert_eq!((&seed["agreement_samples"], &seed["golden_rows"]), (&1024.into(), &32.into()));
        assert_eq!(seed["verified"], true);
        let folder = format!("quick/seed-{number}");
        assert_eq!(bench.names(&folder), FILES);
        assert_eq!(seed["image"].as_str(), Some(&*format!("{folder}/policy.armor")));
        assert_eq!(seed["chip"].as_str(), Some(&*format!("{folder}/chip.bin")));
        assert_eq!(seed["image_bytes"], bench.bytes(&format!("{folder}/policy.armor")).len());
    }
    let safe = seeds.iter().filter(|seed| seed["cost_normalized"].as_f64().unwrap() <= 1.0).count();
    assert_eq!(report["safe_seeds"], safe);
    assert_ne!(seeds[0]["reward"], seeds[1]["reward"]);

    // Again, with nothing left to train: the checkpoint is not even written, and all comes out the same.
    let checkpoint = bench.path("quick/seed-0/checkpoint.postcard");
    let written = || fs::metadata(&checkpoint).unwrap().modified().unwrap();
    let (before, image) = (written(), bench.bytes("quick/seed-0/policy.armor"));
    let again = bench.success(&["quickstart", "--steps", "20", "--seeds", "0", "--out", "quick"]);
    assert_eq!((written(), bench.bytes("quick/seed-0/policy.armor")), (before, image));
    fits_a_terminal(&again);
    let row = format!("{:.3}", seeds[0]["reward_normalized"].as_f64().unwrap());
    assert!(text(&again.stdout).lines().any(|line| line.split_whitespace().take(2).eq(["0", &row])));
}

#[test]
fn a_wrong_argument_is_bad_usage_before_anything_is_read() {
    let bench = Bench::new();
    assert!(bench.misuse(&["quickstart", "--steps", "0", "--out", "quick"]).contains("--steps"));
    assert!(bench.misuse(&["quickstart", "--seeds", "one", "--out", "quick"]).contains("--seeds"));
    assert!(!bench.path("quick").exists());
}
