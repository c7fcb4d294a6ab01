//! Policies in integers that fly otherwise than the ones they were made of.

use firmware_sim::verify::verify;

use super::*;

/// The arguments of an export in integers.
fn integers<'a>(run: &'a str, precision: &'a str, image: &'a str) -> [&'a str; 6] {
    ["export", run, "--precision", precision, "-o", image]
}

/// Networks of 8 units that are hardly trained are far off in 8 bits about
/// every second time; the seeds are tried until one is.
fn drifting(bench: &Bench) -> String {
    for seed in 0..12 {
        let (run, seed) = (format!("run-{seed}"), seed.to_string());
        let mut arguments = ball_run(&run, 20);
        arguments.extend(["--set", "actor_rate=0.1", "--seed", &seed].map(str::to_owned));
        bench.success(&arguments);
        if !bench.run(&integers(&run, "int8", "taken.armor")).status.success() {
            return run;
        }
        fs::remove_file(bench.path("taken.armor")).unwrap();
    }
    panic!("none of 12 policies drifts");
}

#[test]
fn an_image_that_drifts_is_refused_and_can_be_taken_all_the_same() {
    let bench = Bench::new();
    let run = drifting(&bench);
    let before = bench.names(".");
    let output = bench.run(&integers(&run, "int8", "taken.armor"));
    let told = error(&output);
    assert!(told.starts_with("error: refused to write taken.armor: in Int8, rung "), "{told}");
    assert!(told.contains("export as int16x8 or f32, or take it with --accept-drift"), "{told}");
    // What was measured is shown, for whoever has to decide.
    assert!(text(&output.stderr).contains("root mean square"), "{}", text(&output.stderr));
    assert!(output.stdout.is_empty());
    assert_eq!(bench.names("."), before);

    let accepted = bench.json(&[&integers(&run, "int8", "taken.armor")[..], &["--accept-drift"]].concat());
    let beyond = |rung: &Value| {
        let moved = |key: &str| rung[key].as_f64().unwrap() - rung[format!("float_{key}")].as_f64().unwrap();
        moved("reward_normalized").abs() > 0.02 || moved("cost_normalized") > 0.1
    };
    assert!(accepted["drift"].as_array().unwrap().iter().any(beyond), "{accepted}");
    let bytes = firmware_sim::memory::AlignedBytes::read(&bench.path("taken.armor")).unwrap();
    assert!(verify(bytes.as_slice(), 1).passed);

    bench.success(&integers(&run, "f32", "float.armor"));
}

#[test]
fn a_budget_map_goes_into_an_integer_image_as_it_is() {
    let bench = Bench::new();
    let mut arguments = ball_run("run", 2);
    for option in ["condition=lambda", "extraction=weighted", "bootstrap=in_sample", "critic_steps=1"] {
        arguments.extend(["--set", option].map(str::to_owned));
    }
    bench.success(&arguments);
    bench.success(&["calibrate", "run", "--constant", "0.5"]);
    let map = |precision: &str| {
        let image = format!("{precision}.armor");
        bench.success(&[&integers("run", precision, &image)[..], &["--accept-drift"]].concat());
        let bytes = firmware_sim::memory::AlignedBytes::read(&bench.path(&image)).unwrap();
        // Among the checks is a second implementation, which reads the map, too.
        let verification = verify(bytes.as_slice(), 1);
        assert!(verification.passed, "{verification}");
        let image = armor_core::image::PolicyImage::new_checked(bytes.as_slice()).unwrap();
        image.words(armor_core::image::SectionKind::BudgetMap).to_vec()
    };
    let float = map("f32");
    assert!(!float.is_empty());
    for precision in ["int16x8", "int8"] {
        assert_eq!(map(precision), float, "{precision}");
    }
}
