//! `firmware-sim bench --board`: what an action takes on microcontroller
//! boards, modelled.

use std::fmt;
use std::path::{Path, PathBuf};

use armor_core::image::{Layout, PolicyImage, Precision};
use serde::Serialize;

use super::output::{CommandResult, Output};
use super::sampler_name;
use crate::board::{BOARDS, Board, DoesNotFit, UnknownBoard};
use crate::host::HostController;
use crate::image_file::{ImageFile, NotAnImage};

/// The boards of an argument.
#[derive(Clone, Debug)]
pub(super) struct Boards(Vec<&'static Board>);

pub(super) fn boards(name: &str) -> Result<Boards, UnknownBoard> {
    match name {
        "all" => Ok(Boards(BOARDS.iter().collect())),
        name => Board::named(name).map(|board| Boards(vec![board])),
    }
}

#[derive(Serialize)]
struct Report {
    modelled: Vec<Modelled>,
    #[serde(skip)]
    images: Vec<Image>,
}

/// An action on a board along a rung; nothing of it was measured.
#[derive(Serialize)]
struct Modelled {
    image: PathBuf,
    precision: Precision,
    layout: Layout,
    board: &'static str,
    clock_hz: u32,
    fits: bool,
    rung: usize,
    steps: u16,
    modelled_instructions: f64,
    modelled_cycles: f64,
    modelled_ms: f64,
    modelled_worst_ms: f64,
    /// How far published figures lie from the model of the core, as a share.
    model_error: Option<f64>,
}

/// An image's lines.
struct Image {
    title: String,
    chains: Vec<String>,
    boards: Vec<(&'static Board, Result<(), DoesNotFit>, Vec<f64>)>,
}

/// Reports what an action of every rung of the images takes on the boards.
pub(super) fn report(Boards(boards): &Boards, paths: &[PathBuf], output: Output) -> CommandResult {
    let mut report = Report { modelled: Vec::new(), images: Vec::new() };
    for path in paths {
        let file = ImageFile::read(path)?;
        let image = file.image().map_err(|error: NotAnImage| error)?;
        report.add(path, &image, boards);
    }
    output.report(&report)
}

impl Report {
    fn add(&mut self, path: &Path, image: &PolicyImage<'_>, boards: &[&'static Board]) {
        let manifest = image.manifest();
        let weights = if manifest.layout == Layout::Paired { ", weights in pairs" } else { "" };
        let title = format!("{}, {:?}{weights}, {} bytes", path.display(), manifest.precision, image.bytes().len());
        let chain = |rung: &armor_core::image::Rung| format!("{} {}", sampler_name(rung.sampler), rung.steps);
        let mut lines = Vec::new();
        for &board in boards {
            let fit = board.check_fit(image.bytes().len(), HostController::RAM_BYTES);
            let mut times = Vec::new();
            for (rung, flown) in manifest.rungs.iter().enumerate() {
                let Some(action) = board.action(image, rung) else { continue };
                let modelled_ms = 1e3 * action.time.as_secs_f64();
                times.push(modelled_ms);
                self.modelled.push(Modelled {
                    image: path.into(),
                    precision: manifest.precision,
                    layout: manifest.layout,
                    board: board.name,
                    clock_hz: board.clock_hz,
                    fits: fit.is_ok(),
                    rung,
                    steps: flown.steps,
                    modelled_instructions: action.instructions,
                    modelled_cycles: action.cycles,
                    modelled_ms,
                    modelled_worst_ms: 1e3 * action.worst.as_secs_f64(),
                    model_error: board.core.error().filter(|_| manifest.precision != Precision::F32),
                });
            }
            lines.push((board, fit, times));
        }
        self.images.push(Image { title, chains: manifest.rungs.iter().map(chain).collect(), boards: lines });
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "ms an action, modelled, not measured")?;
        for Image { title, chains, boards } in &self.images {
            write!(f, "\n\n{title}\n{:<10}{:<6}", "board", "fits")?;
            chains.iter().try_for_each(|chain| write!(f, "{chain:>8}"))?;
            for (board, fit, times) in boards {
                let fits = match fit {
                    Ok(()) => "yes",
                    Err(DoesNotFit::Flash { .. }) => "flash",
                    Err(DoesNotFit::Ram { .. }) => "RAM",
                };
                write!(f, "\n{:<10}{fits:<6}", board.name)?;
                times.iter().try_for_each(|time| write!(f, "{time:>8.2}"))?;
            }
            if let Some(error) = boards.iter().find_map(|(_, fit, _)| fit.as_ref().err()) {
                write!(f, "\n{error}")?;
            }
        }
        Ok(())
    }
}
