//! A small sound recording to spoil: what to write, data set by data set.

use std::path::{Path, PathBuf};

use hdf5_pure::{
    Datatype, DatatypeByteOrder, EnumTypeBuilder, FileBuilder, make_f32_type, make_i8_type, make_i16_type,
};

/// Rows of [`Table::sound`]; its two trajectories end at rows 2 and 5.
pub(crate) const ROWS: usize = 6;

/// Values of a data set and the type that they are stored as.
pub(crate) enum Values {
    F32(Vec<f32>),
    F64(Vec<f64>),
    F32BigEndian(Vec<f32>),
    U8(Vec<u8>),
    I8(Vec<i8>),
    I32(Vec<i32>),
    /// As h5py writes numpy's bool.
    Bool(Vec<bool>),
    /// An enumeration of one byte a value over a base type of two.
    TornEnum(Vec<u8>),
    Text(Vec<&'static str>),
}

/// The data sets of a file: name, shape, values.
pub(crate) struct Table(Vec<(&'static str, Vec<u64>, Values)>);

impl Table {
    /// Three state entries, two action entries, no fault, no warning.
    pub(crate) fn sound() -> Self {
        let state = |t: usize| [t as f32, 0.5 * t as f32, -(t as f32)];
        let flags = |end: usize| (0..ROWS).map(|row| row == end).collect();
        let n = ROWS as u64;
        Self(vec![
            ("observations", vec![n, 3], Values::F32((0..ROWS).flat_map(state).collect())),
            ("next_observations", vec![n, 3], Values::F32((1..=ROWS).flat_map(state).collect())),
            ("actions", vec![n, 2], Values::F32((0..2 * ROWS).map(|entry| entry as f32 / 16.0).collect())),
            ("rewards", vec![n], Values::F32((0..ROWS).map(|row| row as f32 - 2.0).collect())),
            ("costs", vec![n], Values::F32(vec![1.0, 0.0, 2.0, 0.0, 1.0, 0.0])),
            ("terminals", vec![n], Values::Bool(flags(2))),
            ("timeouts", vec![n], Values::Bool(flags(5))),
        ])
    }

    /// Replaces a data set.
    pub(crate) fn with(mut self, name: &'static str, shape: &[u64], values: Values) -> Self {
        self.0.retain(|(other, ..)| *other != name);
        self.0.push((name, shape.to_vec(), values));
        self
    }

    /// Replaces a single column of f32.
    pub(crate) fn with_column(self, name: &'static str, values: &[f32]) -> Self {
        self.with(name, &[values.len() as u64], Values::F32(values.to_vec()))
    }

    /// Leaves a data set out.
    pub(crate) fn without(mut self, name: &str) -> Self {
        self.0.retain(|(other, ..)| *other != name);
        self
    }

    /// Writes the file.
    pub(crate) fn write(&self, folder: &Path, name: &str) -> PathBuf {
        let path = folder.join(name);
        self.build().write(&path).unwrap();
        path
    }

    /// The file, to add more to.
    pub(crate) fn build(&self) -> FileBuilder {
        let mut file = FileBuilder::new();
        for (name, shape, values) in &self.0 {
            let data = file.create_dataset(name);
            match values {
                Values::F32(values) => data.with_f32_data(values),
                Values::F64(values) => data.with_f64_data(values),
                Values::F32BigEndian(values) => {
                    let bytes = values.iter().flat_map(|value| value.to_be_bytes()).collect();
                    data.with_raw_data(big_endian(make_f32_type()), bytes, values.len() as u64)
                }
                Values::U8(values) => data.with_u8_data(values),
                Values::I8(values) => data.with_i8_data(values),
                Values::I32(values) => data.with_i32_data(values),
                Values::Bool(values) => {
                    let bool = EnumTypeBuilder::with_base(make_i8_type()).value("FALSE", 0).value("TRUE", 1);
                    let bytes = values.iter().map(|&value| u8::from(value)).collect();
                    data.with_raw_data(bool.build().unwrap(), bytes, values.len() as u64)
                }
                Values::TornEnum(values) => {
                    let torn = Datatype::Enumeration { size: 1, base_type: Box::new(make_i16_type()), members: vec![] };
                    data.with_raw_data(torn, values.clone(), values.len() as u64)
                }
                Values::Text(values) => data.with_strings(values).unwrap(),
            };
            data.with_shape(shape);
        }
        file
    }
}

fn big_endian(datatype: Datatype) -> Datatype {
    match datatype {
        Datatype::FloatingPoint { size, layout, .. } => {
            Datatype::FloatingPoint { size, byte_order: DatatypeByteOrder::BigEndian, layout }
        }
        other => other,
    }
}
