//! How the networks see a state (O-5).

use crate::data::{Dataset, StateMoments};

/// The networks see `(s - mean) * factor`, entry by entry; stored in the policy image.
#[derive(Clone, Debug, PartialEq)]
pub struct Normaliser {
    /// Mean `[S]`.
    pub mean: Vec<f32>,
    /// Factor `[S]`.
    pub factor: Vec<f32>,
}

impl Normaliser {
    /// States of mean 0 and variance 1, or as recorded.
    pub fn new(data: &Dataset, normalize: bool) -> Self {
        if normalize {
            let moments = StateMoments::new(data);
            Self { factor: moments.std.iter().map(|std| 1.0 / std).collect(), mean: moments.mean }
        } else {
            Self { mean: vec![0.0; data.state_dim()], factor: vec![1.0; data.state_dim()] }
        }
    }

    /// The state as the networks see it; the controller computes the same bits.
    pub fn apply<'a>(&'a self, state: &'a [f32]) -> impl Iterator<Item = f32> + 'a {
        let moments = self.mean.iter().zip(&self.factor);
        state.iter().zip(moments).map(|(&state, (&mean, &factor))| (state - mean) * factor)
    }
}
