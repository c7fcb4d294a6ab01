use super::*;
use crate::config::Preset;
use crate::critic::bootstrap::Bootstrap;
use crate::testing::recording;

/// Critics first, in the sample, then the actor by advantage weights; more samples than a share.
fn config() -> Config {
    let mut config = Preset::Quick.config("test", 1.0);
    (config.hidden, config.trunk, config.head, config.dual_hidden) = (8, 8, 8, 8);
    (config.batch, config.steps, config.critic_steps) = (SHARE + 32, 20, 10);
    (config.bootstrap, config.extraction) = (Bootstrap::InSample, Extraction::Weighted);
    config.relabel_share = 0.5;
    config
}

fn data() -> Dataset {
    recording(8, 5, |row| (row as f32).sin(), |row| f32::from(row % 3 == 0))
}

fn after(config: &Config, data: &Dataset, steps: u64) -> LearnerState<f32> {
    let mut learner: Learner<'_, f32> = Learner::new(config.clone(), data);
    for _ in 0..steps {
        learner.step();
    }
    learner.state().clone()
}

#[test]
fn the_critics_learn_first_and_are_frozen_while_the_actor_learns() {
    let (config, data) = (config(), data());
    let [start, critics, end] = [0, 10, 20].map(|steps| after(&config, &data, steps).parameters);
    assert_ne!((&start.critic, &start.target), (&critics.critic, &critics.target));
    assert_ne!(start.state_value, critics.state_value);
    assert_eq!(start.actor, critics.actor);
    assert_eq!((&critics.critic, &critics.target), (&end.critic, &end.target));
    assert_eq!(critics.state_value, end.state_value);
    assert_ne!(critics.actor, end.actor);
    assert_eq!(start.dual, end.dual);
}

#[test]
fn each_phase_measures_what_it_trains() {
    let (config, data) = (config(), data());
    let mut learner: Learner<'_, f32> = Learner::new(config, &data);
    let metrics: Vec<Metrics> = (0..20).map(|_| learner.step()).collect();
    let (critics, actor) = (&metrics[9], &metrics[10]);
    assert!(critics.critic.is_some_and(|critic| critic.value_losses.iter().all(|&loss| loss > 0.0)));
    assert!(critics.values.is_some() && critics.actor.is_none() && critics.batch_weights.is_none());
    assert!(actor.actor.is_some_and(|actor| actor.cloning > 0.0) && actor.critic.is_none() && actor.values.is_none());
    let weights = actor.batch_weights.unwrap();
    assert!(weights.mean > 0.0 && weights.effective > 0.0 && weights.effective <= 1.0);
}

/// At no price and no temperature every transition weighs what Eq. 10 says.
#[test]
fn without_temperature_the_weights_are_those_of_eq_10() {
    let data = data();
    let mut config = config();
    (config.advantage_temperature, config.reweight_warmup) = (0.0, 0);
    let mut learner: Learner<'_, f32> = Learner::new(config.clone(), &data);
    for _ in 0..11 {
        learner.step();
    }
    let combined = &learner.weights().combined;
    let (low, high) = combined.iter().fold((f32::MAX, 0f32), |(low, high), &w| (low.min(w), high.max(w)));
    assert!(low < high, "feasible trajectories weigh more");
    let batch: Vec<f32> = learner.workers.iter().flat_map(|worker| worker.batch.weight.clone()).collect();
    let mean = batch.iter().sum::<f32>() / batch.len() as f32;
    assert!((mean - 1.0).abs() < 1e-5);
    let ratios: Vec<f32> = batch.iter().map(|weight| weight / batch[0]).collect();
    let allowed = [1.0, low / high, high / low];
    assert!(ratios.iter().all(|ratio| allowed.iter().any(|a| (ratio - a).abs() < 1e-4)), "{ratios:?}");
    assert!(ratios.iter().any(|ratio| (ratio - 1.0).abs() > 0.1));
}

/// The states of the batch of each of the first eleven steps, of which the last trains the actor.
fn states(config: &Config, data: &Dataset) -> Vec<Vec<f32>> {
    let mut learner: Learner<'_, f32> = Learner::new(config.clone(), data);
    let batch = |learner: &Learner<'_, f32>| {
        learner.workers.iter().flat_map(|worker| worker.batch.state.as_slice().to_vec()).collect()
    };
    (0..11).map(|_| (learner.step(), batch(&learner)).1).collect()
}

#[test]
fn noise_is_on_the_states_that_the_actor_clones_from_alone() {
    let (data, plain) = (data(), config());
    let noisy = Config { state_noise: 0.5, ..plain.clone() };
    let [plain, noisy] = [plain, noisy].map(|config| states(&config, &data));
    assert_eq!(plain[..10], noisy[..10]);
    let added: Vec<f32> = noisy[10].iter().zip(&plain[10]).map(|(noisy, plain)| noisy - plain).collect();
    let mean_of = |values: &mut dyn Iterator<Item = f32>| values.sum::<f32>() / added.len() as f32;
    // 328 draws: bounds of four standard errors.
    assert!(mean_of(&mut added.iter().copied()).abs() < 4.0 * 0.5 / (added.len() as f32).sqrt());
    let deviation = mean_of(&mut added.iter().map(|x| x * x)).sqrt();
    assert!((deviation - 0.5).abs() < 4.0 * 0.5 / (2.0 * added.len() as f32).sqrt(), "{deviation}");
}

