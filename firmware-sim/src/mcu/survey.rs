//! What a machine does with a policy: proofs, and what it takes.

use std::collections::BTreeMap;
use std::fmt;
use std::time::Duration;

use armor_core::image::{PolicyImage, Precision};
use armor_core::units::CostLimit;
use armor_infer::link::{Answer, Request, VERSION};
use serde::Serialize;

use super::class::Class;
use super::count::{Instructions, count};
use super::emulator::Flashed;
use super::episode::{EpisodePlan, fly};
use super::error::McuError;
use super::firmware::Firmware;
use super::machine::Machine;
use crate::host;
use crate::link::HostEndpoint;
use crate::task::{Task, World};

/// Functions that a report names; the others are few instructions.
const FUNCTIONS: usize = 8;

/// What to find out.
#[derive(Clone, Copy, Debug)]
pub struct SurveyPlan {
    /// Calls of the denoiser that an action may take, which picks the rung.
    pub max_steps: usize,
    /// Actions whose instructions are counted.
    pub actions: u32,
    /// Decides the episode's start and noise.
    pub seed: u64,
    /// What the emulator may take for one run, or one answer.
    pub patience: Duration,
}

/// What a machine does with a policy. Every bit that it answered was the host's.
#[derive(Clone, Debug, Serialize)]
pub struct Survey {
    /// The machine.
    pub machine: &'static str,
    /// Its processor core.
    pub core: &'static str,
    /// Number format of the policy.
    pub precision: Precision,
    /// Calls of the denoiser in an action.
    pub steps: u16,
    /// Rows of the golden trace that it reproduced.
    pub golden_rows: u32,
    /// The task whose plant it flew; none where this program has none for the policy.
    pub task: Option<&'static str>,
    /// Actions of that episode.
    pub episode_actions: u32,
    /// Its return.
    pub episode_reward: f64,
    /// Its cost return.
    pub episode_cost: f64,
    /// Multiply-accumulates of an action.
    pub macs_per_action: u64,
    /// Instructions of an action.
    pub instructions_per_action: f64,
    /// Those over the multiply-accumulates.
    pub instructions_per_mac: f64,
    /// Instructions of an action, by class.
    pub classes: BTreeMap<Class, f64>,
    /// Instructions of an action, by function, the most first.
    pub functions: Vec<(String, f64)>,
    /// Bytes of the image.
    pub image_bytes: usize,
    /// Bytes of flash that the firmware takes beside it.
    pub firmware_bytes: u64,
    /// Bytes of RAM that hold variables.
    pub static_ram_bytes: u64,
    /// The stack's high-water mark over golden trace and episode.
    pub stack_bytes: u32,
}

/// Flies a policy on a machine and counts what it takes.
///
/// # Errors
/// [`McuError`]; among them that the machine's answers differ from the host's.
pub fn survey(
    machine: &'static Machine,
    firmware: &Firmware,
    bytes: &[u8],
    plan: &SurveyPlan,
) -> Result<Survey, McuError> {
    let flyable = host::check(bytes)?;
    let (image, manifest) = (&flyable.image, flyable.image.manifest());
    let rung = flyable.policy.rung_within(plan.max_steps).and_then(|rung| manifest.rungs.get(rung));
    let steps = rung.map(|rung| rung.steps).ok_or(McuError::NoRung { max_steps: plan.max_steps })?;
    let flashed = Flashed::new(machine, firmware, image.bytes())?;

    let golden = flashed.run("golden", plan.patience)?;
    let mut stack = [golden.number("stack_bytes"), None];
    let task = native(manifest.task);
    let mut episode = None;
    if let Some(task) = task {
        let limit = CostLimit::new(task.cost_limit).map_or(manifest.kappa.trained_max, CostLimit::cost);
        let limit = CostLimit::from_cost(limit.min(manifest.kappa.trained_max));
        let plan = EpisodePlan { task, limit, seed: plan.seed, max_steps: steps.into(), patience: plan.patience };
        let (flown, told) = fly(machine, &flashed, image, &plan)?;
        stack[1] = told.number("stack_bytes");
        episode = Some(flown);
    }
    let instructions = count(&flashed, firmware, steps.into(), plan.actions, plan.patience)?;
    let expected = checksum(image, steps.into(), 1 + plan.actions)?;
    if instructions.checksum != expected {
        let what = format!(
            "the checksum of {} actions is {:08x} there and {expected:08x} here",
            1 + plan.actions,
            instructions.checksum
        );
        return Err(McuError::Differs { machine: machine.name, what });
    }

    let macs = manifest.shape.macs_once() + u64::from(steps) * manifest.shape.macs_per_step();
    let Instructions { total, classes, functions, .. } = instructions;
    Ok(Survey {
        machine: machine.name,
        core: machine.core,
        precision: manifest.precision,
        steps,
        golden_rows: golden.number("golden_rows").unwrap_or_default(),
        task: task.map(|task| task.name),
        episode_actions: episode.map_or(0, |episode| episode.actions),
        episode_reward: episode.map_or(0.0, |episode| episode.reward),
        episode_cost: episode.map_or(0.0, |episode| episode.cost),
        macs_per_action: macs,
        instructions_per_action: total,
        instructions_per_mac: total / macs as f64,
        classes,
        functions: functions.into_iter().take(FUNCTIONS).collect(),
        image_bytes: image.bytes().len(),
        firmware_bytes: firmware.flash_bytes,
        static_ram_bytes: firmware.static_ram_bytes,
        stack_bytes: stack.into_iter().flatten().max().unwrap_or_default(),
    })
}

