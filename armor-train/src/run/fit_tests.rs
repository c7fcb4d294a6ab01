use super::*;
use crate::config::Preset;
use crate::critic::bootstrap::Bootstrap;
use crate::extraction::Extraction;
use crate::run::{ALARMS_FILE, COLUMNS, Cause, METRICS_FILE, SPEED_FILE, Table};
use crate::testing::recording;

/// Remembers the alarms, and stops after a number of steps.
struct Observer {
    stop_at: u64,
    step: u64,
    alarms: Vec<Cause>,
}

impl Observer {
    fn until(stop_at: u64) -> Self {
        Self { stop_at, step: 0, alarms: Vec::new() }
    }
}

impl Watch for Observer {
    fn step(&mut self, step: u64, _: &Window) {
        self.step = step;
    }

    fn alarm(&mut self, alarm: &Alarm) {
        self.alarms.push(alarm.cause);
    }

    fn wants_stop(&self) -> bool {
        self.step >= self.stop_at
    }
}

/// A run of 250 small steps.
fn config() -> Config {
    let mut config = Preset::Quick.config("test", 1.0);
    (config.hidden, config.trunk, config.head, config.dual_hidden) = (8, 8, 8, 8);
    (config.batch, config.steps, config.reweight_warmup, config.reweight_interval) = (16, 250, 40, 60);
    config
}

fn data() -> Dataset {
    recording(6, 5, |row| (row as f32).sin(), |row| f32::from(row % 3 == 0))
}

fn read(folder: &Path, name: &str) -> String {
    std::fs::read_to_string(folder.join(name)).unwrap()
}

#[test]
fn a_run_leaves_its_rows_its_speed_and_its_origin() {
    let folder = tempfile::tempdir().unwrap();
    let outcome = fit(&config(), &data(), folder.path(), false, &mut Observer::until(u64::MAX)).unwrap();
    assert_eq!(outcome, Outcome::Done);
    let metrics = Table::parse(&read(folder.path(), METRICS_FILE));
    assert!(metrics.names().eq(COLUMNS.iter().map(|column| column.name)));
    let rows = metrics.rows().unwrap();
    assert_eq!(rows.iter().map(|row| row[0]).collect::<Vec<_>>(), [100.0, 200.0]);
    let at = |name: &str| super::super::columns::value(&rows[1], name);
    assert!(at("q_reward_min") < at("q_reward") && at("q_reward") < at("q_reward_max"));
    assert!(at("weight_min") < at("weight_max"), "the weights were refreshed");
    assert!(at("gradient_critic") > 0.0 && at("gradient_dual") > 0.0 && at("lambda_kappa_0") > 0.0);
    let speed = Table::parse(&read(folder.path(), SPEED_FILE)).rows().unwrap();
    assert!(speed.len() == 2 && speed.iter().all(|row| row[1] > 0.0));
    let origin: Provenance = serde_json::from_str(&read(folder.path(), Provenance::FILE)).unwrap();
    assert_eq!((origin.data_sha256, origin.seed), ("05".repeat(32), config().seed));
    assert_eq!((origin.transitions, origin.trajectories, origin.max_kappa), (30, 6, 2.0));
    assert!((origin.cost_to_go.max - (1.0 + 0.99f64.powi(3))).abs() < 1e-12);
}

#[test]
fn a_resumed_run_writes_the_bits_of_one_never_stopped() {
    let (straight, stopped) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    fit(&config(), &data(), straight.path(), false, &mut Observer::until(u64::MAX)).unwrap();
    // Within a row, on a row's last step, and right before and after a refresh.
    for (part, stop_at) in [30, 40, 41, 100, 163].into_iter().enumerate() {
        let outcome = fit(&config(), &data(), stopped.path(), part > 0, &mut Observer::until(stop_at)).unwrap();
        assert_eq!(outcome, Outcome::Stopped(stop_at));
    }
    fit(&config(), &data(), stopped.path(), true, &mut Observer::until(u64::MAX)).unwrap();
    for name in [METRICS_FILE, ALARMS_FILE, Provenance::FILE, CONFIG_FILE, Checkpoint::FILE] {
        let bytes = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert!(bytes(straight.path()) == bytes(stopped.path()), "{name} differs");
    }
}

