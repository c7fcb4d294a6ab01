//! Gradient surgery on the shared trunk (Eq. 5; Yu et al. 2020).

use serde::{Deserialize, Serialize};

use crate::nn::{Scalar, dot};

/// Below this squared norm a gradient has no direction to project on.
const NO_DIRECTION: f64 = 1e-12;

/// In which order a task meets the others (O-17).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Order {
    /// A random one for each task and step (the authors of PCGrad).
    Random,
    /// Reward, long-term cost, short-term cost.
    Fixed,
    /// No surgery ("w/o PCGrad", section 4.5).
    Off,
}

/// How the tasks' gradients become one (O-17).
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum Pooling {
    /// Their mean (the paper).
    Mean,
    /// Their sum.
    Sum,
}

/// What gradient surgery saw of the original gradients.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Surgery {
    /// Pairs in conflict, 0 to 3 (Table A1).
    pub conflicts: usize,
    /// Euclidean norm of each task's gradient.
    pub norms: [f64; 3],
}

/// Projects each task's gradient off the others that it conflicts with, and averages or adds.
///
/// For task `i`, in the order `orders[i]`, `g_i <- g_i - (g_i . g_j) / |g_j|^2 g_j`
/// wherever `g_i . g_j < 0`; `g_j` is always the original gradient. Without
/// `orders` the gradients stay as they are. What they become together is added to `out`.
pub fn project<T: Scalar>(
    gradients: &[Vec<T>; 3],
    orders: Option<&[[usize; 2]; 3]>,
    pooling: Pooling,
    out: &mut [T],
) -> Surgery {
    // All inner products of the originals; a projection changes them by these alone.
    let gram = gradients.each_ref().map(|a| gradients.each_ref().map(|b| dot(a, b)));
    let conflicts = [(0, 1), (0, 2), (1, 2)].into_iter().filter(|&(i, j)| gram[i][j] < 0.0).count();
    // The result is a combination of the originals: find its coefficients first.
    let mut coefficients = [0.0; 3];
    let parts = match pooling {
        Pooling::Mean => 3.0,
        Pooling::Sum => 1.0,
    };
    for i in 0..3 {
        let mut own = [0.0; 3];
        own[i] = 1.0;
        for &j in orders.iter().flat_map(|orders| &orders[i]) {
            let inner: f64 = own.iter().zip(gram).map(|(coefficient, row)| coefficient * row[j]).sum();
            if inner < 0.0 && gram[j][j] > NO_DIRECTION {
                own[j] -= inner / gram[j][j];
            }
        }
        for (sum, own) in coefficients.iter_mut().zip(own) {
            *sum += own / parts;
        }
    }
    let [x, y, z] = coefficients.map(T::of);
    let [a, b, c] = gradients;
    for (((out, &a), &b), &c) in out.iter_mut().zip(a).zip(b).zip(c) {
        *out += x * a + y * b + z * c;
    }
    Surgery { conflicts, norms: [gram[0][0], gram[1][1], gram[2][2]].map(f64::sqrt) }
}