/// The native task that policies of the task `trained` fly.
fn native(trained: &str) -> Option<&'static Task> {
    crate::task::TASKS.iter().find(|task| task.world == World::Native && task.flies(trained))
}

/// What the firmware's `bench` tells, computed by this host.
fn checksum(image: &PolicyImage<'_>, steps: usize, actions: u32) -> Result<u32, McuError> {
    let golden = &image.sections().golden;
    let mut endpoint = HostEndpoint::new(image, steps).map_err(McuError::Load)?;
    endpoint.answer(&Request::Hello { version: VERSION });
    endpoint.answer(&Request::Reset { episode: 1, limit: golden.limit, seed: golden.seed });
    let rows: Vec<_> = golden.rows().collect();
    let mut sum = 0u32;
    for (tick, row) in (0..actions).zip(rows.iter().cycle()) {
        let state = heapless::Vec::from_slice(row.state).unwrap_or_default();
        if let Some(Answer::Act { action, .. }) =
            endpoint.answer(&Request::Observe { episode: 1, tick, incurred: 0.0, state })
        {
            sum = action.iter().fold(sum, |sum, entry| sum.rotate_left(5) ^ entry.to_bits());
        }
    }
    Ok(sum)
}

impl fmt::Display for Survey {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{}, {}: {:?}, {} steps", self.machine, self.core, self.precision, self.steps)?;
        write!(f, "  as the host bit for bit: golden trace of {} rows", self.golden_rows)?;
        if let Some(task) = self.task {
            write!(f, ", {task} of {} actions", self.episode_actions)?;
        }
        writeln!(f)?;
        let (total, macs) = (self.instructions_per_action, self.macs_per_action);
        writeln!(f, "  {total:.0} instructions an action, {:.3} for each of {macs} MAC", self.instructions_per_mac)?;
        let (flash, image) = (self.firmware_bytes, self.image_bytes);
        writeln!(f, "  flash {flash} bytes of firmware and {image} of policy")?;
        write!(f, "  RAM {} bytes of variables and {} of stack", self.static_ram_bytes, self.stack_bytes)?;
        let share = |count: &f64| 100.0 * count / total;
        let mut classes: Vec<_> = self.classes.iter().collect();
        classes.sort_by(|a, b| b.1.total_cmp(a.1));
        for (class, count) in classes {
            write!(f, "\n{count:>12.0}{:>7.1} %  {}", share(count), class.name())?;
        }
        for (name, count) in &self.functions {
            write!(f, "\n{count:>12.0}{:>7.1} %  {}", share(count), short(name))?;
        }
        Ok(())
    }
}

/// A function's name without what does not fit a line.
fn short(name: &str) -> &str {
    name.char_indices().nth(56).map_or(name, |(end, _)| &name[..end])
}
