//! One instance of the unit: its lifecycle, get and set, steps. Safe Rust, no C types, no log: what is to be said to
//! the host is returned, and said at the boundary.
//!
//! A call that is refused changes nothing: everything is checked before the first value is written, and the mode
//! stays. So the standard's state *error* does not exist here; a failed step may be repeated, or the run terminated.

use super::description::{self, ALL, LOG_CATEGORIES};
use super::model::Model;
use super::saved::{self, Unreadable};
use super::variables::{self, Kind, Variable};
use crate::archive::{self, Archive, Archived, Corrupt, archived};
use crate::integrator::Effort;
use crate::sensitivity::{self, Sensitivity};
use crate::unit::{self, Acting, Allowed, Derivatives, Inputs, Parameters, Unit};
use std::collections::BTreeMap;
use std::{fmt, mem, ptr};

/// Where an instance stands in its life.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Mode {
    #[default]
    Instantiated,
    Initialization,
    /// At a communication point.
    StepComplete,
    Terminated,
    /// A panic was caught; the instance can only be freed.
    Fatal,
}

impl fmt::Display for Mode {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.write_str(match self {
            Self::Instantiated => "instantiated",
            Self::Initialization => "initialization mode",
            Self::StepComplete => "step complete",
            Self::Terminated => "terminated",
            Self::Fatal => "fatal",
        })
    }
}

/// The functions which take an instance; their names are those of C without the prefix.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Function {
    SetDebugLogging,
    SetupExperiment,
    EnterInitializationMode,
    ExitInitializationMode,
    Terminate,
    Reset,
    GetReal,
    GetInteger,
    GetBoolean,
    GetString,
    SetReal,
    SetInteger,
    SetBoolean,
    SetString,
    GetFMUstate,
    SetFMUstate,
    FreeFMUstate,
    SerializedFMUstateSize,
    SerializeFMUstate,
    DeSerializeFMUstate,
    GetDirectionalDerivative,
    SetRealInputDerivatives,
    GetRealOutputDerivatives,
    DoStep,
    CancelStep,
    GetStatus,
    GetRealStatus,
    GetIntegerStatus,
    GetBooleanStatus,
    GetStringStatus,
}

impl Function {
    /// The modes in which the standard allows the call. Beyond it, inputs may be set before initialisation, as masters
    /// do that apply all start values at once; they only replace the start value.
    fn allowed_in(self) -> &'static [Mode] {
        use Mode::*;
        match self {
            Self::SetupExperiment | Self::EnterInitializationMode => &[Instantiated],
            Self::ExitInitializationMode => &[Initialization],
            Self::Terminate | Self::DoStep | Self::CancelStep => &[StepComplete],
            Self::SetReal | Self::SetInteger | Self::SetBoolean | Self::SetString | Self::SetRealInputDerivatives => {
                &[Instantiated, Initialization, StepComplete]
            }
            Self::GetReal | Self::GetInteger | Self::GetBoolean | Self::GetString | Self::GetDirectionalDerivative => {
                &[Initialization, StepComplete, Terminated]
            }
            Self::GetRealOutputDerivatives
            | Self::GetStatus
            | Self::GetRealStatus
            | Self::GetIntegerStatus
            | Self::GetBooleanStatus
            | Self::GetStringStatus => &[StepComplete, Terminated],
            Self::SetDebugLogging
            | Self::Reset
            | Self::GetFMUstate
            | Self::SetFMUstate
            | Self::FreeFMUstate
            | Self::SerializedFMUstateSize
            | Self::SerializeFMUstate
            | Self::DeSerializeFMUstate => &[Instantiated, Initialization, StepComplete, Terminated],
        }
    }
}

impl fmt::Display for Function {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "fmi2{self:?}")
    }
}

