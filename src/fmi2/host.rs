//! The other side of the C boundary: loads an unpacked unit and drives it through its C functions only, as a master
//! does that knows nothing but the model description. For the commands, the tests and the benchmarks.
//!
//! `unsafe` here is what it is for every host: the library is trusted to be what it claims. It shares the C types with
//! `abi`, as two programs share the headers, and nothing else.
#![allow(unsafe_code, non_snake_case)]

pub use super::abi::{
    CO_SIMULATION, fmi2Boolean, fmi2Byte, fmi2CallbackFunctions, fmi2CallbackLogger, fmi2Component,
    fmi2ComponentEnvironment, fmi2FMUstate, fmi2Integer, fmi2Real, fmi2Status, fmi2String, fmi2ValueReference,
};
use super::description;
use super::model::Model;
use super::variables::Kind;
use libloading::Library;
use quick_xml::events::{BytesStart, Event};
use quick_xml::{Reader, XmlVersion};
use std::collections::BTreeMap;
use std::ffi::{CStr, CString, c_int, c_void};
use std::path::{Path, PathBuf};
use std::str::FromStr;
use std::sync::{Mutex, PoisonError};
use std::{fmt, fs, io, ptr};

/// Takes an instance and nothing else.
pub type Plain = unsafe extern "C" fn(fmi2Component) -> fmi2Status;
/// Reads variables.
pub type Get<T> = unsafe extern "C" fn(fmi2Component, *const fmi2ValueReference, usize, *mut T) -> fmi2Status;
/// Writes variables.
pub type Set<T> = unsafe extern "C" fn(fmi2Component, *const fmi2ValueReference, usize, *const T) -> fmi2Status;
/// Asks for a status.
pub type Inquire<T> = unsafe extern "C" fn(fmi2Component, c_int, *mut T) -> fmi2Status;
/// Signature of `fmi2Instantiate`.
pub type Instantiate = unsafe extern "C" fn(
    fmi2String,
    c_int,
    fmi2String,
    fmi2String,
    *const fmi2CallbackFunctions,
    fmi2Boolean,
    fmi2Boolean,
) -> fmi2Component;
/// Signature of `fmi2SetupExperiment`.
pub type SetupExperiment =
    unsafe extern "C" fn(fmi2Component, fmi2Boolean, fmi2Real, fmi2Real, fmi2Boolean, fmi2Real) -> fmi2Status;
/// Signature of `fmi2GetDirectionalDerivative`.
pub type GetDirectionalDerivative = unsafe extern "C" fn(
    fmi2Component,
    *const fmi2ValueReference,
    usize,
    *const fmi2ValueReference,
    usize,
    *const fmi2Real,
    *mut fmi2Real,
) -> fmi2Status;

