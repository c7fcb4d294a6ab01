//! Pages of HTML with drawings as inline SVG, complete in themselves: no
//! script, no font, no file beside them.
//!
//! ```text
//! Chart --plot--> SVG --figure--> HTML          curves, for any report
//!   \--axis (ticks, numbers)
//! Record --flight--> HTML                       a flight: paths, budgets, latency, faults
//! ```

pub mod axis;
pub mod chart;
pub mod flight;
pub mod plot;

use std::fmt::Write;

use chart::{Chart, Layer};

/// The style of every page.
pub const STYLE: &str = include_str!("style.css");

/// A page up to its body; `title` is text.
pub fn head(title: &str) -> String {
    let title = escape(title);
    format!(
        "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
         <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
         <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n"
    )
}

/// The end of a page; `footer` is text.
pub fn foot(footer: &str) -> String {
    format!("<footer>{}</footer>\n</body>\n</html>\n", escape(footer))
}

/// A chart with its title, legend and caption.
pub fn figure(chart: &Chart<'_>, out: &mut String) {
    let _ = write!(out, "<figure>\n<h3>{}</h3>\n<ul class=\"legend\">", chart.title);
    for layer in chart.layers.iter().filter(|layer| !layer.label().is_empty()) {
        let sample = match layer {
            Layer::Line { .. } | Layer::Level { .. } => "M0 5H18",
            Layer::Dots { .. } => "M9 5h0",
            Layer::Area { .. } | Layer::Band { .. } => "M0 0H18V10H0Z",
        };
        let _ = write!(
            out,
            "<li><svg viewBox=\"0 0 18 10\" aria-hidden=\"true\"><path class=\"{}\" d=\"{sample}\"/></svg>{}</li>",
            layer.class(),
            escape(layer.label())
        );
    }
    let _ =
        write!(out, "</ul>\n{}\n<figcaption>{}</figcaption>\n</figure>\n", plot::svg(chart), escape(&chart.caption));
}

/// Text as it may stand in HTML.
pub fn escape(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}
