//! Saving and loading. A struct names what it stores once, and the same lines write it and read it; it knows no rod.
//!
//! Numbers follow each other with their lowest byte first, without names and types: only what was saved by the same
//! fields in the same order can be loaded, and whoever keeps the bytes has to see to that. Bytes that end early or late,
//! and choices that are unknown, are refused.

use nalgebra::SMatrix;
use std::fmt;

/// Bytes that are written or read.
#[derive(Debug)]
pub enum Archive<'a> {
    /// What is visited is appended to these.
    Saving(&'a mut Vec<u8>),
    /// What is visited is taken from the beginning of these.
    Loading(&'a [u8]),
}

/// What can be saved and loaded.
pub trait Archived {
    /// Passes all that is stored to the archive, in an order that depends on nothing else. Saving changes nothing.
    ///
    /// # Errors
    /// [`Corrupt`] while loading; what was visited by then is of no use.
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt>;
}

/// Why bytes cannot be loaded.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Corrupt {
    /// They end too early.
    TooShort,
    /// They go on after the end.
    TooLong {
        /// Bytes too many.
        left: usize,
    },
    /// A choice is not among those there are.
    NoChoice {
        /// Its number.
        given: u8,
        /// How many there are.
        choices: usize,
    },
    /// What they say is not allowed.
    Refused {
        /// By what.
        why: String,
    },
}

impl fmt::Display for Corrupt {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooShort => write!(f, "it ends too early"),
            Self::TooLong { left } => write!(f, "it goes on for {left} bytes after its end"),
            Self::NoChoice { given, choices } => write!(f, "choice {given} of {choices}, counted from 0"),
            Self::Refused { why } => f.write_str(why),
        }
    }
}

impl std::error::Error for Corrupt {}

/// Saves `what` in place of all that `bytes` hold.
pub fn save(what: &mut impl Archived, bytes: &mut Vec<u8>) {
    bytes.clear();
    let written = what.visit(&mut Archive::Saving(bytes));
    debug_assert!(written.is_ok(), "memory takes every byte");
}

/// Loads `what` from all of `bytes`.
///
/// # Errors
/// [`Corrupt`]; `what` is of no use then.
pub fn load(what: &mut impl Archived, bytes: &[u8]) -> Result<(), Corrupt> {
    let mut archive = Archive::Loading(bytes);
    what.visit(&mut archive)?;
    match archive {
        Archive::Loading([]) | Archive::Saving(_) => Ok(()),
        Archive::Loading(rest) => Err(Corrupt::TooLong { left: rest.len() }),
    }
}

/// Whether both store the same bytes.
pub fn are_same<T: Archived>(a: &mut T, b: &mut T) -> bool {
    let [mut first, mut second] = [Vec::new(), Vec::new()];
    save(a, &mut first);
    save(b, &mut second);
    first == second
}

impl Archive<'_> {
    /// Whether what is visited is overwritten.
    pub fn is_loading(&self) -> bool {
        matches!(self, Self::Loading(_))
    }

    /// Visits one of `all`, of which there are less than 256.
    ///
    /// # Errors
    /// [`Corrupt`] while loading.
    pub fn choose<T: Copy + PartialEq>(&mut self, value: &mut T, all: &[T]) -> Result<(), Corrupt> {
        let mut number = all.iter().position(|choice| choice == value).unwrap_or(all.len()) as u8;
        number.visit(self)?;
        let chosen = all.get(usize::from(number));
        *value = *chosen.ok_or(Corrupt::NoChoice { given: number, choices: all.len() })?;
        Ok(())
    }

    fn bytes<const N: usize>(&mut self, own: [u8; N]) -> Result<[u8; N], Corrupt> {
        match self {
            Self::Saving(bytes) => {
                bytes.extend_from_slice(&own);
                Ok(own)
            }
            Self::Loading(bytes) => {
                let (first, rest) = bytes.split_first_chunk().ok_or(Corrupt::TooShort)?;
                *bytes = rest;
                Ok(*first)
            }
        }
    }
}

/// Numbers, as they are in memory, byte by byte.
macro_rules! numbers {
    ($($number:ty),*) => {
        $(impl Archived for $number {
            fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
                *self = Self::from_le_bytes(archive.bytes(self.to_le_bytes())?);
                Ok(())
            }
        })*
    };
}

numbers!(u8, u32, u64, i32, f64);

impl Archived for bool {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        archive.choose(self, &[false, true])
    }
}

/// As many as there are.
impl<T: Archived> Archived for [T] {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        self.iter_mut().try_for_each(|element| element.visit(archive))
    }
}

