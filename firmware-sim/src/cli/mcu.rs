//! `firmware-sim mcu`

use std::fmt;
use std::net::TcpListener;
use std::path::PathBuf;
use std::time::Duration;

use clap::CommandFactory;
use clap::error::ErrorKind;
use serde::Serialize;

use super::Cli;
use super::output::{CommandResult, Output};
use crate::host;
use crate::image_file::ImageFile;
use crate::mcu::{Firmware, Flashed, MACHINES, Machine, Survey, SurveyPlan, bridge, survey};

/// Fly a policy on emulated microcontrollers: bit equality with this host over
/// golden trace and episode, instructions of an action, flash, RAM, stack.
///
/// The firmware of firmware-sim/mcu runs under QEMU with the policy in its
/// flash, and is built first where its source has changed.
#[derive(Debug, clap::Args)]
pub(super) struct Mcu {
    /// The policy image.
    image: PathBuf,
    /// The emulated board, or `all` of them.
    #[arg(long, value_name = "M", value_parser = machines)]
    machine: Machines,
    /// Instead, wait for a plant at this address, as in 127.0.0.1:4750, and
    /// give it the machine's UART until it leaves.
    #[arg(long, value_name = "HOST:PORT", conflicts_with_all = ["actions", "seed"])]
    listen: Option<String>,
    /// A folder with built firmware, MACHINE.elf, in place of building it.
    #[arg(long, value_name = "DIR")]
    firmware: Option<PathBuf>,
    /// Calls of the denoiser that an action may take, which picks the rung; no
    /// limit, if not given.
    #[arg(long, value_name = "N", default_value_t = usize::MAX, hide_default_value = true)]
    max_steps: usize,
    /// Actions whose instructions are counted; their mean is reported.
    #[arg(long, value_name = "N", default_value_t = 4, value_parser = clap::value_parser!(u32).range(1..=1000))]
    actions: u32,
    /// Decides the episode's start and noise.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Seconds that the emulator may take for a run or an answer.
    #[arg(long, value_name = "SECONDS", default_value_t = 600, value_parser = clap::value_parser!(u64).range(1..))]
    patience: u64,
}

/// The machines of an argument.
#[derive(Clone, Debug)]
pub(super) struct Machines(pub(super) Vec<&'static Machine>);

pub(super) fn machines(name: &str) -> Result<Machines, String> {
    match name {
        "all" => Ok(Machines(MACHINES.iter().collect())),
        name => Machine::named(name).map(|machine| Machines(vec![machine])),
    }
}

#[derive(Serialize)]
struct Report {
    image: PathBuf,
    machines: Vec<Survey>,
}

impl Mcu {
    pub(super) fn run(self, output: Output) -> CommandResult {
        if self.listen.is_some() && self.machine.0.len() != 1 {
            let message = "--listen puts one machine behind the link; name it";
            Cli::command().error(ErrorKind::ArgumentConflict, message).exit();
        }
        let file = ImageFile::read(&self.image)?;
        file.image()?;
        let (max_steps, actions, seed) = (self.max_steps, self.actions, self.seed);
        let patience = Duration::from_secs(self.patience);
        let plan = SurveyPlan { max_steps, actions, seed, patience };
        let mut report = Report { image: self.image.clone(), machines: Vec::new() };
        for &machine in &self.machine.0 {
            output.note(format_args!("{}: firmware", machine.name));
            let firmware = match &self.firmware {
                None => Firmware::build(machine)?,
                Some(folder) => Firmware::read(&folder.join(format!("{}.elf", machine.name)))?,
            };
            if let Some(address) = &self.listen {
                return self.serve((machine, &firmware), &file, address, output);
            }
            output.note(format_args!("{}: flying and counting", machine.name));
            report.machines.push(survey(machine, &firmware, file.bytes(), &plan)?);
        }
        output.report(&report)
    }

    /// Hardware in the loop: who connects first has the machine's UART.
    fn serve(
        &self,
        (machine, firmware): (&'static Machine, &Firmware),
        file: &ImageFile,
        address: &str,
        output: Output,
    ) -> CommandResult {
        let image = host::check(file.bytes()).map_err(|error| format!("{}: {error}", self.image.display()))?.image;
        let flashed = Flashed::new(machine, firmware, image.bytes())?;
        let listener = TcpListener::bind(address).map_err(|error| format!("cannot listen at {address}: {error}"))?;
        output.note(format_args!("listening at {}", listener.local_addr()?));
        bridge(&flashed, u32::try_from(self.max_steps).unwrap_or(u32::MAX), &listener)?;
        output.note("the plant left");
        Ok(())
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "policy {}", self.image.display())?;
        self.machines.iter().try_for_each(|survey| write!(f, "\n\n{survey}"))
    }
}