/// The 34 functions of co-simulation, under their C names without the prefix.
#[allow(missing_docs)]
#[derive(Clone, Copy, Debug)]
pub struct Functions {
    pub GetTypesPlatform: unsafe extern "C" fn() -> fmi2String,
    pub GetVersion: unsafe extern "C" fn() -> fmi2String,
    pub SetDebugLogging: unsafe extern "C" fn(fmi2Component, fmi2Boolean, usize, *const fmi2String) -> fmi2Status,
    pub Instantiate: Instantiate,
    pub FreeInstance: unsafe extern "C" fn(fmi2Component),
    pub SetupExperiment: SetupExperiment,
    pub EnterInitializationMode: Plain,
    pub ExitInitializationMode: Plain,
    pub Terminate: Plain,
    pub Reset: Plain,
    pub GetReal: Get<fmi2Real>,
    pub GetInteger: Get<fmi2Integer>,
    pub GetBoolean: Get<fmi2Boolean>,
    pub GetString: Get<fmi2String>,
    pub SetReal: Set<fmi2Real>,
    pub SetInteger: Set<fmi2Integer>,
    pub SetBoolean: Set<fmi2Boolean>,
    pub SetString: Set<fmi2String>,
    pub GetFMUstate: unsafe extern "C" fn(fmi2Component, *mut fmi2FMUstate) -> fmi2Status,
    pub SetFMUstate: unsafe extern "C" fn(fmi2Component, fmi2FMUstate) -> fmi2Status,
    pub FreeFMUstate: unsafe extern "C" fn(fmi2Component, *mut fmi2FMUstate) -> fmi2Status,
    pub SerializedFMUstateSize: unsafe extern "C" fn(fmi2Component, fmi2FMUstate, *mut usize) -> fmi2Status,
    pub SerializeFMUstate: unsafe extern "C" fn(fmi2Component, fmi2FMUstate, *mut fmi2Byte, usize) -> fmi2Status,
    pub DeSerializeFMUstate:
        unsafe extern "C" fn(fmi2Component, *const fmi2Byte, usize, *mut fmi2FMUstate) -> fmi2Status,
    pub GetDirectionalDerivative: GetDirectionalDerivative,
    pub SetRealInputDerivatives: unsafe extern "C" fn(
        fmi2Component,
        *const fmi2ValueReference,
        usize,
        *const fmi2Integer,
        *const fmi2Real,
    ) -> fmi2Status,
    pub GetRealOutputDerivatives: unsafe extern "C" fn(
        fmi2Component,
        *const fmi2ValueReference,
        usize,
        *const fmi2Integer,
        *mut fmi2Real,
    ) -> fmi2Status,
    pub DoStep: unsafe extern "C" fn(fmi2Component, fmi2Real, fmi2Real, fmi2Boolean) -> fmi2Status,
    pub CancelStep: Plain,
    pub GetStatus: Inquire<fmi2Status>,
    pub GetRealStatus: Inquire<fmi2Real>,
    pub GetIntegerStatus: Inquire<fmi2Integer>,
    pub GetBooleanStatus: Inquire<fmi2Boolean>,
    pub GetStringStatus: Inquire<fmi2String>,
}

impl Functions {
    fn load(library: &Library) -> Result<Self, Error> {
        /// # Safety
        /// The symbol, if it is there, is of type `T`.
        unsafe fn symbol<T: Copy>(library: &Library, name: &'static str) -> Result<T, Error> {
            unsafe { library.get::<T>(name) }.map(|found| *found).map_err(|error| Error::Symbol { name, error })
        }
        unsafe {
            Ok(Self {
                GetTypesPlatform: symbol(library, "fmi2GetTypesPlatform")?,
                GetVersion: symbol(library, "fmi2GetVersion")?,
                SetDebugLogging: symbol(library, "fmi2SetDebugLogging")?,
                Instantiate: symbol(library, "fmi2Instantiate")?,
                FreeInstance: symbol(library, "fmi2FreeInstance")?,
                SetupExperiment: symbol(library, "fmi2SetupExperiment")?,
                EnterInitializationMode: symbol(library, "fmi2EnterInitializationMode")?,
                ExitInitializationMode: symbol(library, "fmi2ExitInitializationMode")?,
                Terminate: symbol(library, "fmi2Terminate")?,
                Reset: symbol(library, "fmi2Reset")?,
                GetReal: symbol(library, "fmi2GetReal")?,
                GetInteger: symbol(library, "fmi2GetInteger")?,
                GetBoolean: symbol(library, "fmi2GetBoolean")?,
                GetString: symbol(library, "fmi2GetString")?,
                SetReal: symbol(library, "fmi2SetReal")?,
                SetInteger: symbol(library, "fmi2SetInteger")?,
                SetBoolean: symbol(library, "fmi2SetBoolean")?,
                SetString: symbol(library, "fmi2SetString")?,
                GetFMUstate: symbol(library, "fmi2GetFMUstate")?,
                SetFMUstate: symbol(library, "fmi2SetFMUstate")?,
                FreeFMUstate: symbol(library, "fmi2FreeFMUstate")?,
                SerializedFMUstateSize: symbol(library, "fmi2SerializedFMUstateSize")?,
                SerializeFMUstate: symbol(library, "fmi2SerializeFMUstate")?,
                DeSerializeFMUstate: symbol(library, "fmi2DeSerializeFMUstate")?,
                GetDirectionalDerivative: symbol(library, "fmi2GetDirectionalDerivative")?,
                SetRealInputDerivatives: symbol(library, "fmi2SetRealInputDerivatives")?,
                GetRealOutputDerivatives: symbol(library, "fmi2GetRealOutputDerivatives")?,
                DoStep: symbol(library, "fmi2DoStep")?,
                CancelStep: symbol(library, "fmi2CancelStep")?,
                GetStatus: symbol(library, "fmi2GetStatus")?,
                GetRealStatus: symbol(library, "fmi2GetRealStatus")?,
                GetIntegerStatus: symbol(library, "fmi2GetIntegerStatus")?,
                GetBooleanStatus: symbol(library, "fmi2GetBooleanStatus")?,
                GetStringStatus: symbol(library, "fmi2GetStringStatus")?,
            })
        }
    }
}