#[test]
fn the_actor_clones_the_safest_trajectories_alone() {
    let (data, mut config) = (data(), config());
    config.safest_share = 1e-3;
    let batches = states(&config, &data);
    let distinct = |batch: &[f32]| {
        let states: std::collections::HashSet<Vec<u32>> =
            batch.chunks(data.state_dim()).map(|state| state.iter().map(|x| x.to_bits()).collect()).collect();
        states.len()
    };
    // Eight trajectories of five rows: the critics see all of them, the actor the rows of one.
    assert_eq!((distinct(&batches[9]), distinct(&batches[10])), (40, 5));
}

/// What is followed is not in a checkpoint: frozen critics find it again.
#[test]
fn a_resumed_actor_follows_the_same_trajectories_to_the_bit() {
    let (data, mut config) = (data(), config());
    (config.safest_share, config.state_noise) = (0.5, 0.3);
    let mut resumed: Learner<'_, f32> = Learner::resume(config.clone(), &data, after(&config, &data, 15));
    for _ in 15..20 {
        resumed.step();
    }
    assert_eq!(*resumed.state(), after(&config, &data, 20));
}

#[test]
fn a_guided_actor_may_follow_frozen_critics() {
    let data = data();
    let mut config = config();
    config.extraction = Extraction::Guidance;
    let [critics, end] = [10, 20].map(|steps| after(&config, &data, steps).parameters);
    assert_eq!(critics.critic, end.critic);
    assert_ne!((&critics.actor, &critics.dual), (&end.actor, &end.dual));
}

#[test]
fn a_critic_that_does_not_see_kappa_has_one_opinion_at_every_budget() {
    let data = data();
    let mut config = config();
    for sees in [true, false] {
        config.critic_sees_kappa = sees;
        let learner: Learner<'_, f32> = Learner::new(config.clone(), &data);
        let (critic, parameters) = (&learner.model.critic, &learner.state.parameters.critic);
        let at = |kappa: f32| {
            let mut tape = critic.tape(1);
            let (state, action) = (nalgebra::DMatrix::from_element(2, 1, 0.5), nalgebra::DMatrix::zeros(1, 1));
            critic.forward(parameters, &Task::ALL, (&state, &[kappa], &action), &mut tape, false);
            Task::ALL.map(|task| tape.pessimistic(task).next().unwrap())
        };
        assert_eq!(at(0.0) != at(2.0), sees);
    }
}

#[test]
fn the_bits_do_not_depend_on_the_number_of_threads() {
    let (config, data) = (config(), data());
    let with = |threads: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
        pool.install(|| after(&config, &data, 20))
    };
    assert!(with(1) == with(3));
}

/// The paper's actor, small, with the named options.
fn joint(options: &[&str]) -> Config {
    let mut config = Preset::Quick.config("test", 1.0);
    let small = ["hidden=4", "trunk=4", "head=4", "dual_hidden=4", "batch=140", "steps=2000", "reweight_warmup=2"];
    small.iter().chain(options).for_each(|option| config.set(option).unwrap());
    config.check().unwrap();
    config
}

#[test]
fn the_weights_of_a_batch_have_mean_one_where_asked_once_they_are_in_use() {
    let data = data();
    let options = ["weight_mean=batch", "weight_min=0", "weight_max=100"];
    let mut learner: Learner<'_, f64> = Learner::new(joint(&options), &data);
    for step in 0..4 {
        learner.step();
        let weights = || learner.workers.iter().flat_map(|worker| &worker.batch.weight);
        let mean = weights().sum::<f64>() / 140.0;
        assert!((mean - 1.0).abs() < 1e-5, "{mean}");
        assert_eq!(weights().any(|weight| *weight != 1.0), step >= 2);
    }
    // The mean over the data is not that of a batch.
    let mut learner: Learner<'_, f64> = Learner::new(joint(&options[1..]), &data);
    for _ in 0..4 {
        learner.step();
    }
    let mean = learner.workers.iter().flat_map(|worker| &worker.batch.weight).sum::<f64>() / 140.0;
    assert!((mean - 1.0).abs() > 1e-3, "{mean}");
}

#[test]
fn the_actor_with_the_smallest_cloning_loss_flies_where_asked() {
    let data = data();
    let options = ["hidden=2", "batch=8", "actor_average=0"];
    let chosen =
        |selection, steps| after(&joint(&[&options[..], &[&format!("selection={selection}")]].concat()), &data, steps);
    // Steps 3 to 502 are the first period with weights in use.
    let (at_first, later) = (chosen("last", 502), chosen("cloning_loss", 700));
    assert_eq!(later.flying_actor(), at_first.parameters.actor);
    assert_ne!(later.flying_actor(), later.parameters.actor);
    assert_eq!(at_first.flying_actor(), at_first.parameters.actor);
}

#[test]
fn a_random_twin_is_drawn_for_each_step() {
    let data = data();
    let mut learner: Learner<'_, f32> = Learner::new(joint(&["policy_twins=random"]), &data);
    let seconds: Vec<bool> = (0..20)
        .map(|_| {
            learner.step();
            assert!(learner.workers.windows(2).all(|pair| pair[0].second_twin == pair[1].second_twin));
            learner.workers[0].second_twin
        })
        .collect();
    assert!(seconds.contains(&true) && seconds.contains(&false));
}

#[test]
fn every_option_of_sampling_and_of_the_data_trains_and_changes_the_run() {
    let data = data();
    let plain = after(&joint(&[]), &data, 5);
    for option in ["sampling=trajectory", "sampling=cost_bins", "time_frequencies=learned", "weight_decay=0.1"] {
        let other = after(&joint(&[option]), &data, 5);
        assert_ne!(other.parameters.actor, plain.parameters.actor, "{option}");
        assert!(other.parameters.actor.iter().all(|weight| weight.is_finite()), "{option}");
    }
}
