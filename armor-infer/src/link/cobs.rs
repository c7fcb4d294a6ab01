//! Consistent overhead byte stuffing (Cheshire and Baker, 1999), without a
//! panic: the bytes of a frame hold no zero.
//!
//! Each run of bytes without a zero goes behind its *code*, one more than its
//! length; the zero after it is left out. A code of 255 stands before a run of
//! 254 bytes that no zero follows.

/// The code of the longest run.
const LONGEST: usize = 255;

/// Stuffs bytes, one after the other, into a buffer.
pub(super) struct Stuffed<'b> {
    buffer: &'b mut [u8],
    /// Bytes written, codes among them.
    length: usize,
    /// Where the code of the present run goes.
    code: usize,
}

/// The buffer is full.
pub(super) struct Full;

impl<'b> Stuffed<'b> {
    pub(super) fn new(buffer: &'b mut [u8]) -> Self {
        // The first code's place.
        Self { buffer, length: 1, code: 0 }
    }

    pub(super) fn push(&mut self, byte: u8) -> Result<(), Full> {
        if byte != 0 {
            self.put(self.length, byte)?;
            self.length += 1;
        }
        if byte == 0 || self.length - self.code == LONGEST {
            self.end_run()?;
            self.code = self.length;
            self.length += 1;
        }
        Ok(())
    }

    /// Ends the frame with `end`; returns its bytes.
    pub(super) fn finish(mut self, end: u8) -> Result<&'b mut [u8], Full> {
        self.end_run()?;
        self.put(self.length, end)?;
        self.buffer.get_mut(..=self.length).ok_or(Full)
    }

    fn end_run(&mut self) -> Result<(), Full> {
        self.put(self.code, (self.length - self.code) as u8)
    }

    fn put(&mut self, at: usize, byte: u8) -> Result<(), Full> {
        *self.buffer.get_mut(at).ok_or(Full)? = byte;
        Ok(())
    }
}

/// Takes the stuffing out, in place; returns the number of bytes that remain at
/// the front, or none where this was no stuffing. A zero ends the frame.
pub(super) fn unstuff(frame: &mut [u8]) -> Option<usize> {
    let end = frame.iter().position(|&byte| byte == 0).unwrap_or(frame.len());
    let (mut from, mut to) = (0, 0);
    while from < end {
        let code = usize::from(*frame.get(from)?);
        let run = from + 1..from + code;
        if run.end > end {
            return None;
        }
        for at in run.clone() {
            *frame.get_mut(to)? = *frame.get(at)?;
            to += 1;
        }
        from = run.end;
        if code != LONGEST && from < end {
            *frame.get_mut(to)? = 0;
            to += 1;
        }
    }
    (!frame.is_empty()).then_some(to)
}
