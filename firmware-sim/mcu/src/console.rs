//! What the firmware is told and what it tells: semihosting, the line between a
//! program and its debugger, or the emulator in its place.

use core::ffi::CStr;

use semihosting::sys::arm_compat::{CommandLine as Buffer, sys_write0};

/// The command line with which the emulator was started.
pub(crate) struct CommandLine([u8; Self::CAPACITY]);

impl CommandLine {
    const CAPACITY: usize = 64;

    /// Asks for it; an empty one, where there is none or it is too long.
    #[expect(deprecated, reason = "what replaces it may panic, as far as the compiler knows")]
    pub(crate) fn new() -> Self {
        use semihosting::sys::arm_compat::sys_get_cmdline;
        let mut bytes = [0; Self::CAPACITY];
        let mut buffer = Buffer { ptr: bytes.as_mut_ptr(), size: bytes.len() };
        // SAFETY: pointer and size are those of `bytes`.
        let asked = unsafe { sys_get_cmdline(&mut buffer) };
        if asked.is_ok() { Self(bytes) } else { Self([0; Self::CAPACITY]) }
    }

    /// Its words.
    pub(crate) fn words(&self) -> impl Iterator<Item = &[u8]> {
        self.0.split(|byte| matches!(byte, b' ' | 0)).filter(|word| !word.is_empty())
    }
}

/// The number of a word; none where it is none.
pub(crate) fn number(word: &[u8]) -> Option<u32> {
    word.iter().try_fold(0u32, |value, digit| {
        let digit = u32::from(digit.checked_sub(b'0')?);
        value.checked_mul(10)?.checked_add((digit < 10).then_some(digit)?)
    })
}

/// Tells a line of a word and a number. (`core::fmt` would bring panics.)
pub(crate) fn tell(word: &CStr, value: u32) {
    let mut digits = [0; 11];
    let mut rest = value;
    for (place, digit) in digits.iter_mut().rev().skip(1).enumerate() {
        if place == 0 || rest > 0 {
            *digit = b'0' + (rest % 10) as u8;
        }
        rest /= 10;
    }
    sys_write0(word);
    sys_write0(c" ");
    let written = digits.iter().position(|&digit| digit != 0).and_then(|first| digits.get(first..));
    if let Some(Ok(text)) = written.map(CStr::from_bytes_until_nul) {
        sys_write0(text);
    }
    sys_write0(c"\n");
}

/// Tells a line.
pub(crate) fn tell_words(words: &CStr) {
    sys_write0(words);
    sys_write0(c"\n");
}
