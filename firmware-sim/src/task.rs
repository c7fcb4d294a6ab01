//! The tasks of the paper: sizes, horizons, control rates, and what scores are
//! normalised by.
//!
//! Returns, horizons and cost limits are those of the paper's benchmark (DSRL,
//! `dsrl/infos.py`; limits from section 4.3 of the paper: Bullet 5, velocity
//! 10, navigation 20). Rates follow from the simulators' time steps:
//! Bullet-Safety-Gym `envs/builder.py` (run 4/120 s, drone 2/120 s), Gymnasium
//! `mujoco/*_v4.py` (ant and half-cheetah 0.05 s, walker 0.008 s),
//! Safety-Gymnasium 10 sub-steps of `xmls/point.xml` (0.002 s) or `car.xml` (0.004 s).

use serde::Serialize;
use thiserror::Error;

use crate::plant::{BallCircle, BallRun, Plant, PointCircle, PointGoal};

/// A task and its protocol.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Task {
    /// Its name on the command line and in images.
    pub name: &'static str,
    /// Who runs it.
    pub world: World,
    /// Entries of the state.
    pub state: usize,
    /// Entries of the action; each lies within -1 and 1.
    pub action: usize,
    /// Control steps of an episode.
    pub horizon: usize,
    /// Smallest return of the benchmark's data, `R_min` of Eq. 17.
    pub reward_min: f64,
    /// Largest return of the benchmark's data, `R_max` of Eq. 17.
    pub reward_max: f64,
    /// The paper's cost limit, `d` of Eq. 1.
    pub cost_limit: f32,
    /// Control steps a second.
    pub rate_hz: u32,
}

/// Who runs a task.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum World {
    /// A plant of this crate.
    Native,
    /// Bullet-Safety-Gym or Safety-Gymnasium.
    Simulator,
}

/// Why a task cannot be named or flown.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum TaskError {
    /// No task has the name.
    #[error("no task is called {name}; the tasks are {}", names())]
    Unknown {
        /// The name.
        name: String,
    },
    /// The task belongs to a simulator.
    #[error("{task} needs its simulator: fly it by armor-train evaluate; native tasks are {}", native_names())]
    NotNative {
        /// The task.
        task: &'static str,
    },
}

/// Every task, native ones first; the last is not the paper's, but what `ball-circle` stands for.
pub const TASKS: [Task; 19] = [
    native("ball-run", [7, 2, 100], [26.339754, 1327.44556], 5.0, 30),
    native("ball-circle", [8, 2, 200], [0.38312, 881.46338], 5.0, 10),
    native("point-circle", [28, 2, 500], [20.067627, 61.728195], 20.0, 50),
    native("point-goal", [60, 2, 1000], [0.0119601, 30.071115], 20.0, 50),
    simulated("SafetyAntRun-v0", [33, 8, 200], [0.0017674, 955.48187], 5.0, 30),
    simulated("SafetyBallRun-v0", [7, 2, 100], [26.339754, 1327.44556], 5.0, 30),
    simulated("SafetyDroneRun-v0", [17, 4, 200], [10.557030, 682.83301], 5.0, 60),
    simulated("SafetyAntVelocity-v1", [27, 8, 1000], [6.1519012, 2976.27661], 10.0, 20),
    simulated("SafetyWalker2dVelocity-v1", [17, 6, 1000], [18.668499, 3418.22388], 10.0, 125),
    simulated("SafetyHalfCheetahVelocity-v1", [17, 6, 1000], [5.7509766, 2806.93311], 10.0, 20),
    simulated("SafetyPointCircle1-v0", [28, 2, 500], [20.067627, 61.728195], 20.0, 50),
    simulated("SafetyPointGoal1-v0", [60, 2, 1000], [0.0119601, 30.071115], 20.0, 50),
    simulated("SafetyPointPush1-v0", [76, 2, 1000], [0.0014002, 16.518654], 20.0, 50),
    simulated("SafetyPointButton1-v0", [76, 2, 1000], [0.0088221, 41.193016], 20.0, 50),
    simulated("SafetyCarCircle1-v0", [40, 2, 500], [8.0370731, 24.941555], 20.0, 25),
    simulated("SafetyCarGoal1-v0", [72, 2, 1000], [0.0122328, 39.907809], 20.0, 25),
    simulated("SafetyCarPush1-v0", [88, 2, 1000], [0.0137002, 16.304468], 20.0, 25),
    simulated("SafetyCarButton1-v0", [88, 2, 1000], [0.0028926, 44.420003], 20.0, 25),
    simulated("SafetyBallCircle-v0", [8, 2, 200], [0.38312, 881.46338], 5.0, 10),
];

/// Native tasks, and the simulators' tasks that they stand for.
const STANDS_FOR: [(&str, &str); 4] = [
    ("ball-run", "SafetyBallRun-v0"),
    ("ball-circle", "SafetyBallCircle-v0"),
    ("point-circle", "SafetyPointCircle1-v0"),
    ("point-goal", "SafetyPointGoal1-v0"),
];

const fn simulated(name: &'static str, size: [usize; 3], returns: [f64; 2], cost_limit: f32, rate_hz: u32) -> Task {
    let [state, action, horizon] = size;
    let [reward_min, reward_max] = returns;
    Task { name, world: World::Simulator, state, action, horizon, reward_min, reward_max, cost_limit, rate_hz }
}

