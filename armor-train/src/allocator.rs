//! The system's allocator, with large blocks at the start of a cache line.
//!
//! A vector register of AVX-512 is as wide as a line. glibc begins its blocks 16 bytes
//! into one, so that every load and store of a matrix meets two lines
//! (`docs/training-speed.md` has what that costs).
#![allow(unsafe_code)]

use std::alloc::{GlobalAlloc, Layout, System};
use std::ops::RangeInclusive;

/// Bytes of a cache line.
const LINE: usize = 64;
/// Bytes of the blocks that are aligned: parameters and the matrices of a share. Smaller ones
/// are not worth it; larger ones hold recorded data, and growing them shall stay cheap.
const SIZES: RangeInclusive<usize> = 4 << 10..=4 << 20;

/// An allocator for programs that train: `#[global_allocator]`.
#[derive(Clone, Copy, Debug)]
pub struct CacheLines;

/// What the system is asked for in place of `layout`; a function of it alone.
fn aligned(layout: Layout) -> Layout {
    if SIZES.contains(&layout.size()) { layout.align_to(LINE).unwrap_or(layout) } else { layout }
}

// SAFETY: every method hands its contract on to the system's allocator, with a layout that is
// at least as strict; a block is freed and grown with the layout that it was allocated with.
unsafe impl GlobalAlloc for CacheLines {
    unsafe fn alloc(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        unsafe { System.alloc(aligned(layout)) }
    }

    unsafe fn alloc_zeroed(&self, layout: Layout) -> *mut u8 {
        // SAFETY: as above.
        unsafe { System.alloc_zeroed(aligned(layout)) }
    }

    unsafe fn dealloc(&self, block: *mut u8, layout: Layout) {
        // SAFETY: as above.
        unsafe { System.dealloc(block, aligned(layout)) }
    }

    unsafe fn realloc(&self, block: *mut u8, layout: Layout, size: usize) -> *mut u8 {
        // SAFETY: the caller's promise about the new size is that of a layout.
        let new = unsafe { Layout::from_size_align_unchecked(size, layout.align()) };
        if aligned(layout).align() == aligned(new).align() {
            // SAFETY: as above. The system can grow a block where it lies.
            return unsafe { System.realloc(block, aligned(layout), size) };
        }
        // SAFETY: as above; both blocks have as many bytes as are copied.
        unsafe {
            let moved = self.alloc(new);
            if !moved.is_null() {
                moved.copy_from_nonoverlapping(block, size.min(layout.size()));
                self.dealloc(block, layout);
            }
            moved
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blocks_of_all_sizes_keep_their_bytes_and_the_large_ones_begin_a_line() {
        for size in [1, 100, 4095, 4096, 5000, 135_168, 4 << 20, (4 << 20) + 1] {
            for align in [1, 16, 128] {
                let layout = Layout::from_size_align(size, align).unwrap();
                // SAFETY: the block is used within its layout, and freed with the one that it has.
                unsafe {
                    let block = CacheLines.alloc_zeroed(layout);
                    let line = if SIZES.contains(&size) { LINE.max(align) } else { align };
                    assert!(!block.is_null() && block.addr().is_multiple_of(line));
                    assert_eq!((*block, *block.add(size - 1)), (0, 0));
                    block.write_bytes(7, size);
                    let larger = CacheLines.realloc(block, layout, 2 * size);
                    assert_eq!((*larger, *larger.add(size - 1)), (7, 7));
                    CacheLines.dealloc(larger, Layout::from_size_align(2 * size, align).unwrap());
                }
            }
        }
    }
}