/// Why a call is refused.
#[derive(Clone, Debug)]
pub enum Failure {
    WrongMode {
        mode: Mode,
        allowed: &'static [Mode],
    },
    NullPointer {
        argument: &'static str,
    },
    EmptyName,
    WrongType {
        given: i32,
    },
    WrongGuid {
        given: String,
        expected: String,
    },
    /// What [`super::model::read`] says of the library.
    NoModel(Corrupt),
    UnknownReference {
        reference: u32,
    },
    WrongKind {
        variable: Variable,
        asked: Kind,
    },
    NotSettable {
        variable: Variable,
        value: f64,
    },
    NotAllowed {
        variable: Variable,
        value: f64,
    },
    /// Of derivatives.
    NotUnknown {
        variable: Variable,
    },
    /// Of derivatives.
    NotKnown {
        variable: Variable,
    },
    NoDerivative {
        variable: Variable,
        order: i32,
    },
    NoOutputDerivative {
        variable: Variable,
        order: i32,
    },
    DerivativeNotAllowed {
        variable: Variable,
        order: i32,
        value: f64,
    },
    BadArgument {
        argument: &'static str,
        value: f64,
        allowed: Allowed,
    },
    StopBeforeStart {
        start: f64,
        stop: f64,
    },
    WrongTime {
        given: f64,
        expected: f64,
    },
    PastStopTime {
        end: f64,
        stop: f64,
    },
    UnknownCategory {
        name: String,
    },
    NotSupported {
        what: &'static str,
    },
    /// Answered with `fmi2Discard`.
    NothingPending {
        asked: StatusKind,
    },
    WrongStatusKind {
        given: i32,
    },
    UnknownState,
    WrongSize {
        given: usize,
        expected: usize,
    },
    Unreadable(Unreadable),
    Corrupt(Corrupt),
    Unit(unit::Error),
    Panic {
        message: String,
    },
}

/// What may be asked with the five status functions.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum StatusKind {
    DoStepStatus,
    PendingStatus,
    LastSuccessfulTime,
    Terminated,
}

impl StatusKind {
    pub fn new(number: i32) -> Result<Self, Failure> {
        [Self::DoStepStatus, Self::PendingStatus, Self::LastSuccessfulTime, Self::Terminated]
            .into_iter()
            .find(|kind| *kind as i32 == number)
            .ok_or(Failure::WrongStatusKind { given: number })
    }

    /// This kind where one of another type was asked for.
    pub fn mismatch(self) -> Failure {
        Failure::WrongStatusKind { given: self as i32 }
    }

    /// A step is finished when [`Instance::do_step`] returns, so nothing can be said of a pending one. The standard
    /// has fmi2Discard for a status that is not available.
    pub fn pending<T>(self, answered: Self) -> Result<T, Failure> {
        Err(if self == answered { Failure::NothingPending { asked: self } } else { self.mismatch() })
    }
}

impl From<unit::Error> for Failure {
    fn from(error: unit::Error) -> Self {
        Self::Unit(error)
    }
}

