//! Reads the seven data sets of a DSRL HDF5 file.
//!
//! A file's claims are checked before they cost memory: the types and shapes of
//! all data sets first, then the values of those whose rows agree.

use hdf5_pure::{Datatype, Error, File, FormatError};
use sha2::{Digest, Sha256};

use super::error::Fault;
use super::key::Key;

/// The most bytes that one byte of a deflate stream can stand for
/// (RFC 1951: a match of 258 bytes takes at least 2 bits).
const DEFLATE_MAX_RATIO: u64 = 1032;

/// A data set as f32, row-major; flags are 0 and 1 unless the file is at fault.
pub(super) struct Column {
    pub(super) width: usize,
    pub(super) values: Vec<f32>,
}

/// What could be read of a file, and why the rest could not.
pub(super) struct Contents {
    pub(super) sha256: [u8; 32],
    /// In the order of [`Key::ALL`]; all there if `faults` is empty.
    pub(super) columns: [Option<Column>; 7],
    pub(super) faults: Vec<Fault>,
}

/// Reads every data set that can be read from the bytes of a file.
///
/// # Errors
/// The [`Fault`] of bytes that cannot be opened as HDF5 at all.
pub(super) fn parse(bytes: Vec<u8>) -> Result<Contents, Fault> {
    let sha256 = Sha256::digest(&bytes).into();
    let file = open(bytes)?;

    let mut faults = Vec::new();
    let mut sources = Key::ALL.map(|key| find(&file, key).map_err(|fault| faults.push(fault)).ok());
    faults.extend(disagreements(&mut sources));
    let columns = sources.map(|source| {
        let source = source?;
        source.values(file.file_size()).map_err(|fault| faults.push(fault)).ok()
    });
    Ok(Contents { sha256, columns, faults })
}

fn open(bytes: Vec<u8>) -> Result<File, Fault> {
    let length = bytes.len() as u64;
    if !hdf5_pure::is_hdf5_bytes(&bytes) {
        return Err(Fault::NotHdf5 { bytes: length });
    }
    let file = File::from_bytes(bytes).map_err(refused)?;
    // The HDF5 reader itself does not mind a missing tail until it needs it.
    let superblock = file.superblock();
    let expected = superblock.eof_address.saturating_add(superblock.base_address.get());
    if length < expected {
        return Err(Fault::Truncated { bytes: length, expected });
    }
    Ok(file)
}

/// A data set of the right kind and shape, its values not yet read.
struct Source {
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
    /// Decodes the values, unless they are more than a file of `file_bytes` can hold.
    fn values(self, file_bytes: u64) -> Result<Column, Fault> {
        let key = self.key;
        let values = self.rows.saturating_mul(self.width);
        let element = self.dataset.element_size().map_err(|error| refused_at(key, error))?;
        let stored = values.saturating_mul(element);
        if stored > file_bytes.saturating_mul(DEFLATE_MAX_RATIO) {
            return Err(Fault::Damaged {
                reason: format!("`{key}` claims {stored} bytes, more than the file can hold"),
            });
        }
        let read = self.dataset.read_f32().map_err(|error| refused_at(key, error))?;
        if read.len() as u64 != values {
            return Err(Fault::Damaged { reason: format!("`{key}` claims {values} values but holds {}", read.len()) });
        }
        Ok(Column { width: self.width as usize, values: read })
    }
}

fn refused(error: Error) -> Fault {
    named(error.to_string(), &error)
}

fn refused_at(key: Key, error: Error) -> Fault {
    named(format!("`{key}`: {error}"), &error)
}

/// A version or a filter that the HDF5 reader does not know is taken at its word; all else is damage.
fn named(reason: String, error: &Error) -> Fault {
    match error {
        Error::Format(
            FormatError::UnsupportedVersion(_)
            | FormatError::InvalidLayoutVersion(_)
            | FormatError::UnsupportedFilter(_)
            | FormatError::UnsupportedVirtualLayout
            | FormatError::UnsupportedExternalStorage,
        ) => Fault::Unsupported { reason },
        _ => Fault::Damaged { reason },
    }
}
