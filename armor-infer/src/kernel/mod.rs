//! Matrix-vector products, and the one numerical contract that they all keep.
//!
//! For a matrix from `I` inputs to `O` outputs, stored input by input,
//!
//! ```text
//! out[o] = ((start[o] + x[0] w[0][o]) + x[1] w[1][o]) + ... + x[I-1] w[I-1][o]
//! ```
//!
//! in f32, each product and each sum rounded on its own (no fused
//! multiply-add), the inputs in this order. How many outputs a machine works
//! on at a time does not show in the bits, so a kernel is free in that alone.

mod portable;

pub(crate) use portable::accumulate;
