//! The method's invariants, and where each is tested.
//!
//! | invariant | where |
//! |---|---|
//! | feasible mass `nu_beta(F)` at the shares of Table 1 (Eq. 7) | `armor-train/tests/data/shipped.rs` |
//! | transitions, trajectories, `P_nz` and `P_feas` of the recording (Table 1) | `armor-train/tests/data/shipped.rs` |
//! | `kappa' = kappa - c` exactly | `armor-train/tests/data/shipped.rs`, any recording: `tests/data/dataset.rs` |
//! | `w = 1` before the warm-up; `w` in `[0.8, 2]`, `w_cf` in `[1, 2]` after | here |
//! | `w_traj` is 1.5 on the feasible trajectories and 1 elsewhere (Eq. 6) | here |
//! | the mean of the unclipped weights is 1 (Eq. 10) | here; `reweight/mod.rs` |
//! | 36 refreshes, the first before step 20,000 | `reweight/mod.rs` |
//! | margins, weights and their average (Eqs. 8 to 10) | against PyTorch: `armor-train/tests/reference.rs` |
//! | gradient surgery: opposed, identical, conflicting gradients, any order (Eq. 5) | `pcgrad.rs` |
//! | surgery on the trunk only, mean over the tasks | against PyTorch: `armor-train/tests/reference.rs` |
//! | the weights act on the cloning of the actor alone (Eq. 13) | here; `actor/tests.rs` |
//! | conflicts are counted and logged (Table A1) | here; `run/metrics.rs` |
//! | targets: least reward, largest cost; an end stops the bootstrap (Eq. 3) | `critic.rs`; learned: here |
//! | the exact Gaussian score gives back its mean and variance (Eq. 12) | `actor/tests.rs` |
//! | schedule constants for `N = 20` | `armor-core/src/schedule.rs` |
//! | the dual rises above the budget, falls below it, and is bounded (Eq. 16) | `dual.rs` |
//! | finite differences through the 20-step chain and its clips (Eq. 15) | `actor/tests.rs` |
//! | Table 2 and Appendix B | `config/` |

use armor_train::critic::Task;
use armor_train::data::{Dataset, Recording};
use armor_train::learner::Learner;
use armor_train::reweight::EPSILON;
use armor_train::run::COLUMNS;
use nalgebra::DMatrix;

use crate::fixture::{LIMIT, Run, config, made_up, shipped};

/// Three refreshes on the recorded data, with the paper's settings of the weights.
#[test]
fn weights_are_one_before_the_warm_up_and_keep_their_bounds_after_it() {
    let data = shipped();
    let (warmup, interval) = (300, 20);
    let mut config = config(&["diffusion_steps=2", "target_steps=2", "critic_rate=0.01"]);
    assert_eq!((config.beta, config.weight_min, config.weight_max, config.reweight_ema), (0.5, 0.8, 2.0, 0.3));
    assert_eq!((config.perturbations, config.sigma), (8, 0.1));
    (config.reweight_warmup, config.reweight_interval) = (warmup, interval);
    let mut learner = Learner::<f32>::new(config, data);
    let mut refreshes = 0;
    for step in 0..warmup + 3 * interval {
        let before = (step > warmup).then(|| learner.weights().clone());
        learner.step();
        let (weights, counterfactual) = (learner.weights(), &learner.state().counterfactual);
        if step < warmup {
            // Every weight, but not at every step: there are 94,000.
            if step.is_multiple_of(50) || step + 1 == warmup {
                assert!(weights.combined.iter().chain(counterfactual).all(|&weight| weight == 1.0));
            }
            continue;
        }
        if !(step - warmup).is_multiple_of(interval) {
            assert!(before.as_ref() == Some(weights), "no refresh is due before step {step}");
            continue;
        }
        refreshes += 1;

        // Eq. 9 caps the new value at 2, and each refresh goes 0.3 of the way there.
        let most = 2.0 - 0.7f32.powi(refreshes) + 1e-6;
        assert!(counterfactual.iter().all(|weight| (1.0..=most).contains(weight)));
        let raised = counterfactual.iter().filter(|&&weight| weight > 1.0).count();
        assert!(raised > 0 && raised < data.len(), "{raised} of {}", data.len());

        // Eq. 6.
        let costs = data.trajectories().iter().map(|trajectory| trajectory.cost_return);
        let expected = costs.map(|cost| if cost <= LIMIT { 1.5 } else { 1.0 });
        assert!(weights.trajectory.iter().copied().eq(expected));

        // Eq. 10: mean 1, then the clip.
        let of_trajectory = |row| f64::from(weights.trajectory[data.trajectory(row)]);
        let products = counterfactual.iter().enumerate().map(|(row, &weight)| of_trajectory(row) * f64::from(weight));
        let products: Vec<f64> = products.collect();
        let mean = products.iter().sum::<f64>() / data.len() as f64;
        let unclipped: Vec<f64> = products.iter().map(|product| product / (mean + EPSILON)).collect();
        assert!((unclipped.iter().sum::<f64>() / data.len() as f64 - 1.0).abs() < 2e-6);
        for (weight, unclipped) in weights.combined.iter().zip(unclipped) {
            assert!((0.8..=2.0).contains(weight));
            assert!((f64::from(*weight) - unclipped.clamp(0.8, 2.0)).abs() < 1e-6);
        }
    }
    assert_eq!(refreshes, 3);
}

