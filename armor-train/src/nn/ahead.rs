//! Memory that is needed soon, fetched while products keep the arithmetic busy.
//!
//! What a chain remembers for its gradient is several times what the second cache
//! holds. A product reads that memory in strides too long for the processor to
//! foresee, and waits; but it has loads to spare, a line for every few of its
//! multiply-adds, and those fetch what the next one will read.

use std::ops::Range;
use std::sync::atomic::{AtomicUsize, Ordering::Relaxed};

/// Bytes of a cache line.
const LINE: usize = 64;

/// Pieces of memory, in the order in which they will be needed. A hint: no result depends on it.
#[derive(Debug)]
pub struct Ahead {
    /// Addresses.
    pieces: Vec<Range<usize>>,
    /// Lines that are fetched already, counted through the pieces.
    fetched: AtomicUsize,
}

impl Ahead {
    /// No memory.
    pub fn nothing() -> &'static Self {
        static NOTHING: Ahead = Ahead { pieces: Vec::new(), fetched: AtomicUsize::new(0) };
        &NOTHING
    }

    /// The memory of `pieces`.
    pub fn new<'a, T: 'a>(pieces: impl IntoIterator<Item = &'a [T]>) -> Self {
        let addresses = |piece: &[T]| piece.as_ptr().addr()..piece.as_ptr_range().end.addr();
        Self { pieces: pieces.into_iter().map(addresses).collect(), fetched: AtomicUsize::new(0) }
    }

    /// Where the next `lines` lines of memory begin; they may reach beyond the piece that they begin in.
    pub(super) fn next(&self, lines: usize) -> Option<usize> {
        let mut at = self.fetched.load(Relaxed);
        for piece in &self.pieces {
            let len = piece.len().div_ceil(LINE);
            if at < len {
                self.fetched.fetch_add(lines.min(len - at), Relaxed);
                return Some(piece.start + at * LINE);
            }
            at -= len;
        }
        None
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_line_comes_once_and_in_order() {
        let (one, two) = ([0.0f32; 40], [0.0f32; 17]);
        let ahead = Ahead::new([&one[..], &two[..], &[]]);
        let [one, two] = [one.as_ptr().addr(), two.as_ptr().addr()];
        let places: Vec<_> = std::iter::from_fn(|| ahead.next(2)).collect();
        assert_eq!(places, [one, one + 2 * LINE, two]);
        assert_eq!(Ahead::nothing().next(1), None);
    }
}