impl<T: Archived, const N: usize> Archived for [T; N] {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        self.as_mut_slice().visit(archive)
    }
}

impl<const R: usize, const C: usize> Archived for SMatrix<f64, R, C> {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        self.as_mut_slice().visit(archive)
    }
}

/// Its length, and then its elements: nothing is allocated where there is room for as many.
impl<T: Archived + Clone + Default> Archived for Vec<T> {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        let mut length = self.len() as u64;
        length.visit(archive)?;
        if let Archive::Loading(bytes) = archive {
            // an element has one byte at least: what asks for more memory than that is no length
            let length = usize::try_from(length).ok().filter(|length| *length <= bytes.len());
            self.resize(length.ok_or(Corrupt::TooShort)?, T::default());
        }
        self.as_mut_slice().visit(archive)
    }
}

/// Its bytes, as they are in UTF-8.
impl Archived for String {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        let mut bytes = std::mem::take(self).into_bytes();
        bytes.visit(archive)?;
        *self = Self::from_utf8(bytes).map_err(|error| Corrupt::Refused { why: error.to_string() })?;
        Ok(())
    }
}

impl<A: Archived, B: Archived> Archived for (A, B) {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        self.0.visit(archive)?;
        self.1.visit(archive)
    }
}

impl Archived for Option<f64> {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        let mut is_some = self.is_some();
        let mut value = self.unwrap_or_default();
        is_some.visit(archive)?;
        value.visit(archive)?;
        *self = is_some.then_some(value);
        Ok(())
    }
}

/// Names the fields that a struct stores and, after `but`, those that it does not, so that none is forgotten.
macro_rules! archived {
    ($type:ident { $($stored:ident),* $(,)? } $(but { $($other:ident),* $(,)? })?) => {
        impl $crate::archive::Archived for $type {
            fn visit(&mut self, archive: &mut $crate::archive::Archive) -> Result<(), $crate::archive::Corrupt> {
                let Self { $($stored,)* $($($other: _,)*)? } = self;
                $($crate::archive::Archived::visit($stored, archive)?;)*
                Ok(())
            }
        }
    };
}
pub(crate) use archived;

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::{Matrix3, Vector3};

    #[derive(Clone, Debug, Default, PartialEq)]
    struct Thing {
        number: f64,
        count: u32,
        yes: bool,
        limit: Option<f64>,
        name: String,
        list: Vec<(Vector3<f64>, i32)>,
        matrix: Matrix3<f64>,
        scratch: u8,
    }

    archived!(Thing { number, count, yes, limit, name, list, matrix } but { scratch });

    fn thing() -> Thing {
        let list = vec![(Vector3::new(1.0, -0.0, f64::MIN_POSITIVE), -7); 3];
        let matrix = Matrix3::from_fn(|i, j| (3 * i + j) as f64);
        let (limit, name) = (Some(f64::INFINITY), "κ".to_owned());
        Thing { number: 0.1, count: 5, yes: true, limit, name, list, matrix, scratch: 9 }
    }

    #[test]
    fn what_is_loaded_is_what_was_saved() {
        let (mut saved, mut bytes) = (thing(), vec![1]);
        save(&mut saved, &mut bytes);
        assert_eq!(saved, thing());
        assert_eq!(bytes.len(), 8 + 4 + 1 + 9 + 10 + 8 + 3 * 28 + 72);
        assert_eq!(bytes[..8], 0.1f64.to_le_bytes());
        let mut loaded = Thing::default();
        load(&mut loaded, &bytes).unwrap();
        assert_eq!(loaded, Thing { scratch: 0, ..thing() });
        assert_eq!(loaded.list[0].0.y.to_bits(), (-0.0f64).to_bits());
    }

    #[test]
    fn what_does_not_fit_is_refused() {
        let mut bytes = Vec::new();
        save(&mut thing(), &mut bytes);
        for length in 0..bytes.len() {
            assert_eq!(load(&mut Thing::default(), &bytes[..length]), Err(Corrupt::TooShort), "{length}");
        }
        let mut endless = bytes.clone();
        endless[32..40].fill(0xff);
        assert_eq!(load(&mut Thing::default(), &endless), Err(Corrupt::TooShort));
        bytes.extend([0; 5]);
        assert_eq!(load(&mut Thing::default(), &bytes), Err(Corrupt::TooLong { left: 5 }));
        bytes[30] = 0xff;
        assert!(matches!(load(&mut Thing::default(), &bytes), Err(Corrupt::Refused { .. })));
        bytes[12] = 2;
        assert_eq!(load(&mut Thing::default(), &bytes), Err(Corrupt::NoChoice { given: 2, choices: 2 }));
    }
}
