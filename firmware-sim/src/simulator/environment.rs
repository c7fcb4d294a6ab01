//! The Python environment that the simulators run in, made on first use.

use std::env;
use std::fs::{self, File};
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use crc::{CRC_32_ISO_HDLC, Crc};

use super::error::SimulatorError;

/// The packages of the simulators, each in the version that works.
const REQUIREMENTS: &str = include_str!("../../python/simulators.txt");
/// Where a Python may be found that they run on.
const PYTHONS: [&str; 3] = ["python3.11", "python3.10", "python3"];

/// A Python with both simulators.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Environment {
    folder: PathBuf,
}

impl Environment {
    /// The environment variable that names the environment's folder.
    pub const VARIABLE: &str = "ARMOR_SIMULATORS";

    /// The folder that [`Environment::VARIABLE`] names, or one in the user's
    /// cache with a name of its own for each set of packages.
    ///
    /// # Errors
    /// [`SimulatorError::NoHome`]
    pub fn folder() -> Result<PathBuf, SimulatorError> {
        let named = |variable| env::var_os(variable).filter(|value| !value.is_empty()).map(PathBuf::from);
        if let Some(folder) = named(Self::VARIABLE) {
            return Ok(folder);
        }
        let cache = named("XDG_CACHE_HOME").or_else(|| Some(named("HOME")?.join(".cache")));
        let packages = Crc::<u32>::new(&CRC_32_ISO_HDLC).checksum(REQUIREMENTS.as_bytes());
        Ok(cache.ok_or(SimulatorError::NoHome)?.join("armor").join(format!("simulators-{packages:08x}")))
    }

    /// The environment in `folder`, made if there is none; `note` is told
    /// before that, as it takes a while.
    ///
    /// It is made in a folder beside, then renamed, so that one is whole if it
    /// is there at all; two processes do not make it at once.
    ///
    /// # Errors
    /// [`SimulatorError`]
    pub fn open(folder: &Path, note: impl FnOnce(&str)) -> Result<Self, SimulatorError> {
        Self::open_with(folder, &PYTHONS, note)
    }

    /// As [`Environment::open`], made by the first of `pythons` that will do.
    pub(super) fn open_with(folder: &Path, pythons: &[&str], note: impl FnOnce(&str)) -> Result<Self, SimulatorError> {
        let environment = Self { folder: folder.into() };
        if environment.is_there() {
            return Ok(environment);
        }
        let parent = folder.parent().ok_or(SimulatorError::NoHome)?;
        fs::create_dir_all(parent).map_err(SimulatorError::system("create", parent))?;
        let lock_path = beside(folder, "lock");
        let lock = File::create(&lock_path).map_err(SimulatorError::system("create", &lock_path))?;
        lock.lock().map_err(SimulatorError::system("lock", &lock_path))?;
        // Another process may have made it while this one waited.
        if !environment.is_there() {
            note(&format!("installing the simulators in {}, once", folder.display()));
            environment.make(pythons)?;
        }
        Ok(environment)
    }

    /// The environment's Python.
    pub fn python(&self) -> PathBuf {
        self.folder.join("bin").join("python")
    }

    fn is_there(&self) -> bool {
        self.python().exists()
    }

    fn make(&self, pythons: &[&str]) -> Result<(), SimulatorError> {
        let python = pythons.iter().find(|python| is_suitable(python)).ok_or(SimulatorError::NoPython)?;
        let part = beside(&self.folder, "part");
        // What an interrupted run left behind.
        if part.exists() {
            fs::remove_dir_all(&part).map_err(SimulatorError::system("remove", &part))?;
        }
        run(Command::new(python).args(["-m", "venv"]).arg(&part))?;
        let requirements = part.join("simulators.txt");
        crate::file::write(&requirements, REQUIREMENTS.as_bytes())?;
        run(Command::new(part.join("bin").join("python"))
            .args(["-m", "pip", "install", "--quiet", "--disable-pip-version-check", "--no-deps", "-r"])
            .arg(&requirements))?;
        fs::rename(&part, &self.folder).map_err(SimulatorError::system("make", &self.folder))
    }
}

/// A path with a suffix of its own, in the same folder.
fn beside(path: &Path, suffix: &str) -> PathBuf {
    let mut name = path.as_os_str().to_owned();
    name.push(".");
    name.push(suffix);
    name.into()
}

/// Whether a command is a Python that the packages have builds for.
fn is_suitable(python: &str) -> bool {
    let question = "import sys; sys.exit(sys.version_info[:2] not in ((3, 10), (3, 11)))";
    let status = Command::new(python).args(["-c", question]).stdout(Stdio::null()).stderr(Stdio::null()).status();
    status.is_ok_and(|status| status.success())
}

/// Runs a command to its end; its last line is the error where it fails.
fn run(command: &mut Command) -> Result<(), SimulatorError> {
    let name = command.get_program().to_owned();
    let output = command.stdin(Stdio::null()).output().map_err(SimulatorError::system("run", &name))?;
    if output.status.success() {
        return Ok(());
    }
    let printed = [output.stdout, output.stderr].concat();
    let arguments = command.get_args().take(3).map(|argument| argument.to_string_lossy().into_owned());
    Err(SimulatorError::Setup {
        command: [name.to_string_lossy().into_owned()].into_iter().chain(arguments).collect::<Vec<_>>().join(" "),
        said: last_line(&String::from_utf8_lossy(&printed)),
    })
}

/// The last line with a text in it.
pub(super) fn last_line(text: &str) -> String {
    text.lines().rfind(|line| !line.trim().is_empty()).unwrap_or("nothing").trim().into()
}
