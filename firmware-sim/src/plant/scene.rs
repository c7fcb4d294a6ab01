//! What a plant looks like from above, for drawing.

use nalgebra::Vector2;

/// A robot and the things around it, in m.
#[derive(Clone, Debug, PartialEq)]
pub struct Scene {
    /// Where the robot is.
    pub robot: Vector2<f64>,
    /// Its radius.
    pub radius: f64,
    /// Heading in rad, counter-clockwise from x; none of a ball.
    pub heading: Option<f64>,
    /// What is around it.
    pub things: Vec<Thing>,
}

/// Something around a robot, in m.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Thing {
    /// A line along y at this x; beyond it, seen from the origin, steps cost.
    WallX(f64),
    /// A line along x at this y, likewise.
    WallY(f64),
    /// A circle around the origin to run along.
    Track(f64),
    /// A disc in which steps cost.
    Hazard(Vector2<f64>, f64),
    /// A disc to reach.
    Goal(Vector2<f64>, f64),
    /// A square that costs nothing, and half its side.
    Vase(Vector2<f64>, f64),
}
