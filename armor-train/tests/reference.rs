//! One whole training step against the numbers of an independent PyTorch
//! program, `tests/reference/step.py`, in f64. The program is run by hand; its
//! output, `step.json`, holds all inputs and all expected outputs.

use armor_core::schedule::{Sampler, Schedule};
use armor_train::actor::chain::Chain;
use armor_train::actor::denoiser::{Denoiser, Widths};
use armor_train::actor::{Actor, CloningNorm, Guidance, PolicyGradient, Process};
use armor_train::critic::{Critic, Task, Twins};
use armor_train::data::{Dataset, Recording};
use armor_train::dual::{Dual, DualOptions};
use armor_train::model::{ActorCopy, CriticCopy, Model, Optimisers, Parameters};
use armor_train::nn::Adam;
use armor_train::pcgrad::{Order, Pooling};
use armor_train::reweight::Weights;
use armor_train::reweight::counterfactual::Counterfactual;
use armor_train::update::{Worker, update_actor, update_critic, update_target};
use nalgebra::DMatrix;
use serde_json::Value;

const STATE: usize = 5;
const ACTION: usize = 2;
const SAMPLES: usize = 6;
const STEPS: usize = 5;
/// The order `r: [L, S], L: [S, r], S: [r, L]` of `pcgrad_order`.
const ORDERS: [[usize; 2]; 3] = [[1, 2], [2, 0], [0, 1]];

/// The program's output.
struct Reference(Value);

impl Reference {
    fn read() -> Self {
        Self(serde_json::from_str(include_str!("reference/step.json")).unwrap())
    }

    fn numbers(&self, key: &str) -> Vec<f64> {
        self.0[key].as_array().unwrap_or_else(|| panic!("no {key}")).iter().map(|x| x.as_f64().unwrap()).collect()
    }

    fn number(&self, key: &str) -> f64 {
        self.0[key].as_f64().unwrap_or_else(|| panic!("no {key}"))
    }

    fn matrix(&self, key: &str, rows: usize) -> DMatrix<f64> {
        let numbers = self.numbers(key);
        DMatrix::from_vec(rows, numbers.len() / rows, numbers)
    }

    #[track_caller]
    fn expect(&self, key: &str, actual: &[f64]) {
        let expected = self.numbers(key);
        assert_eq!(actual.len(), expected.len(), "{key}");
        for (index, (actual, expected)) in actual.iter().zip(expected).enumerate() {
            let error = (actual - expected).abs();
            assert!(error <= 1e-9 * (1.0 + expected.abs()), "{key}[{index}] is {actual}, not {expected}");
        }
    }

    fn model(&self, policy_gradient: PolicyGradient) -> Model {
        let widths = Widths {
            state: STATE,
            action: ACTION,
            hidden: 16,
            kappa_hidden: 8,
            kappa_embedding: 4,
            time_code: 8,
            time_hidden: 12,
            time_embedding: 6,
            steps: STEPS,
        };
        let kappa_scale = self.0["config"]["kappa_scale"].as_f64().unwrap();
        let schedule = Schedule::vp(STEPS);
        Model {
            actor: Actor {
                denoiser: Denoiser::new(widths, kappa_scale),
                process: Process::paper(schedule),
                policy_gradient,
                gradient_steps: 0,
                cloning_norm: CloningNorm::Sum,
                eta: 1.0,
                guidance: Guidance::Raw,
                constraint_scale: 1.0,
                twins: Twins::Pessimistic,
            },
            critic: Critic::new(STATE, ACTION, 12, 10, kappa_scale),
            dual: Dual::new(DualOptions::default(), 9, kappa_scale),
            dual_decay: 0.0,
            state_value: None,
            keeps_average: false,
            target_actor: ActorCopy::Live,
            policy_critic: CriticCopy::Live,
            target_chain: schedule.chain(Sampler::Ddpm, STEPS).collect(),
            discounts: [0.99, 0.99, 0.3],
            gradient_clip: 0.0,
            pcgrad: Order::Random,
            trunk_gradient: Pooling::Mean,
        }
    }

    fn parameters(&self) -> Parameters<f64> {
        Parameters {
            actor: self.numbers("actor"),
            actor_average: Vec::new(),
            critic: self.numbers("critic"),
            target: self.numbers("target_critic"),
            state_value: Vec::new(),
            dual: self.numbers("dual"),
        }
    }

    fn optimisers(parameters: &Parameters<f64>) -> Optimisers<f64> {
        Optimisers {
            actor: Adam::new(parameters.actor.len(), 1e-4),
            critic: Adam::new(parameters.critic.len(), 1e-3),
            state_value: Adam::new(0, 1e-3),
            dual: Adam::new(parameters.dual.len(), 1e-4),
        }
    }

