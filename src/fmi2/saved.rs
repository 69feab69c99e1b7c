//! A saved state as bytes that leave the process: before the state itself, as [`crate::archive`] has it, stands what it is,
//! of what, and by which it is told whether it is whole.

use crate::archive::{self, archived};
use std::fmt;

const MAGIC: [u8; 8] = *b"COSSEROD";

/// Number of the order in which fields are stored, to be counted up whenever that changes.
const FORMAT: u32 = 1;

struct Header {
    magic: [u8; 8],
    format: u32,
    /// Of the model description.
    guid: [u8; GUID],
    length: u64,
    /// CRC-32 of the state.
    checksum: u32,
}

/// Bytes of a GUID with its braces.
const GUID: usize = 38;

/// Bytes before the state.
pub const HEADER: usize = 8 + 4 + GUID + 8 + 4;

/// Why bytes are no saved state.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum Unreadable {
    /// They do not begin like one.
    Foreign,
    /// Another release of the library wrote them.
    Format {
        /// In this format.
        given: u32,
    },
    /// They belong to another model description.
    Guid {
        /// With this GUID.
        given: String,
        /// In place of this one.
        expected: String,
    },
    /// Some are missing, or too many.
    Length {
        /// How many there are.
        given: usize,
        /// How many there should be.
        expected: u64,
    },
    /// Some have changed.
    Checksum,
}

impl fmt::Display for Unreadable {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Foreign => write!(f, "it does not begin like one of this unit"),
            Self::Format { given } => write!(f, "its format is {given}, this library has {FORMAT}"),
            Self::Guid { given, expected } => write!(f, "its GUID is '{given}', this library is {expected}"),
            Self::Length { given, expected } => write!(f, "it has {given} bytes in place of {expected}"),
            Self::Checksum => write!(f, "its bytes do not belong to its checksum"),
        }
    }
}

archived!(Header { magic, format, guid, length, checksum });

impl Header {
    fn of(state: &[u8], guid: &str) -> Self {
        let mut own = [0; GUID];
        own.iter_mut().zip(guid.bytes()).for_each(|(own, byte)| *own = byte);
        let (length, checksum) = (state.len() as u64, crc32fast::hash(state));
        Self { magic: MAGIC, format: FORMAT, guid: own, length, checksum }
    }
}

/// The state with all that tells what it is; `guid` is that of the model description.
pub fn sealed(state: &[u8], guid: &str) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(HEADER + state.len());
    archive::save(&mut Header::of(state, guid), &mut bytes);
    bytes.extend_from_slice(state);
    bytes
}

/// The state among bytes that [`sealed`] made.
///
/// # Errors
/// [`Unreadable`] says what they are instead.
pub fn opened<'a>(bytes: &'a [u8], guid: &str) -> Result<&'a [u8], Unreadable> {
    let (first, state) = bytes.split_at_checked(HEADER).ok_or(Unreadable::Foreign)?;
    let own = Header::of(state, guid);
    let mut header = Header::of(&[], guid);
    archive::load(&mut header, first).map_err(|_| Unreadable::Foreign)?;
    if header.magic != own.magic {
        return Err(Unreadable::Foreign);
    }
    if header.format != own.format {
        return Err(Unreadable::Format { given: header.format });
    }
    if header.guid != own.guid {
        let given = String::from_utf8_lossy(&header.guid).into_owned();
        return Err(Unreadable::Guid { given, expected: guid.to_owned() });
    }
    if header.length != own.length {
        let expected = header.length.saturating_add(HEADER as u64);
        return Err(Unreadable::Length { given: bytes.len(), expected });
    }
    if header.checksum == own.checksum { Ok(state) } else { Err(Unreadable::Checksum) }
}
