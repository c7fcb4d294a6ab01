//! The robot's way from above, to scale, over walls, hazards and goals.

use std::f64::consts::TAU;
use std::fmt::Write;

use nalgebra::Vector2;

use crate::harness::RobotEpisode;
use crate::page::axis::{Axis, label};
use crate::plant::{Scene, Thing};

/// Width of the drawing, in units that are pixels.
const WIDTH: f64 = 1000.0;
/// Heights that it may have.
const HEIGHTS: [f64; 2] = [170.0, 620.0];
/// Room for labels: left, right, top, bottom.
const MARGINS: [f64; 4] = [44.0, 14.0, 14.0, 38.0];
/// More points than this a path does not show.
const POINTS: usize = 700;
/// Those of each episode in the background.
const FAINT_POINTS: usize = 150;

/// Draws episode `number`, and the others faintly behind it where they are in the same place.
pub(super) fn figure(episodes: &[RobotEpisode], number: usize, out: &mut String) {
    let Some(episode) = episodes.get(number) else { return };
    out.push_str("<figure class=\"wide\">\n<h3>Path</h3>\n");
    legend(episode, episodes.len() > 1, out);
    svg(episodes, number, out);
    out.push_str("</figure>\n");
}

fn legend(episode: &RobotEpisode, has_others: bool, out: &mut String) {
    let has = |kind: fn(&Thing) -> bool| episode.scene.things.iter().any(kind);
    let entries = [
        (true, "line c0", "M0 5H18", "path"),
        (has_others, "other", "M0 5H18", "other episodes"),
        (true, "costly", "M0 5H18", "where it cost"),
        (true, "struck", "M6 2l6 6m0 -6l-6 6", "a fault struck"),
        (has(|thing| matches!(thing, Thing::WallX(_) | Thing::WallY(_))), "danger", "M0 0H18V10H0Z", "beyond a limit"),
        (has(|thing| matches!(thing, Thing::Hazard(..))), "hazard", "M0 0H18V10H0Z", "hazard"),
        (has(|thing| matches!(thing, Thing::Goal(..))), "goal", "M0 0H18V10H0Z", "goal, one after the other"),
        (has(|thing| matches!(thing, Thing::Vase(..))), "vase", "M4 0H14V10H4Z", "vase"),
        (has(|thing| matches!(thing, Thing::Track(_))), "track", "M0 5H18", "circle to run"),
    ];
    out.push_str("<ul class=\"legend\">");
    for (_, class, sample, name) in entries.into_iter().filter(|entry| entry.0) {
        let _ = write!(
            out,
            "<li><svg viewBox=\"0 0 18 10\" aria-hidden=\"true\"><path class=\"{class}\" d=\"{sample}\"/></svg>{name}</li>"
        );
    }
    out.push_str("</ul>\n");
}

fn svg(episodes: &[RobotEpisode], number: usize, out: &mut String) {
    let episode = &episodes[number];
    let others: Vec<&RobotEpisode> =
        episodes.iter().filter(|other| other.scene.things == episode.scene.things).collect();
    let map = Map::new(episode, &others);
    let _ = write!(out, "<svg viewBox=\"0 0 {WIDTH} {:.0}\" role=\"img\" aria-label=\"path\">", map.height);
    map.things(episode, out);
    map.axes(out);
    for other in others {
        let places: Vec<_> = places(other).collect();
        let _ = write!(out, "<path class=\"other\" d=\"{}\"/>", map.line(&thinned(&places, FAINT_POINTS)));
    }
    let own: Vec<_> = places(episode).collect();
    let _ = write!(out, "<path class=\"line c0\" d=\"{}\"/>", map.line(&thinned(&own, POINTS)));
    let _ = write!(out, "<path class=\"costly\" d=\"{}\"/>", map.costly(episode));
    for record in episode.records.iter().filter(|record| record.injected.iter().any(|kind| !kind.is_constant())) {
        let [x, y] = map.at(record.place);
        let _ = write!(out, "<path class=\"struck\" d=\"M{:.1} {:.1}l6 6m0 -6l-6 6\"/>", x - 3.0, y - 3.0);
    }
    map.robot(episode, out);
    out.push_str("</svg>\n");
}

