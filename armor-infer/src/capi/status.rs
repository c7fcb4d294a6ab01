//! What became of a call.

use core::ffi::{CStr, c_char};

use armor_core::image::ImageError;
use armor_core::units::LimitError;

use crate::golden::GoldenError;
use crate::{Fault, LoadError};

/// What became of a call. A number keeps its meaning; new ones are added.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(i32)]
pub enum ArmorStatus {
    /// It did what it says.
    Ok = 0,

    /// A pointer is null.
    NullPointer = 1,
    /// A pointer does not lie on the boundary that its type asks for.
    MisalignedPointer = 2,
    /// The memory is shorter than ARMOR_CONTROLLER_SIZE.
    MemoryTooSmall = 3,
    /// The cost limit is negative, NaN, infinite, or 65536 and more.
    InvalidLimit = 4,

    /// There are fewer bytes than the image's header says.
    ImageTruncated = 10,
    /// The image does not start on a boundary of ARMOR_IMAGE_ALIGN bytes.
    ImageMisaligned = 11,
    /// The bytes are no policy image.
    ImageMagic = 12,
    /// The image has another format version.
    ImageVersion = 13,
    /// The image's header is damaged.
    ImageHeader = 14,
    /// The image is damaged.
    ImageChecksum = 15,
    /// The image's manifest cannot be decoded.
    ImageManifest = 16,
    /// A dimension is zero or beyond the format's limits.
    ImageShape = 17,
    /// The image has no valid denoising chain.
    ImageChain = 18,
    /// The image has no valid scale of the cost budget.
    ImageKappaRange = 19,
    /// The image has no valid map from the cost budget.
    ImageBudgetMap = 20,
    /// A section of the image is missing, misplaced or of the wrong length.
    ImageSection = 21,
    /// A section of the image holds a NaN or an infinity.
    ImageNotFinite = 22,
    /// A section of the image holds a number out of its range.
    ImageOutOfRange = 23,
    /// The image has reversed action bounds or a fallback action outside them.
    ImageBounds = 24,

    /// The policy has more than ARMOR_STATE_MAX state entries.
    LoadStateCapacity = 40,
    /// The policy has more than ARMOR_ACTION_MAX action entries.
    LoadActionCapacity = 41,
    /// The policy has a layer of more than ARMOR_HIDDEN_MAX units.
    LoadHiddenCapacity = 42,
    /// The cost limit lies above every budget that the policy was trained with.
    LoadLimitAboveTrainedRange = 43,
    /// The library was built without the number format of the policy.
    LoadPrecision = 44,
    /// The image has no critic to choose among candidates by.
    LoadNoCritic = 45,

    /// The image has no golden trace.
    GoldenEmpty = 60,
    /// This machine's budget is not that of the golden trace.
    GoldenKappa = 61,
    /// This machine's action is not that of the golden trace.
    GoldenAction = 62,

    /// The state has not the policy's length; the action is the fallback.
    StepStateLength = 80,
    /// The state holds a NaN or an infinity; the action is the fallback.
    StepStateNotFinite = 81,
    /// The incurred cost was negative, NaN or infinite; the whole budget was
    /// charged, and the action is the policy's at kappa 0.
    StepInvalidCost = 82,
    /// Every chain takes more steps than the call allowed; the action is the fallback.
    StepNoRung = 83,
    /// The network met or answered a NaN or an infinity; the action is the fallback.
    StepActionNotFinite = 84,
}

impl ArmorStatus {
    /// Every status.
    pub(super) const ALL: [Self; 34] = [
        Self::Ok,
        Self::NullPointer,
        Self::MisalignedPointer,
        Self::MemoryTooSmall,
        Self::InvalidLimit,
        Self::ImageTruncated,
        Self::ImageMisaligned,
        Self::ImageMagic,
        Self::ImageVersion,
        Self::ImageHeader,
        Self::ImageChecksum,
        Self::ImageManifest,
        Self::ImageShape,
        Self::ImageChain,
        Self::ImageKappaRange,
        Self::ImageBudgetMap,
        Self::ImageSection,
        Self::ImageNotFinite,
        Self::ImageOutOfRange,
        Self::ImageBounds,
        Self::LoadStateCapacity,
        Self::LoadActionCapacity,
        Self::LoadHiddenCapacity,
        Self::LoadLimitAboveTrainedRange,
        Self::LoadPrecision,
        Self::LoadNoCritic,
        Self::GoldenEmpty,
        Self::GoldenKappa,
        Self::GoldenAction,
        Self::StepStateLength,
        Self::StepStateNotFinite,
        Self::StepInvalidCost,
        Self::StepNoRung,
        Self::StepActionNotFinite,
    ];

    /// The status of a call that stops at its first fault.
    pub(super) fn of(call: impl FnOnce() -> Result<(), Self>) -> Self {
        call().err().unwrap_or(Self::Ok)
    }

