//! The critic that an image carries is the one that was trained, and a
//! controller of the best of several actions chooses by it.

use armor_core::image::{Critic, PolicyImage, SectionKind};
use armor_core::units::{Cost, CostLimit};
use armor_train::config::Config;
use armor_train::critic::Task;
use armor_train::export::{ExportError, export, with_critic};
use armor_train::model::Model;
use armor_train::normaliser::Normaliser;
use armor_train::run::Checkpoint;
use firmware_sim::flight::{FlightPlan, fly, fly_best_of};
use firmware_sim::memory::AlignedBytes;
use firmware_sim::reference::CriticReference;
use firmware_sim::task::Task as Flown;
use firmware_sim::verify::verify;
use nalgebra::DMatrix;

use crate::fixture::{self, LIMIT, Run, made_up, shipped};

fn criticised() -> AlignedBytes {
    let policy = fixture::policy();
    let image = PolicyImage::new_checked(policy.exported.bytes.as_slice()).unwrap();
    with_critic(&image, &policy.checkpoint).unwrap()
}

#[test]
fn the_critic_of_an_image_is_the_trainers() {
    let bytes = criticised();
    let image = PolicyImage::new_checked(bytes.as_slice()).unwrap();
    let Checkpoint { config, state, .. } = &fixture::policy().checkpoint;
    let critic = Model::new(config, 7, 2).critic;
    let reference = CriticReference::new(image.critic().unwrap());
    let normaliser = Normaliser::new(shipped(), config.normalize_states);

    let rows: Vec<usize> = (0..64).map(|i| 1000 * i + 7).collect();
    let states: Vec<f32> = rows.iter().flat_map(|&row| normaliser.apply(shipped().observation(row))).collect();
    let actions: Vec<f32> = rows.iter().flat_map(|&row| shipped().action(row).to_vec()).collect();
    let kappas: Vec<f32> = rows.iter().map(|&row| shipped().kappa(row)).collect();
    let columns = |entries: &[f32]| DMatrix::from_column_slice(entries.len() / rows.len(), rows.len(), entries);
    let mut tape = critic.tape(rows.len());
    let input = (&columns(&states), kappas.as_slice(), &columns(&actions));
    critic.forward(&state.parameters.critic, &Task::ALL, input, &mut tape, false);
    let trained = tape.pessimistic(Task::Reward).zip(tape.pessimistic(Task::LongCost));
    for (sample, (reward, cost)) in trained.enumerate() {
        let wide = |values: &[f32]| values.iter().map(|&value| value.into()).collect::<Vec<f64>>();
        let (state, action) = (wide(&states[7 * sample..][..7]), wide(&actions[2 * sample..][..2]));
        let kappa = Cost::from_incurred(kappas[sample]).unwrap().to_f32().into();
        let estimate = reference.estimate(&state, kappa, &action);
        let size = 1.0 + estimate.reward.abs() + kappa;
        assert!((estimate.reward - f64::from(reward)).abs() < 1e-5 * size);
        assert!((estimate.excess - (f64::from(cost) - config.cost_scale * kappa)).abs() < 1e-5 * size);
    }
}

#[test]
fn an_image_with_a_critic_passes_every_check_and_flies_both_ways() {
    let (bytes, plain) = (criticised(), &fixture::policy().exported.bytes);
    let verification = verify(bytes.as_slice(), 1);
    assert!(verification.passed, "{verification}");
    assert!(verification.checks.iter().any(|check| check.name == "best of candidates"));

    let image = PolicyImage::new_checked(bytes.as_slice()).unwrap();
    let without = PolicyImage::new_checked(plain.as_slice()).unwrap();
    for kind in SectionKind::ALL.into_iter().filter(|&kind| kind != SectionKind::Critic) {
        assert_eq!(image.words(kind), without.words(kind));
    }
    assert_eq!(image.words(SectionKind::Critic)[..2], [10, 9]);
    assert!(image.words(SectionKind::Critic).len() > Critic::HEADER_WORDS);
    let best_of: Vec<u8> = image.manifest().quality.iter().map(|flight| flight.candidates).collect();
    assert_eq!(best_of[best_of.len() - 2..], [4, 16]);
    assert_eq!(image.manifest().quality.len(), without.manifest().quality.len() + 2);

    let task = Flown::named("ball-run").unwrap();
    let limit = CostLimit::new(LIMIT).unwrap();
    let plan = FlightPlan { task, limit, episodes: 2, seed: 4, rate_hz: task.rate_hz, max_steps: usize::MAX };
    let steps = |episodes: Vec<firmware_sim::flight::Episode>| -> Vec<_> {
        episodes.into_iter().flat_map(|episode| episode.ticks).map(|tick| tick.step).collect()
    };
    let plainly = steps(fly(&without, &plan).unwrap().episodes);
    assert_eq!(steps(fly(&image, &plan).unwrap().episodes), plainly);
    let best = steps(fly_best_of(&image, &plan, 4).unwrap().episodes);
    assert!(best.iter().all(|step| step.fault.is_none()));
    assert_ne!(best, plainly);
    assert!(fly_best_of(&without, &plan, 4).is_err());
}

#[test]
fn a_critic_that_an_image_cannot_hold_is_refused() {
    let data = made_up();
    for option in ["critic_trunk=separate", "head_layers=2", "cost_output=softplus"] {
        let config: Config = fixture::config(&["steps=2", option]);
        let run = Run::new();
        run.fit(&config, &data, None);
        let checkpoint = run.checkpoint();
        let bytes = export(&checkpoint, &data, None).unwrap().bytes;
        let image = PolicyImage::new_checked(bytes.as_slice()).unwrap();
        assert!(matches!(with_critic(&image, &checkpoint), Err(ExportError::CriticLayout)), "{option}");
    }
}
