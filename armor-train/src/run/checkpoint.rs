//! The file that a run goes on from.

use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::Path;

use firmware_sim::file;
use postcard::ser_flavors::crc::CrcModifier;
use postcard::ser_flavors::io::WriteFlavor;
use serde::{Deserialize, Serialize};

use super::RunError;
use super::metrics::Window;
use crate::config::Config;
use crate::learner::LearnerState;

/// The first bytes of a checkpoint, with its version.
const MAGIC: &[u8; 8] = b"ARMRCK04";
const CRC: crc::Crc<u32> = crc::Crc::<u32>::new(&crc::CRC_32_ISO_HDLC);

/// A run at one moment; to be written, a reference to its state will do.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Checkpoint<S = LearnerState<f32>> {
    /// The effective configuration.
    pub config: Config,
    /// SHA-256 of the recorded data.
    pub data_sha256: [u8; 32],
    /// Networks, optimisers and weights.
    pub state: S,
    /// Metrics since the last row of `metrics.csv`.
    pub window: Window,
}

impl Checkpoint {
    /// Name of the file within a run's folder.
    pub const FILE: &str = "checkpoint.postcard";

    /// The last checkpoint of the run in `folder`.
    ///
    /// # Errors
    /// [`RunError::NoRun`], [`RunError::File`] and [`RunError::Checkpoint`].
    pub fn read(folder: &Path) -> Result<Self, RunError> {
        let path = folder.join(Self::FILE);
        if !path.exists() {
            return Err(RunError::NoRun { folder: folder.into() });
        }
        let bytes = file::read(&path)?;
        Self::decode(&bytes).ok_or(RunError::Checkpoint { path })
    }

    fn decode(bytes: &[u8]) -> Option<Self> {
        let body = bytes.strip_prefix(MAGIC)?;
        postcard::from_bytes_crc32(body, CRC.digest()).ok()
    }
}

impl<S: Serialize> Checkpoint<S> {
    /// Writes the checkpoint, whole or not at all.
    ///
    /// # Errors
    /// [`RunError::File`]; the checkpoint before is kept then.
    pub fn write(&self, folder: &Path) -> Result<(), RunError> {
        let path = folder.join(Checkpoint::FILE);
        Ok(file::write_with(&path, |file| {
            file.write_all(MAGIC)?;
            let mut failure = Ok(());
            let writer = BufWriter::new(Attentive { file, failure: &mut failure });
            let flavor = CrcModifier::new(WriteFlavor::new(writer), CRC.digest());
            let written = postcard::serialize_with_flavor(self, flavor).map(drop);
            failure.and(written.map_err(io::Error::other))
        })?)
    }
}

/// Keeps the error that the serialiser would forget.
struct Attentive<'a> {
    file: &'a mut File,
    failure: &'a mut io::Result<()>,
}

impl Write for Attentive<'_> {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes).map_err(|error| {
            let kind = error.kind();
            *self.failure = Err(error);
            kind.into()
        })
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::config::Preset;
    use crate::model::{Model, Optimisers};
    use crate::selection::Selection;
    use armor_core::noise::Noise;

    fn checkpoint() -> Checkpoint {
        let mut config = Preset::Quick.config("ball-run", 5.0);
        (config.hidden, config.trunk, config.head, config.dual_hidden) = (4, 4, 4, 4);
        let parameters = Model::new(&config, 3, 2).initialise(Noise::new(1));
        let optimisers = Optimisers::new(&config, &parameters);
        let state = LearnerState {
            step: 7,
            parameters,
            optimisers,
            counterfactual: vec![1.0, 1.5],
            counterfactual_active: 0.5,
            selection: Selection::new(),
        };
        Checkpoint { config, data_sha256: [3; 32], state, window: Window::default() }
    }

    #[test]
    fn what_is_written_is_read_back() {
        let folder = tempfile::tempdir().unwrap();
        checkpoint().write(folder.path()).unwrap();
        assert_eq!(Checkpoint::read(folder.path()).unwrap(), checkpoint());
    }

    #[test]
    fn a_folder_without_a_run_is_named() {
        let folder = tempfile::tempdir().unwrap();
        let error = Checkpoint::read(folder.path()).unwrap_err();
        assert!(matches!(&error, RunError::NoRun { .. }), "{error}");
    }

    #[test]
    fn every_flipped_byte_and_every_cut_is_noticed() {
        let folder = tempfile::tempdir().unwrap();
        checkpoint().write(folder.path()).unwrap();
        let bytes = std::fs::read(folder.path().join(Checkpoint::FILE)).unwrap();
        for index in 0..bytes.len() {
            let mut damaged = bytes.clone();
            damaged[index] ^= 0x40;
            assert!(Checkpoint::decode(&damaged).is_none(), "flip at {index}");
        }
        for length in (0..bytes.len()).step_by(7) {
            assert!(Checkpoint::decode(&bytes[..length]).is_none(), "cut at {length}");
        }
    }
}