/// The orders in which tasks meet the others, from three uniform words: each pair swapped or not.
pub const fn orders(words: [u32; 3]) -> [[usize; 2]; 3] {
    const fn order(pair: [usize; 2], word: u32) -> [usize; 2] {
        if word & 1 == 0 { pair } else { [pair[1], pair[0]] }
    }
    [order([1, 2], words[0]), order([0, 2], words[1]), order([0, 1], words[2])]
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::fill;

    const ORDERS: [[usize; 2]; 3] = orders([0; 3]);

    /// Eq. 5 as it stands, vector by vector.
    fn by_the_letter(gradients: &[Vec<f64>; 3], orders: &[[usize; 2]; 3]) -> Vec<f64> {
        let mut mean = vec![0.0; gradients[0].len()];
        for (i, order) in orders.iter().enumerate() {
            let mut own = gradients[i].clone();
            for &j in order {
                let inner = dot(&own, &gradients[j]);
                if inner < 0.0 {
                    let factor = inner / dot(&gradients[j], &gradients[j]);
                    own.iter_mut().zip(&gradients[j]).for_each(|(own, other)| *own -= factor * other);
                }
            }
            mean.iter_mut().zip(own).for_each(|(mean, own)| *mean += own / 3.0);
        }
        mean
    }

    #[test]
    fn it_is_equation_five_in_every_order() {
        for stream in 0..20 {
            let gradients = [0, 1, 2].map(|i| fill(4, 3 * stream + i));
            for words in 0..8 {
                let orders = orders([words & 1, words >> 1 & 1, words >> 2]);
                let mut out = vec![0f64; 4];
                project(&gradients, Some(&orders), Pooling::Mean, &mut out);
                for (out, expected) in out.iter().zip(by_the_letter(&gradients, &orders)) {
                    assert!((out - expected).abs() < 1e-12, "{out} is not {expected}");
                }
            }
        }
    }

    #[test]
    fn identical_gradients_are_unchanged() {
        let mut out = vec![0f64; 3];
        assert_eq!(project(&[0; 3].map(|_| vec![1.0, -2.0, 3.0]), Some(&ORDERS), Pooling::Mean, &mut out).conflicts, 0);
        for (out, expected) in out.iter().zip([1.0, -2.0, 3.0]) {
            assert!((out - expected).abs() < 1e-12);
        }
    }

    #[test]
    fn conflicting_gradients_become_orthogonal_to_each_other() {
        // The third task is silent, so only the first two meet.
        let (a, b) = (vec![1.0, 0.0], vec![-1.0, 1.0]);
        let mut out = vec![0f64; 2];
        assert_eq!(project(&[a.clone(), b.clone(), vec![0.0; 2]], Some(&ORDERS), Pooling::Mean, &mut out).conflicts, 1);
        // a off b is (0.5, 0.5), b off a is (0, 1).
        assert!((out[0] - 0.5 / 3.0).abs() < 1e-12);
        assert!((out[1] - 1.5 / 3.0).abs() < 1e-12);
    }

    #[test]
    fn without_surgery_gradients_are_averaged_or_added_as_they_are() {
        let gradients = [vec![1.0, 0.0], vec![-1.0, 1.0], vec![0.0, 2.0]];
        for (pooling, expected) in [(Pooling::Mean, [0.0, 1.0]), (Pooling::Sum, [0.0, 3.0])] {
            let mut out = vec![0f64; 2];
            assert_eq!(project(&gradients, None, pooling, &mut out).conflicts, 1, "conflicts are counted all the same");
            assert_eq!(out, expected);
        }
    }

    #[test]
    fn opposed_gradients_cancel() {
        let mut out = vec![0f64; 2];
        assert_eq!(
            project(&[vec![1.0, 1.0], vec![-2.0, -2.0], vec![0.0; 2]], Some(&ORDERS), Pooling::Mean, &mut out)
                .conflicts,
            1
        );
        assert!(out.iter().all(|value: &f64| value.abs() < 1e-12));
    }

    #[test]
    fn conflicts_are_counted_by_pairs() {
        let third = |angle: f64| vec![angle.cos(), angle.sin()];
        let mut out = vec![0f64; 2];
        let spread = [0.0, 1.0, 2.0].map(|k| third(k * std::f64::consts::TAU / 3.0));
        assert_eq!(project(&spread, Some(&ORDERS), Pooling::Mean, &mut out).conflicts, 3);
    }

    #[test]
    fn norms_are_those_of_the_originals() {
        let gradients = [vec![3.0, 4.0], vec![-1.0, 0.0], vec![0.0, 0.0]];
        assert_eq!(project(&gradients, Some(&ORDERS), Pooling::Mean, &mut [0f64; 2]).norms, [5.0, 1.0, 0.0]);
    }
}
