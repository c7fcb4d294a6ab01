//! Advantages by what the recording goes on with (generalised advantage
//! estimation, Schulman et al. 2016, along recorded trajectories).
//!
//! ```text
//! delta_t = signal_t + gamma V(s_{t+1}) - V(s_t)
//! A_t     = delta_t + gamma decay A_{t+1}            A = 0 behind a trajectory's end
//! ```
//!
//! At `decay` 0 an action is judged by what follows at once, as `Q - V` is; at 1
//! by all that the trajectory really brought. A recording of several drivers
//! tells them apart only the second way: one step of a careless driver costs
//! nothing yet, and a value of the next state is an average over all of them.

/// Discount and decay of a trace.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Trace {
    /// `gamma`.
    pub discount: f64,
    /// Weight of the recorded future against the values', within 0 and 1.
    pub decay: f64,
}

impl Trace {
    /// Makes advantages of the temporal differences of a whole trajectory, in column `task`.
    pub(crate) fn extend(&self, trajectory: &mut [[f64; 2]], task: usize) {
        let mut ahead = 0.0;
        for pair in trajectory.iter_mut().rev() {
            pair[task] += self.discount * self.decay * ahead;
            ahead = pair[task];
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const SIGNAL: [f64; 3] = [1.0, 2.0, 4.0];
    /// Of the four states, the last of which ends the trajectory.
    const VALUE: [f64; 4] = [3.0, 5.0, 2.0, 7.0];

    fn advantages(decay: f64) -> [f64; 3] {
        let mut found = [0, 1, 2].map(|row| [9.0, SIGNAL[row] + 0.5 * VALUE[row + 1] - VALUE[row]]);
        Trace { discount: 0.5, decay }.extend(&mut found, 1);
        assert!(found.iter().all(|pair| pair[0] == 9.0));
        found.map(|pair| pair[1])
    }

    #[test]
    fn without_a_trace_an_advantage_is_the_temporal_difference() {
        assert_eq!(advantages(0.0), [0.5, -2.0, 5.5]);
    }

    /// 1 + 2/2 + 4/4 + 7/8 - 3, and so on.
    #[test]
    fn with_a_whole_trace_it_is_the_recorded_return_above_the_value() {
        assert_eq!(advantages(1.0), [0.875, 0.75, 5.5]);
    }

    #[test]
    fn between_it_decays() {
        assert_eq!(advantages(0.5), [0.5 - 2.0 * 0.25 + 5.5 * 0.0625, -2.0 + 5.5 * 0.25, 5.5]);
    }
}
