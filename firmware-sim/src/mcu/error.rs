//! Why a microcontroller cannot be emulated.

use std::io;
use std::path::{Path, PathBuf};
use std::time::Duration;

use armor_infer::LoadError;
use thiserror::Error;

use crate::file::FileError;
use crate::host::Unfit;
use crate::link::ClientError;
use crate::task::TaskError;

/// Why a policy was not flown, or not counted, on an emulated microcontroller.
#[derive(Debug, Error)]
pub enum McuError {
    /// A program is not installed.
    #[error("{tool} is not in the PATH; on Debian: apt-get install {package}")]
    Missing {
        /// The program.
        tool: &'static str,
        /// Debian's package of it.
        package: &'static str,
    },
    /// The firmware could not be built.
    #[error("cannot build the firmware: {said}")]
    Build {
        /// The last line of what its script said.
        said: String,
    },
    /// A file is no firmware.
    #[error("{}: no firmware of firmware-sim/mcu: {why}; build it by firmware-sim/mcu/build.sh", path.display())]
    NoFirmware {
        /// The file.
        path: PathBuf,
        /// What is wrong with it.
        why: String,
    },
    /// A file cannot be read.
    #[error(transparent)]
    File(#[from] FileError),
    /// A file or process cannot be used.
    #[error("cannot {action} {}: {source}", path.display())]
    System {
        /// What was tried.
        action: &'static str,
        /// With which file.
        path: PathBuf,
        /// What the system said.
        source: io::Error,
    },
    /// The image has no room in the firmware's flash.
    #[error("the image has {image} bytes and the slot of the firmware {slot}; export it in another precision")]
    Slot {
        /// Bytes of the image.
        image: usize,
        /// Bytes of the slot.
        slot: u64,
    },
    /// This host does not fly the image.
    #[error("{0}")]
    Unfit(#[from] Unfit),
    /// This host does not fly the image at this limit.
    #[error("{0}")]
    Load(LoadError),
    /// Every chain is longer than what was asked for.
    #[error("the image has no chain of at most {max_steps} steps; allow more")]
    NoRung {
        /// Calls of the denoiser that were allowed.
        max_steps: usize,
    },
    /// The task has no plant here.
    #[error(transparent)]
    Task(#[from] TaskError),
    /// The emulator was ended.
    #[error("{machine}: no end after {} s; it was stopped", patience.as_secs())]
    Late {
        /// The machine.
        machine: &'static str,
        /// What was waited.
        patience: Duration,
    },
    /// The firmware, or the emulator, gave up.
    #[error("{machine} failed: {why}")]
    Failed {
        /// The machine.
        machine: &'static str,
        /// What it said.
        why: String,
    },
    /// The controller on the machine did not answer as it should.
    #[error("{machine}: {error}")]
    Link {
        /// The machine.
        machine: &'static str,
        /// What went wrong.
        error: ClientError,
    },
    /// The controller on the machine answers otherwise than the host's.
    #[error("{machine} and this host differ: {what}; do not fly")]
    Differs {
        /// The machine.
        machine: &'static str,
        /// Where they part.
        what: String,
    },
    /// What the instruction counter wrote is not to be read.
    #[error("cannot count instructions: {what}")]
    Count {
        /// What is wrong.
        what: String,
    },
}

impl McuError {
    pub(super) fn system(action: &'static str, path: &Path) -> impl FnOnce(io::Error) -> Self + use<> {
        let path = path.into();
        move |source| Self::System { action, path, source }
    }
}
