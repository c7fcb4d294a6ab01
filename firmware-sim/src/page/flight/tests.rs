use super::*;
use crate::board::Board;
use crate::fixture;
use crate::harness::{Device, fly_all};
use crate::memory::AlignedBytes;
use crate::task::Task;
use armor_core::units::CostLimit;

/// The page of two episodes of the fixture, on a board and under faults.
fn flown() -> String {
    let task = Task::named("ball-run").unwrap();
    let limit = CostLimit::new(5.0).unwrap();
    let plan = FlightPlan { task, limit, episodes: 2, seed: 1, rate_hz: 30, max_steps: usize::MAX };
    let memory = AlignedBytes::from(fixture::ball_run(1).as_slice());
    let image = PolicyImage::new_checked(memory.as_slice()).unwrap();
    let faults = ["sensor-nan=0.2", "cost-lost=0.2"].map(|fault| fault.parse().unwrap());
    let setup = Setup::new(&plan, &image, Some(Board::named("nrf52840").unwrap()), faults.into());
    let flight = fly_all(&mut Device::flashed(memory.as_slice()).unwrap(), &plan, &setup, 0).unwrap();
    page(&Told { flight: &flight, plan: &plan, setup: &setup, image: &image })
}

#[test]
fn a_page_is_complete_in_itself_and_every_tag_is_closed() {
    let page = flown();
    for outside in ["http:", "https:", "src=", "href=", "url(", "@import", "<script", "<link", "NaN", "inf"] {
        assert!(!page.contains(outside), "{outside}");
    }
    for tag in
        ["figure", "figcaption", "table", "tr", "td", "th", "ul", "li", "svg", "text", "div", "h2", "h3", "p", "dl"]
    {
        let opened = page.matches(&format!("<{tag}>")).count() + page.matches(&format!("<{tag} ")).count();
        assert!(opened > 0, "{tag}");
        assert_eq!(opened, page.matches(&format!("</{tag}>")).count(), "{tag}");
    }
}

#[test]
fn a_page_tells_board_faults_chains_and_notices() {
    let page = flown();
    for word in [
        "nrf52840 at 64 MHz, modelled",
        "sensor-nan=0.2, cost-lost=0.2",
        "budget errors</dt><dd>0</dd>",
        "DDPM 5",
        "noticed state",
        "noticed: missing_cost",
        "period, the deadline",
    ] {
        assert!(page.contains(word), "{word}");
    }
}
