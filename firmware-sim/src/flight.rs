//! The control loop: a policy flies a plant at a fixed rate on a virtual clock.
//!
//! Each control step: sense, let the controller step, act. The plant advances
//! in its own steps; where the loop runs at half the plant's rate, each action
//! is held for two of them and their costs are reported together. The clock is
//! virtual and never late; what the controller took is measured on the host,
//! and an answer later than a period is counted as a missed deadline.
//!
//! Words: a *flight* is several episodes of one policy; the *period* is the
//! time between control steps; *latency* is host time around the controller's
//! step.

use std::time::{Duration, Instant};

use armor_core::image::PolicyImage;
use armor_core::noise::Noise;
use armor_core::units::{Cost, CostLimit, Micros};
use armor_infer::{Fault, LoadError, Policy, Step};
use thiserror::Error;

use crate::host::{self, ACTION, HostController, Pilot};
use crate::latency::Latency;
use crate::plant::Plant;
use crate::summary::FlightSummary;
use crate::task::{Task, TaskError};

/// What to fly.
#[derive(Clone, Copy, Debug)]
pub struct FlightPlan {
    /// The task.
    pub task: &'static Task,
    /// Cost that each episode may incur.
    pub limit: CostLimit,
    /// Number of episodes.
    pub episodes: u32,
    /// Decides every start and all noise.
    pub seed: u64,
    /// Control steps a second: the task's rate, or a whole fraction of it.
    pub rate_hz: u32,
    /// Calls of the denoiser that an action may take: each control step flies
    /// the policy's longest rung within them.
    pub max_steps: usize,
}

/// Why a policy cannot fly a task.
#[derive(Clone, Debug, PartialEq, Error)]
pub enum FlightError {
    /// The task has no plant here.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// The image was trained for another task.
    #[error("the image was trained for {image} and not for {task}; fly that task or flash another image")]
    WrongTask {
        /// The task in the image.
        image: String,
        /// The task to fly.
        task: &'static str,
    },
    /// The network does not fit the task's robot.
    #[error(
        "the image senses {state} and moves {action} entries, {task} has {expected_state} and {expected_action}; export it for this task"
    )]
    WrongSize {
        /// The task to fly.
        task: &'static str,
        /// State entries of the image.
        state: usize,
        /// Action entries of the image.
        action: usize,
        /// State entries of the task.
        expected_state: usize,
        /// Action entries of the task.
        expected_action: usize,
    },
    /// Samples and actions travel too long for the rate.
    #[error(
        "a sample and an action that travel for {transport_us} us each do not fit a period of {period_us} us; fly at a lower rate"
    )]
    Transport {
        /// Time each of them travels, in us.
        transport_us: u64,
        /// Time between samples, in us.
        period_us: u64,
    },
    /// The chip holds no image that checks.
    #[error("the chip holds no whole image; flash a good one")]
    Image,
    /// The controller refuses the policy or the limit.
    #[error("{0}")]
    Load(LoadError),
    /// The plant cannot be controlled at this rate.
    #[error("{task} advances {task_rate} times a second; fly it at {task_rate} Hz or a whole fraction, not at {rate}")]
    Rate {
        /// The task to fly.
        task: &'static str,
        /// Its rate in Hz.
        task_rate: u32,
        /// The rate that was asked for, in Hz.
        rate: u32,
    },
}

/// Episodes that were flown.
#[derive(Clone, Debug)]
pub struct Flight {
    /// Every control step of every episode.
    pub episodes: Vec<Episode>,
    /// What the controller took.
    pub latency: Latency,
    /// Scores and quantiles.
    pub summary: FlightSummary,
}

/// An episode that was flown.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Episode {
    /// Its control steps, in order.
    pub ticks: Vec<Tick>,
    /// Goals that were reached; none where the plant does not count them.
    pub goals: Option<u32>,
}

/// A control step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tick {
    /// Virtual time since the episode's start.
    pub time: Micros,
    /// The controller's answer, with the budget before the step.
    pub step: Step<ACTION>,
    /// Reward that the step brought.
    pub reward: f64,
    /// Cost that the step incurred.
    pub cost: f64,
    /// Host time that the controller took.
    pub latency: Duration,
}

impl Episode {
    /// Undiscounted return.
    pub fn reward(&self) -> f64 {
        self.ticks.iter().map(|tick| tick.reward).sum()
    }

    /// Undiscounted cost return.
    pub fn cost(&self) -> f64 {
        self.ticks.iter().map(|tick| tick.cost).sum()
    }

    /// The budget before each step: kappa of section 3.5.
    pub fn kappas(&self) -> impl Iterator<Item = Cost> + '_ {
        self.ticks.iter().map(|tick| tick.step.kappa)
    }

    /// What went wrong.
    pub fn faults(&self) -> impl Iterator<Item = Fault> + '_ {
        self.ticks.iter().filter_map(|tick| tick.step.fault)
    }
}

