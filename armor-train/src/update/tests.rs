//! What the options change in an update, against the update without them.

use std::sync::Arc;

use armor_core::noise::Noise;
use nalgebra::DMatrix;

use super::*;
use crate::config::{Config, Preset};
use crate::testing::fill;

const SAMPLES: usize = 6;

/// A small network of the `paper` preset, but for the named options.
fn config(options: &[&str]) -> Config {
    let mut config = Preset::Paper.config("own", 1.0);
    let sizes = ["hidden=6", "trunk=6", "head=4", "dual_hidden=4", "diffusion_steps=3", "target_steps=3"];
    sizes.iter().chain(options).for_each(|option| config.set(option).unwrap());
    config
}

/// A batch of `SAMPLES` random transitions in two shares.
fn workers(model: &Model) -> Vec<Worker<f64>> {
    let rooms = Arc::default();
    let share = |first: usize| {
        let mut worker = Worker::new(model, first, SAMPLES / 2, Arc::clone(&rooms));
        let stream = 20 * first as u32;
        worker.batch.state = DMatrix::from_vec(3, 3, fill(9, stream + 1));
        worker.batch.next_state = DMatrix::from_vec(3, 3, fill(9, stream + 2));
        worker.batch.action = DMatrix::from_vec(2, 3, fill(6, stream + 3));
        worker.batch.reward = fill(3, stream + 4);
        worker.batch.weight.fill(1.0);
        worker.batch.alive.fill(1.0);
        worker.cloning = DMatrix::from_vec(2, 3, fill(6, stream + 5));
        worker
    };
    vec![share(0), share(3)]
}

fn draw(stage: usize, sample: usize, out: &mut [f64]) {
    out.copy_from_slice(&fill(out.len(), (100 + 10 * stage + sample) as u32));
}

/// The gradients of actor and dual in the first update, with the reward critic's values `scale` times as large.
fn actor_gradients(options: &[&str], scale: f64) -> [Vec<f64>; 2] {
    let config = config(options);
    let model = Model::new(&config, 3, 2);
    let mut parameters: Parameters<f64> = model.initialise(Noise::new(1));
    // The outputs of the two reward heads: weights and bias of their last layer.
    let head = 6 * 4 + 4;
    for twin in 0..2 {
        let end = model.critic.trunk_size() + (twin + 1) * (head + 5);
        parameters.critic[end - 5..end].iter_mut().for_each(|parameter| *parameter *= scale);
    }
    let mut optimisers = Optimisers::new(&config, &parameters);
    update_actor(&model, &mut parameters, &mut optimisers, &mut workers(&model), &draw).1
}

#[test]
fn normalised_guidance_does_not_mind_the_scale_of_rewards() {
    let difference = |options: &[&str]| {
        let ([one, _], [ten, _]) = (actor_gradients(options, 1.0), actor_gradients(options, 10.0));
        one.iter().zip(ten).map(|(one, ten)| (one - ten).abs()).fold(0.0, f64::max)
    };
    assert!(difference(&["guidance=normalized"]) < 1e-12);
    assert!(difference(&["guidance=raw"]) > 1e-3);
}

#[test]
fn decay_draws_the_dual_towards_zero_weights() {
    let parameters: Parameters<f64> = Model::new(&config(&[]), 3, 2).initialise(Noise::new(1));
    let ([_, without], [_, with]) = (actor_gradients(&[], 1.0), actor_gradients(&["dual_decay=0.5"], 1.0));
    for ((with, without), parameter) in with.iter().zip(without).zip(parameters.dual) {
        assert!((with - without - parameter).abs() < 1e-12);
    }
}

/// Actor and critic after one update of each, the copies of both far from what learns.
fn after(options: &[&str]) -> [Vec<f64>; 2] {
    let config = config(&[&["actor_average=0.9"], options].concat());
    let model = Model::new(&config, 3, 2);
    let mut parameters: Parameters<f64> = model.initialise(Noise::new(1));
    parameters.target = fill(parameters.target.len(), 7);
    parameters.actor_average = fill(parameters.actor.len(), 8);
    let mut optimisers = Optimisers::new(&config, &parameters);
    let mut workers = workers(&model);
    update_critic(&model, &mut parameters, &mut optimisers, &mut workers, &draw, &pcgrad::orders([0; 3]));
    let critic = parameters.critic.clone();
    update_actor(&model, &mut parameters, &mut optimisers, &mut workers, &draw);
    [parameters.actor, critic]
}

#[test]
fn targets_and_judgements_come_from_the_copies_that_are_asked_for() {
    let [actor, critic] = after(&[]);
    let [other_actor, same_critic] = after(&["policy_critic=target"]);
    assert!(actor != other_actor && critic == same_critic);
    assert_ne!(after(&["target_actor=average"])[1], critic);
}
