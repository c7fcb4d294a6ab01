//! How a command speaks: results on stdout, prose on stderr, an exit code.
//!
//! With `--json`, stdout carries one JSON object on its last line and nothing
//! else, and the text for people goes to stderr. A failure is one line on
//! stderr that starts with `error: `, and exit code 1; bad usage is code 2 and
//! clap's business. That nobody listens any more (a broken pipe) is no failure
//! and no panic.

use std::error::Error;
use std::fmt::Display;
use std::io::{self, ErrorKind, Write};
use std::process::ExitCode;

use serde::Serialize;

/// The end of a command: any error with a message for the user.
pub type CommandResult = Result<(), Box<dyn Error>>;

/// Where a command's words go.
#[derive(Clone, Copy, Debug)]
pub struct Output {
    json: bool,
}

impl Output {
    /// Output for people, or for programs with `json`.
    pub const fn new(json: bool) -> Self {
        Self { json }
    }

    /// Writes a line of prose or progress to stderr.
    pub fn note(&self, text: impl Display) {
        // Where stderr is closed there is no one to tell.
        let _ = writeln!(io::stderr(), "{text}");
    }

    /// Writes the result of a command: its text to stdout or, with `--json`,
    /// its text to stderr and its JSON to stdout.
    ///
    /// # Errors
    /// Where stdout is there but cannot be written, such as a full disk.
    pub fn report(&self, report: &(impl Serialize + Display)) -> CommandResult {
        if self.json {
            self.note(report);
            write_line(&mut io::stdout(), &serde_json::to_string(report)?)
        } else {
            write_line(&mut io::stdout(), report)
        }
    }
}

fn write_line(out: &mut impl Write, text: impl Display) -> CommandResult {
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(format!("cannot write the result: {error}").into()),
        _ => Ok(()),
    }
}

/// Ends a command: its failure goes to stderr in one line.
pub fn exit(result: CommandResult) -> ExitCode {
    match result {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            let _ = writeln!(io::stderr(), "error: {}", one_line(&error.to_string()));
            ExitCode::FAILURE
        }
    }
}

fn one_line(message: &str) -> String {
    message.split_whitespace().collect::<Vec<_>>().join(" ")
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Fails every write with one kind of error.
    struct Closed(ErrorKind);

    impl Write for Closed {
        fn write(&mut self, _: &[u8]) -> io::Result<usize> {
            Err(self.0.into())
        }

        fn flush(&mut self) -> io::Result<()> {
            Err(self.0.into())
        }
    }

    #[test]
    fn a_reader_that_left_is_no_failure_but_a_full_disk_is() {
        assert!(write_line(&mut Closed(ErrorKind::BrokenPipe), "x").is_ok());
        let error = write_line(&mut Closed(ErrorKind::StorageFull), "x").unwrap_err();
        assert!(error.to_string().starts_with("cannot write the result: "), "{error}");
    }

    #[test]
    fn a_failure_is_one_line() {
        assert_eq!(one_line("first\n  second\tthird"), "first second third");
    }
}