/// Why a unit cannot be driven.
#[derive(Debug)]
pub enum Error {
    /// The model description cannot be read.
    Read {
        /// Of the file.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// The model description is no XML.
    Xml(quick_xml::Error),
    /// The model description ends before its elements do.
    Truncated,
    /// An attribute of the model description is no number.
    NotANumber {
        /// Its name.
        attribute: &'static str,
        /// Its value, empty where it is missing.
        value: String,
    },
    /// The library cannot be loaded.
    Load {
        /// Of the library.
        path: PathBuf,
        /// Why.
        error: libloading::Error,
    },
    /// A function is missing.
    Symbol {
        /// Its name.
        name: &'static str,
        /// Why.
        error: libloading::Error,
    },
    /// `fmi2Instantiate` gave no instance.
    NoInstance {
        /// What it said.
        log: Vec<Line>,
    },
    /// A call was not answered with fmi2OK or fmi2Warning.
    Refused {
        /// Name of the function.
        function: &'static str,
        /// Its answer.
        status: fmi2Status,
        /// What it said.
        log: Vec<Line>,
    },
    /// The model description knows no such variable of this type.
    UnknownVariable {
        /// Its name.
        name: String,
    },
    /// As many values as references are needed.
    Lengths {
        /// How many references.
        references: usize,
        /// How many values.
        values: usize,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let lines =
            |f: &mut fmt::Formatter<'_>, log: &[Line]| log.iter().try_for_each(|line| write!(f, "; {}", line.text));
        match self {
            Self::Read { path, error } => write!(f, "{}: {error}", path.display()),
            Self::Xml(error) => write!(f, "model description: {error}"),
            Self::Truncated => write!(f, "the model description ends before its elements do"),
            Self::NotANumber { attribute, value } => {
                write!(f, "model description: {attribute} = \"{value}\" is no such number")
            }
            Self::Load { path, error } => match reason(error) {
                // most systems name the file themselves
                text if text.contains(&*path.to_string_lossy()) => f.write_str(&text),
                text => write!(f, "{}: {text}", path.display()),
            },
            Self::Symbol { name, error } => write!(f, "{name}: {}", reason(error)),
            Self::NoInstance { log } => {
                write!(f, "fmi2Instantiate gave no instance")?;
                lines(f, log)
            }
            Self::Refused { function, status, log } => {
                write!(f, "{function} answered {}", status.0)?;
                lines(f, log)
            }
            Self::UnknownVariable { name } => write!(f, "the model description has no variable {name} of this type"),
            Self::Lengths { references, values } => write!(f, "{references} value references but {values} values"),
        }
    }
}

impl std::error::Error for Error {}

/// What the system says; the error itself only says what was tried.
fn reason(error: &libloading::Error) -> String {
    std::error::Error::source(error).map_or_else(|| error.to_string(), ToString::to_string)
}

/// A line of the log.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Line {
    /// Name of the instance.
    pub instance: String,
    /// Answer of the call that wrote it.
    pub status: fmi2Status,
    /// Log category.
    pub category: String,
    /// Text.
    pub text: String,
}

