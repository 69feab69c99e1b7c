//! The build script of the unit: library, descriptions and documentation into one archive, and out of it again.

pub mod raster;

pub mod sketch;

pub mod terminals;

pub mod documentation;

pub mod centreline;

pub mod rod_file;

use crate::fmi2::model::{self, Model};
use crate::fmi2::{description, host};
use std::io::{self, Write};
use std::path::{Path, PathBuf};
use std::{env, fmt, fs};
use zip::result::ZipError;
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// Why there is no archive.
#[derive(Debug)]
pub enum Error {
    /// The library has not been built.
    NoLibrary {
        /// Where it was looked for.
        places: Vec<PathBuf>,
    },
    /// The library cannot be loaded, or is of another version than this program.
    Library(host::Error),
    /// The library does not take the rod.
    NoPlace(model::NoPlace),
    /// The icon cannot be drawn.
    Icon(raster::Error),
    /// An archive has no file of this name.
    Missing {
        /// The archive.
        archive: PathBuf,
        /// The file.
        name: String,
    },
    /// A file cannot be read or written.
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoLibrary { places } => {
                write!(f, "the library is missing, build it with 'cargo build'; looked for")?;
                places.iter().try_for_each(|place| write!(f, " {}", place.display()))
            }
            Self::Library(error) => write!(f, "the library does not fit this program, build both again: {error}"),
            Self::NoPlace(error) => error.fmt(f),
            Self::Icon(error) => write!(f, "the icon of the archive: {error}"),
            Self::Missing { archive, name } => write!(f, "{}: no {name} in the archive", archive.display()),
            Self::File { path, error } => write!(f, "{}: {error}", path.display()),
        }
    }
}

impl std::error::Error for Error {}

fn at(path: &Path) -> impl Fn(io::Error) -> Error {
    |error| Error::File { path: path.to_owned(), error }
}

/// The library that was built with the running program.
///
/// It lies beside the program, in `deps` beside it, or in its parent if the program is a test. `cargo test` renews only
/// that in `deps`, `cargo build` both: the youngest is the one.
///
/// # Errors
/// [`Error::NoLibrary`]
pub fn library() -> Result<PathBuf, Error> {
    let (prefix, suffix) = (env::consts::DLL_PREFIX, env::consts::DLL_SUFFIX);
    let name = format!("{prefix}cosserat_rod{suffix}");
    let program = env::current_exe().map_err(at(Path::new("this program")))?;
    let directory = program.parent().unwrap_or(Path::new("."));
    let places: Vec<PathBuf> = ["", "deps", "..", "../deps"].iter().map(|to| directory.join(to).join(&name)).collect();
    let age = |place: &&PathBuf| fs::metadata(place).and_then(|metadata| metadata.modified()).ok();
    match places.iter().filter(|place| age(place).is_some()).max_by_key(age) {
        Some(place) => Ok(place.clone()),
        None => Err(Error::NoLibrary { places }),
    }
}

/// Writes the archive of a model, and the directories above it where they are missing.
///
/// # Errors
/// [`Error`]
pub fn package(archive: &Path, model: &Model) -> Result<(), Error> {
    let library = library()?;
    // A library that was left over from another version answers to another GUID.
    host::Fmu::from_library(&library)
        .and_then(|fmu| fmu.instantiate("package", false).map(drop))
        .map_err(Error::Library)?;
    let mut code = fs::read(&library).map_err(at(&library))?;
    if *model != Model::default() {
        model::write(&mut code, model).map_err(Error::NoPlace)?;
    }
    let (binary, ports) = (description::binary(&model.name), terminals::ports_file(&model.name));
    let files = [
        (description::FILE, description::xml(model).into_bytes()),
        (sketch::ICON, raster::png(&sketch::svg(), 1).map_err(Error::Icon)?),
        (binary.as_str(), code),
        (documentation::INDEX, documentation::index(model).into_bytes()),
        ("documentation/licenses/LICENSE-APACHE.txt", include_bytes!("../../LICENSE-APACHE").to_vec()),
        ("documentation/licenses/LICENSE-MIT.txt", include_bytes!("../../LICENSE-MIT").to_vec()),
        ("documentation/licenses/THIRD-PARTY.txt", include_bytes!("../../THIRD-PARTY.txt").to_vec()),
        (terminals::TERMINALS, terminals::terminals().into_bytes()),
        (&ports, terminals::ports().into_bytes()),
    ];
    let bytes = zip(&files).map_err(at(archive))?;
    if let Some(directory) = archive.parent() {
        fs::create_dir_all(directory).map_err(at(directory))?;
    }
    fs::write(archive, bytes).map_err(at(archive))
}

/// Deflated, without 64-bit sizes, so that version 2.0 of the format is enough, which is all the standard allows. Every
/// file has the same date, so that the same files give the same bytes.
fn zip(files: &[(&str, Vec<u8>)]) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(false)
        .last_modified_time(zip::DateTime::default());
    let mut writer = ZipWriter::new(io::Cursor::new(Vec::new()));
    for (name, content) in files {
        writer.start_file(*name, options)?;
        writer.write_all(content)?;
    }
    Ok(writer.finish()?.into_inner())
}

fn open(archive: &Path) -> Result<ZipArchive<fs::File>, Error> {
    let file = fs::File::open(archive).map_err(at(archive))?;
    ZipArchive::new(file).map_err(|error| at(archive)(error.into()))
}

/// Unpacks an archive into a directory, which is made where it is missing.
///
/// # Errors
/// [`Error::File`]
pub fn unpack(archive: &Path, directory: &Path) -> Result<(), Error> {
    open(archive)?.extract(directory).map_err(|error| at(archive)(error.into()))
}

/// The names of the files in an archive.
///
/// # Errors
/// [`Error::File`]
pub fn names(archive: &Path) -> Result<Vec<String>, Error> {
    let zip = open(archive)?;
    let names: Result<Vec<String>, _> = zip.file_names().map(|name| name.map(|name| name.into_owned())).collect();
    let mut names = names.map_err(|error| at(archive)(io::Error::other(error)))?;
    // those that end so are folders
    names.retain(|name| !name.ends_with('/'));
    Ok(names)
}

/// A text in an archive.
///
/// # Errors
/// [`Error::Missing`], [`Error::File`]
pub fn read(archive: &Path, name: &str) -> Result<String, Error> {
    let mut zip = open(archive)?;
    match zip.by_name(name) {
        Ok(file) => io::read_to_string(file).map_err(at(&archive.join(name))),
        Err(ZipError::FileNotFound) => Err(Error::Missing { archive: archive.to_owned(), name: name.to_owned() }),
        Err(error) => Err(at(archive)(error.into())),
    }
}