impl fmt::Display for Failure {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::WrongMode { mode, allowed } => {
                write!(f, "not allowed in the state '{mode}', only in")?;
                for (k, mode) in allowed.iter().enumerate() {
                    write!(f, "{} '{mode}'", if k == 0 { "" } else { "," })?;
                }
                Ok(())
            }
            Self::NullPointer { argument } => write!(f, "{argument} is a null pointer, or no array of that length"),
            Self::EmptyName => write!(f, "instanceName is empty; it must name the instance"),
            Self::WrongType { given } => write!(f, "fmuType = {given} is not allowed: only 1 (fmi2CoSimulation)"),
            Self::WrongGuid { given, expected } => {
                write!(f, "fmuGUID = '{given}' is not allowed: this library is {expected}")
            }
            Self::NoModel(error) => write!(f, "the rod in this library cannot be read: {error}"),
            Self::UnknownReference { reference } => write!(
                f,
                "value reference {reference} is unknown: it is not in the model description, whose last one is {}",
                variables::all().len() - 1
            ),
            Self::WrongKind { variable, asked } => {
                write!(f, "{variable} is of type {:?}, not {asked:?}", variable.kind())
            }
            Self::NotSettable { variable, value } => {
                let why = if variable.is_output() {
                    "an output is never set"
                } else {
                    "a fixed parameter is set before the end of the initialization"
                };
                write!(f, "{variable} = {value} is not allowed: {why}")
            }
            Self::NotAllowed { variable, value } => {
                write!(f, "{variable} = {value} is not allowed: {}", variable.allowed())
            }
            Self::NotUnknown { variable } => write!(f, "{variable} is not computed: derivatives are those of outputs"),
            Self::NotKnown { variable } => {
                write!(f, "{variable} has no derivatives: they are those by inputs and tunable parameters")
            }
            Self::NoDerivative { variable, order } => {
                write!(f, "derivative of order {order} of {variable} is not allowed: only orders 1 and 2 of inputs")
            }
            Self::NoOutputDerivative { variable, order } => {
                write!(f, "derivative of order {order} of {variable} is not known: only order 1 of outputs")
            }
            Self::DerivativeNotAllowed { variable, order, value } => {
                write!(f, "derivative of order {order} of {variable} = {value} is not allowed: {}", Allowed::Finite)
            }
            Self::BadArgument { argument, value, allowed } => {
                write!(f, "{argument} = {value} is not allowed: {allowed}")
            }
            Self::StopBeforeStart { start, stop } => {
                write!(f, "stopTime = {stop} is not allowed: finite and >= startTime = {start}")
            }
            Self::WrongTime { given, expected } => {
                write!(f, "currentCommunicationPoint = {given} is not allowed: the instance is at {expected}")
            }
            Self::PastStopTime { end, stop } => {
                write!(f, "a step to {end} is not allowed: the experiment ends at stopTime = {stop}")
            }
            Self::UnknownCategory { name } => {
                write!(f, "category '{name}' is unknown: only")?;
                LOG_CATEGORIES.iter().try_for_each(|(name, _)| write!(f, " {name}"))
            }
            Self::NotSupported { what } => write!(f, "{what} not supported, as the model description says"),
            Self::NothingPending { asked } => {
                write!(f, "fmi2{asked:?} is not available: a step is finished when fmi2DoStep returns")
            }
            Self::WrongStatusKind { given } => write!(f, "status kind {given} is unknown or not of this type"),
            Self::UnknownState => write!(
                f,
                "FMUstate is none that this instance has saved and not freed; one of another instance is to be serialized"
            ),
            Self::WrongSize { given, expected } => {
                write!(f, "size = {given} is not allowed: the serialized state has {expected} bytes")
            }
            Self::Unreadable(error) => write!(f, "this is no saved state: {error}"),
            Self::Corrupt(error) => write!(f, "this is no saved state: {error}"),
            Self::Unit(error) => error.fmt(f),
            Self::Panic { message } => write!(f, "panic, the instance can only be freed: {message}"),
        }
    }
}

/// What the host is told about a call that succeeded.
#[derive(Clone, Debug, PartialEq)]
pub enum Note {
    Initialized { cells: i32 },
    Repeated { retries: i32, end: f64 },
    Terminated { steps: i32, iterations: i32, retries: i32 },
    Warning(unit::Warning),
}

impl Note {
    /// One of the declared log categories.
    pub fn category(&self) -> &'static str {
        match self {
            Self::Initialized { .. } | Self::Terminated { .. } => "logEvents",
            Self::Repeated { .. } => "logNonlinearSystems",
            Self::Warning(_) => "logStatusWarning",
        }
    }
}

impl fmt::Display for Note {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Initialized { cells } => write!(f, "initialized with {cells} cells"),
            Self::Repeated { retries, end } => {
                write!(f, "on the way to {end} s, {retries} internal steps were tried again with smaller ones")
            }
            Self::Terminated { steps, iterations, retries } => {
                write!(f, "terminated after {steps} internal steps, {iterations} iterations, {retries} retries")
            }
            Self::Warning(warning) => warning.fmt(f),
        }
    }
}

/// The end of a call.
pub type Answer = Result<Option<Note>, Failure>;

/// A type of the C interface that carries values of one kind.
pub trait Scalar: Copy {
    const KIND: Kind;
    fn to_f64(self) -> f64;
    /// From a value of this kind, which an `f64` carries without loss.
    fn from_f64(value: f64) -> Self;
}

impl Scalar for f64 {
    const KIND: Kind = Kind::Real;
    fn to_f64(self) -> f64 {
        self
    }
    fn from_f64(value: f64) -> Self {
        value
    }
}

impl Scalar for i32 {
    const KIND: Kind = Kind::Integer;
    fn to_f64(self) -> f64 {
        self.into()
    }
    fn from_f64(value: f64) -> Self {
        value as i32
    }
}

