//! What a chart is made of.

use super::axis::Scale;

/// A chart of curves over one quantity, such as time.
pub struct Chart<'a> {
    /// What it shows.
    pub title: &'static str,
    /// What lies across, with its unit.
    pub across: &'static str,
    /// Unit of the upright axis.
    pub unit: &'static str,
    /// Scale of the upright axis.
    pub scale: Scale,
    /// Ends of the upright axis, where they are not those of the numbers.
    pub ends: Option<[f64; 2]>,
    /// Places of the numbers across, rising.
    pub steps: &'a [f64],
    /// From the back to the front.
    pub layers: Vec<Layer<'a>>,
    /// What to look for.
    pub caption: String,
}

/// Something drawn in a chart; one without a label is left out of the legend; `colour` is the number of one in the style sheet.
pub enum Layer<'a> {
    /// A curve.
    Line {
        /// Name in the legend.
        label: String,
        /// Number of its colour.
        colour: usize,
        /// A number for each place across.
        values: &'a [f64],
    },
    /// A dot for each number.
    Dots {
        /// Name in the legend.
        label: String,
        /// Number of its colour.
        colour: usize,
        /// A number for each place across.
        values: &'a [f64],
    },
    /// All between two curves.
    Area {
        /// Name in the legend.
        label: String,
        /// Number of its colour.
        colour: usize,
        /// The lower edge, a number for each place across.
        low: &'a [f64],
        /// The upper edge.
        high: &'a [f64],
    },
    /// All between two numbers, everywhere.
    Band {
        /// Name in the legend.
        label: String,
        /// The lower number.
        low: f64,
        /// The upper one.
        high: f64,
    },
    /// A number, everywhere.
    Level {
        /// Name in the legend.
        label: String,
        /// The number.
        at: f64,
    },
}

impl Layer<'_> {
    /// Its name in the legend; empty where it has none there.
    pub fn label(&self) -> &str {
        match self {
            Self::Line { label, .. }
            | Self::Dots { label, .. }
            | Self::Area { label, .. }
            | Self::Band { label, .. }
            | Self::Level { label, .. } => label,
        }
    }

    /// Classes of the style sheet.
    pub fn class(&self) -> String {
        match self {
            Self::Line { colour, .. } => format!("line c{colour}"),
            Self::Dots { colour, .. } => format!("dots c{colour}"),
            Self::Area { colour, .. } => format!("area c{colour}"),
            Self::Band { .. } => "band".to_owned(),
            Self::Level { .. } => "level".to_owned(),
        }
    }

    /// All numbers that the axis must hold.
    pub fn values(&self) -> Vec<f64> {
        match self {
            Self::Line { values, .. } | Self::Dots { values, .. } => values.to_vec(),
            Self::Area { low, high, .. } => [*low, *high].concat(),
            Self::Band { low, high, .. } => vec![*low, *high],
            Self::Level { at, .. } => vec![*at],
        }
    }
}
