//! Where a task is flown: by a plant of this program, or by its simulator.

use std::error::Error;

use armor_core::image::PolicyImage;
use firmware_sim::cli::output::Output;
use firmware_sim::flight::{Flight, FlightPlan, fly_best_of};
use firmware_sim::simulator::{self, Environment};
use firmware_sim::task::{Task, World};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

/// Episodes between plain lines where there is no terminal.
const LINE_EPISODES: u32 = 10;

/// What flies a task.
pub(super) enum Flyer {
    /// A plant of this program.
    Native,
    /// Its simulator.
    Simulator(Environment),
}

impl Flyer {
    /// What flies `task`; installs the simulators if they are not there.
    pub(super) fn of(task: &Task, output: Output) -> Result<Self, Box<dyn Error>> {
        Ok(match task.world {
            World::Native => Self::Native,
            World::Simulator => Self::Simulator(Environment::open(&Environment::folder()?, |note| output.note(note))?),
        })
    }

    /// Flies a policy.
    pub(super) fn fly(
        &self,
        image: &PolicyImage<'_>,
        plan: &FlightPlan,
        best_of: u8,
        output: Output,
    ) -> Result<Flight, Box<dyn Error>> {
        let environment = match self {
            Self::Native => return Ok(fly_best_of(image, plan, best_of)?),
            Self::Simulator(_) if best_of > 1 => {
                return Err(
                    "in a simulator a policy flies its own action; take the best of several on a native task".into()
                );
            }
            Self::Simulator(environment) => environment,
        };
        let bar = ProgressBar::with_draw_target(Some(plan.episodes.into()), ProgressDrawTarget::stderr());
        // The template is a constant; were it malformed, indicatif's default bar is shown.
        if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {pos}/{len} episodes {eta:>4}") {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(plan.task.name);
        bar.tick();
        let flight = simulator::fly(image, plan, environment, |episodes| {
            bar.set_position(episodes.into());
            if bar.is_hidden() && (episodes.is_multiple_of(LINE_EPISODES) || episodes == plan.episodes) {
                output.note(format_args!("{} episode {episodes} of {}", plan.task.name, plan.episodes));
            }
        });
        bar.finish_and_clear();
        Ok(flight?)
    }
}