/// Flies the policy of an image.
///
/// # Errors
/// [`FlightError`]
pub fn fly(image: &PolicyImage<'_>, plan: &FlightPlan) -> Result<Flight, FlightError> {
    fly_best_of(image, plan, 1)
}

/// Flies the policy of an image, at every step the best of so many candidates
/// ([`host::CANDIDATES`]) by the image's critic.
///
/// # Errors
/// [`FlightError`]
pub fn fly_best_of(image: &PolicyImage<'_>, plan: &FlightPlan, candidates: u8) -> Result<Flight, FlightError> {
    let mut plant = plan.task.plant()?;
    let hold = check(image, plan)?;
    let mut controller = host::pilot(image, plan.limit, 0, candidates).map_err(FlightError::Load)?;
    let mut episodes = Vec::new();
    for index in 0..plan.episodes {
        plant.reset(episode_seed(plan.seed, Use::Plant, index));
        let noise_seed = episode_seed(plan.seed, Use::Controller, index);
        controller.new_episode(plan.limit, noise_seed).map_err(FlightError::Load)?;
        episodes.push(fly_episode(plant.as_mut(), controller.as_mut(), plan, hold));
    }
    let latency = episodes.iter().flat_map(|episode| &episode.ticks).map(|tick| tick.latency).collect();
    let summary = FlightSummary::new(plan, &episodes, &latency);
    Ok(Flight { episodes, latency, summary })
}

/// The image's controller, if it may be given the plan's limit.
pub(crate) fn controller<'a>(image: &PolicyImage<'a>, plan: &FlightPlan) -> Result<HostController<'a>, FlightError> {
    let policy = Policy::load(image).map_err(FlightError::Load)?;
    HostController::new(policy, plan.limit, 0).map_err(FlightError::Load)
}

/// Whether image, task, rate and limit go together; how many plant steps hold an action.
pub(crate) fn check(image: &PolicyImage<'_>, plan: &FlightPlan) -> Result<usize, FlightError> {
    let (task, manifest) = (plan.task, image.manifest());
    if !task.flies(manifest.task) {
        return Err(FlightError::WrongTask { image: manifest.task.into(), task: task.name });
    }
    let (state, action) = (usize::from(manifest.shape.state), usize::from(manifest.shape.action));
    if (state, action) != (task.state, task.action) {
        let Task { name: task, state: expected_state, action: expected_action, .. } = *task;
        return Err(FlightError::WrongSize { task, state, action, expected_state, expected_action });
    }
    if plan.rate_hz == 0 || !task.rate_hz.is_multiple_of(plan.rate_hz) {
        return Err(FlightError::Rate { task: task.name, task_rate: task.rate_hz, rate: plan.rate_hz });
    }
    Policy::load(image).and_then(|policy| HostController::new(policy, plan.limit, 0)).map_err(FlightError::Load)?;
    Ok((task.rate_hz / plan.rate_hz) as usize)
}

fn fly_episode(plant: &mut dyn Plant, controller: &mut dyn Pilot, plan: &FlightPlan, hold: usize) -> Episode {
    let task = plan.task;
    let mut state = vec![0.0; task.state];
    let mut episode = Episode::default();
    let mut incurred = 0.0;
    let mut steps_left = task.horizon;
    let mut time = Micros(0);
    while steps_left > 0 {
        plant.observe(&mut state);
        let started = Instant::now();
        let step = controller.step_within(&state, incurred as f32, plan.max_steps);
        let latency = started.elapsed();

        let (mut reward, mut cost) = (0.0, 0.0);
        for _ in 0..hold.min(steps_left) {
            let outcome = plant.step(&step.action.as_slice()[..task.action]);
            reward += outcome.reward;
            cost += outcome.cost;
            steps_left = if outcome.done { 0 } else { steps_left - 1 };
            if outcome.done {
                break;
            }
        }
        episode.ticks.push(Tick { time, step, reward, cost, latency });
        incurred = cost;
        time.0 += plan.period().0;
    }
    episode
}

impl FlightPlan {
    /// Time between control steps.
    pub fn period(&self) -> Micros {
        // A rate that `check` lets pass divides a task's rate, and those are a few hundred Hz at most.
        Micros::period(self.rate_hz).unwrap_or_default()
    }
}

/// What a seed is for: a plant must not start where the controller's noise says.
#[derive(Clone, Copy, Debug)]
pub(crate) enum Use {
    Plant,
    Controller,
    Faults,
    Mixture,
}

/// The seed of an episode, independent of how many others are flown.
pub(crate) fn episode_seed(seed: u64, purpose: Use, episode: u32) -> u64 {
    let [low, high, ..] = Noise::new(seed).words(purpose as u32, episode.into(), 0);
    u64::from(high) << 32 | u64::from(low)
}

#[cfg(test)]
mod tests;
