//! Recorded data in, a policy flying on a simulated controller out: the same
//! numbers at every station.

use armor_core::image::PolicyImage;
use armor_core::noise::Noise;
use armor_core::units::CostLimit;
use armor_infer::{Policy, golden};
use armor_train::actor::chain::Chain;
use armor_train::export::{AGREEMENT_BOUND, AGREEMENT_SAMPLES};
use armor_train::model::Model;
use armor_train::normaliser::Normaliser;
use firmware_sim::chip::{Boot, Chip, Slot};
use firmware_sim::file;
use firmware_sim::flight::{FlightPlan, fly};
use firmware_sim::host::HostController;
use firmware_sim::image_file::ImageFile;
use firmware_sim::task::Task;
use firmware_sim::verify::verify;
use nalgebra::DMatrix;

use crate::fixture::{LIMIT, Run, SEED, STEPS, policy, shipped};

/// Two episodes at the limit, by the longest chain.
fn plan() -> FlightPlan {
    let task = Task::named("ball-run").unwrap();
    let limit = CostLimit::new(LIMIT).unwrap();
    FlightPlan { task, limit, episodes: 2, seed: 1, rate_hz: task.rate_hz, max_steps: usize::MAX }
}

/// Writes the image to a file and a chip to another, reads both back, and boots.
fn flashed_and_booted(image: &[u8]) -> Boot {
    let folder = Run::new();
    let (image_file, chip_file) = (folder.path("policy.armor"), folder.path("robot.chip"));
    file::write(&image_file, image).unwrap();
    let read = ImageFile::read(&image_file).unwrap();
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
    assert_eq!((provenance.seed, provenance.steps), (SEED, STEPS));
    assert_eq!((&provenance.data_sha256, &checkpoint.data_sha256), (shipped().sha256(), shipped().sha256()));
    let shape = manifest.shape;
    assert_eq!((shape.state, shape.action, shape.steps), (7, 2, 20));
    assert_eq!((shape.hidden, shape.kappa_hidden, shape.kappa_embedding), (12, 5, 3));
    // The costliest recorded trajectory costs 80; raw kappa enters the network (O-8).
    assert_eq!((manifest.kappa.trained_max.to_f32(), manifest.kappa.scale), (80.0, 1.0));
    assert_eq!(manifest.agreement_max_abs, exported.agreement.agreement_max_abs);
}

#[test]
fn a_quality_card_is_a_flight_of_its_rung() {
    let image = PolicyImage::new_checked(policy().exported.bytes.as_slice()).unwrap();
    let manifest = image.manifest();
    assert_eq!(manifest.quality.len(), manifest.rungs.len());
    for (index, (card, rung)) in manifest.quality.iter().zip(&manifest.rungs).enumerate() {
        assert_eq!((usize::from(card.rung), card.limit.to_f32(), card.episodes), (index, LIMIT, 20));
        let plan = FlightPlan { episodes: 20, seed: SEED, max_steps: rung.steps.into(), ..plan() };
        let summary = fly(&image, &plan).unwrap().summary;
        let scores = (summary.reward_normalized as f32, summary.cost_normalized as f32);
        assert_eq!((card.reward_normalized, card.cost_normalized), scores);
    }
}

#[test]
fn trainer_and_image_agree_over_recorded_states_and_budgets() {
    let agreement = policy().exported.agreement;
    assert_eq!(agreement.agreement_samples, AGREEMENT_SAMPLES);
    assert_eq!(AGREEMENT_BOUND, 1e-4);
    assert!(agreement.agreement_max_abs <= 1e-4, "{agreement:?}");
}

/// Agreement at every control step of the golden trace, along its falling
/// budget, and of every rung: not at a first step and of the full chain alone.
#[test]
fn every_rung_is_the_trainers_chain_along_a_falling_budget() {
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
    // Stage 0 is the start of the chain; the tick is the control step.
    let draw = |stage: usize, tick: usize, out: &mut [f32]| {
        Noise::new(trace.seed).fill_normal(stage as u32, tick as u64, out);
    };
    for (index, rung) in image.manifest().rungs.iter().enumerate() {
        let steps = actor.process.chain(rung.sampler, rung.steps.into());
        let mut chain = Chain::new(&actor.denoiser, steps, rows.len(), 0);
        chain.run(&actor.denoiser, parameters, &context, &draw);
        let loaded = Policy::load(&image).unwrap();
        let mut controller = HostController::new(loaded, CostLimit::from_cost(trace.limit), trace.seed).unwrap();
        for (tick, row) in rows.iter().enumerate() {
            let step = controller.step_within(row.state, row.incurred, rung.steps.into());
            assert_eq!((step.rung, step.kappa, step.fault), (Some(index), row.kappa, None));
            for (flown, trained) in step.action.iter().zip(chain.action.column(tick).iter()) {
                assert!((flown - trained).abs() <= AGREEMENT_BOUND, "rung {index}, tick {tick}: {flown}, {trained}");
            }
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
    assert_eq!(
        booted,
        Boot { slot: Slot::A, image: image.clone(), golden_rows: 32, on_trial: true, passed_over: None }
    );
}

#[test]
fn a_booted_policy_flies_within_its_bounds_and_keeps_its_budget() {
    let booted = flashed_and_booted(policy().exported.bytes.as_slice());
    let flight = fly(&PolicyImage::new_checked(booted.image.as_slice()).unwrap(), &plan()).unwrap();
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
