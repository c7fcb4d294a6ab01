//! What a chart is made of.

use super::axis::Scale;

/// A chart over training steps.
pub(super) struct Chart<'a> {
    pub(super) title: &'static str,
    /// Unit of the upright axis.
    pub(super) unit: &'static str,
    pub(super) scale: Scale,
    /// Ends of the upright axis, where they are not those of the numbers.
    pub(super) ends: Option<[f64; 2]>,
    /// Training steps of the numbers.
    pub(super) steps: &'a [f64],
    /// From the back to the front.
    pub(super) layers: Vec<Layer<'a>>,
    /// What to look for.
    pub(super) caption: String,
}

/// Something drawn in a chart; one without a label is left out of the legend; `colour` is the number of one in the style sheet.
pub(super) enum Layer<'a> {
    /// A curve.
    Line { label: String, colour: usize, values: &'a [f64] },
    /// All between two curves.
    Area { label: String, colour: usize, low: &'a [f64], high: &'a [f64] },
    /// All between two numbers, at every step.
    Band { label: String, low: f64, high: f64 },
    /// A number, at every step.
    Level { label: String, at: f64 },
}

impl Layer<'_> {
    pub(super) fn label(&self) -> &str {
        match self {
            Self::Line { label, .. }
            | Self::Area { label, .. }
            | Self::Band { label, .. }
            | Self::Level { label, .. } => label,
        }
    }

    /// Classes of the style sheet.
    pub(super) fn class(&self) -> String {
        match self {
            Self::Line { colour, .. } => format!("line c{colour}"),
            Self::Area { colour, .. } => format!("area c{colour}"),
            Self::Band { .. } => "band".to_owned(),
            Self::Level { .. } => "level".to_owned(),
        }
    }

    /// All numbers that the axis must hold.
    pub(super) fn values(&self) -> Vec<f64> {
        match self {
            Self::Line { values, .. } => values.to_vec(),
            Self::Area { low, high, .. } => [*low, *high].concat(),
            Self::Band { low, high, .. } => vec![*low, *high],
            Self::Level { at, .. } => vec![*at],
        }
    }
}
