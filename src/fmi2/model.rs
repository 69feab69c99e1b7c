//! What an archive is of: the name of the model, its start values and its default experiment, and where in the library
//! they stand.
//!
//! One library is compiled, and [`write()`] puts another rod into a copy of it. So a unit needs no file when it runs, and
//! no word from its host of where such a file might lie: many hosts are silent about it, and some are wrong. The library
//! renders its own model description, and so its GUID, from the rod that it holds; a description of another rod does
//! not fit.

use super::description;
use super::variables::Variable;
use crate::archive::{self, Corrupt, archived};
use crate::unit::{Inputs, Parameters};
use std::fmt;

/// One model: an FMU of a name of its own.
#[derive(Clone, Debug, PartialEq)]
pub struct Model {
    /// Model identifier, and name of the library in the archive.
    pub name: String,
    /// What it is, in a line.
    pub description: String,
    /// Default experiment.
    pub experiment: Experiment,
    /// Start values, and the shape of the unstressed rod.
    pub parameters: Parameters,
    /// Start values.
    pub inputs: Inputs,
}

/// The default experiment of a model; it starts at 0.
#[derive(Clone, Debug, PartialEq)]
pub struct Experiment {
    /// End, s.
    pub stop_time: f64,
    /// Communication step, s.
    pub step_size: f64,
    /// Tolerance.
    pub tolerance: f64,
}

impl Model {
    /// The start value of each parameter and input; `None` for an output.
    pub fn starts(&self) -> impl FnMut(&Variable) -> Option<f64> + use<> {
        // the table has one access for reading and writing
        let (mut parameters, mut inputs) = (self.parameters.clone(), self.inputs.clone());
        move |variable| variable.given(&mut parameters, &mut inputs)
    }
}

archived!(Model { name, description, experiment, parameters, inputs });
archived!(Experiment { stop_time, step_size, tolerance });

impl Default for Model {
    /// The unit as it was compiled.
    fn default() -> Self {
        Self {
            name: description::MODEL_IDENTIFIER.to_owned(),
            description: env!("CARGO_PKG_DESCRIPTION").to_owned(),
            experiment: Experiment::default(),
            parameters: Parameters::default(),
            inputs: Inputs::default(),
        }
    }
}

impl Default for Experiment {
    fn default() -> Self {
        Self { stop_time: description::STOP_TIME, step_size: description::STEP_SIZE, tolerance: description::TOLERANCE }
    }
}

/// Bytes of a library that hold a model: a mark, how many of the rest are in use, their checksum, and the rest. A thousand
/// pieces fit in, and 8 kB of all else.
pub type Place = [u8; 40 * 1024];

/// Numbers of bytes before the model.
const HEADER: usize = MARK.len() + 4 + 4;

/// By which the place is found in the file of a library. No text, lest it stand there once more.
const MARK: [u8; 24] = [
    0xc0, 0x55, 0xe4, 0xa7, 0x9f, 0x1b, 0x83, 0x6d, 0x02, 0xf7, 0x5a, 0xc8, 0x3e, 0x91, 0xd4, 0x60, 0xbb, 0x17, 0x7c,
    0xe9, 0x28, 0xa3, 0x4f, 0xd6,
];

/// The place in the library as it is compiled, of the unit itself.
pub const fn empty() -> Place {
    let mut place = [0; size_of::<Place>()];
    let mut k = 0;
    while k < MARK.len() {
        place[k] = MARK[k];
        k += 1;
    }
    place
}

/// Why a model cannot be put into a library.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoPlace {
    /// The file has not one place for it.
    Places {
        /// But so many.
        found: usize,
    },
    /// The model needs too many bytes.
    TooLarge {
        /// How many.
        given: usize,
    },
}

impl fmt::Display for NoPlace {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Places { found } => write!(f, "the library has {found} places for a rod instead of one"),
            Self::TooLarge { given } => {
                write!(f, "the rod needs {given} bytes, the library has {}", size_of::<Place>() - HEADER)
            }
        }
    }
}

impl std::error::Error for NoPlace {}