/// Where the robot was, from the start on.
fn places(episode: &RobotEpisode) -> impl Iterator<Item = Vector2<f64>> {
    std::iter::once(episode.scene.robot).chain(episode.records.iter().map(|record| record.place))
}

/// Of many places, every so many, and the last.
fn thinned(places: &[Vector2<f64>], most: usize) -> Vec<Vector2<f64>> {
    let stride = places.len().div_ceil(most).max(1);
    places.iter().step_by(stride).chain(places.last()).copied().collect()
}

/// From places in m to places on the drawing, to scale.
struct Map {
    low: Vector2<f64>,
    high: Vector2<f64>,
    /// Units of the drawing in a metre.
    scale: f64,
    height: f64,
}

impl Map {
    /// Holds the paths and all that lies around them.
    fn new(episode: &RobotEpisode, others: &[&RobotEpisode]) -> Self {
        let mut corners: Vec<Vector2<f64>> = others.iter().flat_map(|other| places(other)).collect();
        let mut disc = |place: Vector2<f64>, radius: f64| {
            corners.extend([place.add_scalar(-radius), place.add_scalar(radius)]);
        };
        disc(episode.scene.robot, 2.0 * episode.scene.radius);
        for thing in &episode.scene.things {
            match *thing {
                Thing::WallX(x) => disc(Vector2::new(1.12 * x, episode.scene.robot.y), 0.0),
                Thing::WallY(y) => disc(Vector2::new(episode.scene.robot.x, 1.3 * y), 0.0),
                Thing::Track(radius) => disc(Vector2::zeros(), radius),
                Thing::Hazard(place, radius) | Thing::Goal(place, radius) | Thing::Vase(place, radius) => {
                    disc(place, radius)
                }
            }
        }
        for &(place, radius) in &episode.goals {
            disc(place, radius);
        }
        let fold = |choose: fn(f64, f64) -> f64, start| {
            corners.iter().fold(Vector2::repeat(start), |a: Vector2<f64>, b| a.zip_map(b, choose))
        };
        let (low, high) = (fold(f64::min, f64::INFINITY), fold(f64::max, f64::NEG_INFINITY));
        let span = (high - low).add_scalar(1e-3);
        let [left, right, top, bottom] = MARGINS;
        let room = Vector2::new(WIDTH - left - right, HEIGHTS[1] - top - bottom);
        let scale = 0.97 * (room.x / span.x).min(room.y / span.y);
        let height = (span.y * scale / 0.97 + top + bottom).clamp(HEIGHTS[0], HEIGHTS[1]);
        // What the drawing has room for beyond the things, half on each side.
        let seen = Vector2::new(room.x, height - top - bottom) / scale;
        let middle = 0.5 * (low + high);
        Self { low: middle - 0.5 * seen, high: middle + 0.5 * seen, scale, height }
    }

    fn at(&self, place: Vector2<f64>) -> [f64; 2] {
        let [left, _, top, _] = MARGINS;
        [left + (place.x - self.low.x) * self.scale, top + (self.high.y - place.y) * self.scale]
    }

    fn line(&self, places: &[Vector2<f64>]) -> String {
        let mut path = String::new();
        for &place in places {
            let [x, y] = self.at(place);
            let _ = write!(path, "{}{x:.1} {y:.1}", if path.is_empty() { 'M' } else { 'L' });
        }
        path
    }

    /// The parts of the path whose steps cost.
    fn costly(&self, episode: &RobotEpisode) -> String {
        let mut path = String::new();
        let mut before = episode.scene.robot;
        for record in &episode.records {
            if record.cost > 0.0 {
                let ([x, y], [u, v]) = (self.at(before), self.at(record.place));
                let _ = write!(path, "M{x:.1} {y:.1}L{u:.1} {v:.1}");
            }
            before = record.place;
        }
        path
    }

