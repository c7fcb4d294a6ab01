//! The loops in which the time goes, and the one numerical contract that they
//! all keep (`docs/numerics.md`): whatever the machine, the bits are equal.
//!
//! A kernel for another machine is another variant of [`Kernel`]: it takes
//! over those of the five operations that it does better and leaves the others
//! to the portable code, which says what their results must be.

#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx2;
#[cfg(all(feature = "std", target_arch = "x86_64"))]
mod avx512;
mod check;
mod columns;
#[cfg(all(feature = "dsp", target_arch = "arm"))]
mod cortex_m;
mod float;
mod integer;
#[cfg(test)]
mod tests;

#[cfg(all(feature = "cortex-m55", target_arch = "arm"))]
use armor_core::fixed::SHORT_BITS;
use armor_core::image::Layout;

use crate::denoiser::front;

/// The instructions that a policy's arithmetic runs on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kernel {
    /// What the compiler makes of plain loops.
    Portable,
    /// 256-bit vectors, on x86-64 with the feature `std`.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    Avx2(avx2::Avx2),
    /// 512-bit vectors, likewise, and VNNI where the processor has it.
    #[cfg(all(feature = "std", target_arch = "x86_64"))]
    Avx512(avx512::Avx512),
    /// 16-bit SIMD and the FPU of a Cortex-M4, M7, M33 or M55.
    #[cfg(all(feature = "dsp", target_arch = "arm"))]
    CortexM,
}

/// Outputs whose single-precision sums portable code keeps in registers: eight
/// SSE registers, as many as two additions a cycle of latency four keep busy.
#[cfg(not(target_arch = "arm"))]
const WIDE: usize = 32;
/// Half of the 32 single-precision registers of a Cortex-M FPU.
#[cfg(target_arch = "arm")]
const WIDE: usize = 16;

impl Kernel {
    /// The kernels that this machine can run, the fastest last.
    pub fn available() -> impl Iterator<Item = Self> {
        #[cfg(all(feature = "std", target_arch = "x86_64"))]
        let more = avx2::Avx2::detect().map(Self::Avx2).into_iter().chain(avx512::Avx512::detect().map(Self::Avx512));
        #[cfg(all(feature = "dsp", target_arch = "arm"))]
        let more = Some(Self::CortexM);
        #[cfg(not(any(all(feature = "std", target_arch = "x86_64"), all(feature = "dsp", target_arch = "arm"))))]
        let more = None;
        core::iter::once(Self::Portable).chain(more)
    }

    /// The fastest kernel of this machine.
    pub fn best() -> Self {
        Self::available().last().unwrap_or(Self::Portable)
    }