/// A variable, as far as a master has to know it.
#[derive(Clone, Debug, PartialEq)]
pub struct Variable {
    /// Value reference.
    pub reference: fmi2ValueReference,
    /// Type.
    pub kind: Kind,
    /// `parameter`, `input` or `output`.
    pub causality: String,
    /// `fixed`, `tunable`, `discrete` or `continuous`.
    pub variability: String,
    /// Start value as written; empty for outputs.
    pub start: String,
    /// Unit, empty if none.
    pub unit: String,
}

/// The model description, as far as a master has to know it. What the file does not say is empty, or 0.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Description {
    /// Version of the standard.
    pub fmi_version: String,
    /// Name of the model.
    pub model_name: String,
    /// GUID.
    pub guid: String,
    /// What made it.
    pub generation_tool: String,
    /// Attributes of the element `CoSimulation`: the model identifier and the capabilities. Empty for a unit that is none.
    pub co_simulation: BTreeMap<String, String>,
    /// Start of the default experiment, s.
    pub start_time: f64,
    /// End of the default experiment, s.
    pub stop_time: f64,
    /// Communication step of the default experiment, s.
    pub step_size: f64,
    /// Variables by name.
    pub variables: BTreeMap<String, Variable>,
    /// Their names as they stand in the file, where one may stand twice.
    pub order: Vec<String>,
    /// The outputs of the model structure: places in `order`, from 1.
    pub outputs: Vec<usize>,
}

impl Description {
    /// Reads the text of a `modelDescription.xml`. Enumerations are read as what their C functions take them for, integers.
    ///
    /// # Errors
    /// [`Error::Xml`], [`Error::Truncated`], [`Error::NotANumber`]
    pub fn parse(xml: &str) -> Result<Self, Error> {
        let mut reader = Reader::from_str(xml);
        let mut description = Self::default();
        let mut path: Vec<String> = Vec::new();
        let mut open: Option<(String, Variable)> = None;
        loop {
            let event = reader.read_event().map_err(Error::Xml)?;
            let element = match &event {
                Event::Start(element) | Event::Empty(element) => element,
                Event::End(_) => {
                    path.pop();
                    continue;
                }
                Event::Eof if path.is_empty() => return Ok(description),
                Event::Eof => return Err(Error::Truncated),
                _ => continue,
            };
            description.take(element, path.last().map_or("", String::as_str), &mut open)?;
            if let Event::Start(element) = &event {
                path.push(element.name().as_ref().to_owned());
            }
        }
    }

    /// Takes what an element says; `open` is the variable whose type comes next.
    fn take(
        &mut self,
        element: &BytesStart<'_>,
        parent: &str,
        open: &mut Option<(String, Variable)>,
    ) -> Result<(), Error> {
        let get = |name| attribute(element, name);
        let time = |name| match get(name)? {
            text if text.is_empty() => Ok(0.0),
            text => number(name, text),
        };
        let kind = match element.name().as_ref() {
            "fmiModelDescription" => {
                self.fmi_version = get("fmiVersion")?;
                self.model_name = get("modelName")?;
                self.guid = get("guid")?;
                self.generation_tool = get("generationTool")?;
                return Ok(());
            }
            "CoSimulation" => {
                for found in element.attributes() {
                    let found = found.map_err(|error| Error::Xml(error.into()))?;
                    let name = found.key.as_ref().to_owned();
                    let value = attribute(element, &name)?;
                    self.co_simulation.insert(name, value);
                }
                return Ok(());
            }
            "DefaultExperiment" => {
                self.start_time = time("startTime")?;
                self.stop_time = time("stopTime")?;
                self.step_size = time("stepSize")?;
                return Ok(());
            }
            "Unknown" if parent == "Outputs" => {
                self.outputs.push(number("index", get("index")?)?);
                return Ok(());
            }
            "ScalarVariable" => {
                let variable = Variable {
                    reference: number("valueReference", get("valueReference")?)?,
                    kind: Kind::Real,
                    causality: get("causality")?,
                    variability: get("variability")?,
                    start: String::new(),
                    unit: String::new(),
                };
                let name = get("name")?;
                self.order.push(name.clone());
                *open = Some((name, variable));
                return Ok(());
            }
            "Real" => Kind::Real,
            "Integer" | "Enumeration" => Kind::Integer,
            "Boolean" => Kind::Boolean,
            "String" => Kind::String,
            _ => return Ok(()),
        };
        if let Some((name, variable)) = open.take() {
            let variable = Variable { kind, start: get("start")?, unit: get("unit")?, ..variable };
            self.variables.insert(name, variable);
        }
        Ok(())
    }

