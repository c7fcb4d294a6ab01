//! Room for calculations, handed from one share of a batch to the next.
//!
//! What an update remembers for its gradient, above all three hidden layers of every
//! step of a chain, is most of the memory of training. As many rooms as there are
//! threads serve all shares.

use std::sync::{Mutex, PoisonError};

/// Rooms that no share uses, with their numbers of samples. Whoever borrows a room
/// writes all that it reads there, so it does not matter whose it was.
#[derive(Debug)]
pub struct Pool<R>(Mutex<Vec<(usize, R)>>);

impl<R> Pool<R> {
    /// Room for `samples` samples: one that was given back, or else a new one.
    pub fn lend(&self, samples: usize, new: impl FnOnce() -> R) -> R {
        let mut idle = self.0.lock().unwrap_or_else(PoisonError::into_inner);
        let fitting = idle.iter().position(|(room, _)| *room == samples);
        let room = fitting.map(|index| idle.swap_remove(index).1);
        drop(idle);
        room.unwrap_or_else(new)
    }

    /// Takes a room for `samples` samples back.
    pub fn give_back(&self, samples: usize, room: R) {
        self.0.lock().unwrap_or_else(PoisonError::into_inner).push((samples, room));
    }
}

impl<R> Default for Pool<R> {
    fn default() -> Self {
        Self(Mutex::new(Vec::new()))
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_room_is_lent_again_to_a_share_of_its_size() {
        let pool = Pool::default();
        let [small, large] = [2, 3].map(|samples| (samples, pool.lend(samples, || vec![0; samples])));
        for (samples, mut room) in [small, large] {
            room[0] = samples;
            pool.give_back(samples, room);
        }
        assert_eq!(pool.lend(3, Vec::new), [3, 0, 0]);
        assert!(pool.lend(3, Vec::new).is_empty());
        assert_eq!(pool.lend(2, Vec::new), [2, 0]);
    }
}