/// Two runs that differ in beta alone: the same bits until the weights become
/// active, then another actor at once, and the critic of that step unchanged.
#[test]
fn weights_act_on_the_cloning_of_the_actor_alone_and_only_after_the_warm_up() {
    let data = made_up();
    let learner = |beta: &str| Learner::<f32>::new(config(&["reweight_warmup=2", beta]), &data);
    let (mut one, mut other) = (learner("beta=0.5"), learner("beta=3"));
    for _ in 0..2 {
        assert_eq!(one.step(), other.step());
        assert_eq!(one.state(), other.state());
    }
    let (one_metrics, other_metrics) = (one.step(), other.step());
    assert_eq!(one_metrics.critic, other_metrics.critic);
    let [one_loss, other_loss] = [one_metrics, other_metrics].map(|metrics| metrics.actor.unwrap());
    assert_ne!(one_loss.cloning, other_loss.cloning);
    assert_eq!(one_loss.reward, other_loss.reward);
    let (one, other) = (&one.state().parameters, &other.state().parameters);
    assert_eq!((&one.critic, &one.dual), (&other.critic, &other.dual));
    assert_ne!(one.actor, other.actor);
}

/// Table A1: each step has 0 to 3 pairs of trunk gradients in conflict.
#[test]
fn conflicts_are_logged_as_shares_of_the_steps() {
    let run = Run::new();
    run.fit(&config(&["steps=200", "diffusion_steps=2", "target_steps=2"]), &made_up(), None);
    let metrics = run.files().metrics;
    let mut lines = metrics.lines();
    let names: Vec<&str> = lines.next().unwrap().split(',').collect();
    assert!(names.iter().copied().eq(COLUMNS.iter().map(|column| column.name)));
    let first = names.iter().position(|&name| name == "conflicts_0").unwrap();
    let mut rows = 0;
    for line in lines {
        let row: Vec<f64> = line.split(',').map(|number| number.parse().unwrap()).collect();
        let shares = &row[first..first + 4];
        assert!((shares.iter().sum::<f64>() - 1.0).abs() < 1e-9, "{line}");
        assert!(shares.iter().filter(|&&share| share > 0.0).count() > 1, "{line}");
        rows += 1;
    }
    assert_eq!(rows, 2);
}

/// Eq. 3 end to end. Episodes of two steps, each with reward 3 and cost 1, end
/// by terminal or by timeout; so with rewards scaled by 0.1
/// `Q_r = 0.3 (1 + 0.99)`, `Q_cL = 1 + 0.99`, `Q_cS = 1 + 0.3` before the first
/// step, and 0.3, 1 and 1 before the last, whatever is done.
#[test]
fn the_critic_learns_the_discounted_sums_of_each_task_and_stops_at_every_end() {
    let rows = 16;
    let state = |row: usize| if row.is_multiple_of(2) { [1.0, 0.0] } else { [0.0, 1.0] };
    let action = |row: usize| (row as f32 / 8.0 - 1.0).clamp(-1.0, 1.0);
    let data = Dataset::new(Recording {
        state_dim: 2,
        action_dim: 1,
        observations: (0..rows).flat_map(state).collect(),
        next_observations: (0..rows).flat_map(|row| state(row + 1)).collect(),
        actions: (0..rows).map(action).collect(),
        rewards: vec![3.0; rows],
        costs: vec![1.0; rows],
        terminals: (0..rows).map(|row| row % 4 == 1).collect(),
        timeouts: (0..rows).map(|row| row % 4 == 3).collect(),
        sha256: [0; 32],
    })
    .unwrap();
    let mut config = config(&["diffusion_steps=2", "target_steps=2", "critic_rate=0.01", "target_rate=0.05"]);
    config.task = "two-steps".to_owned();
    let mut learner = Learner::<f32>::new(config, &data);
    for _ in 0..1500 {
        learner.step();
    }

    let critic = &learner.model().critic;
    let column = |entries: Vec<f32>| DMatrix::from_vec(entries.len() / rows, rows, entries);
    let states = column((0..rows).flat_map(state).collect());
    let actions = column((0..rows).map(action).collect());
    let kappas: Vec<f32> = (0..rows).map(|row| data.kappa(row)).collect();
    assert_eq!(kappas[..2], [2.0, 1.0]);
    let mut tape = critic.tape(rows);
    critic.forward(&learner.state().parameters.critic, &Task::ALL, (&states, &kappas, &actions), &mut tape, false);
    for (task, first, last) in [(Task::Reward, 0.597, 0.3), (Task::LongCost, 1.99, 1.0), (Task::ShortCost, 1.3, 1.0)] {
        for (row, value) in tape.pessimistic(task).enumerate() {
            let expected = if row.is_multiple_of(2) { first } else { last };
            assert!((value - expected).abs() < 0.02, "{task:?}, row {row}: {value} and not {expected}");
        }
    }
}
