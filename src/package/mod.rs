//! The build script of the unit: library, descriptions and documentation into one archive, and out of it again.

pub mod raster;

pub mod sketch;

pub mod terminals;

pub mod reference;

pub mod documentation;

pub mod centreline;

pub mod rod_file;

use crate::fmi2::model::{self, Model};
use crate::fmi2::{description, host};
use crate::unit;
use object::{Architecture, Object};
use std::io::{self, Read, Write};
use std::path::{self, Path, PathBuf};
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
    /// The library is for another platform, and does not export all functions of the unit.
    Exports {
        /// How many it does.
        found: usize,
    },
    /// The library does not take the rod.
    NoPlace(model::NoPlace),
    /// The icon cannot be drawn.
    Icon(raster::Error),
    /// The reference results cannot be computed.
    Reference(unit::Error),
    /// An archive that is to be merged is of another model, or of another version of it.
    OtherModel {
        /// The archive.
        archive: PathBuf,
        /// Its GUID.
        guid: String,
        /// The archive it was to be merged into.
        first: PathBuf,
        /// The GUID of that.
        expected: String,
    },
    /// Two archives that are to be merged have different files of one name.
    Differs {
        /// The later archive.
        archive: PathBuf,
        /// The file.
        name: String,
    },
    /// The description in an archive cannot be read.
    Description {
        /// The archive.
        archive: PathBuf,
        /// Why.
        error: host::Error,
    },
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
            Self::Exports { found } => {
                write!(f, "the library exports {found} functions of FMI, {FUNCTIONS} are needed")
            }
            Self::NoPlace(error) => error.fmt(f),
            Self::Icon(error) => write!(f, "the icon of the archive: {error}"),
            Self::Reference(error) => write!(f, "the reference results of the archive: {error}"),
            Self::OtherModel { archive, guid, first, expected } => {
                write!(f, "{}: GUID {guid} is not allowed: {expected}, that of {}", archive.display(), first.display())
            }
            Self::Differs { archive, name } => {
                write!(f, "{}: {name} differs from the one in an archive before", archive.display())
            }
            Self::Description { archive, error } => write!(f, "{}: {error}", archive.display()),
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

/// Writes the archive of a model with the library that was built with the running program, and the directories above it
/// where they are missing.
///
/// # Errors
/// [`Error`]
pub fn package(archive: &Path, model: &Model) -> Result<(), Error> {
    package_library(&library()?, archive, model).map(drop)
}

/// Functions of FMI 2.0 co-simulation.
const FUNCTIONS: usize = 34;

/// How a library was checked.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Checked {
    /// An instance was made, which a library of another version refuses.
    Run,
    /// It is for another platform: its exports were counted.
    Read,
}

/// How many functions of FMI a library for Windows on x86-64 exports; nothing of another file.
fn windows_exports(code: &[u8]) -> Option<usize> {
    let file =
        object::read::pe::PeFile64::parse(code).ok().filter(|file| file.architecture() == Architecture::X86_64)?;
    let is_function = |export: &object::Result<object::Export>| {
        let name = export.as_ref().ok().map(object::Export::name);
        matches!(name, Some(object::NameOrOrdinal::Name(name)) if name.starts_with(b"fmi2"))
    };
    Some(file.exports().map_or(0, |exports| exports.filter(is_function).count()))
}