/// Puts a model into the bytes of a library file. What has been signed, as all that runs on ARM under macOS, has to be
/// signed anew.
///
/// # Errors
/// [`NoPlace`]; the bytes are as before.
pub fn write(library: &mut [u8], model: &Model) -> Result<(), NoPlace> {
    let mut bytes = Vec::new();
    archive::save(&mut model.clone(), &mut bytes);
    let starts = library.windows(MARK.len()).enumerate().filter(|(_, window)| *window == MARK);
    let starts: Vec<usize> = starts.map(|(start, _)| start).collect();
    let place = match starts.as_slice() {
        [start] => library.get_mut(*start..start + size_of::<Place>()),
        _ => None,
    };
    let place = place.ok_or(NoPlace::Places { found: starts.len() })?;
    let length = u32::try_from(bytes.len()).ok().filter(|_| HEADER + bytes.len() <= place.len());
    let length = length.ok_or(NoPlace::TooLarge { given: bytes.len() })?;
    let header = [length.to_le_bytes(), crc32fast::hash(&bytes).to_le_bytes()].concat();
    let rest = header.into_iter().chain(bytes).chain(std::iter::repeat(0));
    place[MARK.len()..].iter_mut().zip(rest).for_each(|(own, byte)| *own = byte);
    Ok(())
}

/// The model in a place, of which `byte` tells the bytes.
///
/// # Errors
/// [`Corrupt`] if somebody else has written there.
pub fn read(byte: impl Fn(usize) -> Option<u8>) -> Result<Model, Corrupt> {
    let bytes =
        |start: usize, count: usize| (start..start.saturating_add(count)).map(&byte).collect::<Option<Vec<u8>>>();
    let number = |start: usize| {
        let bytes = bytes(start, 4).and_then(|bytes| bytes.try_into().ok());
        bytes.map(u32::from_le_bytes).ok_or(Corrupt::TooShort)
    };
    let (length, checksum) = (number(MARK.len())?, number(MARK.len() + 4)?);
    let mut model = Model::default();
    if length > 0 {
        let bytes = bytes(HEADER, length as usize).ok_or(Corrupt::TooShort)?;
        if crc32fast::hash(&bytes) != checksum {
            return Err(Corrupt::Refused { why: "its bytes do not belong to its checksum".to_owned() });
        }
        archive::load(&mut model, &bytes)?;
    }
    Ok(model)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::rest::{MAX_PIECES, Piece, RestShape};
    use nalgebra::Vector3;

    fn read_from(place: &[u8]) -> Result<Model, Corrupt> {
        read(|k| place.get(k).copied())
    }

    fn largest() -> Model {
        let piece = |k: usize| Piece { part: 1.0 / MAX_PIECES as f64, turn: Vector3::repeat(k as f64) };
        let rest_shape = RestShape::new(&(0..MAX_PIECES).map(piece).collect::<Vec<_>>()).unwrap();
        let parameters = Parameters { rest_shape, length: 0.3, ..Parameters::default() };
        Model { name: "x".repeat(100), description: "ä".repeat(1000), parameters, ..Model::default() }
    }

    #[test]
    fn a_library_holds_the_model_that_was_put_into_it() {
        let mut library = [vec![7; 1000], empty().to_vec(), vec![9; 1000]].concat();
        assert_eq!(read_from(&library[1000..]), Ok(Model::default()));
        let before = library.len();
        write(&mut library, &largest()).unwrap();
        assert_eq!(read_from(&library[1000..]), Ok(largest()));
        assert_eq!((library.len(), library[999], library[1000 + empty().len()]), (before, 7, 9));
        // and then another
        let small = Model { name: "Small".to_owned(), ..Model::default() };
        write(&mut library, &small).unwrap();
        assert_eq!(read_from(&library[1000..]), Ok(small));
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut none = vec![0; 100];
        assert_eq!(write(&mut none, &Model::default()), Err(NoPlace::Places { found: 0 }));
        let mut twice = [empty(), empty()].concat();
        assert_eq!(write(&mut twice, &Model::default()), Err(NoPlace::Places { found: 2 }));
        let mut once = empty().to_vec();
        let long = Model { description: "x".repeat(50_000), ..Model::default() };
        assert!(matches!(write(&mut once, &long), Err(NoPlace::TooLarge { .. })));
        assert_eq!(once, empty());
        write(&mut once, &largest()).unwrap();
        once[1000] ^= 1;
        assert!(read_from(&once).unwrap_err().to_string().contains("checksum"));
        assert_eq!(read_from(&once[..1000]), Err(Corrupt::TooShort));
    }
}
