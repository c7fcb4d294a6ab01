//! `firmware-sim bench --link`: what the link adds to an action.

use std::io::{self, BufRead, BufReader, Read, Write};
use std::net::TcpStream;
use std::path::Path;
use std::process::{Child, ChildStdin, ChildStdout, Command, Stdio};
use std::time::{Duration, Instant};

use armor_core::noise::Noise;
use armor_core::units::Cost;
use serde::Serialize;

use crate::latency::{Latency, Quantiles};
use crate::link::{Client, patient_socket};

/// Round trips that are timed.
const TICKS: u64 = 2000;
/// Round trips before those, untimed.
const WARM_UP: u64 = 100;
/// What the bench waits for an answer.
const PATIENCE: Duration = Duration::from_secs(10);

/// Round trips over one kind of line, from a state to its action.
#[derive(Serialize)]
pub(super) struct RoundTrips {
    /// The kind of line.
    pub(super) line: &'static str,
    /// Calls of the denoiser in an action.
    pub(super) steps: u16,
    ticks: u64,
    #[serde(flatten)]
    pub(super) quantiles: Quantiles,
}

/// Times round trips to a controller process of an image, over each kind of line.
pub(super) fn time(image: &Path, steps: u16) -> Result<[RoundTrips; 2], Box<dyn std::error::Error>> {
    let serve = |line: &[&str]| {
        let mut command = Command::new(std::env::current_exe()?);
        command.arg("serve").arg(image).args(["--max-steps", &steps.to_string()]).args(line);
        Controller::start(&mut command)
    };
    let mut controller = serve(&["--listen", "127.0.0.1:0"])?;
    let socket = TcpStream::connect(controller.address()?)?;
    let tcp = ticks(Client::new(patient_socket(socket, PATIENCE)?))?;

    let mut controller = serve(&["--stdio"])?;
    let pipes = Pipes::of(&mut controller.0).ok_or("the controller process has no standard streams")?;
    let stdio = ticks(Client::new(pipes))?;

    let row = |line, quantiles| RoundTrips { line, steps, ticks: TICKS, quantiles };
    Ok([row("tcp", tcp), row("stdio", stdio)])
}

fn ticks(mut client: Client<impl Read + Write>) -> Result<Quantiles, Box<dyn std::error::Error>> {
    let mut state = vec![0.0; client.hello()?.state];
    client.reset(Cost::ZERO, 0)?;
    let noise = Noise::new(0);
    let mut trips = Vec::new();
    for tick in 0..WARM_UP + TICKS {
        noise.fill_normal(0, tick, &mut state);
        let started = Instant::now();
        client.step(&state, 0.0)?;
        if tick >= WARM_UP {
            trips.push(started.elapsed());
        }
    }
    Ok(trips.into_iter().collect::<Latency>().quantiles())
}

/// A process of `firmware-sim serve`, ended where it is dropped.
struct Controller(Child);

impl Controller {
    fn start(command: &mut Command) -> io::Result<Self> {
        command.stdin(Stdio::piped()).stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().map(Self)
    }

    /// Where it listens, as it says on stderr.
    fn address(&mut self) -> Result<String, Box<dyn std::error::Error>> {
        let stderr = self.0.stderr.take().ok_or("the controller process has no stderr")?;
        for line in BufReader::new(stderr).lines() {
            if let Some(address) = line?.strip_prefix("listening at ") {
                return Ok(address.into());
            }
        }
        Err("the controller process does not listen".into())
    }
}

impl Drop for Controller {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// The standard streams of a process as one line.
struct Pipes(ChildStdout, ChildStdin);

impl Pipes {
    fn of(child: &mut Child) -> Option<Self> {
        Some(Self(child.stdout.take()?, child.stdin.take()?))
    }
}

impl Read for Pipes {
    fn read(&mut self, buffer: &mut [u8]) -> io::Result<usize> {
        self.0.read(buffer)
    }
}

impl Write for Pipes {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.1.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.1.flush()
    }
}