    /// The kernel's name in reports.
    pub const fn name(self) -> &'static str {
        match self {
            Self::Portable => "portable",
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(_) => "avx2",
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) => kernel.name(),
            #[cfg(all(feature = "dsp", target_arch = "arm"))]
            Self::CortexM => "cortex-m",
        }
    }

    /// For a matrix from `I` inputs to `O` outputs, stored input by input,
    ///
    /// ```text
    /// out[o] = ((out[o] + x[0] w[0][o]) + x[1] w[1][o]) + ... + x[I-1] w[I-1][o]
    /// ```
    ///
    /// in f32, each product and each sum rounded on its own (no fused
    /// multiply-add), the inputs in this order. How many outputs a machine
    /// works on at a time does not show in the bits, so a kernel is free in
    /// that alone. Where `weights` is too short, the inputs without weights are
    /// left out.
    pub(crate) fn accumulate(self, weights: &[f32], x: &[f32], out: &mut [f32]) {
        match self {
            Self::Portable => float::accumulate::<WIDE>(weights, x, out),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(kernel) => kernel.accumulate(weights, x, out),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) => kernel.accumulate(weights, x, out),
            #[cfg(all(feature = "dsp", target_arch = "arm", target_abi = "eabihf"))]
            Self::CortexM => cortex_m::accumulate(weights, x, out),
            #[cfg(all(feature = "dsp", target_arch = "arm", not(target_abi = "eabihf")))]
            Self::CortexM => float::accumulate::<WIDE>(weights, x, out),
        }
    }

    /// As [`Kernel::accumulate`] for `K` columns at once: an input has `K`
    /// values, and so has an output. Each column has the bits that it would
    /// have alone, but the weights are read once for all.
    pub(crate) fn accumulate_columns<const K: usize>(self, weights: &[f32], x: &[[f32; K]], out: &mut [[f32; K]]) {
        if K == 1 {
            return self.accumulate(weights, x.as_flattened(), out.as_flattened_mut());
        }
        match self {
            Self::Portable => columns::accumulate(weights, x, out),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(kernel) => kernel.accumulate_columns(weights, x, out),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) => kernel.accumulate_columns(weights, x, out),
            #[cfg(all(feature = "dsp", target_arch = "arm"))]
            Self::CortexM => columns::accumulate(weights, x, out),
        }
    }

    /// [`armor_core::mish::mish`] of each value, in place.
    pub(crate) fn mish(self, values: &mut [f32]) {
        match self {
            Self::Portable => float::mish(values),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(kernel) => kernel.mish(values),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) => kernel.mish(values),
            #[cfg(all(feature = "dsp", target_arch = "arm"))]
            Self::CortexM => float::mish(values),
        }
    }

    /// `sums[o]`: the sum of a row's `weights` times `codes`, for `O` rows of
    /// `I` weights in `layout`. At most [`fixed::MAX_TERMS`] codes, so that no sum
    /// overflows and their order does not matter; codes of 7 bits lie within 0
    /// and 127, those of 15 bits within -32767 and 32767. Rows without weights
    /// keep their sum.
    ///
    /// [`fixed::MAX_TERMS`]: armor_core::fixed::MAX_TERMS
    #[cfg_attr(
        not(any(all(feature = "std", target_arch = "x86_64"), all(feature = "dsp", target_arch = "arm"))),
        expect(unused_variables)
    )]
    pub(crate) fn sum_rows(self, layout: Layout, weights: &[i8], codes: &[i16], bits: u32, sums: &mut [i32]) {
        match self {
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(kernel) if layout == Layout::Rows => kernel.sum_rows(weights, codes, bits, sums),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) if layout == Layout::Rows => kernel.sum_rows(weights, codes, bits, sums),
            #[cfg(all(feature = "dsp", target_arch = "arm"))]
            Self::CortexM if layout == Layout::Paired => cortex_m::sum_pairs(weights, codes, bits, sums),
            #[cfg(all(feature = "cortex-m55", target_arch = "arm"))]
            Self::CortexM if bits == SHORT_BITS => cortex_m::sum_rows_short(weights, codes, sums),
            _ => match layout {
                Layout::Rows => integer::sum_rows(weights, codes, sums),
                Layout::Paired => integer::sum_pairs(weights, codes, sums),
            },
        }
    }

    /// As [`Kernel::sum_rows`] for `K` columns of `inputs` codes and of `outputs`
    /// sums, the weights read once for all.
    pub(crate) fn sum_rows_columns<const H: usize, const K: usize>(
        self,
        (layout, weights): (Layout, &[i8]),
        (codes, bits): (&[[i16; H]; K], u32),
        sums: &mut [[i32; H]; K],
        [inputs, outputs]: [usize; 2],
    ) {
        if K == 1 {
            let codes = codes.as_flattened().get(..inputs).unwrap_or_default();
            return self.sum_rows(layout, weights, codes, bits, front(sums.as_flattened_mut(), outputs));
        }
        columns::sum_rows(self, (layout, weights), (codes, bits), sums, [inputs, outputs]);
    }

    /// Sums over codes of `bits` become pre-activations
    /// ([`armor_core::fixed::rescale`]), in place.
    pub(crate) fn rescale(self, sums: &mut [i32], bits: u32, multiplier: &[i32], factor: i32, bias: &[i32]) {
        match self {
            Self::Portable => integer::rescale(sums, bits, multiplier, factor, bias),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(kernel) => kernel.rescale(sums, bits, multiplier, factor, bias),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) => kernel.rescale(sums, bits, multiplier, factor, bias),
            #[cfg(all(feature = "dsp", target_arch = "arm"))]
            Self::CortexM => cortex_m::rescale(sums, bits, multiplier, factor, bias),
        }
    }

    /// Pre-activations become codes ([`armor_core::fixed::activate`]).
    pub(crate) fn activate(self, pre: &[i32], factor: i32, bits: u32, codes: &mut [i16]) {
        match self {
            Self::Portable => integer::activate(pre, factor, bits, codes),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx2(kernel) => kernel.activate(pre, factor, bits, codes),
            #[cfg(all(feature = "std", target_arch = "x86_64"))]
            Self::Avx512(kernel) => kernel.activate(pre, factor, bits, codes),
            #[cfg(all(feature = "dsp", target_arch = "arm"))]
            Self::CortexM => cortex_m::activate(pre, factor, bits, codes),
        }
    }
}
