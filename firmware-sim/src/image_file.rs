//! An image file in memory, and errors that name it.

use std::path::{Path, PathBuf};

use armor_core::image::{ImageError, PolicyImage};
use thiserror::Error;

use crate::file::FileError;
use crate::memory::AlignedBytes;

/// The bytes of a file that should be an image.
#[derive(Clone, Debug)]
pub struct ImageFile {
    path: PathBuf,
    memory: AlignedBytes,
}

/// A file is no policy image.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
#[error("{}: {error}", path.display())]
pub struct NotAnImage {
    path: PathBuf,
    error: ImageError,
}

impl ImageFile {
    /// Reads a file, unchecked.
    ///
    /// # Errors
    /// [`FileError`]
    pub fn read(path: &Path) -> Result<Self, FileError> {
        Ok(Self { path: path.into(), memory: AlignedBytes::read(path)? })
    }

    /// The bytes, at a multiple of 64.
    pub fn bytes(&self) -> &[u8] {
        self.memory.as_slice()
    }

    /// The image.
    ///
    /// # Errors
    /// [`NotAnImage`]
    pub fn image(&self) -> Result<PolicyImage<'_>, NotAnImage> {
        PolicyImage::new_checked(self.bytes()).map_err(|error| NotAnImage { path: self.path.clone(), error })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::fixture;

    #[test]
    fn a_file_is_an_image_or_says_which_file_is_not() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("p.armor");
        let bytes = fixture::ball_run(1);
        std::fs::write(&path, &bytes).unwrap();
        let file = ImageFile::read(&path).unwrap();
        assert_eq!(file.image().unwrap().bytes(), bytes);
        std::fs::write(&path, &bytes[..100]).unwrap();
        let error = ImageFile::read(&path).unwrap().image().unwrap_err();
        assert_eq!(error.error, ImageError::Truncated { expected: bytes.len(), actual: 100 });
        assert!(error.to_string().contains("p.armor"), "{error}");
    }
}