const fn native(name: &'static str, size: [usize; 3], returns: [f64; 2], cost_limit: f32, rate_hz: u32) -> Task {
    Task { world: World::Native, ..simulated(name, size, returns, cost_limit, rate_hz) }
}

impl Task {
    /// The task of a name.
    ///
    /// # Errors
    /// [`TaskError::Unknown`]
    pub fn named(name: &str) -> Result<&'static Self, TaskError> {
        TASKS.iter().find(|task| task.name == name).ok_or_else(|| TaskError::Unknown { name: name.into() })
    }

    /// The task's plant.
    ///
    /// # Errors
    /// [`TaskError::NotNative`]
    pub fn plant(&self) -> Result<Box<dyn Plant>, TaskError> {
        match self.name {
            "ball-run" => Ok(Box::new(BallRun::default())),
            "ball-circle" => Ok(Box::new(BallCircle::default())),
            "point-circle" => Ok(Box::new(PointCircle::default())),
            "point-goal" => Ok(Box::new(PointGoal::default())),
            task => Err(TaskError::NotNative { task }),
        }
    }

    /// Whether a policy that was trained for the task `trained` flies this one:
    /// it is the same, or a native task and the simulator's that it stands for.
    pub fn flies(&self, trained: &str) -> bool {
        let pair = |native: &str, simulator| STANDS_FOR.contains(&(native, simulator));
        self.name == trained || pair(self.name, trained) || pair(trained, self.name)
    }

    /// Whether an episode can succeed: a goal to reach, a box to push, a button to press.
    pub fn has_goal(&self) -> bool {
        ["goal", "Goal", "Push", "Button"].iter().any(|word| self.name.contains(word))
    }

    /// Eq. 17 for a reward return: 0 at [`Task::reward_min`], 1 at [`Task::reward_max`].
    pub fn reward_normalized(&self, reward: f64) -> f64 {
        (reward - self.reward_min) / (self.reward_max - self.reward_min)
    }
}

/// Eq. 17 for a cost return and the limit `d`: 1 at the limit.
///
/// Where `d` is 0, 1 is added to both sides, as the benchmark does (DSRL,
/// `offline_env.py`, `get_normalized_score`).
pub fn cost_normalized(cost: f64, limit: f64) -> f64 {
    if limit == 0.0 { cost + 1.0 } else { cost / limit }
}

fn names() -> String {
    TASKS.map(|task| task.name).join(", ")
}

fn native_names() -> String {
    let native = TASKS.iter().filter(|task| task.world == World::Native).map(|task| task.name);
    native.collect::<Vec<_>>().join(", ")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_native_task_has_a_plant_of_its_size_and_no_other_has_one() {
        for task in &TASKS {
            match task.plant() {
                Ok(plant) => {
                    assert_eq!(task.world, World::Native, "{}", task.name);
                    assert_eq!((plant.state_dim(), plant.action_dim()), (task.state, task.action));
                }
                Err(error) => {
                    assert_eq!(error, TaskError::NotNative { task: task.name });
                    assert_eq!(task.world, World::Simulator, "{}", task.name);
                }
            }
        }
    }

    #[test]
    fn a_native_task_has_the_protocol_of_its_simulator_and_flies_its_policies() {
        for (native, simulator) in STANDS_FOR.map(|(a, b)| (Task::named(a).unwrap(), Task::named(b).unwrap())) {
            assert_eq!(Task { name: native.name, world: native.world, ..*simulator }, *native);
            assert!(native.flies(simulator.name) && simulator.flies(native.name) && native.flies(native.name));
        }
        assert!(!Task::named("ball-run").unwrap().flies("ball-circle"));
    }

    /// The Python package's table.
    #[test]
    fn the_plants_table_is_this_one() {
        let table: Vec<serde_json::Value> =
            serde_json::from_str(include_str!("../python/src/armor_plant/tasks.json")).unwrap();
        let simulated = TASKS.iter().filter(|task| task.world == World::Simulator);
        let mut expected: Vec<_> = simulated.map(|task| serde_json::to_value(task).unwrap()).collect();
        for row in &mut expected {
            row.as_object_mut().unwrap().remove("world");
        }
        assert_eq!(table, expected);
    }

    #[test]
    fn names_are_distinct_and_an_unknown_one_is_answered_with_the_list() {
        for task in &TASKS {
            assert_eq!(Task::named(task.name), Ok(task));
        }
        let error = Task::named("ball-jump").unwrap_err().to_string();
        assert!(error.contains("ball-jump") && error.contains("SafetyCarButton1-v0"), "{error}");
    }

    /// The ceiling of ball-run, by hand: (468.0 - 26.339754) / (1327.44556 - 26.339754).
    #[test]
    fn scores_are_normalised_by_eq_17() {
        let task = Task::named("ball-run").unwrap();
        assert!((task.reward_normalized(468.0) - 0.339_450).abs() < 1e-6);
        assert_eq!((task.reward_normalized(task.reward_min), task.reward_normalized(task.reward_max)), (0.0, 1.0));
        assert_eq!((cost_normalized(4.0, 5.0), cost_normalized(0.0, 0.0), cost_normalized(2.0, 0.0)), (0.8, 1.0, 3.0));
    }
}
