//! The page of a flight: where the robot went, what it earned and paid, what
//! was left of its budget, how long the controller took, and what broke.

mod histogram;
mod path;
mod timeline;

use std::fmt::Write;

use armor_core::image::PolicyImage;
use armor_core::schedule::Sampler;

use super::axis::Scale;
use super::chart::{Chart, Layer};
use super::{escape, figure, foot, head};
use crate::flight::FlightPlan;
use crate::harness::{RobotEpisode, RobotFlight, Setup, Tally};

/// A flight and what it flew with.
#[derive(Clone, Copy, Debug)]
pub struct Told<'a> {
    /// The flight.
    pub flight: &'a RobotFlight,
    /// Its plan.
    pub plan: &'a FlightPlan,
    /// Its board and faults.
    pub setup: &'a Setup,
    /// The image that flew, at the start.
    pub image: &'a PolicyImage<'a>,
}

/// The page, complete in itself. The episode that cost most is drawn, the
/// earliest of several.
pub fn page(told: &Told<'_>) -> String {
    let summary = &told.flight.summary;
    let mut out = head(&format!("{} - ARMOR flight", summary.task));
    header(told, &mut out);
    let episodes = &told.flight.episodes;
    let costs: Vec<f64> = episodes.iter().map(cost).collect();
    let worst = (0..costs.len()).rev().max_by(|&a, &b| costs[a].total_cmp(&costs[b]));
    if let Some((number, episode)) = worst.and_then(|number| Some((number, episodes.get(number)?))) {
        let of = if episodes.len() > 1 { ", the one that cost most" } else { "" };
        let _ = writeln!(out, "<h2>Episode {number}{of}</h2>");
        path::figure(episodes, number, &mut out);
        let curves = Curves::new(episode);
        out.push_str("<div class=\"grid\">\n");
        charts(&curves, told).iter().for_each(|chart| figure(chart, &mut out));
        out.push_str("</div>\n");
        timeline::figure(episode, &chains(told.image), &mut out);
    }
    out.push_str("<h2>All episodes</h2>\n<div class=\"grid\">\n");
    let numbers: Vec<f64> = (0..episodes.len()).map(|number| number as f64).collect();
    let rewards: Vec<f64> = episodes.iter().map(|e| e.records.iter().map(|record| record.reward).sum()).collect();
    returns([&numbers, &rewards, &costs], summary.cost_limit).iter().for_each(|chart| figure(chart, &mut out));
    let deadline = told.plan.period().0 as f64;
    histogram::figure(&told.flight.latency, deadline, &summary.latency_of(), &mut out);
    out.push_str("</div>\n");
    rungs(told, &mut out);
    counts(&told.flight.tally, &mut out);
    out.push_str(&foot(&format!("Made by firmware-sim run {}.", env!("CARGO_PKG_VERSION"))));
    out
}

fn header(told: &Told<'_>, out: &mut String) {
    let Told { flight: RobotFlight { summary, tally, .. }, plan, setup, image } = told;
    let board = match setup.board {
        None => "this host".to_owned(),
        Some(board) => format!("{} at {} MHz, modelled", board.name, board.clock_hz / 1_000_000),
    };
    let faults: Vec<String> = setup.faults.iter().map(ToString::to_string).collect();
    let faults = if faults.is_empty() { "no fault injected".to_owned() } else { faults.join(", ") };
    let _ = write!(
        out,
        "<h1>{}</h1>\n<p class=\"soft\">{} at {} Hz on {board}; cost limit {}, seed {}; {:?}, {} bytes; {}</p>\n",
        escape(summary.task),
        if summary.episodes == 1 { "1 episode".to_owned() } else { format!("{} episodes", summary.episodes) },
        plan.rate_hz,
        summary.cost_limit,
        summary.seed,
        image.manifest().precision,
        image.bytes().len(),
        escape(&faults)
    );
    out.push_str("<dl class=\"facts\">\n");
    let mut fact = |name: &str, value: String, is_bad: bool| {
        let class = if is_bad { " class=\"bad\"" } else { "" };
        let _ = writeln!(out, "<div{class}><dt>{name}</dt><dd>{value}</dd></div>");
    };
    fact("normalised reward", format!("{:.3}", summary.reward_normalized), false);
    fact("normalised cost, safe to 1", format!("{:.3}", summary.cost_normalized), summary.cost_normalized > 1.0);
    fact("episodes within the limit", format!("{} of {}", summary.safe_episodes, summary.episodes), false);
    fact("missed deadlines", summary.deadline_misses.to_string(), summary.deadline_misses > 0);
    fact("faults that struck", tally.struck().to_string(), false);
    fact("budget errors", tally.budget_errors.to_string(), tally.budget_errors > 0);
    fact("actions out of range", tally.actions_out_of_range.to_string(), tally.actions_out_of_range > 0);
    out.push_str("</dl>\n");
}

fn cost(episode: &RobotEpisode) -> f64 {
    episode.records.iter().map(|record| record.cost).sum()
}

/// Numbers of an episode over its time in s.
struct Curves {
    times: Vec<f64>,
    reward: Vec<f64>,
    cost: Vec<f64>,
    kappa: Vec<f64>,
    left: Vec<f64>,
    latency: Vec<f64>,
}

