//! `firmware-sim soak`

use std::fmt;
use std::path::PathBuf;
use std::time::{Duration, Instant};

use serde::Serialize;

use super::output::{CommandResult, Output};
use super::subject::Subject;
use crate::harness::soak::{Breach, SoakPlan, Soaked, soak};
use crate::image_file::ImageFile;

/// Shares at which progress is told.
const NOTES: u32 = 10;

/// Fly an image for virtual hours, under faults drawn anew for each episode.
///
/// Fails if an action out of range comes to the actuators, or a budget is
/// larger than it may be. Tells how worn the budget's journal would be in a year.
#[derive(Debug, clap::Args)]
pub(super) struct Soak {
    #[command(flatten)]
    subject: Subject,
    /// Virtual hours to fly.
    #[arg(long, default_value_t = 8.0, value_parser = hours)]
    hours: f64,
    /// Decides starts, noise and faults.
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// Inject nothing: what a year of quiet flight wears.
    #[arg(long)]
    no_faults: bool,
    /// Where an error is found, write the chip as it was before that episode to
    /// this file, so that the episode can be flown alone.
    #[arg(short, long, value_name = "CHIP")]
    output: Option<PathBuf>,
}

#[derive(Serialize)]
struct Report {
    task: &'static str,
    board: &'static str,
    rate_hz: u32,
    cost_limit: f32,
    seed: u64,
    #[serde(skip)]
    max_steps: usize,
    chip: Option<PathBuf>,
    #[serde(flatten)]
    soaked: Soaked,
    seconds: f64,
}

fn hours(text: &str) -> Result<f64, &'static str> {
    // A year, for what takes longer will not be waited for.
    text.parse().ok().filter(|hours| *hours > 0.0 && *hours <= 8766.0).ok_or("give hours, above 0 and at most 8766")
}

impl Soak {
    pub(super) fn run(self, output: Output) -> CommandResult {
        let file = ImageFile::read(&self.subject.image)?;
        let image = file.image()?;
        let plan = self.subject.plan(self.seed, 1)?;
        let soak_plan = SoakPlan {
            image: image.bytes(),
            plan,
            board: self.subject.board,
            time: Duration::from_secs_f64(3600.0 * self.hours),
            with_faults: !self.no_faults,
        };
        let started = Instant::now();
        let mut told = 0;
        let soaked = soak(&soak_plan, &mut |share| {
            let tenths = (share * f64::from(NOTES)) as u32;
            if tenths > told {
                told = tenths;
                output.note(format_args!("{:>3} %, {:.0} s", 100 * told / NOTES, started.elapsed().as_secs_f64()));
            }
        })?;
        let report = Report {
            task: plan.task.name,
            board: self.subject.board_name(),
            rate_hz: plan.rate_hz,
            cost_limit: plan.limit.cost().to_f32(),
            seed: self.seed,
            max_steps: plan.max_steps,
            chip: self.output.clone(),
            seconds: started.elapsed().as_secs_f64(),
            soaked,
        };
        output.report(&report)?;
        if let (Some(path), Some(chip)) = (&self.output, &report.soaked.breached) {
            chip.write(path)?;
        }
        let tally = &report.soaked.tally;
        super::unbroken(tally.actions_out_of_range, tally.budget_errors)
    }
}

impl Report {
    /// The command that flies an episode alone, in lines of a shell.
    fn command(&self, breach: &Breach) -> String {
        let chip = self.chip.as_ref().map_or_else(|| "CHIP".into(), |path| path.display().to_string());
        let mut text = format!("firmware-sim run --chip {chip} --task {} --board {}", self.task, self.board);
        let mut add = |words: &str| text.push_str(&format!(" \\\n    {words}"));
        let steps =
            if self.max_steps == usize::MAX { String::new() } else { format!("--max-steps {} ", self.max_steps) };
        let (limit, seed, episode) = (self.cost_limit, self.seed, breach.episode);
        add(&format!("{steps}--limit {limit} --seed {seed} --first {episode} --episodes 1 -o error.html"));
        for pair in breach.faults.chunks(2) {
            let words: Vec<_> = pair.iter().map(|fault| format!("--fault {fault}")).collect();
            add(&words.join(" "));
        }
        text
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let Self { soaked, .. } = self;
        writeln!(
            f,
            "{} on {} at {} Hz, cost limit {}, seed {}",
            self.task, self.board, self.rate_hz, self.cost_limit, self.seed
        )?;
        writeln!(f, "virtual time        {:>10.2} hours, {} control steps", soaked.hours, soaked.tally.steps)?;
        writeln!(f, "episodes in limit   {:>10} of {}", soaked.safe_episodes, soaked.episodes)?;
        writeln!(f, "chips flashed anew  {:>10}", soaked.dead_chips)?;
        let (erases, year) = (soaked.journal_erases, soaked.journal_erases_per_year);
        writeln!(f, "journal             {erases:>10.1} erases of a block, {year:.0} in a year")?;
        writeln!(f, "{}", soaked.tally)?;
        write!(f, "took                {:>10.1} s", self.seconds)?;
        for breach in &soaked.breaches {
            let Breach { episode, budget_errors, actions_out_of_range, .. } = breach;
            write!(
                f,
                "\nepisode {episode}: {budget_errors} budget errors, {actions_out_of_range} actions out of range"
            )?;
        }
        match soaked.breaches.first() {
            None => Ok(()),
            Some(first) => {
                let keep = if self.chip.is_none() { " (soak with -o CHIP to keep its chip)" } else { "" };
                write!(f, "\n\nThe first of these alone{keep}:\n{}", self.command(first))
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Were an error ever found: its episode, and the command that flies it alone, in 80 columns.
    #[test]
    fn an_error_tells_how_to_see_it_alone() {
        let faults = ["sensor-infinity=0.2", "cost-negative=0.01", "brown-out"].map(|fault| fault.parse().unwrap());
        let breach = Breach { episode: 2519, faults: faults.into(), budget_errors: 1, actions_out_of_range: 0 };
        let report = Report {
            task: "point-circle",
            board: "stm32h743",
            rate_hz: 50,
            cost_limit: 20.0,
            seed: 7,
            max_steps: 1,
            chip: Some("error.chip".into()),
            soaked: Soaked { breaches: vec![breach], ..Soaked::default() },
            seconds: 1.0,
        };
        let text = report.to_string();
        assert!(text.contains("\nepisode 2519: 1 budget errors, 0 actions out of range\n"), "{text}");
        let command = "firmware-sim run --chip error.chip --task point-circle --board stm32h743 \\\n    \
                       --max-steps 1 --limit 20 --seed 7 --first 2519 --episodes 1 -o error.html \\\n    \
                       --fault sensor-infinity=0.2 --fault cost-negative=0.01 \\\n    --fault brown-out=0.005";
        assert!(text.ends_with(command), "{text}");
        assert!(text.lines().all(|line| line.len() <= 80), "{text}");
    }
}
