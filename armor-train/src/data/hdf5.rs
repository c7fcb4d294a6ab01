//! Reads the seven data sets of a DSRL HDF5 file.
//!
//! A file's claims are checked before they cost memory: the types and shapes of
//! all data sets first, then the values of those whose rows agree.

use std::io::{self, BufRead, BufReader, Read, Seek};

use hdf5_pure::{Datatype, Error, File, FormatError, ReadSeekSource};
use sha2::{Digest, Sha256};

use super::error::Fault;
use super::key::Key;

/// The most bytes that one byte of a deflate stream can stand for
/// (RFC 1951: a match of 258 bytes takes at least 2 bits).
const DEFLATE_MAX_RATIO: u64 = 1032;

/// Values that are decoded at a time, unless a chunk of the file holds more: 4 MiB as f32.
const BLOCK: u64 = 1 << 20;

/// Opens HDF5, of which nothing but the structures is read until it is asked for.
///
/// Returns the SHA-256 of all bytes too.
///
/// # Errors
/// The [`Fault`] of bytes that cannot be opened as HDF5 at all.
pub(super) fn open(mut reader: impl Read + Seek + Send + 'static) -> Result<(File, [u8; 32]), Fault> {
    let (bytes, sha256) = hash(&mut reader)?;
    let source = ReadSeekSource::new(reader).map_err(|error| refused(error.into()))?;
    let file = File::from_source(source).map_err(|error| match error {
        Error::Format(FormatError::SignatureNotFound) => Fault::NotHdf5 { bytes },
        error => refused(error),
    })?;
    // The HDF5 reader itself does not mind a missing tail until it needs it.
    let superblock = file.superblock();
    let expected = superblock.eof_address.saturating_add(superblock.base_address.get());
    if bytes < expected {
        return Err(Fault::Truncated { bytes, expected });
    }
    Ok((file, sha256))
}

/// Length and SHA-256 of all that is read.
fn hash(reader: impl Read) -> io::Result<(u64, [u8; 32])> {
    let mut reader = BufReader::with_capacity(1 << 16, reader);
    let (mut bytes, mut hash) = (0, Sha256::new());
    loop {
        let part = reader.fill_buf()?;
        if part.is_empty() {
            return Ok((bytes, hash.finalize().into()));
        }
        hash.update(part);
        let length = part.len();
        bytes += length as u64;
        reader.consume(length);
    }
}

/// The data sets whose kinds and shapes agree, in the order of [`Key::ALL`], and why the rest do not.
pub(super) fn sources(file: &File) -> ([Option<Source>; 7], Vec<Fault>) {
    let mut faults = Vec::new();
    let mut sources = Key::ALL.map(|key| find(file, key).map_err(|fault| faults.push(fault)).ok());
    faults.extend(disagreements(&mut sources));
    for slot in &mut sources {
        if let Some(Err(fault)) = slot.as_ref().map(|source| source.check_claim(file.file_size())) {
            faults.push(fault);
            *slot = None;
        }
    }
    (sources, faults)
}

/// A data set of the right kind and shape, its values not yet read.
pub(super) struct Source {
    key: Key,
    dataset: hdf5_pure::Dataset,
    rows: u64,
    width: u64,
}

fn find(file: &File, key: Key) -> Result<Source, Fault> {
    let dataset = match file.dataset(key.name()) {
        Ok(dataset) => dataset,
        // A group of that name is no data set either.
        Err(Error::Format(FormatError::PathNotFound(_)) | Error::NotADataset(_)) => {
            let present = file.root().datasets().map_err(refused)?;
            return Err(Fault::MissingKey { key, present });
        }
        Err(error) => return Err(refused_at(key, error)),
    };
    let found = dataset.datatype().map_err(|error| refused_at(key, error))?;
    if !is_supported(key, &found) {
        return Err(Fault::UnsupportedType { key, found: found.to_string() });
    }
    let shape = dataset.shape().map_err(|error| refused_at(key, error))?;
    let (rows, width) = match shape[..] {
        [rows] if !key.is_vector() => (rows, 1),
        [rows, width] if key.accepts_width(width) => (rows, width),
        _ => return Err(Fault::WrongShape { key, shape }),
    };
    Ok(Source { key, dataset, rows, width })
}

