//! A run's folder, or an image file, as an argument.

use std::path::{Path, PathBuf};

use armor_core::image::PolicyImage;
use firmware_sim::cli::output::Output;
use firmware_sim::memory::AlignedBytes;

use crate::calibrate::Knots;
use crate::data::Dataset;
use crate::export::{Exported, export, with_critic};
use crate::run::{Checkpoint, RunError};

/// The policy of the last checkpoint in `folder`, exported in memory; `data`
/// says where the recorded data is now, if it was moved. The data comes along.
pub(super) fn export_folder(
    folder: &Path,
    data: Option<&PathBuf>,
    output: Output,
) -> Result<(Checkpoint, Dataset, Exported), Box<dyn std::error::Error>> {
    let (checkpoint, data) = checkpoint_and_data(folder, data, output)?;
    let exported = export(&checkpoint, &data, Knots::read(folder)?.as_ref())?;
    Ok((checkpoint, data, exported))
}

/// The last checkpoint in `folder`, and the data that the run learns from.
pub(super) fn checkpoint_and_data(
    folder: &Path,
    data: Option<&PathBuf>,
    output: Output,
) -> Result<(Checkpoint, Dataset), Box<dyn std::error::Error>> {
    let checkpoint = Checkpoint::read(folder)?;
    let path = data.cloned().unwrap_or_else(|| PathBuf::from(&checkpoint.config.data));
    let data = super::data::read(&path, checkpoint.config.unfinished, output)
        .map_err(|error| format!("{error}; name the run's recorded data with --data if it was moved"))?;
    same_data(&checkpoint, &data, folder)?;
    Ok((checkpoint, data))
}

fn same_data(checkpoint: &Checkpoint, data: &Dataset, folder: &Path) -> Result<(), RunError> {
    if checkpoint.data_sha256 == *data.sha256() {
        return Ok(());
    }
    Err(RunError::OtherData { folder: folder.into() })
}

/// The image in a file, or of a run's folder, there with its critic if that is asked for.
pub(super) fn image(
    path: &Path,
    data: Option<&PathBuf>,
    critic: bool,
    output: Output,
) -> Result<AlignedBytes, Box<dyn std::error::Error>> {
    if !path.is_dir() {
        return Ok(AlignedBytes::read(path)?);
    }
    let (checkpoint, _, Exported { bytes, .. }) = export_folder(path, data, output)?;
    if !critic {
        return Ok(bytes);
    }
    Ok(with_critic(&PolicyImage::new_checked(bytes.as_slice())?, &checkpoint)?)
}
