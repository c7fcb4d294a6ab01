//! What C hands over, checked as far as it can be.

use core::ffi::c_void;
use core::mem::MaybeUninit;

use super::{ARMOR_CONTROLLER_ALIGN, ARMOR_CONTROLLER_SIZE, ArmorStatus, Inner};

/// Whether a pointer may be followed.
fn check<T>(pointer: *const T, align: usize) -> Result<(), ArmorStatus> {
    if pointer.is_null() {
        return Err(ArmorStatus::NullPointer);
    }
    if !pointer.addr().is_multiple_of(align) {
        return Err(ArmorStatus::MisalignedPointer);
    }
    Ok(())
}

/// Room for a value.
///
/// # Safety
/// A pointer that passes the checks leads to room for a `T` of nobody else's.
pub(super) unsafe fn place<'a, T>(pointer: *mut T) -> Result<&'a mut MaybeUninit<T>, ArmorStatus> {
    check(pointer, align_of::<T>())?;
    // SAFETY: checked, and the caller's word.
    Ok(unsafe { &mut *pointer.cast() })
}

/// Room for a controller.
///
/// # Safety
/// As of [`place`], for `length` bytes.
pub(super) unsafe fn room<'a>(memory: *mut c_void, length: usize) -> Result<&'a mut MaybeUninit<Inner>, ArmorStatus> {
    check(memory, ARMOR_CONTROLLER_ALIGN)?;
    if length < ARMOR_CONTROLLER_SIZE {
        return Err(ArmorStatus::MemoryTooSmall);
    }
    // SAFETY: checked, and the caller's word.
    unsafe { place(memory.cast()) }
}

/// A value that is there.
///
/// # Safety
/// A pointer that passes the checks leads to a `T`.
pub(super) unsafe fn shared<'a, T>(pointer: *const T) -> Result<&'a T, ArmorStatus> {
    check(pointer, align_of::<T>())?;
    // SAFETY: checked, and the caller's word.
    Ok(unsafe { &*pointer })
}

/// As [`shared`], to change it.
///
/// # Safety
/// A pointer that passes the checks leads to a `T` that nobody else looks at.
pub(super) unsafe fn exclusive<'a, T>(pointer: *mut T) -> Result<&'a mut T, ArmorStatus> {
    check(pointer, align_of::<T>())?;
    // SAFETY: checked, and the caller's word.
    Ok(unsafe { &mut *pointer })
}

/// `length` values; no pointer is needed for none.
///
/// # Safety
/// A pointer that passes the checks leads to `length` values that stay as they are.
pub(super) unsafe fn slice<'a, T>(pointer: *const T, length: usize) -> Result<&'a [T], ArmorStatus> {
    if length == 0 {
        return Ok(&[]);
    }
    check(pointer, align_of::<T>())?;
    // No object is larger.
    let length = length.min(isize::MAX as usize / size_of::<T>().max(1));
    // SAFETY: checked, and the caller's word.
    Ok(unsafe { core::slice::from_raw_parts(pointer, length) })
}
