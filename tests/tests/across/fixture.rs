//! What the modules share: recorded data, small configurations, run folders, an exported policy.

use std::fs;
use std::path::{Path, PathBuf};
use std::sync::OnceLock;

use armor_core::noise::Noise;
use armor_train::config::{Config, Preset};
use armor_train::data::{Dataset, Recording};
use armor_train::export::{Exported, export};
use armor_train::run::{Checkpoint, Outcome, Watch, Window, fit};
use tempfile::TempDir;

/// Networks small enough for a test; widths all differ, so that no two can be taken for each other.
const SMALL: [&str; 10] = [
    "batch=32",
    "hidden=12",
    "kappa_hidden=5",
    "kappa_embedding=3",
    "time_code=4",
    "time_hidden=6",
    "time_embedding=7",
    "trunk=10",
    "head=9",
    "dual_hidden=8",
];

/// The recording that ships with the project.
pub(crate) fn shipped() -> &'static Dataset {
    static DATA: OnceLock<Dataset> = OnceLock::new();
    DATA.get_or_init(|| {
        let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("../data/ball-run-bullet.hdf5");
        Dataset::read(&path).unwrap()
    })
}

/// Twelve made-up episodes of 50 steps in the sizes of `ball-run`, where a
/// refresh of the weights takes no time. The first cost nothing, the last 22.
pub(crate) fn made_up() -> Dataset {
    let (episodes, horizon, noise) = (12, 50, Noise::new(1));
    let state = |at: usize| -> [f32; 7] {
        let mut state = [0.0; 7];
        noise.fill_normal(0, at as u64, &mut state);
        state
    };
    let mut recording = Recording { state_dim: 7, action_dim: 2, sha256: [9; 32], ..Recording::default() };
    for episode in 0..episodes {
        for step in 0..horizon {
            let at = (horizon + 1) * episode + step;
            recording.observations.extend(state(at));
            recording.next_observations.extend(state(at + 1));
            let mut action = [0.0; 2];
            noise.fill_normal(1, at as u64, &mut action);
            recording.actions.extend(action.map(|value| value.clamp(-1.0, 1.0)));
            recording.rewards.push(state(at)[0] + action[0]);
            recording.costs.push(if step < 2 * episode { 1.0 } else { 0.0 });
            recording.terminals.push(step + 1 == horizon && episode % 2 == 0);
            recording.timeouts.push(step + 1 == horizon && episode % 2 == 1);
        }
    }
    Dataset::new(recording).unwrap()
}

/// The `paper` preset with small networks, and more options.
pub(crate) fn config(options: &[&str]) -> Config {
    let mut config = Preset::Paper.config("ball-run", LIMIT.into());
    for option in SMALL.iter().chain(options) {
        config.set(option).unwrap();
    }
    config
}

/// The folder of a run.
pub(crate) struct Run(TempDir);

/// All that a run leaves behind, byte by byte.
#[derive(PartialEq, Eq)]
pub(crate) struct Files {
    pub(crate) config: String,
    pub(crate) metrics: String,
    pub(crate) checkpoint: Vec<u8>,
}

impl Run {
    pub(crate) fn new() -> Self {
        Self(tempfile::tempdir().unwrap())
    }

    pub(crate) fn path(&self, name: &str) -> PathBuf {
        self.0.path().join(name)
    }

    /// Trains until the end, or until `stop` steps are done; goes on if there is a checkpoint.
    pub(crate) fn fit(&self, config: &Config, data: &Dataset, stop: Option<u64>) -> Outcome {
        let resume = self.path(Checkpoint::FILE).exists();
        fit(config, data, self.0.path(), resume, &mut Stop { at: stop, done: 0 }).unwrap()
    }

    pub(crate) fn checkpoint(&self) -> Checkpoint {
        Checkpoint::read(self.0.path()).unwrap()
    }

    pub(crate) fn files(&self) -> Files {
        Files {
            config: fs::read_to_string(self.path("config.toml")).unwrap(),
            metrics: fs::read_to_string(self.path("metrics.csv")).unwrap(),
            checkpoint: fs::read(self.path(Checkpoint::FILE)).unwrap(),
        }
    }
}

/// Asks for a stop after a number of steps, as Ctrl-C would.
struct Stop {
    at: Option<u64>,
    done: u64,
}

impl Watch for Stop {
    fn step(&mut self, step: u64, _: &Window) {
        self.done = step;
    }

    fn wants_stop(&self) -> bool {
        self.at == Some(self.done)
    }
}

/// Cost limit, seed and training steps of [`policy`].
pub(crate) const LIMIT: f32 = 5.0;
pub(crate) const SEED: u64 = 3;
pub(crate) const STEPS: u64 = 400;

/// A policy that was trained and exported.
pub(crate) struct Policy {
    pub(crate) checkpoint: Checkpoint,
    pub(crate) exported: Exported,
}

/// A policy of the shipped recording, cloned for long enough to move and to
/// incur costs. States are normalised, so that the image's normaliser has work to do.
pub(crate) fn policy() -> &'static Policy {
    static POLICY: OnceLock<Policy> = OnceLock::new();
    POLICY.get_or_init(|| {
        let mut config = config(&["normalize_states=true", "actor_rate=0.01", "eta=0.01"]);
        (config.seed, config.steps) = (SEED, STEPS);
        let run = Run::new();
        assert_eq!(run.fit(&config, shipped(), None), Outcome::Done);
        let checkpoint = run.checkpoint();
        let exported = export(&checkpoint, shipped(), None).unwrap();
        Policy { checkpoint, exported }
    })
}