/// Floats for numbers; floats, bytes and enumerations over a byte (h5py's bool) for flags.
fn is_supported(key: Key, found: &Datatype) -> bool {
    match found {
        Datatype::FloatingPoint { size: 4 | 8, .. } => true,
        Datatype::FixedPoint { size: 1, .. } | Datatype::Enumeration { size: 1, .. } => key.is_flag(),
        _ => false,
    }
}

/// Takes out every data set whose rows are not as many as in most of the others, and says so;
/// likewise about states and next states of different width.
fn disagreements(sources: &mut [Option<Source>; 7]) -> Vec<Fault> {
    let mut faults = Vec::new();
    let rows: Vec<u64> = sources.iter().flatten().map(|source| source.rows).collect();
    let most = rows.iter().max_by_key(|count| rows.iter().filter(|other| other == count).count());
    let Some(&expected) = most else {
        return faults;
    };
    for slot in sources.iter_mut() {
        if let Some(odd) = slot.take_if(|source| source.rows != expected) {
            faults.push(Fault::LengthsDiffer { key: odd.key, rows: odd.rows, expected });
        }
    }
    if expected == 0 {
        faults.push(Fault::Empty);
    }
    if let [Some(here), Some(next), ..] = sources
        && here.width != next.width
    {
        faults.push(Fault::WidthsDiffer { observations: here.width, next_observations: next.width });
    }
    faults
}

impl Source {
    pub(super) const fn key(&self) -> Key {
        self.key
    }

    /// Values of a row.
    pub(super) const fn width(&self) -> usize {
        self.width as usize
    }

    /// Values of all rows.
    pub(super) const fn len(&self) -> usize {
        (self.rows * self.width) as usize
    }

    /// Whether a file of `file_bytes` can hold as many values.
    fn check_claim(&self, file_bytes: u64) -> Result<(), Fault> {
        let key = self.key;
        let element = self.dataset.element_size().map_err(|error| refused_at(key, error))?;
        let stored = self.rows.saturating_mul(self.width).saturating_mul(element);
        if stored > file_bytes.saturating_mul(DEFLATE_MAX_RATIO) {
            return Err(Fault::Damaged {
                reason: format!("`{key}` claims {stored} bytes, more than the file can hold"),
            });
        }
        Ok(())
    }

    /// Decodes all values in order, some rows at a time, each time whole chunks of the file;
    /// `each` is given the first of these rows and their values.
    ///
    /// # Errors
    /// The [`Fault`] of values that cannot be decoded; `each` may have been given some before.
    pub(super) fn blocks(&self, mut each: impl FnMut(usize, &[f32])) -> Result<(), Fault> {
        let refused = |error| refused_at(self.key, error);
        let chunk = self.dataset.chunk_shape().map_err(refused)?.and_then(|shape| shape.first().copied());
        let rows = BLOCK.div_ceil(self.width).checked_next_multiple_of(chunk.unwrap_or(1)).unwrap_or(self.rows);
        let mut first = 0;
        while first < self.rows {
            let count = rows.min(self.rows - first);
            let (claimed, values) = (count * self.width, self.dataset.read_f32_rows(first, count).map_err(refused)?);
            if values.len() as u64 != claimed {
                let reason = format!("`{}` claims {claimed} values but holds {}", self.key, values.len());
                return Err(Fault::Damaged { reason });
            }
            each(first as usize, &values);
            first += count;
        }
        Ok(())
    }
}

fn refused(error: Error) -> Fault {
    named(error.to_string(), &error)
}

fn refused_at(key: Key, error: Error) -> Fault {
    named(format!("`{key}`: {error}"), &error)
}

/// A version or a filter that the HDF5 reader does not know is taken at its word, and so is the
/// system; all else is damage.
fn named(reason: String, error: &Error) -> Fault {
    match error {
        Error::Format(
            FormatError::UnsupportedVersion(_)
            | FormatError::InvalidLayoutVersion(_)
            | FormatError::UnsupportedFilter(_)
            | FormatError::UnsupportedVirtualLayout
            | FormatError::UnsupportedExternalStorage,
        ) => Fault::Unsupported { reason },
        // A writer that did not close the file may have left it half written.
        Error::Io(_) | Error::Format(FormatError::Source(_)) | Error::FileMarkedInUse { .. } => {
            Fault::Unreadable { reason }
        }
        _ => Fault::Damaged { reason },
    }
}
