//! Latency budgets as a user writes them, in the tests of a firmware.

#[path = "../src/fixture.rs"]
#[expect(dead_code, reason = "the command-line tests use the rest")]
mod fixture;

use firmware_sim::latency_budget::{LatencyBudget, NotMet};
use firmware_sim::memory::AlignedBytes;

/// In a project of your own: `AlignedBytes::read("policy.armor".as_ref()).unwrap()`.
fn policy() -> AlignedBytes {
    AlignedBytes::from(fixture::ball_run(1).as_slice())
}

#[test]
fn the_policy_keeps_up_with_the_robot() {
    let image = policy();
    LatencyBudget::new(image.as_slice()).board("stm32h743").rate_hz(50).margin(0.2).assert();
}

#[test]
fn on_the_smallest_board_a_short_chain_keeps_up() {
    let image = policy();
    LatencyBudget::new(image.as_slice()).board("rp2040").rate_hz(30).max_steps(2).assert();
}

/// What a failing test says: the numbers, and what to do.
#[test]
fn a_budget_that_is_missed_says_by_how_much_and_what_would_do() {
    let image = policy();
    let budget = LatencyBudget::new(image.as_slice()).board("nrf52840");
    let met = budget.check().unwrap();
    let cycles_per_second = met.action.cycles / met.action.time.as_secs_f64();
    assert!((cycles_per_second / 64e6 - 1.0).abs() < 1e-3);

    // A rate that the longest chain misses by a tenth.
    let rate_hz = (1.1 / met.action.worst.as_secs_f64()) as u32;
    let error = budget.rate_hz(rate_hz).check().unwrap_err();
    assert!(matches!(error, NotMet::Slow(_)));
    let message = error.to_string();
    for words in
        ["an action of DDPM 5 takes up to", "M cycles at 64 MHz", "max_steps(2)", "or less, or choose a faster board"]
    {
        assert!(message.contains(words), "{message}");
    }
    budget.rate_hz(rate_hz).max_steps(2).assert();
    let caught = std::panic::catch_unwind(|| budget.rate_hz(rate_hz).assert()).unwrap_err();
    assert_eq!(caught.downcast_ref::<String>(), Some(&format!("latency budget: {message}")));
}

#[test]
fn what_cannot_be_budgeted_is_named() {
    let image = policy();
    let budget = LatencyBudget::new(image.as_slice());
    for wrong in [budget.rate_hz(0), budget.margin(1.0), budget.margin(-0.1), budget.margin(f64::NAN)] {
        assert_eq!(wrong.check(), Err(NotMet::Range));
    }
    assert_eq!(budget.max_steps(1).check(), Err(NotMet::NoRung { max_steps: 1 }));
    assert!(budget.board("arduino").check().unwrap_err().to_string().contains("no board is called arduino"));
    assert!(matches!(LatencyBudget::new(&image.as_slice()[..64]).check(), Err(NotMet::Image(_))));
}
