use super::*;
use crate::recorded::rows;

impl Point {
    /// Holds an action for a whole control step.
    fn hold(&mut self, action: Vector2<f64>) {
        self.step_late(action, action, 0.0);
    }
}

/// From `tests/data/point_steps.py`: a state, an action, and what MuJoCo makes of them.
fn mujoco_steps() -> Vec<(Point, Vector2<f64>, Point, [f64; SENSORS])> {
    let steps = rows::<f64>(include_str!("../../../tests/data/point_steps.csv")).map(|row| {
        let point = |at: &[f64]| Point {
            position: Vector2::new(at[0], at[1]),
            velocity: Vector2::new(at[3], at[4]),
            heading: at[2],
            spin: at[5],
            acceleration: Vector2::zeros(),
        };
        (point(&row), Vector2::new(row[6], row[7]), point(&row[8..]), std::array::from_fn(|i| row[14 + i]))
    });
    steps.collect()
}

/// The servo multiplies rounding by up to 5 a sub-step, which is 1e7 in ten:
/// 1e-15 in, a few 1e-9 out in spin, and 1e-3 of that in the heading.
#[test]
fn a_control_step_is_that_of_mujoco() {
    let steps = mujoco_steps();
    assert_eq!(steps.len(), 40);
    for (before, action, after, sensors) in steps {
        let mut point = before;
        point.hold(action);
        assert!((point.position - after.position).norm() < 1e-10, "{before:?} {action:?}: {point:?}, not {after:?}");
        assert!((point.velocity - after.velocity).norm() < 1e-8, "{before:?} {action:?}: {point:?}, not {after:?}");
        assert!((point.heading - after.heading).abs() < 1e-9, "{before:?} {action:?}: {point:?}, not {after:?}");
        assert!((point.spin - after.spin).abs() < 1e-6, "{before:?} {action:?}: {point:?}, not {after:?}");
        for (sensor, (value, expected)) in point.sensors().into_iter().zip(sensors).enumerate() {
            assert!((value - expected).abs() < 1e-5, "{before:?} {action:?}, sensor {sensor}: {value}, not {expected}");
        }
    }
}

#[test]
fn sensed_and_read_again_the_sensors_say_the_same() {
    for (_, _, _, sensors) in mujoco_steps() {
        let sensors = sensors.map(|value| value as f32);
        let again = Point::sensed(&sensors).sensors();
        for (value, expected) in again.into_iter().zip(sensors) {
            assert!((value - f64::from(expected)).abs() < 1e-5, "{again:?}, not {sensors:?}");
        }
    }
}

/// Energy that thrust and torque put in, less what damping takes out, is what
/// the robot gains. Semi-implicit Euler keeps that to its first order, and a
/// tenth of the sub-step to a tenth of the error would be seen; here the
/// thrust is small and the servo idle, so that the sums are smooth.
#[test]
fn energy_is_what_the_thrust_put_in_less_what_damping_took() {
    let mut point = Point::at_rest(Vector2::zeros(), 0.3);
    let mut put_in = 0.0;
    for _ in 0..200 {
        let nose = Vector2::new(point.heading.cos(), point.heading.sin());
        let before = point;
        point.hold(Vector2::new(0.03, 0.0));
        let speed = 0.5 * (before.velocity + point.velocity);
        let time = SUBSTEP * SUBSTEPS as f64;
        put_in += time * (GEAR * 0.03 * nose.dot(&speed) - SLIDE_DAMPING * speed.norm_squared());
    }
    let kinetic = 0.5 * MASS * point.velocity.norm_squared();
    assert!((kinetic - put_in).abs() < 0.01 * kinetic, "{kinetic} J, put in {put_in} J");
}

/// Thrust over damping: 0.3 * 0.05 / 0.01 m/s, and 0.3 * 0.05 / 0.005 rad/s.
#[test]
fn full_actions_reach_the_terminal_speeds() {
    let mut point = Point::at_rest(Vector2::zeros(), 1.0);
    for _ in 0..500 {
        point.hold(Vector2::new(1.0, 0.0));
    }
    assert!((point.velocity.norm() - 1.5).abs() < 1e-3, "{}", point.velocity.norm());

    let mut point = Point::at_rest(Vector2::zeros(), 1.0);
    let start = point.heading;
    for _ in 0..500 {
        point.hold(Vector2::new(0.0, 1.0));
    }
    let mean_spin = (point.heading - start) / (500.0 * SUBSTEP * SUBSTEPS as f64);
    assert!((mean_spin - 3.0).abs() < 0.05, "{mean_spin}");
}

#[test]
fn the_robot_knows_no_left_or_right() {
    let mirror = |v: Vector2<f64>| Vector2::new(v.x, -v.y);
    for (before, action, ..) in mujoco_steps() {
        let mut point = before;
        let mut mirrored = Point {
            position: mirror(before.position),
            velocity: mirror(before.velocity),
            heading: -before.heading,
            spin: -before.spin,
            ..before
        };
        point.hold(action);
        mirrored.hold(mirror(action));
        assert!((mirrored.position - mirror(point.position)).norm() < 1e-12);
        assert!((mirrored.heading + point.heading).abs() < 1e-12);
    }
}
