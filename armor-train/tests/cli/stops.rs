//! A run that is interrupted, killed at any moment or out of disk, and goes on.

use std::fs::File;
use std::io::{BufRead, BufReader, Read};
use std::process::{Child, ChildStderr};
use std::sync::mpsc;
use std::thread;
use std::time::Duration;

use armor_train::run::Checkpoint;

use super::*;

/// More steps than any of these runs will do: they end by a signal.
const ENDLESS: u64 = 1 << 40;

/// The weights are refreshed before, at and after the first checkpoint.
const REFRESHES: [&str; 4] = ["--set", "reweight_warmup=700", "--set", "reweight_interval=300"];

fn arguments(steps: u64, resume: bool) -> Vec<String> {
    let resume: &[&str] = if resume { &["--resume"] } else { &[] };
    toy("run", steps, &[&REFRESHES, resume].concat())
}

/// A run in progress; it is killed when it goes out of scope, so that no failed test leaves one behind.
struct Running {
    child: Child,
    stderr: Option<BufReader<ChildStderr>>,
}

impl Running {
    /// Starts a run, or goes on with it, and waits for two lines of progress:
    /// by the second, the steps up to the first are saved.
    fn start(bench: &Bench, resume: bool) -> Self {
        let mut command = bench.command(&arguments(ENDLESS, resume));
        let mut child = command.stdout(Stdio::piped()).stderr(Stdio::piped()).spawn().unwrap();
        let mut stderr = BufReader::new(child.stderr.take().unwrap());
        let lines = stderr.by_ref().lines().map_while(Result::ok);
        assert_eq!(lines.filter(|line| line.starts_with("training step ")).take(2).count(), 2, "it ended by itself");
        Self { child, stderr: Some(stderr) }
    }

    /// SIGKILL, as the kernel sends it when memory runs out.
    fn kill(mut self) {
        self.child.kill().unwrap();
        assert_eq!(self.child.wait().unwrap().code(), None, "it was killed");
    }

    /// SIGINT, as Ctrl-C sends it: exit code, stdout, and the rest of stderr.
    fn interrupt(mut self) -> (Option<i32>, String, String) {
        let signal = Command::new("sh").args(["-c", &format!("kill -INT {}", self.child.id())]).status().unwrap();
        assert!(signal.success());
        let [mut stdout, mut stderr] = [(); 2].map(|()| String::new());
        self.stderr.take().unwrap().read_to_string(&mut stderr).unwrap();
        self.child.stdout.take().unwrap().read_to_string(&mut stdout).unwrap();
        (self.child.wait().unwrap().code(), stdout, stderr)
    }
}

impl Drop for Running {
    fn drop(&mut self) {
        // Both fail where it has ended, and that is what is wanted.
        let _ = self.child.kill();
        let _ = self.child.wait();
    }
}

fn steps_done(bench: &Bench) -> u64 {
    Checkpoint::read(&bench.path("run")).unwrap().state.step
}

/// Goes on to `steps`; the folder then holds the bytes of a run that was never stopped.
#[track_caller]
fn ends_as_if_never_stopped(bench: &Bench, steps: u64) {
    bench.success(&arguments(steps, true));
    let straight = Bench::new();
    // The configuration holds the data's path.
    let data = bench.path("small.hdf5").display().to_string();
    straight.success(&fit([&data, "toy", "1"], "run", steps, &REFRESHES));
    for file in ["config.toml", "metrics.csv"] {
        assert_eq!(text(&bench.bytes(&format!("run/{file}"))), text(&straight.bytes(&format!("run/{file}"))));
    }
    assert!(bench.bytes("run/checkpoint.postcard") == straight.bytes("run/checkpoint.postcard"));
}

#[test]
fn an_interrupted_run_saves_says_how_to_go_on_and_ends_as_if_never_stopped() {
    let bench = Bench::new();
    let (code, stdout, stderr) = Running::start(&bench, false).interrupt();
    assert_eq!((code, stdout.as_str()), (Some(1), ""), "{stderr}");
    let steps = steps_done(&bench);
    assert!(steps >= 2000);
    let expected = format!("error: stopped and saved at step {steps}; the same command with --resume goes on");
    assert_eq!(stderr.lines().last(), Some(&*expected));
    ends_as_if_never_stopped(&bench, steps + 150);
}