    fn things(&self, episode: &RobotEpisode, out: &mut String) {
        let ([left, top], [right, bottom]) =
            (self.at(Vector2::new(self.low.x, self.high.y)), self.at(Vector2::new(self.high.x, self.low.y)));
        let all = episode.scene.things.iter().copied();
        let goals = episode.goals.iter().map(|&(place, radius)| Thing::Goal(place, radius));
        for thing in all.chain(goals) {
            let mut circle = |class: &str, place, radius: f64| {
                let [x, y] = self.at(place);
                let _ = write!(
                    out,
                    "<circle class=\"{class}\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{:.1}\"/>",
                    radius * self.scale
                );
            };
            match thing {
                Thing::Track(radius) => circle("track", Vector2::zeros(), radius),
                Thing::Hazard(place, radius) => circle("hazard", place, radius),
                Thing::Goal(place, radius) => circle("goal", place, radius),
                Thing::WallX(wall) => {
                    let [x, _] = self.at(Vector2::new(wall, 0.0));
                    let edge = if wall < 0.0 { left } else { right };
                    let _ =
                        write!(out, "<path class=\"danger\" d=\"M{x:.1} {top:.1}H{edge:.1}V{bottom:.1}H{x:.1}Z\"/>");
                    let _ = write!(out, "<path class=\"wall\" d=\"M{x:.1} {top:.1}V{bottom:.1}\"/>");
                }
                Thing::WallY(wall) => {
                    let [_, y] = self.at(Vector2::new(0.0, wall));
                    let edge = if wall > 0.0 { top } else { bottom };
                    let _ =
                        write!(out, "<path class=\"danger\" d=\"M{left:.1} {y:.1}V{edge:.1}H{right:.1}V{y:.1}Z\"/>");
                    let _ = write!(out, "<path class=\"wall\" d=\"M{left:.1} {y:.1}H{right:.1}\"/>");
                }
                Thing::Vase(place, half) => {
                    let [x, y] = self.at(place.add_scalar(-half));
                    let side = 2.0 * half * self.scale;
                    let _ = write!(out, "<path class=\"vase\" d=\"M{x:.1} {y:.1}h{side:.1}v-{side:.1}h-{side:.1}Z\"/>");
                }
            }
        }
    }

    fn axes(&self, out: &mut String) {
        let [left, right, top, bottom] = MARGINS;
        let (end, floor) = (WIDTH - right, self.height - bottom);
        let across = Axis::exact(self.low.x, self.high.x);
        let upright = Axis::exact(self.low.y, self.high.y);
        for tick in across.ticks(8) {
            let [x, _] = self.at(Vector2::new(tick, 0.0));
            let _ = write!(out, "<path class=\"axis\" d=\"M{x:.1} {floor:.1}v4\"/>");
            let _ = write!(out, "<text class=\"middle\" x=\"{x:.1}\" y=\"{:.1}\">{}</text>", floor + 16.0, label(tick));
        }
        for tick in upright.ticks(((self.height / 70.0) as usize).max(2)) {
            let [_, y] = self.at(Vector2::new(0.0, tick));
            let _ = write!(out, "<path class=\"axis\" d=\"M{left} {y:.1}h-4\"/>");
            let _ = write!(out, "<text class=\"end\" x=\"{}\" y=\"{:.1}\">{}</text>", left - 7.0, y + 4.0, label(tick));
        }
        let _ = write!(out, "<path class=\"axis\" d=\"M{left} {top}V{floor:.1}H{end}\"/>");
        let _ = write!(out, "<text class=\"unit end\" x=\"{end}\" y=\"{:.1}\">x in m</text>", self.height - 5.0);
        let _ = write!(out, "<text class=\"unit\" x=\"4\" y=\"11\">y in m</text>");
    }

    /// The robot where it started, hollow, and where it ended, along its way.
    fn robot(&self, episode: &RobotEpisode, out: &mut String) {
        let Scene { robot, radius, heading, .. } = &episode.scene;
        let size = (radius * self.scale).clamp(4.0, 14.0);
        let [x, y] = self.at(*robot);
        let _ = write!(out, "<circle class=\"start\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{size:.1}\"/>");
        if let Some(heading) = heading {
            let (sin, cos) = (heading % TAU).sin_cos();
            let _ = write!(
                out,
                "<path class=\"nose\" d=\"M{x:.1} {y:.1}l{:.1} {:.1}\"/>",
                1.7 * size * cos,
                -1.7 * size * sin
            );
        }
        if let Some(last) = episode.records.last() {
            let [x, y] = self.at(last.place);
            let _ = write!(out, "<circle class=\"robot\" cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"{size:.1}\"/>");
        }
    }
}
