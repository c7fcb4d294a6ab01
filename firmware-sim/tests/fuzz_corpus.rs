//! The fuzzer's corpus (`armor-infer/fuzz`), through the same functions without the fuzzer.

// What is public in the fuzzer's crate is private here.
#![allow(unreachable_pub)]

#[path = "../../armor-infer/fuzz/src/controller.rs"]
mod controller;
#[allow(dead_code)]
#[path = "../../armor-infer/src/fixture.rs"]
mod fixture;
#[path = "../../armor-infer/fuzz/src/flash.rs"]
mod flash;
#[path = "../../armor-infer/fuzz/src/image.rs"]
mod image;
#[path = "../../armor-infer/fuzz/src/input.rs"]
mod input;
#[path = "../../armor-infer/fuzz/src/journal.rs"]
mod journal;
#[path = "../../armor-infer/fuzz/src/link.rs"]
mod link;

use std::fs;
use std::path::Path;

use armor_infer::{Controller, Policy};

/// Runs every file of a target's corpus; there must be some.
fn replay(target: &str, run: fn(&[u8])) {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("../armor-infer/fuzz/corpus").join(target);
    let mut files: Vec<_> = fs::read_dir(&folder).unwrap().map(|entry| entry.unwrap().path()).collect();
    files.sort();
    assert!(files.len() >= 10, "{} files in {}", files.len(), folder.display());
    for file in files {
        // Named where it fails, for a panic does not say which file it was.
        println!("{}", file.display());
        run(&fs::read(&file).unwrap());
    }
}

#[test]
fn images() {
    replay("image", image::run);
}

#[test]
fn controllers() {
    replay("controller", controller::run);
}

#[test]
fn links() {
    replay("link", link::run);
}

#[test]
fn journals() {
    replay("journal", journal::run);
}
