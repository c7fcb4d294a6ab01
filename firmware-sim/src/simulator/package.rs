//! `armor-plant`, the plant's side of the link: this program carries the
//! package along, so that both sides are always of one version.

use std::fs;

use tempfile::TempDir;

use super::error::SimulatorError;

macro_rules! files {
    ($($name:literal),* $(,)?) => {
        [$(($name, include_str!(concat!("../../python/src/armor_plant/", $name)))),*]
    };
}

/// The files of the package.
pub(super) const FILES: [(&str, &str); 17] = files![
    "__init__.py",
    "__main__.py",
    "cli.py",
    "client.py",
    "cobs.py",
    "flight.py",
    "line.py",
    "messages.py",
    "plants.py",
    "postcard.py",
    "py.typed",
    "recording.py",
    "repairs.py",
    "report.py",
    "tasks.json",
    "tasks.py",
    "wander.py",
];

/// Writes the package to a folder that Python can import it from.
///
/// # Errors
/// [`SimulatorError`]
pub(super) fn unpack() -> Result<TempDir, SimulatorError> {
    let folder =
        TempDir::with_prefix("armor-plant-").map_err(SimulatorError::system("create", std::env::temp_dir()))?;
    let package = folder.path().join("armor_plant");
    fs::create_dir(&package).map_err(SimulatorError::system("create", &package))?;
    for (name, text) in FILES {
        let path = package.join(name);
        fs::write(&path, text).map_err(SimulatorError::system("write", &path))?;
    }
    Ok(folder)
}
