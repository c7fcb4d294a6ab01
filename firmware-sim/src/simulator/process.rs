//! One simulator: a process that asks the controller for actions, and tells on
//! its standard output what became of each episode.

use std::io::{self, BufRead, BufReader, ErrorKind, Read};
use std::net::{TcpListener, TcpStream};
use std::ops::Range;
use std::path::Path;
use std::process::{Child, Command, Stdio};
use std::thread::{self, JoinHandle};
use std::time::{Duration, Instant};

use armor_core::image::PolicyImage;
use serde::Deserialize;

use super::environment::{Environment, last_line};
use super::error::SimulatorError;
use crate::flight::{FlightError, FlightPlan};
use crate::link::{HostEndpoint, Served, patient_socket, serve};

/// What a simulator has for its next request; a reset takes at most seconds.
const PATIENCE: Duration = Duration::from_secs(60);
/// What a simulator has to load and connect; seconds, where nothing is wrong.
const START: Duration = Duration::from_secs(180);
/// Time between looks at whether a simulator has connected.
const GLANCE: Duration = Duration::from_millis(5);

/// What a simulator tells of an episode.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub(super) struct Told {
    /// Its number in the flight.
    pub(super) episode: u32,
    /// Reward of each control step.
    pub(super) rewards: Vec<f64>,
    /// Cost of each control step.
    pub(super) costs: Vec<f64>,
    /// Goals that were reached.
    pub(super) goals: u32,
}

/// Flies some episodes of a plan in a simulator of its own.
///
/// `answered` sees each of the controller's answers, `ended` each episode.
///
/// # Errors
/// [`SimulatorError`]
pub(super) fn fly<'a>(
    (environment, package): (&Environment, &Path),
    image: &PolicyImage<'a>,
    plan: &FlightPlan,
    episodes: Range<u32>,
    answered: impl FnMut(Served<'a>),
    ended: impl Fn(Told) + Send + 'static,
) -> Result<(), SimulatorError> {
    let task = plan.task.name;
    let lost = |said: String| SimulatorError::Lost { task, said };
    let listener = TcpListener::bind("127.0.0.1:0").map_err(|error| lost(error.to_string()))?;
    let address = listener.local_addr().map_err(|error| lost(error.to_string()))?;

    let python = environment.python();
    let mut command = Command::new(&python);
    command.env("PYTHONPATH", package).args(["-m", "armor_plant", task, "--each"]);
    command.args(["--connect", &address.to_string(), "--patience", &PATIENCE.as_secs().to_string()]);
    command.args(["--limit", &f64::from(plan.limit.cost().to_f32()).to_string(), "--seed", &plan.seed.to_string()]);
    command.args(["--first", &episodes.start.to_string(), "--episodes", &episodes.len().to_string()]);
    command.stdin(Stdio::null()).stdout(Stdio::piped()).stderr(Stdio::piped());
    let child = command.spawn().map_err(SimulatorError::system("run", &python))?;
    let mut simulator = Simulator::new(child, episodes.len(), ended);

    let served = match simulator.connection(&listener) {
        Ok(Some(socket)) => {
            let mut endpoint = HostEndpoint::new(image, plan.max_steps).map_err(FlightError::Load)?;
            patient_socket(socket, PATIENCE)
                .map_err(|error| error.to_string())
                .and_then(|mut socket| serve(&mut socket, &mut endpoint, PATIENCE, answered).map_err(|e| e.to_string()))
        }
        // It ended before it connected, and says why.
        Ok(None) => Ok(()),
        Err(error) => Err(error.to_string()),
    };
    if served.is_err() {
        simulator.kill();
    }
    let said = simulator.end();
    served.map_err(lost)?;
    said.map_err(|said| SimulatorError::Failed { task, said })
}

/// A running simulator, killed where it is dropped before its end.
struct Simulator {
    child: Child,
    told: Option<JoinHandle<()>>,
    complaints: Option<JoinHandle<String>>,
}

impl Simulator {
    /// Listens to a simulator's first `episodes` lines, and to its complaints.
    fn new(mut child: Child, episodes: usize, ended: impl Fn(Told) + Send + 'static) -> Self {
        let told = child.stdout.take().map(|stdout| {
            thread::spawn(move || {
                let mut lines = BufReader::new(stdout).lines();
                for line in lines.by_ref().take(episodes).map_while(Result::ok) {
                    if let Ok(episode) = serde_json::from_str(&line) {
                        ended(episode);
                    }
                }
                // The rest is a summary for people; nobody may wait for it to be read.
                lines.for_each(drop);
            })
        });
        let complaints = child.stderr.take().map(|mut stderr| {
            thread::spawn(move || {
                let mut text = Vec::new();
                // What came before an error is the best that is to be had.
                let _ = stderr.read_to_end(&mut text);
                String::from_utf8_lossy(&text).into_owned()
            })
        });
        Self { child, told, complaints }
    }

    /// Waits until the simulator connects; none where it ends before that.
    fn connection(&mut self, listener: &TcpListener) -> io::Result<Option<TcpStream>> {
        listener.set_nonblocking(true)?;
        let started = Instant::now();
        loop {
            match listener.accept() {
                Ok((socket, _)) => {
                    socket.set_nonblocking(false)?;
                    return Ok(Some(socket));
                }
                Err(error) if error.kind() == ErrorKind::WouldBlock => {}
                Err(error) => return Err(error),
            }
            if self.child.try_wait()?.is_some() {
                return Ok(None);
            }
            if started.elapsed() > START {
                return Err(ErrorKind::TimedOut.into());
            }
            thread::sleep(GLANCE);
        }
    }

    fn kill(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
    }

    /// Waits for its end; where it failed, the last line of its complaints, or how it ended if it had none.
    fn end(mut self) -> Result<(), String> {
        let status = self.child.wait();
        if let Some(thread) = self.told.take() {
            let _ = thread.join();
        }
        let complaints = self.complaints.take().and_then(|thread| thread.join().ok()).unwrap_or_default();
        match status {
            Ok(status) if status.success() => Ok(()),
            // A process that was killed has no time to complain.
            Ok(status) if complaints.trim().is_empty() => Err(status.to_string()),
            _ => Err(last_line(&complaints).trim_start_matches("error: ").into()),
        }
    }
}

impl Drop for Simulator {
    fn drop(&mut self) {
        self.kill();
        let _ = self.child.wait();
    }
}
