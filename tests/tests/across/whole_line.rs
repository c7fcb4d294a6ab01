//! Recorded data in, a policy flying on a simulated controller out: the same
//! numbers at every station.

use armor_core::image::PolicyImage;
use armor_core::noise::Noise;
use armor_core::schedule::Sampler;
use armor_core::units::CostLimit;
use armor_infer::golden;
use armor_train::actor::chain::Chain;
use armor_train::export::{AGREEMENT_BOUND, AGREEMENT_SAMPLES};
use armor_train::model::Model;
use armor_train::normaliser::Normaliser;
use firmware_sim::chip::{Boot, Chip, Slot};
use firmware_sim::file;
use firmware_sim::flight::{Flight, FlightPlan, fly};
use firmware_sim::task::Task;
use firmware_sim::verify::verify;
use nalgebra::DMatrix;

use crate::fixture::{Run, policy, shipped};

const LIMIT: f32 = 5.0;

fn flown(image: &[u8]) -> Flight {
    let task = Task::named("ball-run").unwrap();
    let limit = CostLimit::new(LIMIT).unwrap();
    let plan = FlightPlan { task, limit, episodes: 2, seed: 1, rate_hz: task.rate_hz };
    fly(&PolicyImage::new_checked(image).unwrap(), &plan).unwrap()
}

/// Writes the image to a file and a chip to another, reads both back, and boots.
fn flashed_and_booted(image: &[u8]) -> Boot {
    let folder = Run::new();
    let (image_file, chip_file) = (folder.path("policy.armor"), folder.path("robot.chip"));
    file::write(&image_file, image).unwrap();
    let read = firmware_sim::image_file::ImageFile::read(&image_file).unwrap();
    let mut chip = Chip::blank();
    chip.flash(read.bytes(), None).unwrap();
    chip.write(&chip_file).unwrap();
    Chip::read(&chip_file).unwrap().boot().unwrap()
}

#[test]
fn the_image_says_what_it_was_made_from() {
    let (checkpoint, exported) = (&policy().checkpoint, &policy().exported);
    let image = PolicyImage::new_checked(exported.bytes.as_slice()).unwrap();
    let manifest = image.manifest();
    let provenance = &manifest.provenance;
    assert_eq!((manifest.task, provenance.preset), ("ball-run", "paper"));
    assert_eq!((provenance.seed, provenance.steps), (3, 400));
    assert_eq!((&provenance.data_sha256, &checkpoint.data_sha256), (shipped().sha256(), shipped().sha256()));
    let shape = manifest.shape;
    assert_eq!((shape.state, shape.action, shape.steps), (7, 2, 20));
    assert_eq!((shape.hidden, shape.kappa_hidden, shape.kappa_embedding), (12, 5, 3));
    // The costliest recorded trajectory costs 80; raw kappa enters the network (O-8).
    assert_eq!((manifest.kappa.trained_max.to_f32(), manifest.kappa.scale), (80.0, 1.0));
    assert_eq!(manifest.agreement_max_abs, exported.agreement.agreement_max_abs);
}

#[test]
fn trainer_and_image_agree_over_recorded_states_and_budgets() {
    let agreement = policy().exported.agreement;
    assert_eq!(agreement.agreement_samples, AGREEMENT_SAMPLES);
    assert_eq!(AGREEMENT_BOUND, 1e-4);
    assert!(agreement.agreement_max_abs <= 1e-4, "{agreement:?}");
}

/// The trace again, by the trainer's own chain: agreement at every control
/// step and along a falling budget, not at the first step alone.
#[test]
fn the_golden_trace_is_what_the_trainer_computes() {
    let Model { actor, .. } = Model::new(&policy().checkpoint.config, 7, 2);
    let parameters = &policy().checkpoint.state.parameters.actor;
    let normaliser = Normaliser::new(shipped(), true);
    let image = PolicyImage::new_checked(policy().exported.bytes.as_slice()).unwrap();
    let trace = &image.sections().golden;
    let rows: Vec<_> = trace.rows().collect();

    let state = rows.iter().flat_map(|row| normaliser.apply(row.state)).collect();
    let kappa: Vec<f32> = rows.iter().map(|row| row.kappa.to_f32()).collect();
    let mut context = actor.denoiser.context(rows.len());
    actor.denoiser.prepare(parameters, &DMatrix::from_vec(7, rows.len(), state), &kappa, &mut context);
    let steps = actor.schedule.chain(Sampler::Ddpm, 20).collect();
    let mut chain = Chain::new(&actor.denoiser, steps, rows.len(), false);
    // Stage 0 is the start of the chain; the tick is the control step.
    let draw = |stage: usize, tick: usize, out: &mut [f32]| {
        Noise::new(trace.seed).fill_normal(stage as u32, tick as u64, out);
    };
    chain.run(&actor.denoiser, parameters, &context, &draw);
    for (tick, row) in rows.iter().enumerate() {
        for (flown, trained) in row.action.iter().zip(chain.action.column(tick).iter()) {
            assert!((flown - trained).abs() <= AGREEMENT_BOUND, "tick {tick}: {flown} and not {trained}");
        }
    }
}

/// The budget of the trace is seen full, falling by the recorded costs, and spent.
#[test]
fn the_golden_trace_replays_bit_for_bit_on_a_controller_of_any_capacity() {
    let image = PolicyImage::new_checked(policy().exported.bytes.as_slice()).unwrap();
    let rows: Vec<_> = image.sections().golden.rows().collect();
    assert_eq!(rows.len(), 32);
    assert_eq!(golden::replay::<7, 2, 12>(&image), Ok(32));
    assert_eq!(golden::replay::<128, 16, 512>(&image), Ok(32));

    let mut kappa = LIMIT;
    for row in &rows {
        kappa = (kappa - row.incurred).max(0.0);
        assert_eq!(row.kappa.to_f32(), kappa);
    }
    assert_eq!((rows[0].kappa.to_f32(), kappa), (LIMIT, 0.0));
    assert!(rows.iter().flat_map(|row| row.action).any(|entry| entry.abs() < 1.0), "every action is at its bound");
}

#[test]
fn every_check_of_the_image_passes() {
    let verification = verify(policy().exported.bytes.as_slice(), 1);
    assert!(verification.passed, "{verification}");
    assert_eq!((verification.checks.len(), verification.golden_rows), (7, 32));
}

#[test]
fn what_boots_is_what_was_exported() {
    let image = &policy().exported.bytes;
    let booted = flashed_and_booted(image.as_slice());
    assert_eq!(booted, Boot { slot: Slot::A, image: image.clone(), golden_rows: 32, passed_over: None });
}

#[test]
fn a_booted_policy_flies_within_its_bounds_and_keeps_its_budget() {
    let booted = flashed_and_booted(policy().exported.bytes.as_slice());
    let flight = flown(booted.image.as_slice());
    assert_eq!((flight.episodes.len(), flight.summary.actions, flight.summary.faults), (2, 200, 0));
    for episode in &flight.episodes {
        let mut kappa = f64::from(LIMIT);
        for tick in &episode.ticks {
            assert_eq!((f64::from(tick.step.kappa.to_f32()), tick.step.fault), (kappa, None));
            assert!(tick.step.action.iter().all(|entry| (-1.0..=1.0).contains(entry)), "{:?}", tick.step);
            assert!(tick.step.action.iter().skip(2).all(|&entry| entry == 0.0));
            kappa = (kappa - tick.cost).max(0.0);
        }
    }
    // Else the budget has not been seen to fall and to stop at 0.
    assert!(flight.episodes.iter().any(|episode| episode.cost() > f64::from(LIMIT)), "{}", flight.summary);
}
