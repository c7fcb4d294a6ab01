use armor_core::image::SectionKind;

use super::*;
use crate::fixture::{self, BALL_RUN, GOLDEN_ROWS, Parts};
use crate::memory::AlignedBytes;

fn verified(bytes: &[u8]) -> Verification {
    verify(AlignedBytes::from(bytes).as_slice(), 1)
}

fn failed(verification: &Verification) -> Vec<&'static str> {
    verification.checks.iter().filter(|check| !check.passed).map(|check| check.name).collect()
}

#[test]
fn a_good_image_passes_every_check() {
    let bytes = fixture::ball_run(1);
    let verification = verified(&bytes);
    assert!(verification.passed, "{verification}");
    assert_eq!((verification.checks.len(), verification.failures()), (7, 0));
    assert_eq!((verification.image_bytes, verification.golden_rows), (bytes.len(), GOLDEN_ROWS));
    // The controller computes in single precision: close, but not the same.
    let largest = verification.agreement_max_abs.unwrap();
    assert!(largest > 0.0 && largest < 2e-5, "{largest}");
}

/// Header and manifest of the fixture: 9 flips a byte, all of its 32 and some hundred bytes.
#[test]
fn the_front_is_damaged_exhaustively_and_the_rest_at_two_thousand_places() {
    let verification = verified(&fixture::ball_run(1));
    let count = |name: &str| {
        let check = verification.checks.iter().find(|check| check.name == name).unwrap();
        check.detail.split(' ').next().unwrap().parse::<usize>().unwrap()
    };
    let front = count("header, manifest: cuts");
    assert!(front > 32 + 100 && front.is_multiple_of(16), "{front}");
    assert_eq!(count("header, manifest: flips"), 9 * front);
    assert_eq!((count("sections: flips"), count("sections: cuts")), (2000, 2000));
}

#[test]
fn an_image_of_another_machine_fails_on_its_golden_trace() {
    let mut parts = Parts::random("ball-run", BALL_RUN, 1).with_golden();
    *parts.section(SectionKind::Golden).last_mut().unwrap() ^= 1;
    let verification = verified(&parts.bytes());
    assert_eq!((verification.passed, failed(&verification)), (false, vec!["golden trace"]));
}

#[test]
fn an_image_without_golden_states_proves_nothing() {
    let verification = verified(&Parts::random("ball-run", BALL_RUN, 1).bytes());
    assert_eq!(failed(&verification), ["golden trace", "agreement"]);
}

#[test]
fn a_controller_that_cannot_compute_the_action_does_not_agree() {
    let mut parts = Parts::random("ball-run", BALL_RUN, 1);
    parts.section(SectionKind::Output).fill(f32::MAX.to_bits());
    let verification = verified(&parts.with_golden().bytes());
    assert_eq!(failed(&verification), ["agreement"]);
}

#[test]
fn what_is_no_image_fails_and_is_named() {
    let verification = verified(b"not an image, and long enough to hold a header");
    assert_eq!((verification.passed, failed(&verification)), (false, vec!["image"]));
    assert!(verification.to_string().contains("does not start with ARMR"));
}

#[test]
fn the_report_fits_a_terminal() {
    let report = verified(&fixture::ball_run(1)).to_string();
    assert!(report.lines().all(|line| line.len() <= 80), "{report}");
    assert!(report.ends_with("7 of 7 checks passed"));
}
