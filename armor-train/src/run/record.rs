//! What a run writes down as it goes.

use std::path::Path;
use std::time::Instant;

use firmware_sim::file;

use super::alarm::Alarms;
use super::columns::{COLUMNS, SPEED_COLUMNS};
use super::metrics::Snapshot;
use super::provenance::Provenance;
use super::{RunError, Table, Watch, Window};
use crate::config::Config;
use crate::data::Dataset;
use crate::learner::Learner;
use crate::reweight::WeightSummary;

/// Rows of metrics, one every 100 steps.
pub const METRICS_FILE: &str = "metrics.csv";
/// Steps per second, which differ from run to run and are kept apart.
pub const SPEED_FILE: &str = "speed.csv";
/// Alarms, one a line.
pub const ALARMS_FILE: &str = "alarms.log";

/// The tables of a run.
pub(super) struct Record {
    metrics: Table,
    speed: Table,
    alarms: Alarms,
    kappas: [f64; 4],
    refreshes: u64,
    weights: WeightSummary,
    since: (Instant, u64),
}

impl Record {
    /// An empty record of a run that starts, or goes on, with `learner`.
    pub(super) fn new(config: &Config, data: &Dataset, provenance: &Provenance, learner: &Learner<'_, f32>) -> Self {
        let (limit, max) = (config.limit, f64::from(data.max_kappa()));
        Self {
            metrics: Table::new(COLUMNS.iter().map(|column| column.name)),
            speed: Table::new(SPEED_COLUMNS.iter().map(|(name, ..)| *name)),
            alarms: Alarms::new(config, provenance),
            kappas: [0.0, limit / 2.0, limit, max],
            refreshes: learner.refreshes(),
            weights: WeightSummary::new(learner.weights()),
            since: (Instant::now(), learner.state().step),
        }
    }

    /// Takes up the tables in `folder`, up to the step of the last checkpoint.
    pub(super) fn take_up(&mut self, folder: &Path) -> Result<(), RunError> {
        let (_, step) = self.since;
        for (name, table) in [(METRICS_FILE, &mut self.metrics), (SPEED_FILE, &mut self.speed)] {
            let path = folder.join(name);
            if path.exists() {
                let mut earlier = Table::parse(&String::from_utf8_lossy(&file::read(&path)?));
                if !earlier.names().eq(table.names()) {
                    return Err(RunError::Columns { path });
                }
                earlier.keep_until(step);
                *table = earlier;
            }
        }
        let rows = self.metrics.rows().map_err(|line| RunError::Row { path: folder.join(METRICS_FILE), line })?;
        for row in rows {
            self.alarms.look(&row);
        }
        Ok(())
    }

    /// Adds the row that `window` filled, and empties the window.
    pub(super) fn row(&mut self, learner: &Learner<'_, f32>, window: &mut Window, watch: &mut dyn Watch) {
        if self.refreshes != learner.refreshes() {
            self.refreshes = learner.refreshes();
            self.weights = WeightSummary::new(learner.weights());
        }
        let step = learner.state().step;
        let advantages = learner.advantages();
        let snapshot = Snapshot {
            // A dual that is never trained has nothing to say.
            lambda_by_kappa: if learner.trains_dual() { learner.lambda(self.kappas) } else { [0.0; 4] },
            weights: self.weights,
            advantage_scales: advantages.map_or([0.0; 2], |advantages| advantages.scales),
        };
        let row = window.take_row(step, &snapshot).values();
        self.metrics.push(&row);
        self.alarms.look(&row).iter().for_each(|alarm| watch.alarm(alarm));
        let (clock, before) = self.since;
        self.speed.push(&[step as f64, (step - before) as f64 / clock.elapsed().as_secs_f64()]);
        self.since = (Instant::now(), step);
    }

    /// Notes that a column is not finite.
    pub(super) fn not_finite(&mut self, step: u64, column: &str, watch: &mut dyn Watch) {
        if let Some(alarm) = self.alarms.not_finite(step, column) {
            watch.alarm(alarm);
        }
    }

    /// Writes all tables, each whole or not at all.
    pub(super) fn write(&self, folder: &Path) -> Result<(), RunError> {
        let files =
            [(METRICS_FILE, self.metrics.text()), (SPEED_FILE, self.speed.text()), (ALARMS_FILE, self.alarms.text())];
        for (name, text) in files {
            file::write(&folder.join(name), text.as_bytes())?;
        }
        Ok(())
    }
}