/// Whenever it is, the last checkpoint is whole, and no more than 1000 steps are lost.
#[test]
fn a_run_that_is_killed_at_any_moment_ends_as_if_never_stopped() {
    let bench = Bench::new();
    let mut done = 0;
    for (round, pause) in [0, 37, 74, 5, 111, 19, 53].into_iter().enumerate() {
        let running = Running::start(&bench, round > 0);
        thread::sleep(Duration::from_millis(pause));
        running.kill();
        let steps = steps_done(&bench);
        assert!(steps > done && steps.is_multiple_of(1000), "{steps} after {done}");
        done = steps;
    }
    ends_as_if_never_stopped(&bench, done + 150);
}

/// A file is written aside and renamed; the kill falls while it lies there half done.
#[test]
fn a_run_that_is_killed_while_it_writes_ends_as_if_never_stopped() {
    let bench = Bench::new();
    let mut running = Running::start(&bench, false);
    // Progress is read, so that the run never waits for its reader, and that one that writes in place is found out.
    let stderr = running.stderr.take().unwrap();
    let (sender, progress) = mpsc::channel();
    thread::spawn(move || stderr.lines().map_while(Result::ok).try_for_each(|line| sender.send(line)));
    let mut lines = 0;
    while !bench.names("run").iter().any(|name| name.ends_with(".part")) {
        lines += progress.try_iter().count();
        assert!(lines < 50, "in 50 checkpoints no file was seen aside");
    }
    running.kill();

    let steps = steps_done(&bench);
    assert!(steps.is_multiple_of(1000), "{steps}");
    ends_as_if_never_stopped(&bench, steps + 150);
    assert!(!bench.names("run").iter().any(|name| name.ends_with(".part")), "what was half written is gone");
}

/// Whoever has a file open keeps the old one whole: it is replaced, and never written in place.
#[test]
fn a_reader_of_a_runs_files_never_sees_a_part_of_one() {
    let bench = Bench::new();
    bench.success(&toy("run", 2, &[]));
    let files = ["config.toml", "metrics.csv", "checkpoint.postcard"].map(|name| bench.path("run").join(name));
    let mut open = files.each_ref().map(|path| File::open(path).unwrap());
    let before = files.each_ref().map(|path| fs::read(path).unwrap());
    bench.success(&toy("run", 102, &["--resume"]));
    for ((path, open), before) in files.iter().zip(&mut open).zip(before) {
        let mut still = Vec::new();
        open.read_to_end(&mut still).unwrap();
        assert!(still == before, "{} was written in place", path.display());
        assert!(fs::read(path).unwrap() != before, "{} was not written", path.display());
    }
}

/// A limit on the size of files stands for a disk that fills up: the write fails half way.
#[test]
fn a_run_on_a_full_disk_says_so_and_its_last_checkpoint_goes_on() {
    let bench = Bench::new();
    bench.success(&arguments(700, false));
    let before = bench.bytes("run/checkpoint.postcard");

    // In blocks of 512 bytes, fewer than the checkpoint has; all other files of the run are smaller.
    let blocks = (before.len() - 1) / 512;
    let limited = "trap '' XFSZ; ulimit -f \"$0\"; exec \"$@\"";
    let run = bench.command(&arguments(900, true));
    let mut command = Command::new("sh");
    command.current_dir(bench.folder.path()).args(["-c", limited, &blocks.to_string()]);
    let message = error(&command.arg(run.get_program()).args(run.get_args()).output().unwrap());

    assert!(message.starts_with("error: cannot write run/checkpoint.postcard: File too large"), "{message}");
    assert!(bench.bytes("run/checkpoint.postcard") == before);
    assert!(!bench.names("run").iter().any(|name| name.ends_with(".part")));
    ends_as_if_never_stopped(&bench, 900);
}
