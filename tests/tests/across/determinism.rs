//! The same seed gives the same bits: twice, on any number of threads, and
//! across any stop.

use armor_train::config::Config;
use armor_train::data::Dataset;
use armor_train::run::Outcome;
use rayon::ThreadPoolBuilder;

use crate::fixture::{self, Files, Run, made_up, shipped};

/// Steps of a run, with a row of the metrics at 100 and a window that is not full at the end.
const STEPS: u64 = 130;

/// Refreshes of the weights before steps 40, 80 and 120, and more options.
fn config(options: &[&str]) -> Config {
    let own = [
        "seed=4",
        &format!("steps={STEPS}"),
        "diffusion_steps=4",
        "target_steps=4",
        "reweight_warmup=40",
        "reweight_interval=40",
    ];
    fixture::config(&[&own, options].concat())
}

/// A run without a stop.
fn straight(config: &Config) -> Files {
    run(config, &made_up(), &[])
}

/// A run that is stopped after each of `stops` steps, and gone on with.
fn run(config: &Config, data: &Dataset, stops: &[u64]) -> Files {
    let run = Run::new();
    for &stop in stops {
        assert_eq!(run.fit(config, data, Some(stop)), Outcome::Stopped(stop));
        assert_eq!(run.checkpoint().state.step, stop);
    }
    assert_eq!(run.fit(config, data, None), Outcome::Done);
    run.files()
}

fn on_threads<T: Send>(threads: usize, work: impl FnOnce() -> T + Send) -> T {
    ThreadPoolBuilder::new().num_threads(threads).build().unwrap().install(|| {
        assert_eq!(rayon::current_num_threads(), threads);
        work()
    })
}

#[track_caller]
fn assert_same(one: &Files, other: &Files) {
    assert_eq!(one.config, other.config);
    assert_eq!(one.metrics, other.metrics);
    // Not `assert_eq`: the bytes tell a reader nothing.
    assert!(one.checkpoint == other.checkpoint, "the checkpoints differ");
}

#[test]
fn the_same_seed_gives_the_same_files_and_another_seed_another_policy() {
    let once = straight(&config(&[]));
    assert_same(&once, &straight(&config(&[])));
    // A header and the row of step 100.
    assert_eq!(once.metrics.lines().count(), 2);

    // A checkpoint holds its seed, so compare what was learned.
    let data = made_up();
    let learned = |seed: &str| {
        let run = Run::new();
        run.fit(&config(&["steps=3", seed]), &data, None);
        run.checkpoint().state
    };
    let (four, five) = (learned("seed=4"), learned("seed=5"));
    assert_eq!(four, learned("seed=4"));
    assert_ne!(four.parameters.actor, five.parameters.actor);
    assert_ne!(four.parameters.critic, five.parameters.critic);
    assert_ne!(four.parameters.dual, five.parameters.dual);
}

/// A batch of three unequal shares, and a refresh over data of five.
#[test]
fn the_number_of_threads_changes_nothing() {
    let config = config(&["batch=300", "steps=50"]);
    let one = on_threads(1, || straight(&config));
    for threads in [2, 3] {
        assert_same(&one, &on_threads(threads, || straight(&config)));
    }
    // From one stop to the next, too.
    let data = made_up();
    let changed = Run::new();
    on_threads(2, || changed.fit(&config, &data, Some(41)));
    on_threads(1, || changed.fit(&config, &data, None));
    assert_same(&one, &changed.files());
}

/// Before, at and after each refresh; at and around a row of the metrics; the first and the last step.
#[test]
fn a_run_that_was_stopped_ends_as_one_that_never_was() {
    let (config, data) = (config(&[]), made_up());
    let never = straight(&config);
    for stop in [1, 39, 40, 41, 80, 81, 99, 100, 101, 129] {
        assert_same(&never, &run(&config, &data, &[stop]));
    }
    assert_same(&never, &run(&config, &data, &[20, 40, 41, 100, 120, 129]));
}

/// Whatever is not in the paper has its own state, or its own draws.
#[test]
fn a_stop_changes_nothing_under_the_options_beyond_the_paper_either() {
    let options = [
        "relabel_share=0.5",
        "threshold=discounted",
        "dual_slack=0.1",
        "dual_normalize=true",
        "final_rate=0.1",
        "gradient_clip=1",
        "actor_average=0.9",
        "feasible_mass=0.5",
        "sigma_per_entry=true",
        "counterfactual_reference=realised",
        "counterfactual_tolerance=0.1",
        "policy_gradient=one_step",
        "target_sampler=ddim",
        "target_steps=2",
        "normalize_states=true",
    ];
    let (config, data) = (config(&options), made_up());
    let never = straight(&config);
    for stop in [1, 41, 100] {
        assert_same(&never, &run(&config, &data, &[stop]));
    }
}

#[test]
fn a_finished_run_that_is_extended_ends_as_a_longer_one() {
    let data = made_up();
    let longer = straight(&config(&[]));
    for steps in [40, 115] {
        let run = Run::new();
        assert_eq!(run.fit(&config(&[&format!("steps={steps}")]), &data, None), Outcome::Done);
        assert_eq!(run.fit(&config(&[]), &data, None), Outcome::Done);
        assert_same(&longer, &run.files());
    }
}

/// Recorded data: a refresh runs over 94,000 transitions in many shares.
#[test]
fn a_stop_after_a_refresh_on_recorded_data_changes_nothing() {
    let config = config(&["steps=6", "reweight_warmup=2", "reweight_interval=2", "perturbations=2"]);
    let never = on_threads(1, || run(&config, shipped(), &[]));
    assert_same(&never, &on_threads(2, || run(&config, shipped(), &[3])));
}
