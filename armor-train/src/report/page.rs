//! The report's page.

use std::fmt::Write;

use firmware_sim::page::{self, escape, figure};

use super::charts::sections;
use super::folder::RunFolder;
use crate::config::options::{OPTIONS, plain};
use crate::run::COLUMNS;

/// The page of a run, complete in itself.
pub fn page(run: &RunFolder) -> String {
    let name = escape(&run.name);
    let mut out = page::head(&format!("{} - ARMOR run", run.name));
    header(run, &name, &mut out);
    for section in sections(run) {
        let _ = write!(out, "<h2>{}</h2>\n<div class=\"grid\">\n", section.title);
        section.charts.iter().for_each(|chart| figure(chart, &mut out));
        out.push_str("</div>\n");
    }
    last_row(run, &mut out);
    configuration(run, &mut out);
    provenance(run, &mut out);
    out.push_str(&page::foot(&format!(
        "Made by armor-train report {} from metrics.csv, speed.csv, alarms.log, config.toml and provenance.json.",
        env!("CARGO_PKG_VERSION")
    )));
    out
}

fn header(run: &RunFolder, name: &str, out: &mut String) {
    let config = &run.config;
    let _ = write!(
        out,
        "<h1>{name}</h1>\n<p class=\"soft\">{}, preset {}, cost limit {}, seed {}; {} of {} steps</p>\n",
        escape(&config.task),
        config.preset.name(),
        config.limit,
        config.seed,
        run.steps(),
        config.steps
    );
    if run.alarms.is_empty() {
        out.push_str("<p>No alarm was raised.</p>\n");
        return;
    }
    out.push_str("<ul class=\"alarms\">\n");
    for alarm in &run.alarms {
        let _ = writeln!(out, "<li>{}</li>", with_code(&escape(alarm)));
    }
    out.push_str("</ul>\n");
}

fn last_row(run: &RunFolder, out: &mut String) {
    table(out, "Last row of metrics.csv", &["column", "value", "unit", "meaning"]);
    for column in COLUMNS {
        let value = run.metrics.get(column.name).last().map_or(String::new(), |value| format!("{}", Short(*value)));
        row(out, false, &[column.name, &value, column.unit, column.meaning]);
    }
    out.push_str("</table></div>\n");
}

/// A number with six significant digits, or fewer if it needs no more.
struct Short(f64);

impl std::fmt::Display for Short {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let rounded: f64 = format!("{:.5e}", self.0).parse().unwrap_or(self.0);
        if rounded != 0.0 && !(1e-2..1e9).contains(&rounded.abs()) {
            write!(f, "{rounded:e}")
        } else {
            write!(f, "{rounded}")
        }
    }
}

fn configuration(run: &RunFolder, out: &mut String) {
    let title = "Configuration";
    table(out, title, &["option", "value", "preset", "meaning"]);
    let preset = run.config.preset.config(&run.config.task, run.config.limit);
    let (options, preset) = (run.config.options(), preset.options());
    for (key, meaning) in OPTIONS.iter().flat_map(|(_, entries)| *entries) {
        let value = options.get(*key).map(plain).unwrap_or_default();
        // The data belongs to the run and has no preset.
        let usual = if *key == "data" { value.clone() } else { preset.get(*key).map(plain).unwrap_or_default() };
        let changed = value != usual;
        row(out, changed, &[key, &value, if changed { &usual } else { "" }, &meaning.replace('`', "")]);
    }
    out.push_str("</table></div>\n");
}

fn provenance(run: &RunFolder, out: &mut String) {
    let origin = &run.provenance;
    let range = |to_go: &crate::data::ToGo| {
        let [min, p5, p50, p95, max] = [to_go.min, to_go.p5, to_go.p50, to_go.p95, to_go.max].map(Short);
        format!("{min} to {max}; 5, 50, 95 %: {p5}, {p50}, {p95}")
    };
    table(out, "Provenance", &["what", "value"]);
    for (what, value) in [
        ("armor-train", origin.version.clone()),
        ("data SHA-256", origin.data_sha256.clone()),
        ("data file", run.config.data.clone()),
        ("seed", origin.seed.to_string()),
        ("transitions", origin.transitions.to_string()),
        ("trajectories", origin.trajectories.to_string()),
        ("state, action entries", format!("{}, {}", origin.state_entries, origin.action_entries)),
        ("largest kappa", origin.max_kappa.to_string()),
        ("discounted reward to go, scaled", range(&origin.reward_to_go)),
        ("discounted cost to go, scaled", range(&origin.cost_to_go)),
    ] {
        row(out, false, &[what, &value]);
    }
    out.push_str("</table></div>\n");
}

fn table(out: &mut String, title: &str, heads: &[&str]) {
    let _ = write!(out, "<h2>{title}</h2>\n<div class=\"table\"><table>\n<tr>");
    heads.iter().for_each(|head| out.push_str(&format!("<th>{head}</th>")));
    out.push_str("</tr>\n");
}

/// A row whose second cell is a value.
fn row(out: &mut String, changed: bool, cells: &[&str]) {
    out.push_str(if changed { "<tr class=\"changed\">" } else { "<tr>" });
    for (place, cell) in cells.iter().enumerate() {
        let class = if place == 1 { " class=\"value\"" } else { "" };
        let _ = write!(out, "<td{class}>{}</td>", escape(cell));
    }
    out.push_str("</tr>\n");
}

/// Names in backticks as code.
fn with_code(text: &str) -> String {
    let parts = text.split('`').enumerate();
    parts.map(|(place, part)| if place % 2 == 1 { format!("<code>{part}</code>") } else { part.to_owned() }).collect()
}
