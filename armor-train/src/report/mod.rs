//! `armor-train report`: a run's folder as one page of HTML, with curves as inline SVG.
//!
//! The page needs nothing but itself: no script, no font, no file beside it.
//!
//! ```text
//! folder --folder--> RunFolder --charts--> Chart --firmware_sim::page--> SVG --page--> HTML
//! ```

mod charts;
mod folder;
mod page;

pub use folder::{Curves, ReportError, RunFolder};
pub use page::page;

#[cfg(test)]
mod tests;