    /// The value of an attribute of the element `CoSimulation`.
    pub fn capability(&self, name: &str) -> &str {
        self.co_simulation.get(name).map_or("", String::as_str)
    }

    /// Where in the archive its library for this platform lies.
    pub fn binary(&self) -> String {
        description::binary(self.capability("modelIdentifier"))
    }

    /// The value reference of a variable of this type.
    ///
    /// # Errors
    /// [`Error::UnknownVariable`]
    pub fn reference(&self, name: &str, kind: Kind) -> Result<fmi2ValueReference, Error> {
        let variable = self.variables.get(name).filter(|variable| variable.kind == kind);
        variable.map(|variable| variable.reference).ok_or_else(|| Error::UnknownVariable { name: name.to_owned() })
    }

    /// The value references of a Real array, in the order of its elements.
    ///
    /// # Errors
    /// [`Error::UnknownVariable`]
    pub fn array<const N: usize>(&self, name: &str) -> Result<[fmi2ValueReference; N], Error> {
        let mut references = [0; N];
        for (k, reference) in references.iter_mut().enumerate() {
            *reference = self.reference(&format!("{name}[{}]", k + 1), Kind::Real)?;
        }
        Ok(references)
    }
}

fn number<T: FromStr>(attribute: &'static str, value: String) -> Result<T, Error> {
    value.trim().parse().map_err(|_| Error::NotANumber { attribute, value })
}

fn attribute(element: &BytesStart<'_>, name: &str) -> Result<String, Error> {
    let found = element.try_get_attribute(name).map_err(|error| Error::Xml(error.into()))?;
    let value = found.map(|found| found.normalized_value(XmlVersion::Implicit1_0).map(|value| value.into_owned()));
    Ok(value.transpose().map_err(Error::Xml)?.unwrap_or_default())
}

/// A loaded unit.
#[derive(Debug)]
pub struct Fmu {
    /// What it says of itself.
    pub description: Description,
    functions: Functions,
    resources: String,
    /// Last, for it must outlive the functions.
    _library: Library,
}

impl Fmu {
    /// Loads the unit that was unpacked into `directory`.
    ///
    /// # Errors
    /// What of it cannot be read or loaded.
    pub fn open(directory: &Path) -> Result<Self, Error> {
        let path = directory.join(description::FILE);
        let xml = fs::read_to_string(&path).map_err(|error| Error::Read { path, error })?;
        let description = Description::parse(&xml)?;
        let resources = format!("file://{}/resources", directory.display());
        Self::load(&directory.join(description.binary()), description, resources)
    }

    /// Loads a library that has not been packaged, with the description this crate renders of the unit itself.
    ///
    /// # Errors
    /// What of it cannot be loaded.
    pub fn from_library(path: &Path) -> Result<Self, Error> {
        Self::load(path, Description::parse(&description::xml(&Model::default()))?, String::new())
    }

    fn load(path: &Path, description: Description, resources: String) -> Result<Self, Error> {
        // Loading runs whatever the library wants to run then; ours has no initialisers.
        let library = unsafe { Library::new(path) }.map_err(|error| Error::Load { path: path.to_owned(), error })?;
        Ok(Self { description, functions: Functions::load(&library)?, resources, _library: library })
    }

    /// The bare functions. They must not be called after `self` is gone.
    pub fn functions(&self) -> &Functions {
        &self.functions
    }

    /// The version of the standard that the library says it follows.
    pub fn version(&self) -> String {
        text(unsafe { (self.functions.GetVersion)() })
    }

