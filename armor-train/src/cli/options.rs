//! `armor-train options`

use std::fmt;

use firmware_sim::cli::output::{CommandResult, Output};
use serde::Serialize;

use crate::config::options::{OPTIONS, listing};

/// List every option of `fit --set`: its meaning, and its value in each preset.
#[derive(Debug, clap::Args)]
pub(super) struct Options {}

#[derive(Serialize)]
struct Listing {
    options: Vec<Entry>,
}

#[derive(Serialize)]
struct Entry {
    key: &'static str,
    meaning: &'static str,
}

impl Options {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let entries = OPTIONS.iter().flat_map(|(_, entries)| *entries);
        output.report(&Listing { options: entries.map(|&(key, meaning)| Entry { key, meaning }).collect() })
    }
}

impl fmt::Display for Listing {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(&listing())
    }
}
