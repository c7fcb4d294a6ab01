//! The pseudo-lidar of Safety-Gymnasium (`bases/base_task.py`, `_obs_lidar_pseudo`).
//!
//! Sixteen bins around the robot, the first one from its nose to the left. An
//! object at a distance reads `max(0, 1 - distance / range)` in the bin that it
//! lies in, and as a share of that in the two bins beside: the more, the nearer
//! it is to them. The nearest object counts.

use std::f64::consts::TAU;

use nalgebra::Vector2;

/// Bins of a lidar.
pub(super) const BINS: usize = 16;
/// Width of a bin in rad.
const BIN: f64 = TAU / BINS as f64;

/// What the lidar reads of objects, seen from the robot in m.
pub(super) fn readings(objects: impl IntoIterator<Item = Vector2<f64>>, range: f64) -> [f64; BINS] {
    let mut readings = [0.0; BINS];
    for object in objects {
        let closeness = (range - object.norm()).max(0.0) / range;
        let place = f64::atan2(object.y, object.x).rem_euclid(TAU) / BIN;
        // An angle just below 0 may be rounded up to a whole turn.
        let bin = place as usize % BINS;
        let beyond = place.fract();
        let bins = [(bin, 1.0), ((bin + 1) % BINS, beyond), ((bin + BINS - 1) % BINS, 1.0 - beyond)];
        for (bin, share) in bins {
            readings[bin] = f64::max(readings[bin], share * closeness);
        }
    }
    readings
}

/// Where a single object lies, seen from the robot in m; the inverse of
/// [`readings`]. Nowhere, if nothing is read.
pub(super) fn object(readings: &[f32], range: f64) -> Option<Vector2<f64>> {
    let (bin, closeness) = readings.iter().copied().enumerate().max_by(|(_, a), (_, b)| a.total_cmp(b))?;
    if closeness <= 0.0 {
        return None;
    }
    let after = readings.get((bin + 1) % readings.len()).copied().unwrap_or_default();
    let angle = (bin as f64 + f64::from(after) / f64::from(closeness)) * BIN;
    let distance = range * (1.0 - f64::from(closeness));
    Some(distance * Vector2::new(angle.cos(), angle.sin()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn at(angle: f64, distance: f64) -> Vector2<f64> {
        distance * Vector2::new(angle.cos(), angle.sin())
    }

    #[test]
    fn an_object_reads_in_its_bin_and_as_a_share_in_the_bins_beside() {
        let readings = readings([at(2.25 * BIN, 1.5)], 3.0);
        for (bin, reading) in readings.into_iter().enumerate() {
            let expected = [0.0, 0.375, 0.5, 0.125].get(bin).copied().unwrap_or_default();
            assert!((reading - expected).abs() < 1e-12, "bin {bin}: {reading}");
        }
    }

    #[test]
    fn bins_go_round() {
        let readings = readings([at(-0.5 * BIN, 0.0_f64.max(1.5))], 3.0);
        assert!((readings[15] - 0.5).abs() < 1e-12);
        assert!((readings[0] - 0.25).abs() < 1e-12 && (readings[14] - 0.25).abs() < 1e-12);
    }

    #[test]
    fn the_nearest_object_counts_and_one_out_of_range_reads_nothing() {
        let near = readings([at(0.5 * BIN, 1.0)], 3.0);
        assert_eq!(readings([at(0.5 * BIN, 2.0), at(0.5 * BIN, 1.0)], 3.0), near);
        assert_eq!(readings([at(0.5 * BIN, 3.5)], 3.0), [0.0; BINS]);
    }

    proptest! {
        #[test]
        fn a_single_object_is_found_again(x in -4.0f64..4.0, y in -4.0f64..4.0) {
            let seen = Vector2::new(x, y);
            let found = object(&readings([seen], 6.0).map(|reading| reading as f32), 6.0);
            prop_assert!((found.unwrap() - seen).norm() < 1e-5, "{found:?} is not {seen:?}");
        }
    }
}
