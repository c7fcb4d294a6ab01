//! A flight in a simulator: several side by side, one summary.

use std::num::NonZero;
use std::ops::Range;
use std::path::Path;
use std::sync::mpsc::{Sender, channel};
use std::thread;
use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_core::units::Micros;
use armor_infer::Step;
use armor_infer::link::Answer;
use nalgebra::SVector;

use super::environment::Environment;
use super::error::SimulatorError;
use super::package;
use super::process::{self, Told};
use crate::flight::{Episode, Flight, FlightError, FlightPlan, Tick, check, controller};
use crate::host::ACTION;
use crate::latency::Latency;
use crate::summary::FlightSummary;
use crate::task::World;

/// What the controller answered in each step of an episode, and how soon.
type Answered = Vec<(Step<ACTION>, Duration)>;

/// Flies the policy of an image in its task's simulator, at the task's rate,
/// with one simulator for each core; `progress` is told the number of episodes
/// that are over.
///
/// An episode depends on the plan's seed and its own number, and not on how
/// many are flown or how they are shared out. Its latency is from a whole
/// request to the answer, so it holds the reading of the request too.
///
/// # Errors
/// [`SimulatorError`]
pub fn fly(
    image: &PolicyImage<'_>,
    plan: &FlightPlan,
    environment: &Environment,
    mut progress: impl FnMut(u32),
) -> Result<Flight, SimulatorError> {
    let task = plan.task;
    if task.world != World::Simulator {
        return Err(SimulatorError::Native { task: task.name });
    }
    if check(image, plan)? != 1 {
        let (task, task_rate) = (task.name, task.rate_hz);
        return Err(FlightError::Rate { task, task_rate, rate: plan.rate_hz }.into());
    }
    // Refused here, and not after the simulators have started.
    controller(image, plan)?;
    let package = package::unpack()?;
    let cores = thread::available_parallelism().map_or(1, NonZero::get);
    let (ended, over) = channel();
    let episodes = thread::scope(|scope| {
        let workers: Vec<_> = shares(plan.episodes, cores as u32)
            .map(|share| {
                let ended = ended.clone();
                let world = (environment, package.path());
                scope.spawn(move || fly_share(world, image, plan, share, ended))
            })
            .collect();
        drop(ended);
        for (number, ()) in (1..).zip(over) {
            progress(number);
        }
        let flown =
            workers.into_iter().map(|worker| worker.join().unwrap_or_else(|panic| std::panic::resume_unwind(panic)));
        flown.collect::<Result<Vec<_>, _>>().map(|shares| shares.concat())
    })?;
    let latency: Latency = episodes.iter().flat_map(|episode| &episode.ticks).map(|tick| tick.latency).collect();
    let summary = FlightSummary::new(plan, &episodes, &latency);
    Ok(Flight { episodes, latency, summary })
}

/// The numbers of the episodes that each of at most `workers` flies.
pub(super) fn shares(episodes: u32, workers: u32) -> impl Iterator<Item = Range<u32>> {
    let workers = workers.clamp(1, episodes.max(1));
    let start = move |worker| (u64::from(episodes) * u64::from(worker) / u64::from(workers)) as u32;
    (0..workers).map(move |worker| start(worker)..start(worker + 1))
}

/// Flies some episodes of a plan in one simulator.
fn fly_share(
    world: (&Environment, &Path),
    image: &PolicyImage<'_>,
    plan: &FlightPlan,
    share: Range<u32>,
    over: Sender<()>,
) -> Result<Vec<Episode>, SimulatorError> {
    let task = plan.task.name;
    let mut answered: Vec<Answered> = Vec::new();
    let (tell, told) = channel();
    process::fly(
        world,
        image,
        plan,
        share.clone(),
        |(answer, latency)| match answer {
            Answer::Ready { .. } => answered.push(Vec::new()),
            Answer::Act { kappa, rung, fault, action, .. } => {
                let mut whole = SVector::<f32, ACTION>::zeros();
                whole.as_mut_slice()[..action.len()].copy_from_slice(&action);
                let step = Step { action: whole, kappa, rung: rung.map(usize::from), fault };
                answered.last_mut().into_iter().for_each(|steps| steps.push((step, latency)));
            }
            Answer::Hello(_) | Answer::Refused(_) => {}
        },
        move |episode: Told| {
            // Who waits for these ends with an error where the flight does.
            let _ = over.send(());
            let _ = tell.send(episode);
        },
    )?;
    let told: Vec<Told> = told.iter().collect();
    let numbers = told.iter().map(|episode| episode.episode);
    if !numbers.eq(share) || answered.len() != told.len() {
        let said = format!("it told of {} episodes and flew {}", told.len(), answered.len());
        return Err(SimulatorError::Lost { task, said });
    }
    let flown = answered.into_iter().zip(told);
    Ok(flown.map(|(answered, told)| episode(plan, answered, &told)).collect())
}

/// What the controller answered and what the simulator told, control step by control step.
fn episode(plan: &FlightPlan, answered: Answered, told: &Told) -> Episode {
    let outcomes = told.rewards.iter().zip(&told.costs);
    let ticks = (0..).zip(answered).zip(outcomes).map(|((number, (step, latency)), (&reward, &cost))| Tick {
        time: Micros(number * plan.period().0),
        step,
        reward,
        cost,
        latency,
    });
    Episode { ticks: ticks.collect(), goals: Some(told.goals) }
}