    /// The batch in shares of the given sizes.
    fn workers(&self, model: &Model, shares: &[usize]) -> Vec<Worker<f64>> {
        let mut first = 0;
        let workers = shares.iter().map(|&samples| {
            let mut worker = Worker::new(model, first, samples, Default::default());
            let columns = |key, rows| self.matrix(key, rows).columns(first, samples).into_owned();
            let entries = |key| self.numbers(key)[first..first + samples].to_vec();
            worker.batch.state = columns("s", STATE);
            worker.batch.action = columns("a", ACTION);
            worker.batch.next_state = columns("s_next", STATE);
            worker.batch.reward = entries("r");
            worker.batch.cost = entries("c");
            worker.batch.kappa = entries("kappa");
            worker.batch.threshold = entries("kappa");
            worker.batch.next_kappa = entries("kappa_next");
            worker.batch.alive = entries("done").iter().map(|done| 1.0 - done).collect();
            worker.batch.weight = entries("w");
            worker.levels = entries("bc_n").iter().map(|&level| level as usize).collect();
            worker.cloning = columns("bc_eps", ACTION);
            first += samples;
            worker
        });
        workers.collect()
    }

    /// The draws of a chain: start, then the noise of each step but the last.
    fn draws(&self, start: &str, steps: &str) -> impl Fn(usize, usize, &mut [f64]) + Sync + use<> {
        let mut all = self.numbers(start);
        all.extend(self.numbers(steps));
        move |stage, sample, out| {
            let at = (stage * SAMPLES + sample) * ACTION;
            out.copy_from_slice(&all[at..at + ACTION]);
        }
    }

    /// Critic, actor, dual and target, in the order of a training step, and their expected values.
    fn check_step(&self, policy_gradient: PolicyGradient, shares: &[usize]) {
        let model = self.model(policy_gradient);
        let mut parameters = self.parameters();
        let mut optimisers = Self::optimisers(&parameters);
        let mut workers = self.workers(&model, shares);

        let next = self.draws("next_start_noise", "next_step_noise");
        let (critic, gradient) = update_critic(&model, &mut parameters, &mut optimisers, &mut workers, &next, &ORDERS);
        self.expect("critic_losses", &critic.losses);
        assert_eq!(critic.surgery.conflicts as f64, self.number("negative_pairs"));
        self.expect("trunk_grad", &gradient[..model.critic.trunk_size()]);
        self.expect("critic_grad", &gradient);
        self.expect("critic_after", &parameters.critic);

        let policy = self.draws("pi_start_noise", "pi_step_noise");
        let (loss, [gradient, dual_gradient]) =
            update_actor(&model, &mut parameters, &mut optimisers, &mut workers, &policy);
        let total = loss.cloning - loss.reward + loss.penalty;
        let actions: Vec<f64> = workers.iter().flat_map(|worker| worker.policy_action().iter().copied()).collect();
        assert!((loss.cloning - self.number("l_bc")).abs() < 1e-9);
        let name = match policy_gradient {
            PolicyGradient::OneStep => "one_step",
            PolicyGradient::Full | PolicyGradient::LastK => "full",
        };
        self.expect(&format!("{name}_a_pi"), &actions);
        assert!((total - self.number(&format!("{name}_loss"))).abs() < 1e-9);
        self.expect(&format!("{name}_grad"), &gradient);
        if policy_gradient == PolicyGradient::Full {
            assert!((-loss.penalty - self.number("dual_loss")).abs() < 1e-9);
            self.expect("actor_after", &parameters.actor);
            self.expect("dual_grad", &dual_gradient);
            self.expect("dual_after", &parameters.dual);
        }

        update_target(&mut parameters, 0.005);
        self.expect("target_after", &parameters.target);
    }
}

#[test]
fn a_training_step_with_the_full_chain_has_pytorchs_numbers() {
    Reference::read().check_step(PolicyGradient::Full, &[SAMPLES]);
}

#[test]
fn a_training_step_with_the_one_step_gradient_has_pytorchs_numbers() {
    Reference::read().check_step(PolicyGradient::OneStep, &[SAMPLES]);
}

#[test]
fn sharing_the_batch_changes_nothing() {
    Reference::read().check_step(PolicyGradient::Full, &[4, 1, 1]);
}

#[test]
fn adams_moments_are_pytorchs() {
    let reference = Reference::read();
    let mut parameters = reference.numbers("dual");
    let gradient = reference.numbers("dual_grad");
    let mut adam = Adam::new(parameters.len(), 1e-4);
    for factor in [1.0, -0.5, 0.1] {
        let gradient: Vec<f64> = gradient.iter().map(|value| factor * value).collect();
        adam.descend(&mut parameters, &gradient);
    }
    reference.expect("dual_after_three", &parameters);
}

#[test]
fn a_clipped_dual_variable_has_pytorchs_numbers() {
    let reference = Reference::read();
    let dual = reference.model(PolicyGradient::Full).dual;
    let (parameters, kappa) = (reference.numbers("clip_dual"), reference.numbers("clip_kappa"));
    let violation: Vec<f64> = reference.numbers("clip_q_l").iter().zip(&kappa).map(|(q, kappa)| q - kappa).collect();
    let mut tape = dual.tape(kappa.len());
    let mut gradient = vec![0.0; parameters.len()];
    dual.forward(&parameters, &kappa, &mut tape);
    let loss = dual.backward(&parameters, &violation, kappa.len(), &mut tape, &mut gradient);
    reference.expect("clip_lambda", &tape.lambda);
    assert!((loss / kappa.len() as f64 - reference.number("clip_loss")).abs() < 1e-9);
    reference.expect("clip_grad", &gradient);
}

