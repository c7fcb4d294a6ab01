//! Progress of a training run: a bar on a terminal, plain lines elsewhere, and Ctrl-C.

use std::sync::OnceLock;
use std::sync::atomic::{AtomicBool, Ordering};

use firmware_sim::cli::output::Output;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};

use crate::run::{Alarm, Watch, Window};

/// Steps between plain lines where there is no terminal.
const LINE_STEPS: u64 = 1_000;
/// Steps between looks at the metrics on a terminal.
const GLANCE_STEPS: u64 = 20;

/// Shows a run's progress on stderr.
pub(super) struct Progress {
    bar: ProgressBar,
    label: String,
    output: Output,
}

impl Progress {
    /// Progress from `start` to `steps` under a label.
    pub(super) fn new(label: &str, start: u64, steps: u64, output: Output) -> Self {
        let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::stderr());
        // The template is a constant; were it malformed, indicatif's default bar is shown.
        if let Ok(style) = ProgressStyle::with_template("{prefix} {wide_bar} {percent:>3}% {eta:>4} {msg}") {
            bar.set_style(style.progress_chars("=> "));
        }
        bar.set_prefix(label.to_owned());
        bar.set_position(start);
        bar.reset_eta();
        Self { bar, label: label.to_owned(), output }
    }

    /// Takes the bar away.
    pub(super) fn finish(self) {
        self.bar.finish_and_clear();
    }
}

impl Watch for Progress {
    fn step(&mut self, step: u64, window: &Window) {
        let glance = || {
            let [cloning, reward, long_cost, lambda] = window.glance();
            format!("bc {cloning:.2} Qr {reward:.1} Qc {long_cost:.1} lam {lambda:.2}")
        };
        if self.bar.is_hidden() {
            if step.is_multiple_of(LINE_STEPS) {
                let percent = 100 * step / self.bar.length().unwrap_or(step).max(1);
                self.output.note(format_args!("{} step {step} ({percent} %) {}", self.label, glance()));
            }
        } else if step.is_multiple_of(GLANCE_STEPS) {
            self.bar.set_message(glance());
            self.bar.set_position(step);
        }
    }

    fn alarm(&mut self, alarm: &Alarm) {
        self.bar.suspend(|| self.output.note(format_args!("{} ALARM {alarm}", self.label)));
    }

    fn wants_stop(&self) -> bool {
        stop_flag().load(Ordering::Relaxed)
    }
}

/// Set by the first Ctrl-C; the handler is installed on first use.
fn stop_flag() -> &'static AtomicBool {
    static STOP: AtomicBool = AtomicBool::new(false);
    static HANDLER: OnceLock<()> = OnceLock::new();
    HANDLER.get_or_init(|| {
        // Without a handler Ctrl-C ends the process at once, and the last checkpoint is still whole.
        let _ = ctrlc::set_handler(|| {
            if STOP.swap(true, Ordering::Relaxed) {
                std::process::exit(130);
            }
        });
    });
    &STOP
}