/// Times closer than this part of a step, or of the time itself, are the same to a host that adds up its steps; the
/// rounding of a million additions stays below the second, and a step that is too early or too late stands out from
/// both.
const SAME_TIME: [f64; 2] = [1e-6, 1e-12];

/// Name of an instance that panics in its first step, in builds with debug assertions only: the guard has to be seen at
/// work through the boundary, and no input is known that makes the unit panic.
const PANICKING: &str = "panic in fmi2DoStep";

/// One instance.
#[derive(Debug)]
pub struct Instance {
    name: String,
    guid: String,
    /// Where every simulation begins.
    model: Model,
    debug: Debug,
    variables: Vec<Variable>,
    now: Simulation,
    /// What a saved state is loaded into; it then changes places with the present, which stays if that fails.
    spare: Simulation,
    /// The states that the host may name, by their addresses, which are told apart from all that is not among them.
    saved: BTreeMap<usize, Box<Saved>>,
}

/// Where the simulation stands: all that a saved state holds.
#[derive(Debug, Default)]
struct Simulation {
    mode: Mode,
    experiment: Experiment,
    parameters: Parameters,
    inputs: Inputs,
    /// For the step that comes; they lapse with it.
    derivatives: Derivatives,
    /// Before the first step a set drops it, and a get or the end of the initialisation builds it.
    unit: Option<Box<Unit>>,
    time: f64,
}

impl Simulation {
    /// Before anything is set.
    fn of(model: &Model) -> Self {
        Self { parameters: model.parameters.clone(), inputs: model.inputs.clone(), ..Self::default() }
    }
}

archived!(Simulation { mode, experiment, parameters, inputs, derivatives, unit, time });
archived!(Experiment { tolerance, start, stop });

/// An instance that is lost is not saved.
impl Archived for Mode {
    fn visit(&mut self, archive: &mut Archive) -> Result<(), Corrupt> {
        archive.choose(self, &[Self::Instantiated, Self::Initialization, Self::StepComplete, Self::Terminated])
    }
}

/// A state, as [`archive::save`] writes it.
#[derive(Debug, Default)]
struct Saved {
    bytes: Vec<u8>,
}

/// What [`Instance::setup_experiment`] was told.
#[derive(Clone, Debug, Default, PartialEq)]
struct Experiment {
    tolerance: Option<f64>,
    start: f64,
    stop: Option<f64>,
}

/// Which debug lines the host wants.
#[derive(Clone, Debug, PartialEq)]
struct Debug {
    on: bool,
    /// Empty = all.
    categories: Vec<&'static str>,
}

impl Instance {
    /// As after `fmi2Instantiate`.
    pub fn new(model: Model, name: String, guid: &str, debug: bool) -> Result<Self, Failure> {
        if name.is_empty() {
            return Err(Failure::EmptyName);
        }
        let expected = description::guid(&model);
        if guid != expected {
            return Err(Failure::WrongGuid { given: guid.to_owned(), expected });
        }
        Ok(Self {
            name,
            guid: expected,
            debug: Debug { on: debug, categories: Vec::new() },
            variables: variables::all(),
            now: Simulation::of(&model),
            model,
            spare: Simulation::default(),
            saved: BTreeMap::new(),
        })
    }

    /// The communication point.
    pub fn time(&self) -> f64 {
        self.now.time
    }

    /// Whether the call is allowed now.
    pub fn admits(&self, function: Function) -> Result<(), Failure> {
        let allowed = function.allowed_in();
        if allowed.contains(&self.now.mode) { Ok(()) } else { Err(Failure::WrongMode { mode: self.now.mode, allowed }) }
    }

    /// After a panic.
    pub fn give_up(&mut self) {
        self.now.mode = Mode::Fatal;
    }

    /// Whether a debug line of this category is to be logged.
    ///
    /// Warnings and errors are no debug lines. The standard says of the statuses fmi2Warning, fmi2Error and fmi2Fatal
    /// that the logger *was called*, and leaves it to the logger what to show; a host that switches debug lines off
    /// would otherwise learn that a call failed and never why.
    pub fn wants(&self, note: &Note) -> bool {
        let Debug { on, categories } = &self.debug;
        let listed = || categories.is_empty() || categories.contains(&note.category()) || categories.contains(&ALL);
        matches!(note, Note::Warning(_)) || (*on && listed())
    }

