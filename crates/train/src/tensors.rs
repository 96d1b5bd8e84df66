//! Named arrays with one string of metadata: the safetensors container of policies and checkpoints.

use std::collections::{BTreeMap, HashMap};
use std::io;
use std::path::Path;

use canter_sim::file;
use safetensors::SafeTensors;
use safetensors::tensor::{Dtype, TensorView};

/// The one metadata entry; several would be written in random order.
const METADATA_KEY: &str = "canter";

/// The array that holds the checksum of everything else.
const CHECKSUM_NAME: &str = "checksum";

/// A policy, a checkpoint or a measurement of more bytes is a mistake: the largest that canter can write has 40 MB.
pub(crate) const MAX_FILE_BYTES: u64 = 1 << 27;

/// The content of a file, unless it is larger than any of ours.
pub(crate) fn read_file(path: &Path) -> io::Result<Vec<u8>> {
    let bytes = file::read(path, MAX_FILE_BYTES)?;
    if bytes.len() as u64 > MAX_FILE_BYTES {
        let message = format!("it has more than {} MiB, no file of canter does", MAX_FILE_BYTES >> 20);
        return Err(io::Error::new(io::ErrorKind::FileTooLarge, message));
    }
    Ok(bytes)
}

/// Named arrays and their metadata, in memory.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TensorFile {
    metadata: String,
    arrays: BTreeMap<String, Array>,
}

#[derive(Clone, Debug, PartialEq)]
struct Array {
    dtype: Dtype,
    shape: Vec<usize>,
    bytes: Vec<u8>,
}

/// A number that tensors may hold.
pub trait Element: Copy {
    /// Its type in the file.
    const DTYPE: Dtype;
    /// Its bytes, little-endian.
    fn to_bytes(self) -> impl AsRef<[u8]>;
    /// The number of these bytes, as many as it has.
    fn from_bytes(bytes: &[u8]) -> Self;
}

macro_rules! element {
    ($($Type:ty = $dtype:expr),+) => { $(
        impl Element for $Type {
            const DTYPE: Dtype = $dtype;
            fn to_bytes(self) -> impl AsRef<[u8]> {
                self.to_le_bytes()
            }
            fn from_bytes(bytes: &[u8]) -> Self {
                let mut own = [0; size_of::<$Type>()];
                own.copy_from_slice(bytes);
                Self::from_le_bytes(own)
            }
        }
    )+ };
}

element!(f32 = Dtype::F32, f64 = Dtype::F64);

/// What is wrong with a file of tensors.
#[derive(Debug, thiserror::Error)]
pub enum TensorError {
    /// Not the container that it should be.
    #[error("this is no safetensors file: {0}")]
    Container(#[from] safetensors::SafeTensorError),
    /// The metadata of canter is missing.
    #[error("this file has no metadata of canter: it was not written by canter")]
    NoMetadata,
    /// An array is missing.
    #[error("the array `{0}` is missing")]
    Missing(String),
    /// An array has another type or shape.
    #[error("the array `{name}` is {found}, expected {expected}")]
    Shape {
        /// Name of the array.
        name: String,
        /// Type and shape in the file.
        found: String,
        /// Type and shape that belong there.
        expected: String,
    },
    /// An array holds infinities or NaN.
    #[error("the array `{0}` holds numbers that are not finite")]
    NotFinite(String),
    /// The content is not what was written.
    #[error("its checksum does not fit its content: the file is damaged")]
    Checksum,
}

impl TensorFile {
    /// A file with this metadata and no arrays yet.
    pub fn new(metadata: String) -> Self {
        Self { metadata, arrays: BTreeMap::new() }
    }

    /// The metadata.
    pub fn metadata(&self) -> &str {
        &self.metadata
    }

    /// Adds an array.
    ///
    /// # Panics
    /// If there are not as many values as the shape has.
    pub fn push<T: Element>(&mut self, name: &str, shape: &[usize], values: &[T]) {
        assert_eq!(shape.iter().product::<usize>(), values.len(), "values of `{name}`");
        let bytes = values.iter().flat_map(|value| value.to_bytes().as_ref().to_vec()).collect();
        self.arrays.insert(name.to_owned(), Array { dtype: T::DTYPE, shape: shape.to_vec(), bytes });
    }

    /// The values of the array of this name and shape, all finite.
    ///
    /// # Errors
    /// No such array, another type or shape, or a number that is not finite.
    pub fn get<T: Element + Into<f64>>(&self, name: &str, shape: &[usize]) -> Result<Vec<T>, TensorError> {
        let array = self.arrays.get(name).ok_or_else(|| TensorError::Missing(name.to_owned()))?;
        if array.dtype != T::DTYPE || array.shape != shape {
            return Err(TensorError::Shape {
                name: name.to_owned(),
                found: format!("{:?}{:?}", array.dtype, array.shape),
                expected: format!("{:?}{:?}", T::DTYPE, shape),
            });
        }
        let values: Vec<T> = array.bytes.chunks_exact(size_of::<T>()).map(T::from_bytes).collect();
        if values.iter().any(|&value| !value.into().is_finite()) {
            return Err(TensorError::NotFinite(name.to_owned()));
        }
        Ok(values)
    }

