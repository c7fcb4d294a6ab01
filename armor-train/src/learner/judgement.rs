//! Judging all transitions by the frozen critics.

use super::Learner;
use crate::extraction::Extraction;
use crate::extraction::advantage::{Advantages, Judges};
use crate::extraction::cloning::Cloning;
use crate::extraction::risk;
use crate::nn::Scalar;
use crate::sampling::Rows;
use crate::source::Source;

impl<T: Scalar> Learner<'_, T> {
    /// Judges all transitions, where the actor clones by their advantages.
    pub(crate) fn judge_data(&self) -> Option<Cloning> {
        let value = self.model.state_value.as_ref().filter(|_| self.config.extraction == Extraction::Weighted)?;
        let parameters = &self.state.parameters;
        let judges = Judges {
            critic: (&self.model.critic, &parameters.target[..]),
            value: (value, &parameters.state_value[..]),
        };
        let source = Source::new(&self.config, self.data, &self.normaliser);
        let cloning = Cloning::new(&self.config, Advantages::new(&source, judges, self.config.traces()));
        let share = self.config.safest_share;
        if share == 1.0 {
            return Some(cloning);
        }
        Some(cloning.following(Rows::among(risk::safest(&source, judges.value, (share, self.config.limit)))))
    }
}
