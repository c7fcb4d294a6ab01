//! A built firmware: where its parts lie, and which function an address belongs to.

use std::fs;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::process::{Command, Stdio};

use object::{Object, ObjectSegment, ObjectSymbol, SymbolKind};

use super::error::McuError;
use super::machine::Machine;
use crate::file;

/// Where this source tree keeps the firmware's.
const SOURCE: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/mcu");
/// Where the firmware's script puts what it built.
const BUILT: &str = concat!(env!("CARGO_MANIFEST_DIR"), "/../target/mcu");

/// A built firmware.
#[derive(Debug)]
pub struct Firmware {
    /// Its file.
    pub path: PathBuf,
    /// Bytes of flash that it fills, without the policy.
    pub flash_bytes: u64,
    /// Bytes of RAM that hold its variables, without the stack.
    pub static_ram_bytes: u64,
    /// The addresses of the policy's slot.
    pub slot: Range<u64>,
    /// Its functions, by their first address.
    functions: Vec<Function>,
}

#[derive(Debug)]
struct Function {
    addresses: Range<u64>,
    name: String,
}

impl Firmware {
    /// The firmware of a machine, built anew where its source has changed.
    ///
    /// # Errors
    /// [`McuError`]
    pub fn build(machine: &Machine) -> Result<Self, McuError> {
        Self::build_named(machine, "")
    }

    /// As [`Self::build`], with the check of its kernels, which no flight needs.
    ///
    /// # Errors
    /// [`McuError`]
    pub fn build_with_check(machine: &Machine) -> Result<Self, McuError> {
        Self::build_named(machine, "-check")
    }

    fn build_named(machine: &Machine, suffix: &str) -> Result<Self, McuError> {
        let script = Path::new(SOURCE).join("build.sh");
        let output = Command::new(&script).arg(machine.name).stdin(Stdio::null()).output();
        let output = output.map_err(McuError::system("run", &script))?;
        if !output.status.success() {
            let said = String::from_utf8_lossy(&output.stderr);
            let last = said.lines().rfind(|line| line.contains("error")).or(said.lines().last()).unwrap_or_default();
            return Err(McuError::Build { said: last.trim_start_matches("error: ").into() });
        }
        Self::read(&Path::new(BUILT).join(format!("{}{suffix}.elf", machine.name)))
    }

    /// Reads a built firmware.
    ///
    /// # Errors
    /// [`McuError`]
    pub fn read(path: &Path) -> Result<Self, McuError> {
        let bytes = file::read(path)?;
        let no_firmware = |why: String| McuError::NoFirmware { path: path.into(), why };
        let elf = object::File::parse(bytes.as_slice()).map_err(|error| no_firmware(error.to_string()))?;
        let address = |name: &str| {
            let symbol = elf.symbols().find(|symbol| symbol.name() == Ok(name));
            symbol.map(|symbol| symbol.address()).ok_or_else(|| no_firmware(format!("it has no symbol {name}")))
        };
        let functions = elf.symbols().filter(|symbol| symbol.kind() == SymbolKind::Text && symbol.size() > 0);
        let mut functions: Vec<_> = functions
            .map(|symbol| {
                // The lowest bit of a Thumb function's address says that it is one.
                let start = symbol.address() & !1;
                let name = format!("{:#}", rustc_demangle::demangle(symbol.name().unwrap_or_default()));
                Function { addresses: start..start + symbol.size(), name }
            })
            .collect();
        functions.sort_by_key(|function| function.addresses.start);
        Ok(Self {
            path: fs::canonicalize(path).map_err(McuError::system("find", path))?,
            flash_bytes: elf.segments().map(|segment| segment.file_range().1).sum(),
            static_ram_bytes: address("__ebss")? - address("__sdata")?,
            slot: address("_policy_start")?..address("_policy_end")?,
            functions,
        })
    }

    /// The function of an address.
    pub fn function(&self, address: u64) -> Option<&str> {
        let after = self.functions.partition_point(|function| function.addresses.start <= address);
        let function = self.functions.get(after.checked_sub(1)?)?;
        function.addresses.contains(&address).then_some(function.name.as_str())
    }

    /// The functions that take part in a panic; none is to be there.
    pub fn panics(&self) -> impl Iterator<Item = &str> {
        let names = self.functions.iter().map(|function| function.name.as_str());
        names.filter(|name| {
            ["core::panicking", "rust_begin_unwind", "panic_handler"].iter().any(|part| name.contains(part))
        })
    }
}