impl Curves {
    fn new(episode: &RobotEpisode) -> Self {
        let records = &episode.records;
        let sums = |of: fn(&crate::harness::Record) -> f64| {
            let running = |sum: &mut f64, record| {
                *sum += of(record);
                Some(*sum)
            };
            records.iter().scan(0.0, running).collect()
        };
        let units = |cost: armor_core::units::Cost| f64::from(cost.to_f32());
        Self {
            times: records.iter().map(|record| record.time.0 as f64 / 1e6).collect(),
            reward: sums(|record| record.reward),
            cost: sums(|record| record.cost),
            kappa: records.iter().map(|record| record.kappa.map_or(f64::NAN, units)).collect(),
            left: records.iter().map(|record| units(record.left)).collect(),
            latency: records
                .iter()
                .map(|r| r.latency.map_or(f64::NAN, |latency| latency.as_secs_f64() * 1e3))
                .collect(),
        }
    }
}

fn charts<'a>(curves: &'a Curves, told: &Told<'_>) -> Vec<Chart<'a>> {
    let limit = told.flight.summary.cost_limit;
    let line = |label: &str, colour, values| Layer::Line { label: label.to_owned(), colour, values };
    let chart = |title, unit, layers, caption: &str| Chart {
        title,
        across: "time in s",
        unit,
        scale: Scale::Linear,
        ends: None,
        steps: &curves.times,
        layers,
        caption: caption.to_owned(),
    };
    let mut charts = vec![
        chart("Reward so far", "units of reward", vec![line("", 0, &curves.reward)], ""),
        chart(
            "Cost so far",
            "units of cost",
            vec![Layer::Level { label: "limit".to_owned(), at: limit }, line("incurred", 1, &curves.cost)],
            "",
        ),
        chart(
            "Budget",
            "units of cost",
            vec![line("truly left", 2, &curves.left), line("kappa, the controller's", 0, &curves.kappa)],
            "Kappa never lies above what is truly left when its costs are charged; it is charged a step later.",
        ),
    ];
    if told.setup.board.is_some() {
        let deadline = told.plan.period().0 as f64 / 1e3;
        charts.push(chart(
            "Latency",
            "ms, modelled",
            vec![
                Layer::Level { label: "period".to_owned(), at: deadline },
                Layer::Dots { label: "answer".to_owned(), colour: 0, values: &curves.latency },
            ],
            "",
        ));
    }
    charts
}

/// Returns by episode.
fn returns<'a>([numbers, rewards, costs]: [&'a [f64]; 3], limit: f64) -> [Chart<'a>; 2] {
    let chart = |title, unit, colour, values, level: Option<Layer<'a>>| Chart {
        title,
        across: "episode",
        unit,
        scale: Scale::Linear,
        ends: None,
        steps: numbers,
        layers: level.into_iter().chain([Layer::Dots { label: String::new(), colour, values }]).collect(),
        caption: String::new(),
    };
    let level = Layer::Level { label: "limit".to_owned(), at: limit };
    [chart("Return", "units of reward", 0, rewards, None), chart("Cost return", "units of cost", 1, costs, Some(level))]
}

/// The name of each rung.
fn chains(image: &PolicyImage<'_>) -> Vec<String> {
    let name = |rung: &armor_core::image::Rung| match rung.sampler {
        Sampler::Ddpm => format!("DDPM {}", rung.steps),
        Sampler::Ddim => format!("DDIM {}", rung.steps),
    };
    image.manifest().rungs.iter().map(name).collect()
}

fn rungs(told: &Told<'_>, out: &mut String) {
    let all = told.flight.episodes.iter().flat_map(|episode| &episode.records);
    let flown: Vec<usize> = all.filter_map(|record| record.rung).collect();
    out.push_str("<h2>Chains flown</h2>\n<div class=\"table\"><table>\n");
    out.push_str("<tr><th>rung</th><th>chain</th><th>modelled</th><th>answers</th><th>share</th></tr>\n");
    for (rung, chain) in chains(told.image).iter().enumerate() {
        let time = told.setup.board.and_then(|board| board.action(told.image, rung));
        let time = time.map_or(String::new(), |action| format!("{:.2} ms", action.time.as_secs_f64() * 1e3));
        let count = flown.iter().filter(|&&other| other == rung).count();
        let share = 100.0 * count as f64 / flown.len().max(1) as f64;
        let bar = format!(
            "<svg viewBox=\"0 0 100 8\" width=\"160\" height=\"12\" preserveAspectRatio=\"none\" aria-hidden=\"true\">\
             <path class=\"bar\" d=\"M0 0H{share:.1}V8H0Z\"/></svg>"
        );
        let _ = writeln!(
            out,
            "<tr><td>{rung}</td><td class=\"value\">{chain}</td><td>{time}</td><td>{count}</td><td>{bar} {share:.1} %</td></tr>"
        );
    }
    out.push_str("</table></div>\n");
}

fn counts(tally: &Tally, out: &mut String) {
    out.push_str(
        "<h2>Control steps</h2>\n<div class=\"table\"><table>\n<tr><th>what</th><th>control steps</th></tr>\n",
    );
    let decided = [
        ("policy's action", tally.policy),
        ("action before held", tally.held),
        ("fallback", tally.fallback),
        ("controller down", tally.down),
    ];
    for (what, count) in decided {
        let _ = writeln!(out, "<tr><td>{what}</td><td class=\"value\">{count}</td></tr>");
    }
    for (name, count) in tally.injected_by_name().filter(|(_, count)| *count > 0) {
        let _ = writeln!(out, "<tr><td>injected: {name}</td><td class=\"value\">{count}</td></tr>");
    }
    for (name, count) in tally.noticed_by_name().filter(|(_, count)| *count > 0) {
        let _ = writeln!(out, "<tr><td>noticed: {name}</td><td class=\"value\">{count}</td></tr>");
    }
    out.push_str("</table></div>\n");
}

#[cfg(test)]
mod tests;