    pub fn set_debug_logging(&mut self, on: bool, names: &[String]) -> Answer {
        let known = |name: &String| {
            let mut categories = LOG_CATEGORIES.iter().map(|(category, _)| *category);
            categories.find(|category| category == name).ok_or(Failure::UnknownCategory { name: name.clone() })
        };
        let categories = names.iter().map(known).collect::<Result<_, _>>()?;
        self.debug = Debug { on, categories };
        Ok(None)
    }

    /// A tolerance of zero counts as none, as for the parameter.
    pub fn setup_experiment(&mut self, tolerance: Option<f64>, start: f64, stop: Option<f64>) -> Answer {
        check("startTime", start, Allowed::Finite)?;
        if let Some(tolerance) = tolerance {
            check("tolerance", tolerance, Allowed::NonNegative)?;
        }
        if let Some(stop) = stop.filter(|stop| !(stop.is_finite() && *stop >= start)) {
            return Err(Failure::StopBeforeStart { start, stop });
        }
        self.now.experiment = Experiment { tolerance: tolerance.filter(|tolerance| *tolerance > 0.0), start, stop };
        self.now.time = start;
        self.now.unit = None;
        Ok(None)
    }

    pub fn enter_initialization_mode(&mut self) -> Answer {
        self.now.mode = Mode::Initialization;
        Ok(None)
    }

    pub fn exit_initialization_mode(&mut self) -> Answer {
        let cells = self.unit()?.outputs().cells;
        self.now.mode = Mode::StepComplete;
        Ok(Some(Note::Initialized { cells }))
    }

    pub fn terminate(&mut self) -> Answer {
        let Effort { steps, iterations, retries, .. } = self.unit()?.outputs().solver;
        self.now.mode = Mode::Terminated;
        Ok(Some(Note::Terminated { steps, iterations, retries }))
    }

    /// As after `fmi2Instantiate`; which debug lines the host wants is no part of the simulation and stays.
    pub fn reset(&mut self) -> Answer {
        self.now = Simulation::of(&self.model);
        Ok(None)
    }

    /// Saves the present: in place of a state, or as a new one where `state` is 0. Returns what the host is to name it by.
    pub fn save_state(&mut self, state: usize) -> Result<usize, Failure> {
        let mut new = Saved::default();
        let place = if state == 0 { &mut new } else { self.saved.get_mut(&state).ok_or(Failure::UnknownState)? };
        archive::save(&mut self.now, &mut place.bytes);
        Ok(if state == 0 { self.keep(new) } else { state })
    }

    fn keep(&mut self, state: Saved) -> usize {
        let state = Box::new(state);
        let address = ptr::from_ref(&*state).addr();
        self.saved.insert(address, state);
        address
    }

    fn saved(&self, state: usize) -> Result<&Saved, Failure> {
        match (state, self.saved.get(&state)) {
            (0, _) => Err(Failure::NullPointer { argument: "FMUstate" }),
            (_, saved) => saved.map(|saved| &**saved).ok_or(Failure::UnknownState),
        }
    }

    /// Makes a saved state the present.
    pub fn load_state(&mut self, state: usize) -> Answer {
        // what is left of a state that could not be loaded is none
        let mut next = mem::take(&mut self.spare);
        archive::load(&mut next, &self.saved(state)?.bytes).map_err(Failure::Corrupt)?;
        self.spare = mem::replace(&mut self.now, next);
        Ok(None)
    }

    /// Forgets a saved state; 0 is none.
    pub fn free_state(&mut self, state: usize) -> Answer {
        if state != 0 {
            self.saved.remove(&state).ok_or(Failure::UnknownState)?;
        }
        Ok(None)
    }

    /// Bytes of a saved state.
    pub fn state_size(&self, state: usize) -> Result<usize, Failure> {
        let Saved { bytes } = self.saved(state)?;
        Ok(saved::HEADER + bytes.len())
    }

    /// Writes a saved state into as many bytes as it has.
    pub fn serialize(&self, state: usize, into: &mut [u8]) -> Answer {
        let Saved { bytes } = self.saved(state)?;
        let sealed = saved::sealed(bytes, &self.guid);
        if into.len() != sealed.len() {
            return Err(Failure::WrongSize { given: into.len(), expected: sealed.len() });
        }
        into.copy_from_slice(&sealed);
        Ok(None)
    }

