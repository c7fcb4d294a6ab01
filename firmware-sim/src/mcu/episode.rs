//! An episode of a native plant, flown by an emulated controller over its UART.
//!
//! The host's controller is asked beside it, in lockstep: the same states and
//! costs, and the first answer that is not its own, bit for bit, ends the flight.

use std::net::{TcpListener, TcpStream};
use std::thread;
use std::time::{Duration, Instant};

use armor_core::image::PolicyImage;
use armor_core::units::CostLimit;
use armor_infer::Policy;

use super::emulator::{Flashed, Running, Told};
use super::error::McuError;
use super::machine::Machine;
use crate::host::HostController;
use crate::link::{Client, ClientError, patient_socket};
use crate::task::Task;

/// Time between looks at whether an emulator has connected.
const GLANCE: Duration = Duration::from_millis(5);
/// What an emulator has to start and connect.
pub(super) const START: Duration = Duration::from_secs(30);

/// What to fly.
#[derive(Clone, Copy, Debug)]
pub struct EpisodePlan {
    /// The task; it has a native plant.
    pub task: &'static Task,
    /// Cost that the episode may incur.
    pub limit: CostLimit,
    /// Decides start and noise.
    pub seed: u64,
    /// Calls of the denoiser that an action may take.
    pub max_steps: u32,
    /// What an answer may take.
    pub patience: Duration,
}

/// An episode in which every budget and action was the host's, bit for bit.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Episode {
    /// Its control steps.
    pub actions: u32,
    /// Undiscounted return.
    pub reward: f64,
    /// Undiscounted cost return.
    pub cost: f64,
}

/// Flies an episode on a machine and beside it on this host.
///
/// # Errors
/// [`McuError::Differs`] where the two part; other variants where there is no
/// answer at all.
pub fn fly(
    machine: &'static Machine,
    flashed: &Flashed<'_>,
    image: &PolicyImage<'_>,
    plan: &EpisodePlan,
) -> Result<(Episode, Told), McuError> {
    let mut plant = plan.task.plant()?;
    let policy = Policy::load(image).map_err(McuError::Load)?;
    let mut host = HostController::new(policy, plan.limit, plan.seed).map_err(McuError::Load)?;
    let link = |error: ClientError| McuError::Link { machine: machine.name, error };
    let line = |error: std::io::Error| link(ClientError::Line(error));

    let listener = TcpListener::bind("127.0.0.1:0").map_err(line)?;
    let serial = format!("tcp:{}", listener.local_addr().map_err(line)?);
    let actions = u32::try_from(plan.task.horizon).unwrap_or(u32::MAX);
    let mut running = flashed.start(&format!("serve {} {actions}", plan.max_steps), &["-serial".into(), serial])?;
    let Some(socket) = connection(&mut running, &listener)? else {
        // It says why it ended, unless it ended as if its work were done.
        running.wait(START)?;
        return Err(link(ClientError::Left));
    };
    let mut client = Client::new(patient_socket(socket, plan.patience).map_err(line)?);
    client.hello().map_err(link)?;
    client.reset(plan.limit.cost(), plan.seed).map_err(link)?;

    plant.reset(plan.seed);
    let mut state = vec![0.0; plan.task.state];
    let mut episode = Episode { actions: 0, reward: 0.0, cost: 0.0 };
    let mut incurred = 0.0;
    for tick in 0..actions {
        plant.observe(&mut state);
        let theirs = client.step(&state, incurred).map_err(link)?;
        let ours = host.step_within(&state, incurred, plan.max_steps as usize);
        let bits = |entries: &[f32]| entries.iter().map(|entry| entry.to_bits()).collect::<Vec<_>>();
        let action = &ours.action.as_slice()[..plan.task.action];
        if theirs.kappa != ours.kappa || bits(&theirs.action) != bits(action) {
            let what = format!("in step {tick} the machine answers {:?} and the host {action:?}", theirs.action);
            return Err(McuError::Differs { machine: machine.name, what });
        }
        let outcome = plant.step(&theirs.action);
        episode.actions += 1;
        episode.reward += outcome.reward;
        episode.cost += outcome.cost;
        incurred = outcome.cost as f32;
        if outcome.done {
            break;
        }
    }
    // After a shorter episode the firmware waits for the rest of it.
    let told = if episode.actions == actions { running.wait(plan.patience)? } else { Told::default() };
    Ok((episode, told))
}

/// Waits until an emulator connects; none where it ends before that.
pub(super) fn connection(running: &mut Running, listener: &TcpListener) -> Result<Option<TcpStream>, McuError> {
    let failed = McuError::system("listen to", "the emulator's serial line".as_ref());
    let mut accept = || -> std::io::Result<Option<TcpStream>> {
        listener.set_nonblocking(true)?;
        let started = Instant::now();
        loop {
            match listener.accept() {
                Ok((socket, _)) => {
                    socket.set_nonblocking(false)?;
                    return Ok(Some(socket));
                }
                Err(error) if error.kind() == std::io::ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            if started.elapsed() > START {
                return Err(std::io::ErrorKind::TimedOut.into());
            }
            if running.ended().ok().flatten().is_some() {
                return Ok(None);
            }
            thread::sleep(GLANCE);
        }
    };
    accept().map_err(failed)
}
