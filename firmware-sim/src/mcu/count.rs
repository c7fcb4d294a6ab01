//! Instructions, counted: how often the emulator executed each, joined with what it is.

use std::collections::BTreeMap;
use std::fs;
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

use super::class::Class;
use super::emulator::Flashed;
use super::error::McuError;
use super::firmware::Firmware;

/// The plugin of the emulator that counts.
const PLUGIN: &str = include_str!("../../mcu/plugin/count.c");

/// Instructions that an action took.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Instructions {
    /// In all, the mean of several actions.
    pub total: f64,
    /// By class.
    pub classes: BTreeMap<Class, f64>,
    /// Registers that loads of several registers loaded.
    pub loaded_registers: f64,
    /// By function, the most first.
    pub functions: Vec<(String, f64)>,
    /// A number that all bits of the actions enter.
    pub checksum: u32,
    /// The stack's high-water mark.
    pub stack_bytes: u32,
}

/// An instruction and how often it was executed.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Executed {
    executions: u64,
    class: Class,
    /// Registers that it loads, if it loads several.
    loaded_registers: u32,
}

type Counts = BTreeMap<u64, Executed>;

/// Counts what `actions` actions take, each of at most `steps` calls of the
/// denoiser: what the firmware executes for them and one more, less what it
/// executes for that one alone.
///
/// # Errors
/// [`McuError`]
pub fn count(
    flashed: &Flashed<'_>,
    firmware: &Firmware,
    steps: u32,
    actions: u32,
    patience: Duration,
) -> Result<Instructions, McuError> {
    let plugin = flashed.file("count.so");
    compile(&flashed.file("count.c"), &plugin)?;
    let run = |actions: u32| {
        let out = flashed.file("counts");
        let arguments = ["-plugin".into(), format!("{},out={}", plugin.display(), out.display())];
        let told = flashed.start(&format!("bench {steps} {actions}"), &arguments)?.wait(patience)?;
        let text = fs::read_to_string(&out).map_err(McuError::system("read", &out))?;
        Ok::<_, McuError>((parse(&text)?, told))
    };
    let (without, _) = run(1)?;
    let (with, told) = run(1 + actions)?;
    let before = |address| without.get(address).map_or(0, |it: &Executed| it.executions);

    let [checksum, stack_bytes] = ["checksum", "stack_bytes"].map(|word| told.number(word).unwrap_or_default());
    let mut instructions = Instructions { checksum, stack_bytes, ..Instructions::default() };
    let mut functions = BTreeMap::<&str, f64>::new();
    for (address, executed) in &with {
        let mean = executed.executions.saturating_sub(before(address)) as f64 / f64::from(actions);
        instructions.total += mean;
        *instructions.classes.entry(executed.class).or_default() += mean;
        instructions.loaded_registers += mean * f64::from(executed.loaded_registers);
        *functions.entry(firmware.function(*address).unwrap_or("start-up")).or_default() += mean;
    }
    instructions.classes.retain(|_, count| *count > 0.0);
    let functions = functions.into_iter().filter(|(_, count)| *count > 0.0);
    instructions.functions = functions.map(|(name, count)| (name.into(), count)).collect();
    instructions.functions.sort_by(|a, b| b.1.total_cmp(&a.1));
    Ok(instructions)
}

fn compile(source: &Path, plugin: &Path) -> Result<(), McuError> {
    fs::write(source, PLUGIN).map_err(McuError::system("write", source))?;
    let mut compiler = Command::new("cc");
    compiler.args(["-O2", "-shared", "-fPIC", "-o"]).arg(plugin).arg(source).stdin(Stdio::null());
    let output = compiler.output().map_err(|_| McuError::Missing { tool: "cc", package: "gcc libc6-dev" })?;
    if output.status.success() {
        return Ok(());
    }
    Err(McuError::Count { what: String::from_utf8_lossy(&output.stderr).into() })
}

/// The plugin's lines: address, executions, size, disassembly.
fn parse(text: &str) -> Result<Counts, McuError> {
    let line = |line: &str| {
        let mut parts = line.splitn(4, ' ');
        let mut number = || parts.next()?.parse::<u64>().ok();
        let (address, executions, _size) = (number()?, number()?, number()?);
        let text = parts.next().unwrap_or_default();
        let class = Class::of(text);
        Some((address, Executed { executions, class, loaded_registers: class.loaded_registers(text) }))
    };
    let bad = |bad: &str| McuError::Count { what: format!("no count: {bad}") };
    text.lines().map(|text| line(text).ok_or_else(|| bad(text))).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_count_is_read_and_what_is_none_is_named() {
        let counts = parse("45028 125190 4 bne.w #0xae9e\n44988 7 4 vadd.f32 s2, s2, s18\n12 1 2 ").unwrap();
        let expected = [(12, 1, Class::Vector), (44988, 7, Class::Float), (45028, 125_190, Class::Branch)];
        assert!(counts.iter().map(|(&at, it)| (at, it.executions, it.class)).eq(expected));
        assert!(parse("45028 many 4 bne.w").unwrap_err().to_string().contains("45028 many"));
    }
}
