//! The board's first UART, byte by byte and without waiting for ever: the line
//! of the link.

/// Arm's CMSDK APB UART of the MPS boards (Cortex-M System Design Kit TRM, 4.3).
#[cfg(feature = "cortex-m")]
mod registers {
    #[cfg(not(any(feature = "mps2-an505", feature = "mps3-an547")))]
    const BASE: usize = 0x4000_4000;
    /// By its secure address, as the core starts in the secure state.
    #[cfg(feature = "mps2-an505")]
    const BASE: usize = 0x5020_0000;
    #[cfg(feature = "mps3-an547")]
    const BASE: usize = 0x5930_3000;

    pub(super) const DATA: *mut u32 = BASE as _;
    const STATE: *const u32 = (BASE + 0x04) as _;
    const CONTROL: *mut u32 = (BASE + 0x08) as _;
    const BAUD_DIVISOR: *mut u32 = (BASE + 0x10) as _;

    const TRANSMIT_FULL: u32 = 1 << 0;
    const RECEIVE_FULL: u32 = 1 << 1;
    const ENABLE_BOTH: u32 = 0b11;
    /// The smallest that the UART works with.
    const FASTEST: u32 = 16;

    pub(super) fn enable() {
        // SAFETY: registers of the board, which no other code uses.
        unsafe {
            BAUD_DIVISOR.write_volatile(FASTEST);
            CONTROL.write_volatile(ENABLE_BOTH);
        }
    }

    pub(super) fn may_read() -> bool {
        // SAFETY: as above.
        unsafe { STATE.read_volatile() & RECEIVE_FULL != 0 }
    }

    pub(super) fn may_write() -> bool {
        // SAFETY: as above.
        unsafe { STATE.read_volatile() & TRANSMIT_FULL == 0 }
    }
}

/// The 16550 of QEMU's `virt`.
#[cfg(feature = "virt")]
mod registers {
    const BASE: usize = 0x1000_0000;

    pub(super) const DATA: *mut u8 = BASE as _;
    const LINE_STATUS: *const u8 = (BASE + 5) as _;

    const DATA_READY: u8 = 1 << 0;
    const TRANSMIT_EMPTY: u8 = 1 << 5;

    /// It works as it is after reset. Its FIFO would be emptied by turning it
    /// on, and QEMU would wait for ever for the byte that was in it to be read.
    pub(super) fn enable() {}

    pub(super) fn may_read() -> bool {
        // SAFETY: a register of the board, which no other code uses.
        unsafe { LINE_STATUS.read_volatile() & DATA_READY != 0 }
    }

    pub(super) fn may_write() -> bool {
        // SAFETY: as above.
        unsafe { LINE_STATUS.read_volatile() & TRANSMIT_EMPTY != 0 }
    }
}

/// The UART, enabled.
pub(crate) struct Uart(());

impl Uart {
    /// Looks at the line before it is idle: about a minute of an emulator's time.
    const PATIENCE: u32 = 1 << 28;

    pub(crate) fn new() -> Self {
        registers::enable();
        Self(())
    }

    /// The next byte; none if the line stays idle.
    pub(crate) fn read(&mut self) -> Option<u8> {
        // SAFETY: a register of the board, which `self` alone uses.
        wait(registers::may_read).then(|| unsafe { registers::DATA.read_volatile() } as u8)
    }

    /// Writes bytes; false if the line takes no more.
    pub(crate) fn write(&mut self, bytes: &[u8]) -> bool {
        bytes.iter().all(|&byte| {
            let ready = wait(registers::may_write);
            if ready {
                // SAFETY: as above.
                unsafe { registers::DATA.write_volatile(byte.into()) }
            }
            ready
        })
    }
}

fn wait(ready: fn() -> bool) -> bool {
    (0..Uart::PATIENCE).any(|_| ready())
}
