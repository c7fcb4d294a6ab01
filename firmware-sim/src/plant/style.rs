//! How a script drives.

/// Driving style of [`Plant::pilot`](super::Plant::pilot).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Style {
    /// Speed to reach in m/s.
    pub pace: f64,
    /// Distance to keep from where it costs, in m; negative beyond.
    pub margin: f64,
    /// How far ahead on a circle the script aims, in rad; without a circle it does not matter.
    pub look: f64,
}
