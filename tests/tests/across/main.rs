//! What only holds across crates.
//!
//! | module | proves |
//! |---|---|
//! | [`whole_line`] | what flies is what was trained, from the recording to the plant |
//! | [`image_faults`] | a damaged or foreign image is named and never flown |
//! | [`chip_faults`] | a damaged chip boots what was flashed to it, or nothing |
//! | [`integers`] | a policy in integers is the one in single precision, to what 8 bits can say |
//! | [`candidates`] | the critic in an image is the trained one, and the best of several actions is chosen by it |
//! | [`embedding`] | in C and in other loops the controller computes the same bits |
//! | [`mcu`] | on emulated microcontrollers, too |
//! | [`determinism`] | the same seed gives the same bits, on any number of threads and across any stop |
//! | [`conformance`] | the method's invariants on recorded data, and where each of the others is tested |
//!
//! Networks here are tiny and runs short: nothing in these modules says how
//! good a policy is, only that it is the one that was trained.

mod candidates;
mod chip_faults;
mod conformance;
mod determinism;
mod embedding;
mod fixture;
mod image_faults;
mod integers;
mod mcu;
mod whole_line;