/// The last step of the critics, the first of the actor, and amid each phase.
#[test]
fn a_run_of_two_phases_resumes_with_the_same_bits() {
    let mut config = config();
    (config.bootstrap, config.extraction) = (Bootstrap::InSample, Extraction::Weighted);
    (config.critic_steps, config.critic_sees_kappa) = (120, false);
    let (straight, stopped) = (tempfile::tempdir().unwrap(), tempfile::tempdir().unwrap());
    fit(&config, &data(), straight.path(), false, &mut Observer::until(u64::MAX)).unwrap();
    for (part, stop_at) in [60, 119, 120, 121, 200].into_iter().enumerate() {
        let outcome = fit(&config, &data(), stopped.path(), part > 0, &mut Observer::until(stop_at)).unwrap();
        assert_eq!(outcome, Outcome::Stopped(stop_at));
    }
    fit(&config, &data(), stopped.path(), true, &mut Observer::until(u64::MAX)).unwrap();
    for name in [METRICS_FILE, ALARMS_FILE, Checkpoint::FILE] {
        let bytes = |folder: &Path| std::fs::read(folder.join(name)).unwrap();
        assert!(bytes(straight.path()) == bytes(stopped.path()), "{name} differs");
    }
    let rows = Table::parse(&read(straight.path(), METRICS_FILE)).rows().unwrap();
    let at = |row: usize, name: &str| super::super::columns::value(&rows[row], name);
    assert!(at(0, "value_loss_reward") > 0.0 && at(0, "cloning_loss") == 0.0 && at(0, "q_reward_max") != 0.0);
    assert!(at(1, "cloning_loss") > 0.0 && at(1, "advantage_weight_effective") > 0.0);
    assert!(at(1, "advantage_scale_cost") > 0.0 && at(0, "advantage_scale_cost") == 0.0);
    assert!(rows.iter().all(|row| super::super::columns::value(row, "lambda_kappa_0") == 0.0));
    assert!(!read(straight.path(), ALARMS_FILE).contains("lambda"));
}

/// A critic that starts with its own weights as targets and learns far too fast.
fn exploding() -> Config {
    let mut config = config();
    config.critic_rate = 0.3;
    config.target_rate = 1.0;
    config
}

#[test]
fn an_alarm_is_raised_once_and_a_resumed_run_remembers_it() {
    let folder = tempfile::tempdir().unwrap();
    let mut observer = Observer::until(150);
    fit(&exploding(), &data(), folder.path(), false, &mut observer).unwrap();
    assert!(observer.alarms.contains(&Cause::RewardCritic), "{:?}", observer.alarms);
    let before = read(folder.path(), ALARMS_FILE);
    assert_eq!(before.lines().count(), observer.alarms.len());
    let mut resumed = Observer::until(u64::MAX);
    fit(&exploding(), &data(), folder.path(), true, &mut resumed).unwrap();
    assert!(resumed.alarms.iter().all(|cause| !observer.alarms.contains(cause)));
    assert!(read(folder.path(), ALARMS_FILE).starts_with(&before));
}

#[test]
fn a_run_that_diverges_stops_names_the_column_and_keeps_its_checkpoint() {
    let folder = tempfile::tempdir().unwrap();
    let mut config = config();
    config.critic_rate = 1e30;
    let mut observer = Observer::until(u64::MAX);
    let error = fit(&config, &data(), folder.path(), false, &mut observer).unwrap_err();
    let RunError::Diverged { step, column } = error else { panic!("{error}") };
    assert!(step < 100 && COLUMNS.iter().any(|known| known.name == column));
    assert_eq!(observer.alarms, [Cause::NotFinite]);
    assert!(read(folder.path(), ALARMS_FILE).starts_with(&format!("step {step}: a loss is not finite: `{column}`")));
    let kept = Checkpoint::read(folder.path()).unwrap().state;
    assert!(kept.parameters.critic.iter().all(|weight| weight.is_finite()));
}

#[test]
fn a_spoiled_table_is_named_when_the_run_is_resumed() {
    let folder = tempfile::tempdir().unwrap();
    fit(&config(), &data(), folder.path(), false, &mut Observer::until(210)).unwrap();
    let good = read(folder.path(), METRICS_FILE);
    let resume = |text: &str| {
        std::fs::write(folder.path().join(METRICS_FILE), text).unwrap();
        fit(&config(), &data(), folder.path(), true, &mut Observer::until(u64::MAX)).unwrap_err()
    };
    let error = resume(&good.replace("\n200,", "\n200,x"));
    assert!(matches!(error, RunError::Row { line: 3, .. }), "{error}");
    let error = resume(&good.replace("q_reward_min", "q_reward_low"));
    assert!(matches!(error, RunError::Columns { .. }), "{error}");
}
