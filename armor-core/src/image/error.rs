//! Why bytes are no policy image.

use core::fmt;

use super::SectionKind;

/// The first fault found in an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum ImageError {
    /// Fewer bytes than the header says.
    Truncated {
        /// Bytes that the image needs.
        expected: usize,
        /// Bytes that are there.
        actual: usize,
    },
    /// The first byte does not lie on a 16-byte boundary.
    Misaligned,
    /// The bytes do not start with `ARMR`.
    Magic,
    /// The format version is not the one this code reads.
    Version(u16),
    /// The header's own checksum or one of its lengths is wrong.
    Header,
    /// The checksum over manifest and sections is wrong.
    Checksum,
    /// The manifest cannot be decoded, or gives weights in single precision an order.
    Manifest,
    /// A dimension is zero or larger than the format allows.
    Shape,
    /// The denoising chains are missing, too long, not in the order of their length, or do not end at the action.
    Chain,
    /// The scale of the cost budget is not a finite positive number.
    KappaRange,
    /// The budget map has too few or too many knots, or they are not finite or not in order.
    BudgetMap,
    /// A section is missing, out of order, or its length does not fit the shape.
    Section(SectionKind),
    /// A section holds a NaN or an infinity.
    NotFinite(SectionKind),
    /// A section of an integer network holds a number with which a sum might overflow.
    OutOfRange(SectionKind),
    /// An action bound is reversed, or the fallback action lies outside the bounds.
    Bounds,
}

impl fmt::Display for ImageError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Truncated { expected, actual } => {
                write!(f, "image is cut short: {expected} bytes expected, {actual} found; copy or export it again")
            }
            Self::Misaligned => f.write_str("image does not start on a 16-byte boundary; align it in flash"),
            Self::Magic => f.write_str("not a policy image: it does not start with ARMR"),
            Self::Version(found) => write!(
                f,
                "image format version {found}, but this code reads version {}; export it again with a matching armor-train",
                super::VERSION
            ),
            Self::Header => f.write_str("image header is damaged; copy or export it again"),
            Self::Checksum => f.write_str("image is damaged: its checksum is wrong; copy or export it again"),
            Self::Manifest => f.write_str("image manifest cannot be decoded; export it again"),
            Self::Shape => f.write_str("image has a dimension of zero or beyond the format's limits"),
            Self::Chain => f.write_str("image has no valid denoising chain"),
            Self::KappaRange => f.write_str("image has no valid scale of the cost budget"),
            Self::BudgetMap => {
                f.write_str("image has no valid map from the cost budget; calibrate and export it again")
            }
            Self::Section(kind) => write!(f, "image section {kind:?} is missing, misplaced or of the wrong length"),
            Self::NotFinite(kind) => {
                write!(f, "image section {kind:?} holds a NaN or an infinity; the training diverged")
            }
            Self::OutOfRange(kind) => {
                write!(f, "image section {kind:?} holds a number out of its range; export it again")
            }
            Self::Bounds => f.write_str("image has reversed action bounds or a fallback action outside them"),
        }
    }
}

impl core::error::Error for ImageError {}