/// Writes the archive with this library, built for the platform of the running program, or for Windows on x86-64.
///
/// # Errors
/// [`Error`]
pub fn package_library(library: &Path, archive: &Path, model: &Model) -> Result<Checked, Error> {
    let mut code = fs::read(library).map_err(at(library))?;
    let (os, arch) = (env::consts::OS, env::consts::ARCH);
    let (checked, binary) = match windows_exports(&code).filter(|_| (os, arch) != ("windows", "x86_64")) {
        Some(FUNCTIONS) => (Checked::Read, description::binary_for(&model.name, "windows", "x86_64")),
        Some(found) => return Err(Error::Exports { found }),
        None => {
            // The loader looks for a name without a folder elsewhere. A library that was left over from another version
            // answers to another GUID.
            host::Fmu::from_library(&path::absolute(library).map_err(at(library))?)
                .and_then(|fmu| fmu.instantiate("package", false).map(drop))
                .map_err(Error::Library)?;
            (Checked::Run, description::binary(&model.name))
        }
    };
    if *model != Model::default() {
        model::write(&mut code, model).map_err(Error::NoPlace)?;
    }
    let ports = terminals::ports_file(&model.name);
    let [inputs, results, options] = reference::files(model).map_err(Error::Reference)?;
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
        (&inputs.0, inputs.1.into_bytes()),
        (&results.0, results.1.into_bytes()),
        (&options.0, options.1.into_bytes()),
    ];
    write(&files, archive).map(|()| checked)
}

/// Writes one archive of several of the same model, built on different platforms: the files of the first and the
/// libraries of all.
///
/// # Errors
/// [`Error::OtherModel`], [`Error::Differs`], [`Error::Description`], [`Error::Missing`], [`Error::File`]
pub fn merge(archives: &[PathBuf], output: &Path) -> Result<(), Error> {
    let mut files: Vec<(String, Vec<u8>)> = Vec::new();
    let mut first: Option<(&Path, String)> = None;
    for archive in archives {
        let xml = read(archive, description::FILE)?;
        let described = host::Description::parse(&xml);
        let guid = described.map_err(|error| Error::Description { archive: archive.clone(), error })?.guid;
        if let Some((first, expected)) = first.as_ref().filter(|(_, expected)| *expected != guid) {
            let (first, expected) = (first.to_path_buf(), expected.clone());
            return Err(Error::OtherModel { archive: archive.clone(), guid, first, expected });
        }
        let is_first = first.is_none();
        first.get_or_insert((archive, guid));
        for name in names(archive)?.into_iter().filter(|name| is_first || name.starts_with("binaries/")) {
            let content = bytes(archive, &name)?;
            match files.iter().find(|(known, _)| *known == name) {
                Some((_, known)) if *known == content => {}
                Some(_) => return Err(Error::Differs { archive: archive.clone(), name }),
                None => files.push((name, content)),
            }
        }
    }
    write(&files, output)
}

/// Packs these files, and makes the directories above the archive where they are missing.
fn write(files: &[(impl AsRef<str>, Vec<u8>)], archive: &Path) -> Result<(), Error> {
    let bytes = zip(files).map_err(at(archive))?;
    if let Some(directory) = archive.parent() {
        fs::create_dir_all(directory).map_err(at(directory))?;
    }
    fs::write(archive, bytes).map_err(at(archive))
}

/// Deflated, without 64-bit sizes, so that version 2.0 of the format is enough, which is all the standard allows. Every
/// file has the same date, so that the same files give the same bytes.
fn zip(files: &[(impl AsRef<str>, Vec<u8>)]) -> io::Result<Vec<u8>> {
    let options = SimpleFileOptions::default()
        .compression_method(CompressionMethod::Deflated)
        .large_file(false)
        .last_modified_time(zip::DateTime::default());
    let mut writer = ZipWriter::new(io::Cursor::new(Vec::new()));
    for (name, content) in files {
        writer.start_file(name.as_ref(), options)?;
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
    io::read_to_string(&bytes(archive, name)?[..]).map_err(at(&archive.join(name)))
}

/// A file in an archive.
fn bytes(archive: &Path, name: &str) -> Result<Vec<u8>, Error> {
    let mut zip = open(archive)?;
    match zip.by_name(name) {
        Ok(mut file) => {
            let mut content = Vec::new();
            file.read_to_end(&mut content).map_err(at(&archive.join(name)))?;
            Ok(content)
        }
        Err(ZipError::FileNotFound) => Err(Error::Missing { archive: archive.to_owned(), name: name.to_owned() }),
        Err(error) => Err(at(archive)(error.into())),
    }
}
