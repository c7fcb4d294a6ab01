//! Classes of instructions, by their mnemonic.

use serde::Serialize;

/// What an instruction does, as far as its time depends on it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Class {
    /// Loads one register, or two.
    Load,
    /// Loads several registers.
    LoadMultiple,
    /// Stores registers.
    Store,
    /// Jumps, calls and returns, taken or not.
    Branch,
    /// Multiplies integers, and may add the product to others.
    Multiply,
    /// Multiplies 16-bit halves of registers, and adds the products.
    SimdMac,
    /// Widens bytes or halves to larger numbers.
    Extend,
    /// Divides integers.
    Divide,
    /// Multiplies single-precision numbers.
    FloatMultiply,
    /// Multiplies and adds single-precision numbers.
    FloatMac,
    /// Divides single-precision numbers, or takes a root.
    FloatDivide,
    /// Other work in single precision: additions, comparisons, conversions, moves.
    Float,
    /// Arm's 128-bit vectors (MVE).
    Vector,
    /// Other work on integers.
    Integer,
}

/// Beginnings of mnemonics, with a space where that is all; the first that fits decides.
const BEGINNINGS: [(Class, &[&str]); 15] = [
    (Class::LoadMultiple, &["ldm", "vldm", "pop", "vpop"]),
    (Class::Load, &["ldr", "vldr", "lw", "lb", "lh", "flw", "lr."]),
    (Class::Store, &["st", "vst", "push", "vpush", "sw ", "sb ", "sh ", "fsw", "sc."]),
    (Class::SimdMac, &["smlad", "smlald", "smlsd", "smuad", "smusd"]),
    (Class::Multiply, &["smla", "smul", "smml", "smmul", "umull", "umlal", "umaal", "mul", "mla", "mls"]),
    (Class::Extend, &["sxt", "uxt", "sext", "zext"]),
    (Class::Divide, &["sdiv", "udiv", "div", "rem"]),
    (Class::FloatMac, &["vmla", "vmls", "vnml", "vfm", "vfnm", "fmadd", "fmsub", "fnm"]),
    (Class::FloatMultiply, &["vmul", "vnmul", "fmul"]),
    (Class::FloatDivide, &["vdiv", "vsqrt", "fdiv", "fsqrt"]),
    (Class::Integer, &["bic", "bf", "bkpt", "fence"]),
    (Class::Float, &["v", "f"]),
    (Class::Branch, &["b", "cb", "tb", "j", "ret", "mret", "le ", "wls", "dls"]),
    (Class::Vector, &["."]),
    (Class::Integer, &[""]),
];

impl Class {
    /// Every class.
    pub const ALL: [Self; 14] = [
        Self::Load,
        Self::LoadMultiple,
        Self::Store,
        Self::Branch,
        Self::Multiply,
        Self::SimdMac,
        Self::Extend,
        Self::Divide,
        Self::FloatMultiply,
        Self::FloatMac,
        Self::FloatDivide,
        Self::Float,
        Self::Vector,
        Self::Integer,
    ];

    /// The class of an instruction as QEMU's disassembler writes it. What it
    /// does not know are the vectors of a Cortex-M55; nothing else is left out.
    pub fn of(text: &str) -> Self {
        let mnemonic = format!("{} ", text.split_whitespace().next().unwrap_or("."));
        let fits = |beginnings: &[&str]| beginnings.iter().any(|beginning| mnemonic.starts_with(beginning));
        let rule = BEGINNINGS.iter().find(|(_, beginnings)| fits(beginnings));
        rule.map_or(Self::Integer, |(class, _)| *class)
    }

    /// Registers that an instruction of this class loads together, by its list in braces.
    pub fn loaded_registers(self, text: &str) -> u32 {
        let list = text.split_once('{').and_then(|(_, rest)| rest.split_once('}'));
        match (self, list) {
            (Self::LoadMultiple, Some((list, _))) => list.split(',').count() as u32,
            _ => 0,
        }
    }

    /// As tables name it.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Load => "load",
            Self::LoadMultiple => "load multiple",
            Self::Store => "store",
            Self::Branch => "branch",
            Self::Multiply => "multiply",
            Self::SimdMac => "SIMD MAC",
            Self::Extend => "extend",
            Self::Divide => "divide",
            Self::FloatMultiply => "float multiply",
            Self::FloatMac => "float MAC",
            Self::FloatDivide => "float divide",
            Self::Float => "float",
            Self::Vector => "vector",
            Self::Integer => "integer",
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_load_of_several_registers_names_them() {
        for (text, registers) in [
            ("ldm.w r0!, {r2, r3, r4, r5}", 4),
            ("vldmia r1!, {s24}", 1),
            ("pop {r4, pc}", 2),
            ("ldr r0, [r1]", 0),
            ("stm r0!, {r1, r2}", 0),
        ] {
            assert_eq!(Class::of(text).loaded_registers(text), registers, "{text}");
        }
    }

    #[test]
    fn a_mnemonic_is_of_its_class_on_arm_and_on_riscv() {
        for (text, class) in [
            ("vldr s20, [r0, #0x3c]", Class::Load),
            ("ldm.w r0!, {r2, r3, r4, r5}", Class::LoadMultiple),
            ("strd r0, r1, [sp]", Class::Store),
            ("sbcs.w r0, r1, r2", Class::Integer),
            ("sbfx r0, r1, #8, #8", Class::Integer),
            ("bic r0, r1, #1", Class::Integer),
            ("bne.w #0xae9e", Class::Branch),
            ("cbz r0, #4", Class::Branch),
            ("smlad r0, r1, r2, r3", Class::SimdMac),
            ("smlal r0, r1, r2, r3", Class::Multiply),
            ("sxtb16 r0, r1", Class::Extend),
            ("vmul.f32 s16, s16, s20", Class::FloatMultiply),
            ("vadd.f32 s0, s0, s18", Class::Float),
            ("vdiv.f32 s0, s1, s2", Class::FloatDivide),
            ("itttt ne", Class::Integer),
            ("", Class::Vector),
            ("lw              a0,0(a1)", Class::Load),
            ("sb              a0,0(a1)", Class::Store),
            ("sltu            a0,a1,a2", Class::Integer),
            ("jalr            ra,ra,0", Class::Branch),
            ("fmul.s          fa0,fa1,fa2", Class::FloatMultiply),
            ("mulhu           a0,a1,a2", Class::Multiply),
        ] {
            assert_eq!(Class::of(text), class, "{text}");
        }
    }
}
