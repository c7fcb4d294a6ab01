//! The firmware under QEMU: started, told what to do, heard, and ended in time.

use std::fs;
use std::path::{Path, PathBuf};
use std::process::{Child, ExitStatus, Stdio};
use std::thread;
use std::time::{Duration, Instant};

use tempfile::TempDir;

use super::error::McuError;
use super::firmware::Firmware;
use super::machine::Machine;

/// Time between looks at whether an emulator has ended.
const GLANCE: Duration = Duration::from_millis(5);

/// A firmware with a policy in its flash.
#[derive(Debug)]
pub struct Flashed<'a> {
    machine: &'static Machine,
    firmware: &'a Firmware,
    /// Files that the emulator reads and writes.
    folder: TempDir,
}

/// What a firmware told: words with numbers, in order.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct Told(Vec<(String, u32)>);

impl Told {
    /// The number that was told with a word.
    pub fn number(&self, word: &str) -> Option<u32> {
        self.0.iter().find(|(told, _)| told == word).map(|(_, number)| *number)
    }
}

impl<'a> Flashed<'a> {
    /// Puts an image into the policy slot of a machine.
    ///
    /// # Errors
    /// [`McuError`]
    pub fn new(machine: &'static Machine, firmware: &'a Firmware, image: &[u8]) -> Result<Self, McuError> {
        let slot = firmware.slot.end - firmware.slot.start;
        if image.len() as u64 > slot {
            return Err(McuError::Slot { image: image.len(), slot });
        }
        let folder = tempfile::tempdir().map_err(McuError::system("make", Path::new("a temporary folder")))?;
        let flashed = Self { machine, firmware, folder };
        let path = flashed.image();
        fs::write(&path, image).map_err(McuError::system("write", &path))?;
        Ok(flashed)
    }

    /// Runs a command of the firmware to its end.
    ///
    /// # Errors
    /// [`McuError`]
    pub fn run(&self, command: &str, patience: Duration) -> Result<Told, McuError> {
        self.start(command, &[])?.wait(patience)
    }

    /// Starts a command of the firmware; `more` are arguments of the emulator.
    ///
    /// # Errors
    /// [`McuError`]
    pub fn start(&self, command: &str, more: &[String]) -> Result<Running, McuError> {
        let console = self.folder.path().join("console");
        let complaints = self.folder.path().join("complaints");
        // What an earlier run left must not be taken for this one's.
        let _ = fs::remove_file(&console);
        let file = fs::File::create(&complaints).map_err(McuError::system("write", &complaints))?;

        let mut emulator = self.machine.command(&self.firmware.path, &self.image(), self.firmware.slot.start);
        emulator.arg("-chardev").arg(format!("file,id=console,path={}", console.display()));
        let words: String = command.split(' ').map(|word| format!(",arg={word}")).collect();
        emulator.arg("-semihosting-config").arg(format!("enable=on,target=native,chardev=console{words}"));
        if !more.iter().any(|argument| argument == "-serial") {
            emulator.args(["-serial", "null"]);
        }
        emulator.args(more).stdin(Stdio::null()).stdout(Stdio::null()).stderr(file);
        let child = emulator.spawn().map_err(|source| match source.kind() {
            std::io::ErrorKind::NotFound => {
                McuError::Missing { tool: self.machine.emulator, package: self.machine.package() }
            }
            _ => McuError::System { action: "run", path: self.machine.emulator.into(), source },
        })?;
        Ok(Running { machine: self.machine, child, console, complaints })
    }

    /// A file that the emulator may write to.
    pub(super) fn file(&self, name: &str) -> PathBuf {
        self.folder.path().join(name)
    }

    fn image(&self) -> PathBuf {
        self.folder.path().join("policy.armor")
    }
}

/// A running emulator, ended where it is dropped.
#[derive(Debug)]
pub struct Running {
    machine: &'static Machine,
    child: Child,
    console: PathBuf,
    complaints: PathBuf,
}

impl Running {
    /// Waits for its end; what it told.
    ///
    /// # Errors
    /// As of [`Running::console`].
    pub fn wait(self, patience: Duration) -> Result<Told, McuError> {
        let machine = self.machine.name;
        let console = self.console(patience)?;
        let told = console.lines().map(|line| {
            let (word, number) = line.split_once(' ')?;
            Some((word.to_owned(), number.parse().ok()?))
        });
        let why = || "it told what is no line of a word and a number".into();
        told.collect::<Option<_>>().map(Told).ok_or_else(|| McuError::Failed { machine, why: why() })
    }

    /// Waits for its end; all that it printed.
    ///
    /// # Errors
    /// [`McuError`], where it does not end in time, or not as it should.
    pub fn console(mut self, patience: Duration) -> Result<String, McuError> {
        let started = Instant::now();
        loop {
            if let Some(status) = self.ended()? {
                return self.printed(status);
            }
            if started.elapsed() > patience {
                return Err(McuError::Late { machine: self.machine.name, patience });
            }
            thread::sleep(GLANCE);
        }
    }

    /// Whether it has ended by itself.
    pub(super) fn ended(&mut self) -> Result<Option<ExitStatus>, McuError> {
        self.child.try_wait().map_err(McuError::system("wait for", Path::new(self.machine.emulator)))
    }

    fn printed(&self, status: ExitStatus) -> Result<String, McuError> {
        // An emulator that could not start wrote no console.
        let console = fs::read_to_string(&self.console).unwrap_or_default();
        let failed = |why: &str| McuError::Failed { machine: self.machine.name, why: why.into() };
        if let Some(why) = console.lines().find_map(|line| line.strip_prefix("failed ")) {
            return Err(failed(why));
        }
        if !status.success() {
            let complaints = fs::read_to_string(&self.complaints).unwrap_or_default();
            return Err(failed(complaints.lines().last().unwrap_or("nothing")));
        }
        Ok(console)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // It may have ended by itself.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}
