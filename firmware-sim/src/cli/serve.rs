//! `firmware-sim serve`

use std::io;
use std::net::{TcpListener, TcpStream};
use std::path::PathBuf;
use std::thread;
use std::time::Duration;

use armor_core::image::PolicyImage;
use armor_infer::link::Answer;

use super::output::{CommandResult, Output};
use crate::host;
use crate::image_file::ImageFile;
use crate::link::{HostEndpoint, PatientPipe, patient_socket, serve};

/// Put the controller of an image behind a link, for a robot or its simulator.
///
/// docs/link.md is the protocol.
#[derive(Debug, clap::Args)]
pub(super) struct Serve {
    /// The policy image.
    image: PathBuf,
    #[command(flatten)]
    line: Line,
    /// Calls of the denoiser that an action may take, which picks the rung; no
    /// limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
    /// Seconds without a request after which a plant is let go.
    #[arg(long, value_name = "SECONDS", default_value_t = 60, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
}

#[derive(Debug, clap::Args)]
#[group(required = true, multiple = false)]
struct Line {
    /// Wait for plants at this address, as in 127.0.0.1:4750; each has a
    /// controller of its own.
    #[arg(long, value_name = "HOST:PORT")]
    listen: Option<String>,
    /// Serve one plant on stdin and stdout.
    #[arg(long)]
    stdio: bool,
}

impl Serve {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.image)?;
        file.image()?;
        let flyable = host::check(file.bytes()).map_err(|error| format!("{}: {error}", self.image.display()))?;
        let rows = flyable.golden_rows;
        output.note(format_args!("serving {}, {rows} golden rows bit for bit", flyable.image.manifest().task));
        let patience = Duration::from_secs(self.patience);
        let service = Service { image: &flyable.image, max_steps: self.max_steps, patience, output };
        match &self.line.listen {
            None => service.plant(&mut PatientPipe::new(io::stdin(), io::stdout(), patience), "plant"),
            Some(address) => service.listen(address),
        }
    }
}

/// What every plant is served.
#[derive(Clone, Copy)]
struct Service<'a> {
    image: &'a PolicyImage<'a>,
    max_steps: usize,
    patience: Duration,
    output: Output,
}

impl Service<'_> {
    /// Serves whoever connects, each on a thread of its own, until the process is ended.
    fn listen(&self, address: &str) -> CommandResult {
        let listener = TcpListener::bind(address).map_err(|error| format!("cannot listen at {address}: {error}"))?;
        self.output.note(format_args!("listening at {}", listener.local_addr()?));
        thread::scope(|scope| {
            for socket in listener.incoming() {
                let socket = socket?;
                scope.spawn(move || self.socket(socket));
            }
            Ok(())
        })
    }

    fn socket(&self, socket: TcpStream) {
        let name = socket.peer_addr().map_or_else(|_| "plant".into(), |address| address.to_string());
        let served = patient_socket(socket, self.patience)
            .map_err(Into::into)
            .and_then(|mut socket| self.plant(&mut socket, &name));
        if let Err(error) = served {
            self.output.note(format_args!("{name}: {error}"));
        }
    }

    fn plant(&self, line: &mut (impl io::Read + io::Write), name: &str) -> CommandResult {
        let mut endpoint = HostEndpoint::new(self.image, self.max_steps)?;
        let (mut episodes, mut actions, mut faults) = (0, 0, 0);
        serve(line, &mut endpoint, self.patience, |(answer, _)| match answer {
            Answer::Ready { .. } => episodes += 1,
            Answer::Act { fault, .. } => {
                actions += 1;
                faults += u64::from(fault.is_some());
            }
            Answer::Hello(_) | Answer::Refused(_) => {}
        })?;
        self.output.note(format_args!("{name} left after {episodes} episodes, {actions} actions, {faults} faults"));
        Ok(())
    }
}