    /// A new instance; `debug` as `loggingOn`.
    ///
    /// # Errors
    /// [`Error::NoInstance`]
    pub fn instantiate(&self, name: &str, debug: bool) -> Result<Slave<'_>, Error> {
        self.instantiate_as(name, &self.description.guid, debug)
    }

    /// The same with a GUID that may be wrong.
    ///
    /// # Errors
    /// [`Error::NoInstance`]
    pub fn instantiate_as(&self, name: &str, guid: &str, debug: bool) -> Result<Slave<'_>, Error> {
        let log = Log::default();
        // On the stack, as the standard lends it for the time of the call only.
        let mut callbacks = log.callbacks();
        // older units need them, and a unit that does not must not miss them
        if self.description.capability("canNotUseMemoryManagementFunctions") != "true" {
            callbacks.allocateMemory = Some(calloc);
            callbacks.freeMemory = Some(free);
        }
        let [name, guid, resources] = [name, guid, &self.resources].map(|text| CString::new(text).unwrap_or_default());
        let component = unsafe {
            (self.functions.Instantiate)(
                name.as_ptr(),
                CO_SIMULATION,
                guid.as_ptr(),
                resources.as_ptr(),
                &callbacks,
                fmi2Boolean(0),
                fmi2Boolean(debug.into()),
            )
        };
        if component.is_null() {
            return Err(Error::NoInstance { log: log.take() });
        }
        Ok(Slave { functions: &self.functions, component, log })
    }
}

unsafe extern "C" {
    fn calloc(count: usize, size: usize) -> *mut c_void;
    fn free(memory: *mut c_void);
}

/// A string of a unit, empty for null.
fn text(string: fmi2String) -> String {
    if string.is_null() { String::new() } else { unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned() }
}

/// Collects log lines. It stays where it is, for the unit holds its address.
#[derive(Debug, Default)]
pub struct Log(Box<Mutex<Vec<Line>>>);

impl Log {
    /// Callbacks which write into this log as long as it lives.
    pub fn callbacks(&self) -> fmi2CallbackFunctions {
        fmi2CallbackFunctions {
            logger: Some(logger()),
            allocateMemory: None,
            freeMemory: None,
            stepFinished: None,
            componentEnvironment: ptr::from_ref(&*self.0).cast_mut().cast(),
        }
    }

    /// The lines so far, which are then gone.
    pub fn take(&self) -> Vec<Line> {
        std::mem::take(&mut self.0.lock().unwrap_or_else(PoisonError::into_inner))
    }
}

/// Rust cannot define a function with a variable number of arguments. The named ones are passed alike on every platform
/// this runs on, and the unit passes no others.
fn logger() -> fmi2CallbackLogger {
    type Fixed = unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String);
    unsafe extern "C" fn write(
        environment: *mut c_void,
        instance: fmi2String,
        status: fmi2Status,
        category: fmi2String,
        message: fmi2String,
    ) {
        let line = Line { instance: text(instance), status, category: text(category), text: text(message) };
        let log = unsafe { &*environment.cast::<Mutex<Vec<Line>>>() };
        log.lock().unwrap_or_else(PoisonError::into_inner).push(line);
    }
    unsafe { std::mem::transmute::<Fixed, fmi2CallbackLogger>(write) }
}

/// An instance of a loaded unit; freed on drop.
#[derive(Debug)]
pub struct Slave<'a> {
    functions: &'a Functions,
    component: fmi2Component,
    /// Its log.
    pub log: Log,
}

impl Drop for Slave<'_> {
    fn drop(&mut self) {
        unsafe { (self.functions.FreeInstance)(self.component) }
    }
}

