//! Tells the program which commit it was built from.

use std::process::Command;

/// What the program is built from, beside this package's manifest.
const SOURCES: [&str; 4] = ["src", "../armor-core/src", "../armor-infer/src", "../firmware-sim/src"];

fn main() {
    let commit = git(&["rev-parse", "HEAD"]).unwrap_or_else(|| "unknown".to_owned());
    let changes = git(&["status", "--porcelain", "--untracked-files=no"]).unwrap_or_default();
    let suffix = if changes.is_empty() { "" } else { ", with changes" };
    println!("cargo::rustc-env=ARMOR_COMMIT={commit}{suffix}");

    let heads = ["HEAD", "logs/HEAD"].into_iter().filter_map(|file| git(&["rev-parse", "--git-path", file]));
    for path in heads.chain(SOURCES.map(str::to_owned)) {
        println!("cargo::rerun-if-changed={path}");
    }
}

/// What git says; none where there is no git, or no repository.
fn git(arguments: &[&str]) -> Option<String> {
    let output = Command::new("git").args(arguments).output().ok()?;
    let text = String::from_utf8(output.stdout).ok()?;
    output.status.success().then(|| text.trim().to_owned())
}