    /// A saved state from the bytes of one; returns what the host is to name it by.
    pub fn deserialize(&mut self, bytes: &[u8]) -> Result<usize, Failure> {
        let bytes = saved::opened(bytes, &self.guid).map_err(Failure::Unreadable)?.to_vec();
        Ok(self.keep(Saved { bytes }))
    }

    pub fn get<T: Scalar>(&mut self, references: &[u32], values: &mut [T]) -> Answer {
        for &reference in references {
            if self.variable(reference, T::KIND)?.is_output() {
                self.unit()?;
            }
        }
        for (&reference, value) in references.iter().zip(values) {
            let variable = self.variable(reference, T::KIND)?;
            let given = variable.given(&mut self.now.parameters, &mut self.now.inputs);
            let computed = || self.now.unit.as_ref().and_then(|unit| variable.computed(unit.outputs()));
            if let Some(number) = given.or_else(computed) {
                *value = T::from_f64(number);
            }
        }
        Ok(None)
    }

    pub fn set<T: Scalar>(&mut self, references: &[u32], values: &[T]) -> Answer {
        for (&reference, value) in references.iter().zip(values) {
            let (variable, value) = (self.variable(reference, T::KIND)?, value.to_f64());
            let settable = match self.now.mode {
                Mode::StepComplete => variable.is_settable_while_stepping(),
                _ => !variable.is_output(),
            };
            if !settable {
                return Err(Failure::NotSettable { variable, value });
            }
            if !variable.allowed().contains(value) {
                return Err(Failure::NotAllowed { variable, value });
            }
        }
        for (&reference, value) in references.iter().zip(values) {
            self.variable(reference, T::KIND)?.set(&mut self.now.parameters, &mut self.now.inputs, value.to_f64());
        }
        if self.now.mode != Mode::StepComplete {
            self.now.unit = None;
        }
        Ok(None)
    }

    /// Says how continuous inputs go on in the step that comes.
    pub fn set_input_derivatives(&mut self, references: &[u32], orders: &[i32], values: &[f64]) -> Answer {
        let given = |reference: &u32, order: i32, derivatives: &mut Derivatives, value: f64| {
            let variable = self.variable(*reference, Kind::Real)?;
            let place = variable.input_derivative(derivatives, order);
            *place.ok_or(Failure::NoDerivative { variable, order })? = value;
            match value.is_finite() {
                true => Ok(()),
                false => Err(Failure::DerivativeNotAllowed { variable, order, value }),
            }
        };
        let mut derivatives = self.now.derivatives.clone();
        for ((reference, order), value) in references.iter().zip(orders).zip(values) {
            given(reference, *order, &mut derivatives, *value)?;
        }
        self.now.derivatives = derivatives;
        Ok(None)
    }

    /// How continuous outputs change with time.
    pub fn output_derivatives(&mut self, references: &[u32], orders: &[i32], values: &mut [f64]) -> Answer {
        for (&reference, &order) in references.iter().zip(orders) {
            let variable = self.variable(reference, Kind::Real)?;
            if order != 1 || !variable.is_output() {
                return Err(Failure::NoOutputDerivative { variable, order });
            }
        }
        let rates = if references.is_empty() { Default::default() } else { self.unit()?.rates()? };
        for (&reference, value) in references.iter().zip(values) {
            *value = self.variable(reference, Kind::Real)?.computed(&rates).unwrap_or_default();
        }
        Ok(None)
    }

    /// The unit has no strings, so every reference is of the wrong kind, or of none.
    pub fn no_strings(&self, references: &[u32]) -> Answer {
        references.iter().try_for_each(|&reference| self.variable(reference, Kind::String).map(drop))?;
        Ok(None)
    }