/// Each method is the C function of that name, refused unless it answers fmi2OK or fmi2Warning.
///
/// # Errors
/// [`Error::Refused`] with the lines of the log since the last call of [`Log::take`]; [`Error::Lengths`].
// a unit that follows the handle of a state blindly is trusted with it, as with all else
#[allow(clippy::not_unsafe_ptr_arg_deref)]
impl Slave<'_> {
    /// The bare handle.
    pub fn component(&self) -> fmi2Component {
        self.component
    }

    fn check(&self, function: &'static str, status: fmi2Status) -> Result<(), Error> {
        match status {
            fmi2Status::OK | fmi2Status::WARNING => Ok(()),
            _ => Err(Error::Refused { function, status, log: self.log.take() }),
        }
    }

    fn plain(&self, name: &'static str, function: Plain) -> Result<(), Error> {
        self.check(name, unsafe { function(self.component) })
    }

    fn read<T>(
        &self,
        name: &'static str,
        function: Get<T>,
        references: &[fmi2ValueReference],
        values: &mut [T],
    ) -> Result<(), Error> {
        same(references.len(), values.len())?;
        let (count, values) = (values.len(), values.as_mut_ptr());
        self.check(name, unsafe { function(self.component, references.as_ptr(), count, values) })
    }

    fn write<T>(
        &self,
        name: &'static str,
        function: Set<T>,
        references: &[fmi2ValueReference],
        values: &[T],
    ) -> Result<(), Error> {
        same(references.len(), values.len())?;
        let (count, values) = (values.len(), values.as_ptr());
        self.check(name, unsafe { function(self.component, references.as_ptr(), count, values) })
    }

    /// `fmi2SetupExperiment`
    pub fn setup_experiment(&self, start: f64, stop: Option<f64>, tolerance: Option<f64>) -> Result<(), Error> {
        let pair = |value: Option<f64>| (fmi2Boolean(value.is_some().into()), value.unwrap_or_default());
        let ((tolerance_defined, tolerance), (stop_defined, stop)) = (pair(tolerance), pair(stop));
        let setup = self.functions.SetupExperiment;
        let status = unsafe { setup(self.component, tolerance_defined, tolerance, start, stop_defined, stop) };
        self.check("fmi2SetupExperiment", status)
    }

    /// `fmi2EnterInitializationMode`
    pub fn enter_initialization_mode(&self) -> Result<(), Error> {
        self.plain("fmi2EnterInitializationMode", self.functions.EnterInitializationMode)
    }

    /// `fmi2ExitInitializationMode`
    pub fn exit_initialization_mode(&self) -> Result<(), Error> {
        self.plain("fmi2ExitInitializationMode", self.functions.ExitInitializationMode)
    }

    /// `fmi2Terminate`
    pub fn terminate(&self) -> Result<(), Error> {
        self.plain("fmi2Terminate", self.functions.Terminate)
    }

    /// `fmi2Reset`
    pub fn reset(&self) -> Result<(), Error> {
        self.plain("fmi2Reset", self.functions.Reset)
    }

    /// `fmi2DoStep`
    pub fn do_step(&self, time: f64, step_size: f64) -> Result<(), Error> {
        let status = unsafe { (self.functions.DoStep)(self.component, time, step_size, fmi2Boolean(1)) };
        self.check("fmi2DoStep", status)
    }

    /// `fmi2SetRealInputDerivatives`, all of one order.
    pub fn set_input_derivatives(
        &self,
        references: &[fmi2ValueReference],
        order: fmi2Integer,
        values: &[f64],
    ) -> Result<(), Error> {
        same(references.len(), values.len())?;
        let (set, orders) = (self.functions.SetRealInputDerivatives, vec![order; values.len()]);
        let (component, count) = (self.component, values.len());
        let status = unsafe { set(component, references.as_ptr(), count, orders.as_ptr(), values.as_ptr()) };
        self.check("fmi2SetRealInputDerivatives", status)
    }

    /// `fmi2GetFMUstate`, in place of `state` unless that is null.
    pub fn get_state(&self, state: &mut fmi2FMUstate) -> Result<(), Error> {
        self.check("fmi2GetFMUstate", unsafe { (self.functions.GetFMUstate)(self.component, state) })
    }

    /// `fmi2SetFMUstate`
    pub fn set_state(&self, state: fmi2FMUstate) -> Result<(), Error> {
        self.check("fmi2SetFMUstate", unsafe { (self.functions.SetFMUstate)(self.component, state) })
    }

    /// `fmi2FreeFMUstate`
    pub fn free_state(&self, state: &mut fmi2FMUstate) -> Result<(), Error> {
        self.check("fmi2FreeFMUstate", unsafe { (self.functions.FreeFMUstate)(self.component, state) })
    }

    /// `fmi2SerializedFMUstateSize` and `fmi2SerializeFMUstate`
    pub fn serialize(&self, state: fmi2FMUstate) -> Result<Vec<u8>, Error> {
        let mut size = 0;
        let status = unsafe { (self.functions.SerializedFMUstateSize)(self.component, state, &mut size) };
        self.check("fmi2SerializedFMUstateSize", status)?;
        let mut bytes = vec![0u8; size];
        let start = bytes.as_mut_ptr().cast();
        let status = unsafe { (self.functions.SerializeFMUstate)(self.component, state, start, size) };
        self.check("fmi2SerializeFMUstate", status)?;
        Ok(bytes)
    }

    /// `fmi2DeSerializeFMUstate`
    pub fn deserialize(&self, bytes: &[u8]) -> Result<fmi2FMUstate, Error> {
        let (mut state, start) = (ptr::null_mut(), bytes.as_ptr().cast());
        let deserialize = self.functions.DeSerializeFMUstate;
        let status = unsafe { deserialize(self.component, start, bytes.len(), &mut state) };
        self.check("fmi2DeSerializeFMUstate", status)?;
        Ok(state)
    }

    /// `fmi2GetDirectionalDerivative`
    pub fn directional_derivative(
        &self,
        unknown: &[fmi2ValueReference],
        known: &[fmi2ValueReference],
        direction: &[f64],
    ) -> Result<Vec<f64>, Error> {
        same(known.len(), direction.len())?;
        let mut derivatives = vec![f64::NAN; unknown.len()];
        let differentiate = self.functions.GetDirectionalDerivative;
        self.check("fmi2GetDirectionalDerivative", unsafe {
            let (unknown, unknowns) = (unknown.as_ptr(), unknown.len());
            let (known, knowns) = (known.as_ptr(), known.len());
            let into = derivatives.as_mut_ptr();
            differentiate(self.component, unknown, unknowns, known, knowns, direction.as_ptr(), into)
        })?;
        Ok(derivatives)
    }

    /// `fmi2GetRealOutputDerivatives`, of order 1.
    pub fn output_derivatives(&self, references: &[fmi2ValueReference]) -> Result<Vec<f64>, Error> {
        let (count, orders) = (references.len(), vec![1; references.len()]);
        let mut rates = vec![f64::NAN; count];
        let get = self.functions.GetRealOutputDerivatives;
        let status = unsafe { get(self.component, references.as_ptr(), count, orders.as_ptr(), rates.as_mut_ptr()) };
        self.check("fmi2GetRealOutputDerivatives", status)?;
        Ok(rates)
    }

    /// `fmi2GetReal`
    pub fn get_real(&self, references: &[fmi2ValueReference], values: &mut [f64]) -> Result<(), Error> {
        self.read("fmi2GetReal", self.functions.GetReal, references, values)
    }

    /// `fmi2GetInteger`
    pub fn get_integer(&self, references: &[fmi2ValueReference], values: &mut [i32]) -> Result<(), Error> {
        self.read("fmi2GetInteger", self.functions.GetInteger, references, values)
    }

    /// `fmi2GetBoolean`
    pub fn get_boolean(&self, references: &[fmi2ValueReference], values: &mut [fmi2Boolean]) -> Result<(), Error> {
        self.read("fmi2GetBoolean", self.functions.GetBoolean, references, values)
    }

    /// `fmi2SetReal`
    pub fn set_real(&self, references: &[fmi2ValueReference], values: &[f64]) -> Result<(), Error> {
        self.write("fmi2SetReal", self.functions.SetReal, references, values)
    }

    /// `fmi2SetInteger`
    pub fn set_integer(&self, references: &[fmi2ValueReference], values: &[i32]) -> Result<(), Error> {
        self.write("fmi2SetInteger", self.functions.SetInteger, references, values)
    }

    /// `fmi2SetBoolean`
    pub fn set_boolean(&self, references: &[fmi2ValueReference], values: &[fmi2Boolean]) -> Result<(), Error> {
        self.write("fmi2SetBoolean", self.functions.SetBoolean, references, values)
    }
}

fn same(references: usize, values: usize) -> Result<(), Error> {
    if references == values { Ok(()) } else { Err(Error::Lengths { references, values }) }
}
