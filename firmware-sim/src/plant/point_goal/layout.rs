//! Where things are at the start: placement by rejection, as Safety-Gymnasium
//! does it (`utils/random_generator.py`, `sample_layout`).
//!
//! Robot, goal, hazards and vase are placed in this order, each uniformly in
//! the square less its keep-out, and no nearer to an earlier one than both
//! keep-outs together. Where 100 draws of one fail, all start anew.

use std::f64::consts::TAU;

use super::{Noise, Vector2, uniform};

/// Hazards of level 1.
pub(super) const HAZARDS: usize = 8;
/// The square reaches this far from the origin, in m (`placements_conf.extents`).
pub(super) const EXTENT: f64 = 1.5;
/// Keep-out of the robot in m.
pub(super) const ROBOT_KEEPOUT: f64 = 0.4;
/// Keep-out of the goal in m.
pub(super) const GOAL_KEEPOUT: f64 = 0.305;
/// Keep-out of a hazard in m.
pub(super) const HAZARD_KEEPOUT: f64 = 0.18;
/// Keep-out of the vase in m.
pub(super) const VASE_KEEPOUT: f64 = 0.15;
/// Draws of a place before the whole layout starts anew.
const DRAWS: usize = 100;

/// Where things are at the start, in m, and the robot's heading in rad.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Layout {
    pub(super) robot: Vector2<f64>,
    pub(super) heading: f64,
    pub(super) goal: Vector2<f64>,
    pub(super) hazards: [Vector2<f64>; HAZARDS],
    pub(super) vase: Vector2<f64>,
}

/// The draws of an episode, one after the other.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Draws {
    noise: Noise,
    next: u32,
}

/// Places that are taken, and their keep-outs.
pub(super) struct Taken(Vec<(Vector2<f64>, f64)>);

impl Draws {
    /// The draws of an episode's seed.
    pub(super) const fn new(seed: u64) -> Self {
        Self { noise: Noise::new(seed), next: 0 }
    }

    /// Two draws in `[0, 1)`.
    fn pair(&mut self) -> [f64; 2] {
        let [a, b, ..] = self.noise.words(0, 0, self.next);
        self.next = self.next.wrapping_add(1);
        [a, b].map(|word| f64::from(uniform(word)))
    }

    /// A place in the square, `keepout` from its border.
    pub(super) fn place(&mut self, keepout: f64) -> Vector2<f64> {
        Vector2::from(self.pair().map(|draw| (EXTENT - keepout) * (2.0 * draw - 1.0)))
    }
}

impl Taken {
    /// What stands in the way of a new goal.
    pub(super) fn new(robot: Vector2<f64>, hazards: &[Vector2<f64>], vase: Vector2<f64>) -> Self {
        let hazards = hazards.iter().map(|&hazard| (hazard, HAZARD_KEEPOUT));
        Self([(robot, ROBOT_KEEPOUT), (vase, VASE_KEEPOUT)].into_iter().chain(hazards).collect())
    }

    /// Whether something may be put there.
    pub(super) fn leaves(&self, place: Vector2<f64>, keepout: f64) -> bool {
        self.0.iter().all(|(other, other_keepout)| (place - other).norm() >= other_keepout + keepout)
    }

    /// Puts something where there is room, and takes that.
    fn put(&mut self, draws: &mut Draws, keepout: f64) -> Option<Vector2<f64>> {
        let place = (0..DRAWS).map(|_| draws.place(keepout)).find(|place| self.leaves(*place, keepout))?;
        self.0.push((place, keepout));
        Some(place)
    }
}

impl Layout {
    /// The layout of an episode. About one try in two succeeds.
    pub(super) fn draw(draws: &mut Draws) -> Self {
        loop {
            if let Some(layout) = Self::try_draw(draws) {
                return layout;
            }
        }
    }

    fn try_draw(draws: &mut Draws) -> Option<Self> {
        let mut taken = Taken(Vec::new());
        let robot = taken.put(draws, ROBOT_KEEPOUT)?;
        let goal = taken.put(draws, GOAL_KEEPOUT)?;
        let mut hazards = [Vector2::zeros(); HAZARDS];
        for hazard in &mut hazards {
            *hazard = taken.put(draws, HAZARD_KEEPOUT)?;
        }
        let vase = taken.put(draws, VASE_KEEPOUT)?;
        let [heading, _] = draws.pair();
        Some(Self { robot, heading: TAU * heading, goal, hazards, vase })
    }
}