#[test]
fn critic_values_are_pytorchs() {
    let reference = Reference::read();
    let critic = reference.model(PolicyGradient::Full).critic;
    let mut tape = critic.tape(SAMPLES);
    let inputs = (&reference.matrix("s", STATE), &reference.numbers("kappa")[..], &reference.matrix("a", ACTION));
    critic.forward(&reference.numbers("critic"), &Task::ALL, inputs, &mut tape, false);
    let twins = reference.numbers("q");
    let choose: [fn(f64, f64) -> f64; 3] = [f64::min, f64::max, f64::max];
    for (task, choose) in Task::ALL.into_iter().zip(choose) {
        for (sample, value) in tape.pessimistic(task).enumerate() {
            let at = 6 * sample + 2 * task as usize;
            assert!((value - choose(twins[at], twins[at + 1])).abs() < 1e-9, "{task:?} {sample}");
        }
    }
}

/// A trajectory for each sample.
fn single_steps() -> Dataset {
    let recording = Recording {
        state_dim: STATE,
        action_dim: ACTION,
        observations: vec![0.0; SAMPLES * STATE],
        next_observations: vec![0.0; SAMPLES * STATE],
        actions: vec![0.0; SAMPLES * ACTION],
        rewards: vec![0.0; SAMPLES],
        costs: vec![0.0; SAMPLES],
        terminals: vec![false; SAMPLES],
        timeouts: vec![true; SAMPLES],
        sha256: [0; 32],
    };
    Dataset::new(recording).expect("the recording is sound")
}

#[test]
fn counterfactual_weights_are_pytorchs() {
    let reference = Reference::read();
    let critic = reference.model(PolicyGradient::Full).critic;
    let settings =
        Counterfactual { perturbations: 3, sigma: vec![0.1; ACTION], max: 2.0, ema: 0.3, twins: Twins::Pessimistic };
    let perturbation = reference.numbers("perturbation");
    let draw = |k: usize, sample: usize, out: &mut [f64]| {
        let at = (k * SAMPLES + sample) * ACTION;
        out.copy_from_slice(&perturbation[at..at + ACTION]);
    };
    let inputs = (&reference.matrix("s", STATE), &reference.numbers("kappa")[..], &reference.matrix("a", ACTION));
    let mut margin = vec![0.0; SAMPLES];
    let after = reference.numbers("critic_after");
    let bound = inputs.1;
    settings.margins((&critic, &after[..]), inputs, bound, &draw, &mut critic.tape(SAMPLES), &mut margin);
    reference.expect("m", &margin);

    // The weights themselves are kept in f32.
    let to_f32 = |values: Vec<f64>| values.into_iter().map(|value| value as f32).collect::<Vec<f32>>();
    let close = |key: &str, actual: &[f32]| {
        for (actual, expected) in actual.iter().zip(reference.numbers(key)) {
            assert!((f64::from(*actual) - expected).abs() < 1e-6, "{key}: {actual} is not {expected}");
        }
    };
    let mut counterfactual = vec![1.0; SAMPLES];
    let rows: Vec<u32> = (0..SAMPLES as u32).collect();
    settings.update(&to_f32(margin), &rows, &mut counterfactual);
    close("w_cf", &counterfactual);
    let mut weights =
        Weights { trajectory: to_f32(reference.numbers("w_traj")), combined: vec![1.0; SAMPLES], active: 0.0 };
    weights.combine(&single_steps(), &counterfactual, [0.8, 2.0]);
    close("weights", &weights.combined);
}

#[test]
fn a_short_deterministic_chain_has_pytorchs_actions() {
    let reference = Reference::read();
    let actor = reference.model(PolicyGradient::Full).actor;
    let parameters = reference.numbers("actor");
    let steps = actor.process.chain(Sampler::Ddim, 3);
    let levels: Vec<f64> = steps.iter().map(|step| step.n as f64).collect();
    reference.expect("ddim_levels", &levels);
    let mut context = actor.denoiser.context(SAMPLES);
    let (state, kappa) = (reference.matrix("s", STATE), reference.numbers("kappa"));
    actor.denoiser.prepare(&parameters, &state, &kappa, &mut context);
    let mut chain = Chain::new(&actor.denoiser, steps, SAMPLES, 0);
    let draw = reference.draws("pi_start_noise", "pi_step_noise");
    chain.run(&actor.denoiser, &parameters, &context, &draw);
    reference.expect("ddim_a", chain.action.as_slice());
}

#[test]
fn the_schedule_is_pytorchs() {
    let reference = Reference::read();
    let schedule = Schedule::vp(STEPS);
    let alpha_bars: Vec<f64> = (0..=STEPS).map(|n| schedule.alpha_bar(n)).collect();
    reference.expect("alpha_bar", &alpha_bars);
}