    /// How the unknowns, outputs all, change along a direction of the knowns, inputs and tunable parameters: those of the last
    /// step, or of the start.
    pub fn directional_derivative(
        &mut self,
        unknown: &[u32],
        known: &[u32],
        direction: &[f64],
        derivatives: &mut [f64],
    ) -> Answer {
        let unknown = unknown.iter().map(|&reference| {
            let variable = self.variable(reference, Kind::Real)?;
            if variable.is_output() { Ok(variable) } else { Err(Failure::NotUnknown { variable }) }
        });
        let unknown = unknown.collect::<Result<Vec<_>, _>>()?;
        let Acting { mut inputs, tunable, .. } = sensitivity::nowhere();
        let mut parameters = Parameters::default().tuned(&tunable);
        for (&reference, &part) in known.iter().zip(direction) {
            let variable = self.variable(reference, Kind::Real)?;
            if !variable.is_settable_while_stepping() {
                return Err(Failure::NotKnown { variable });
            }
            if !part.is_finite() {
                return Err(Failure::NotAllowed { variable, value: part });
            }
            let sum = variable.given(&mut parameters, &mut inputs).unwrap_or_default() + part;
            variable.set(&mut parameters, &mut inputs, sum);
        }
        let direction = Acting { inputs, tunable: parameters.tunable(), ..sensitivity::nowhere() };
        let sensitivity = Sensitivity::new(self.unit()?, &direction)?;
        for (variable, derivative) in unknown.iter().zip(derivatives) {
            *derivative = sensitivity.of(|outputs| variable.computed(outputs).unwrap_or_default());
        }
        Ok(None)
    }

    pub fn do_step(&mut self, time: f64, step_size: f64) -> Answer {
        if cfg!(debug_assertions) && self.name == PANICKING {
            panic!("as the name of the instance demands");
        }
        check("currentCommunicationPoint", time, Allowed::Finite)?;
        check("communicationStepSize", step_size, Allowed::Positive)?;
        let near = SAME_TIME[0] * step_size + SAME_TIME[1] * self.now.time.abs();
        if (time - self.now.time).abs() > near {
            return Err(Failure::WrongTime { given: time, expected: self.now.time });
        }
        let end = time + step_size;
        if let Some(stop) = self.now.experiment.stop.filter(|stop| end > stop + near) {
            return Err(Failure::PastStopTime { end, stop });
        }
        let (inputs, derivatives) = (self.now.inputs.clone(), self.now.derivatives.clone());
        let tunable = self.now.parameters.tunable();
        let own_step = (time - self.now.time) + step_size;
        let unit = self.unit()?;
        let retries = unit.outputs().solver.retries;
        unit.tune(&tunable)?;
        let warning = unit.advance_along(&inputs, &derivatives, own_step)?;
        let retries = unit.outputs().solver.retries - retries;
        self.now.time = end;
        self.now.derivatives = Derivatives::default();
        Ok(match warning {
            Some(warning) => Some(Note::Warning(warning)),
            None => (retries > 0).then_some(Note::Repeated { retries, end }),
        })
    }

    pub fn last_successful_time(&self, kind: StatusKind) -> Result<f64, Failure> {
        match kind {
            StatusKind::LastSuccessfulTime => Ok(self.now.time),
            _ => Err(kind.mismatch()),
        }
    }

    /// The unit never asks for the end of the simulation.
    pub fn wants_to_terminate<T: Scalar>(&self, kind: StatusKind) -> Result<T, Failure> {
        match kind {
            StatusKind::Terminated => Ok(T::from_f64(0.0)),
            _ => Err(kind.mismatch()),
        }
    }

    fn variable(&self, reference: u32, kind: Kind) -> Result<Variable, Failure> {
        let variable = usize::try_from(reference).ok().and_then(|place| self.variables.get(place));
        let variable = variable.filter(|variable| variable.is_of(&self.model.parameters));
        let variable = *variable.ok_or(Failure::UnknownReference { reference })?;
        if variable.kind() == kind { Ok(variable) } else { Err(Failure::WrongKind { variable, asked: kind }) }
    }

    fn unit(&mut self) -> Result<&mut Unit, Failure> {
        let unit = match self.now.unit.take() {
            Some(unit) => unit,
            None => Box::new(Unit::new(&self.now.parameters, &self.now.inputs, self.now.experiment.tolerance)?),
        };
        Ok(self.now.unit.insert(unit))
    }
}

fn check(argument: &'static str, value: f64, allowed: Allowed) -> Result<(), Failure> {
    if allowed.contains(value) { Ok(()) } else { Err(Failure::BadArgument { argument, value, allowed }) }
}
