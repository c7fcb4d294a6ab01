//! A policy, read in place from its image.

use core::fmt;

use armor_core::image::{KappaRange, MAX_RUNGS, PolicyImage, Precision, Sections};
use armor_core::schedule::ChainStep;
use armor_core::shape::Shape;
use armor_core::units::{Cost, CostLimit};

use crate::kernel::Kernel;

/// A view of a policy's numbers in the bytes of its image.
///
/// Cheap to copy: it borrows the image's bytes and none of its manifest.
#[derive(Clone, Copy, Debug)]
pub struct Policy<'a> {
    pub(crate) shape: Shape,
    pub(crate) kappa: KappaRange,
    pub(crate) precision: Precision,
    pub(crate) sections: Sections<'a>,
    pub(crate) kernel: Kernel,
    /// The steps of each rung; empty where the image has no such rung.
    chains: [&'a [[u32; ChainStep::WORDS]]; MAX_RUNGS],
}

/// Why a policy cannot fly on this controller.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum LoadError {
    /// The policy's state vector is longer than `STATE`.
    StateCapacity {
        /// Entries of the policy's state vector.
        needed: usize,
        /// `STATE` of the controller.
        capacity: usize,
    },
    /// The policy's action vector is longer than `ACTION`.
    ActionCapacity {
        /// Entries of the policy's action vector.
        needed: usize,
        /// `ACTION` of the controller.
        capacity: usize,
    },
    /// A layer of the denoiser or of the kappa embedding is wider than `HIDDEN`.
    HiddenCapacity {
        /// Width of the policy's widest layer.
        needed: usize,
        /// `HIDDEN` of the controller.
        capacity: usize,
    },
    /// The cost limit lies above every budget that the policy was trained with.
    LimitAboveTrainedRange {
        /// The limit that was asked for.
        limit: Cost,
        /// The largest limit that the policy may be given.
        trained_max: Cost,
    },
    /// The firmware was built without the number format of the policy.
    Precision(Precision),
    /// The image has no critic to choose by.
    NoCritic,
}

impl fmt::Display for LoadError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::StateCapacity { needed, capacity } => write!(
                f,
                "the policy senses {needed} state entries, the controller holds {capacity}; build it with STATE >= {needed} or flash a policy for this robot"
            ),
            Self::ActionCapacity { needed, capacity } => write!(
                f,
                "the policy moves {needed} action entries, the controller holds {capacity}; build it with ACTION >= {needed} or flash a policy for this robot"
            ),
            Self::HiddenCapacity { needed, capacity } => write!(
                f,
                "the policy's widest layer has {needed} units, the controller holds {capacity}; build it with HIDDEN >= {needed} or train a narrower policy"
            ),
            Self::LimitAboveTrainedRange { limit, trained_max } => write!(
                f,
                "cost limit {limit} lies above what the policy was trained with; set a limit of at most {trained_max}"
            ),
            Self::Precision(precision) => write!(
                f,
                "the controller was built without {precision:?}; build armor-infer with the feature float or integer, or export the policy in another precision"
            ),
            Self::NoCritic => {
                f.write_str("the image has no critic to choose among candidates by; export it with --critic")
            }
        }
    }
}

impl core::error::Error for LoadError {}

impl<'a> Policy<'a> {
    /// The policy of an image, read in place.
    ///
    /// # Errors
    /// [`LoadError::Precision`]; the capacities are checked by the controller
    /// that the policy is given to.
    pub fn load(image: &PolicyImage<'a>) -> Result<Self, LoadError> {
        let manifest = image.manifest();
        let built = match manifest.precision {
            Precision::F32 => cfg!(feature = "float"),
            Precision::Int16x8 | Precision::Int8 => cfg!(feature = "integer"),
        };
        if !built {
            return Err(LoadError::Precision(manifest.precision));
        }
        Ok(Self {
            shape: manifest.shape,
            kappa: manifest.kappa,
            precision: manifest.precision,
            kernel: Kernel::best(),
            sections: *image.sections(),
            chains: core::array::from_fn(|rung| image.sections().chain_words(manifest, rung)),
        })
    }

    /// The same policy on another kernel, for comparison: the bits are equal.
    #[must_use]
    pub const fn with_kernel(self, kernel: Kernel) -> Self {
        Self { kernel, ..self }
    }

    /// The kernel that the policy runs on: at first [`Kernel::best`].
    pub const fn kernel(&self) -> Kernel {
        self.kernel
    }

    /// Dimensions of the policy network.
    pub const fn shape(&self) -> &Shape {
        &self.shape
    }

    /// The largest cost limit that the policy may be given.
    pub const fn trained_max(&self) -> Cost {
        self.kappa.trained_max
    }

    /// Calls of the denoiser that each rung takes, longest first.
    pub fn rungs(&self) -> impl Iterator<Item = usize> + use<'a> {
        self.chains.into_iter().map(<[_]>::len).filter(|&steps| steps > 0)
    }

    /// The longest rung of at most `steps` calls of the denoiser.
    pub fn rung_within(&self, steps: usize) -> Option<usize> {
        self.rungs().position(|length| length <= steps)
    }

    /// The steps of a rung; none if there is no such rung.
    pub(crate) fn chain(&self, rung: usize) -> impl ExactSizeIterator<Item = ChainStep> + use<'a> {
        let chain = self.chains.get(rung).copied().unwrap_or_default();
        chain.iter().map(|words| ChainStep::from_words(*words))
    }

    /// What the embedding is given at a remaining budget: the budget, or what the image maps it to.
    pub(crate) fn condition(&self, kappa: Cost) -> f32 {
        self.sections.budget_map.map_or(kappa.to_f32(), |map| map.condition(kappa))
    }

    /// Whether buffers of these capacities hold every vector of the network.
    pub(crate) fn check_capacities(&self, state: usize, action: usize, hidden: usize) -> Result<(), LoadError> {
        let shape = &self.shape;
        let widest = usize::from(shape.hidden.max(shape.kappa_hidden).max(shape.kappa_embedding));
        let (needed_state, needed_action) = (usize::from(shape.state), usize::from(shape.action));
        if needed_state > state {
            return Err(LoadError::StateCapacity { needed: needed_state, capacity: state });
        }
        if needed_action > action {
            return Err(LoadError::ActionCapacity { needed: needed_action, capacity: action });
        }
        if widest > hidden {
            return Err(LoadError::HiddenCapacity { needed: widest, capacity: hidden });
        }
        Ok(())
    }

    /// Whether the policy was trained with budgets as large as `limit`.
    pub(crate) fn check_limit(&self, limit: CostLimit) -> Result<(), LoadError> {
        let (limit, trained_max) = (limit.cost(), self.kappa.trained_max);
        if limit > trained_max {
            return Err(LoadError::LimitAboveTrainedRange { limit, trained_max });
        }
        Ok(())
    }
}