    /// Checks that no array of fractions holds infinities or NaN.
    ///
    /// # Errors
    /// The first array that does.
    pub fn check_finite(&self) -> Result<(), TensorError> {
        for (name, array) in &self.arrays {
            match array.dtype {
                Dtype::F32 => self.get::<f32>(name, &array.shape).map(drop)?,
                Dtype::F64 => self.get::<f64>(name, &array.shape).map(drop)?,
                _ => {}
            }
        }
        Ok(())
    }

    /// Names of the arrays.
    pub fn names(&self) -> impl Iterator<Item = &str> {
        self.arrays.keys().map(String::as_str)
    }

    /// Shape of the array of this name.
    pub fn shape(&self, name: &str) -> Option<&[usize]> {
        self.arrays.get(name).map(|array| &array.shape[..])
    }

    /// 64-bit FNV-1a over metadata and arrays: notices accidents, no protection against intent.
    fn checksum(&self) -> Array {
        const OFFSET_BASIS: u64 = 0xcbf2_9ce4_8422_2325;
        const PRIME: u64 = 0x0000_0100_0000_01b3;
        let add = |hash: u64, bytes: &[u8]| {
            bytes.iter().fold(hash, |hash, &byte| (hash ^ u64::from(byte)).wrapping_mul(PRIME))
        };
        let hash = self.arrays.iter().fold(add(OFFSET_BASIS, self.metadata.as_bytes()), |hash, (name, array)| {
            let header = format!("{name:?}{:?}{:?}", array.dtype, array.shape);
            add(add(hash, header.as_bytes()), &array.bytes)
        });
        Array { dtype: Dtype::U64, shape: vec![1], bytes: hash.to_le_bytes().to_vec() }
    }

    /// The file's bytes; the same content gives the same bytes.
    pub fn to_bytes(&self) -> Vec<u8> {
        let checksum = (CHECKSUM_NAME.to_owned(), self.checksum());
        let views = self.arrays.iter().chain([(&checksum.0, &checksum.1)]).map(|(name, array)| {
            let view =
                TensorView::new(array.dtype, array.shape.clone(), &array.bytes).expect("`push` checked the length");
            (name, view)
        });
        let metadata = HashMap::from([(METADATA_KEY.to_owned(), self.metadata.clone())]);
        safetensors::serialize(views, Some(metadata)).expect("arrays of checked lengths can be written")
    }

    /// Reads what [`to_bytes`](Self::to_bytes) wrote.
    ///
    /// # Errors
    /// Bytes that are no such file, or one that was changed since.
    pub fn from_bytes(bytes: &[u8]) -> Result<Self, TensorError> {
        let (_, header) = SafeTensors::read_metadata(bytes)?;
        let metadata = header.metadata().as_ref().and_then(|entries| entries.get(METADATA_KEY));
        let metadata = metadata.ok_or(TensorError::NoMetadata)?.clone();
        let tensors = SafeTensors::deserialize(bytes)?;
        let arrays = tensors.iter().map(|(name, view)| {
            let array = Array { dtype: view.dtype(), shape: view.shape().to_vec(), bytes: view.data().to_vec() };
            (name.to_owned(), array)
        });
        let mut file = Self { metadata, arrays: arrays.collect() };
        let checksum =
            file.arrays.remove(CHECKSUM_NAME).ok_or_else(|| TensorError::Missing(CHECKSUM_NAME.to_owned()))?;
        if checksum != file.checksum() {
            return Err(TensorError::Checksum);
        }
        Ok(file)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn file() -> TensorFile {
        let mut file = TensorFile::new("{\"a\":1}".to_owned());
        file.push("weights", &[2, 2], &[1.0_f32, -2.5, 0.0, 3.5]);
        file.push("state", &[3], &[0.1_f64, 1e300, -0.0]);
        file
    }

    #[test]
    fn what_is_written_reads_back_with_the_same_bytes() {
        let bytes = file().to_bytes();
        let back = TensorFile::from_bytes(&bytes).unwrap();
        assert_eq!(back, file());
        assert_eq!(back.to_bytes(), bytes);
        assert_eq!(back.get::<f32>("weights", &[2, 2]).unwrap(), [1.0, -2.5, 0.0, 3.5]);
        assert_eq!(back.metadata(), "{\"a\":1}");
    }

    #[test]
    fn wrong_content_is_named() {
        let file = file();
        assert_eq!(file.get::<f32>("bias", &[1]).unwrap_err().to_string(), "the array `bias` is missing");
        let message = file.get::<f32>("weights", &[4]).unwrap_err().to_string();
        assert_eq!(message, "the array `weights` is F32[2, 2], expected F32[4]");
        let mut poisoned = file.clone();
        poisoned.push("state", &[1], &[f64::NAN]);
        assert!(matches!(poisoned.get::<f64>("state", &[1]), Err(TensorError::NotFinite(_))));
        let bytes = file.to_bytes();
        for cut in [0, 1, 8, 20, bytes.len() - 1] {
            assert!(TensorFile::from_bytes(&bytes[..cut]).is_err(), "{cut}");
        }
    }
}