    /// What it means, and what to do about it.
    const fn text(self) -> &'static CStr {
        match self {
            Self::Ok => c"ok",
            Self::NullPointer => c"a pointer is null; was a controller made, and did that succeed?",
            Self::MisalignedPointer => c"a pointer is misaligned; align memory to ARMOR_CONTROLLER_ALIGN",
            Self::MemoryTooSmall => c"the memory is too small; give ARMOR_CONTROLLER_SIZE bytes",
            Self::InvalidLimit => c"a cost limit is a finite number from 0 to below 65536",
            Self::ImageTruncated => c"the image is cut short; copy or export it again",
            Self::ImageMisaligned => c"the image is misaligned; align it to ARMOR_IMAGE_ALIGN",
            Self::ImageMagic => c"not a policy image: it does not start with ARMR",
            Self::ImageVersion => c"the image has another format version; export it with a matching armor-train",
            Self::ImageHeader => c"the image's header is damaged; copy or export it again",
            Self::ImageChecksum => c"the image is damaged; copy or export it again",
            Self::ImageManifest => c"the image's manifest cannot be decoded; export it again",
            Self::ImageShape => c"the image has a dimension of zero or beyond the format's limits",
            Self::ImageChain => c"the image has no valid denoising chain",
            Self::ImageKappaRange => c"the image has no valid scale of the cost budget",
            Self::ImageBudgetMap => c"the image has no valid map from the cost budget; calibrate and export it again",
            Self::ImageSection => c"a section of the image is missing, misplaced or of the wrong length",
            Self::ImageNotFinite => c"the image holds a NaN or an infinity; the training diverged",
            Self::ImageOutOfRange => c"the image holds a number out of its range; export it again",
            Self::ImageBounds => c"the image has reversed action bounds or a fallback action outside them",
            Self::LoadStateCapacity => c"the policy has more than ARMOR_STATE_MAX state entries",
            Self::LoadActionCapacity => c"the policy has more than ARMOR_ACTION_MAX action entries",
            Self::LoadHiddenCapacity => c"the policy has a layer wider than ARMOR_HIDDEN_MAX; train a narrower one",
            Self::LoadLimitAboveTrainedRange => {
                c"the cost limit lies above what the policy was trained with; see cost_limit_max"
            }
            Self::LoadPrecision => c"the library lacks the policy's number format; build it with float and integer",
            Self::LoadNoCritic => c"the image has no critic to choose among candidates by; export it with --critic",
            Self::GoldenEmpty => c"the image has no golden trace; export it again",
            Self::GoldenKappa => {
                c"the budget differs from the golden trace; image and library do not match, do not fly"
            }
            Self::GoldenAction => {
                c"an action differs from the golden trace; image and library do not match, do not fly"
            }
            Self::StepStateLength => c"the state has the wrong length; the fallback action was taken",
            Self::StepStateNotFinite => c"the state is not finite; the fallback action was taken, check the sensors",
            Self::StepInvalidCost => {
                c"the incurred cost is no cost; the whole budget was charged, check the cost monitor"
            }
            Self::StepNoRung => c"no chain is as short as allowed; the fallback action was taken",
            Self::StepActionNotFinite => {
                c"the network's answer is not finite; the fallback action was taken, check the state's range"
            }
        }
    }
}

/// What a status (`ArmorStatus`) means, and what to do about it: one line of
/// ASCII that lives as long as the program.
#[unsafe(no_mangle)]
pub extern "C" fn armor_status_text(status: i32) -> *const c_char {
    // C may pass any number.
    let known = ArmorStatus::ALL.into_iter().find(|&known| known as i32 == status);
    known.map_or(c"no status of this library", ArmorStatus::text).as_ptr()
}

impl From<LimitError> for ArmorStatus {
    fn from(LimitError: LimitError) -> Self {
        Self::InvalidLimit
    }
}

impl From<ImageError> for ArmorStatus {
    fn from(error: ImageError) -> Self {
        match error {
            ImageError::Truncated { .. } => Self::ImageTruncated,
            ImageError::Misaligned => Self::ImageMisaligned,
            ImageError::Magic => Self::ImageMagic,
            ImageError::Version(_) => Self::ImageVersion,
            ImageError::Header => Self::ImageHeader,
            ImageError::Checksum => Self::ImageChecksum,
            ImageError::Manifest => Self::ImageManifest,
            ImageError::Shape => Self::ImageShape,
            ImageError::Chain => Self::ImageChain,
            ImageError::KappaRange => Self::ImageKappaRange,
            ImageError::BudgetMap => Self::ImageBudgetMap,
            ImageError::Section(_) => Self::ImageSection,
            ImageError::NotFinite(_) => Self::ImageNotFinite,
            ImageError::OutOfRange(_) => Self::ImageOutOfRange,
            ImageError::Bounds => Self::ImageBounds,
        }
    }
}

impl From<LoadError> for ArmorStatus {
    fn from(error: LoadError) -> Self {
        match error {
            LoadError::StateCapacity { .. } => Self::LoadStateCapacity,
            LoadError::ActionCapacity { .. } => Self::LoadActionCapacity,
            LoadError::HiddenCapacity { .. } => Self::LoadHiddenCapacity,
            LoadError::LimitAboveTrainedRange { .. } => Self::LoadLimitAboveTrainedRange,
            LoadError::Precision(_) => Self::LoadPrecision,
            LoadError::NoCritic => Self::LoadNoCritic,
        }
    }
}

impl From<GoldenError> for ArmorStatus {
    fn from(error: GoldenError) -> Self {
        match error {
            GoldenError::Load(error) => error.into(),
            GoldenError::Empty => Self::GoldenEmpty,
            GoldenError::Kappa { .. } => Self::GoldenKappa,
            GoldenError::Action { .. } => Self::GoldenAction,
        }
    }
}

impl From<Fault> for ArmorStatus {
    fn from(fault: Fault) -> Self {
        match fault {
            Fault::StateLength => Self::StepStateLength,
            Fault::StateNotFinite => Self::StepStateNotFinite,
            Fault::InvalidCost => Self::StepInvalidCost,
            Fault::NoRung => Self::StepNoRung,
            Fault::ActionNotFinite => Self::StepActionNotFinite,
        }
    }
}
