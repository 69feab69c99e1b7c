//! The C interface of FMI 2.0 for co-simulation: types, the 34 functions, and one guard through which every call with
//! an instance passes: null, mode, panic, log, status.
//!
//! The only module of the unit with `unsafe`. It relies on what the standard asks of a host: an instance handle comes
//! from `fmi2Instantiate` and is not used after `fmi2FreeInstance` nor by two threads at once, strings end with a null
//! byte, and arrays have the length that is passed with them. Null pointers are met with an error all the same, and the
//! handle of a saved state is looked up and never followed.
//!
//! A panic ends at the guard. The hook that reports it is left alone: it belongs to the process where the library is
//! linked statically, replacing it would be global state, and its line on standard error names the place of what is
//! always a defect of the unit; the log line carries the message.
#![allow(unsafe_code, non_camel_case_types, non_snake_case)]

use super::instance::{Answer, Failure, Function, Instance, Note, Scalar, StatusKind};
use super::model;
use super::variables::Kind;
use std::ffi::{CStr, CString, c_char, c_int, c_uint, c_void};
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::ptr;

/// An instance, opaque to the host.
pub type fmi2Component = *mut c_void;
/// Whatever the host wants to get back in its callbacks.
pub type fmi2ComponentEnvironment = *mut c_void;
/// A saved state, opaque to the host.
pub type fmi2FMUstate = *mut c_void;
/// Names a variable together with its type.
pub type fmi2ValueReference = c_uint;
/// A real number.
pub type fmi2Real = f64;
/// An integer.
pub type fmi2Integer = c_int;
/// Ends with a null byte.
pub type fmi2String = *const c_char;
/// A byte of a serialized state.
pub type fmi2Byte = c_char;

/// 0 or 1; a type of its own, so that it is not taken for an integer.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct fmi2Boolean(pub c_int);

/// How a call ended. No enumeration, as any number may come from the other side.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[repr(transparent)]
pub struct fmi2Status(pub c_int);

impl fmi2Status {
    /// All well.
    pub const OK: Self = Self(0);
    /// Done, but the log has something to say.
    pub const WARNING: Self = Self(1);
    /// Not done, and not wrong.
    pub const DISCARD: Self = Self(2);
    /// Refused or failed; nothing has changed.
    pub const ERROR: Self = Self(3);
    /// The instance is lost.
    pub const FATAL: Self = Self(4);
}

/// Environment, instance name, status, category, message in the manner of `printf`.
pub type fmi2CallbackLogger =
    unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2String, fmi2Status, fmi2String, fmi2String, ...);

/// What the host lends during `fmi2Instantiate`.
#[derive(Clone, Copy, Debug)]
#[repr(C)]
pub struct fmi2CallbackFunctions {
    /// Takes log lines; may be null.
    pub logger: Option<fmi2CallbackLogger>,
    /// Not used.
    pub allocateMemory: Option<unsafe extern "C" fn(usize, usize) -> *mut c_void>,
    /// Not used.
    pub freeMemory: Option<unsafe extern "C" fn(*mut c_void)>,
    /// Not used: steps are finished when they return.
    pub stepFinished: Option<unsafe extern "C" fn(fmi2ComponentEnvironment, fmi2Status)>,
    /// Given to the logger.
    pub componentEnvironment: fmi2ComponentEnvironment,
}

/// The value of `fmi2Type` that stands for co-simulation.
pub const CO_SIMULATION: c_int = 1;

impl Scalar for fmi2Boolean {
    const KIND: Kind = Kind::Boolean;
    fn to_f64(self) -> f64 {
        self.0.into()
    }
    fn from_f64(value: f64) -> Self {
        Self((value != 0.0).into())
    }
}

/// What a component handle points to.
struct Component {
    instance: Instance,
    log: Log,
}

/// The way to the logger of the host.
struct Log {
    name: CString,
    logger: Option<fmi2CallbackLogger>,
    environment: fmi2ComponentEnvironment,
}

impl Log {
    /// # Safety
    /// The logger is one of the standard's type, and callable.
    unsafe fn line(&self, status: fmi2Status, category: &str, text: &str) {
        if let Some(logger) = self.logger {
            let (category, text) = (c_string(category), c_string(text));
            unsafe { logger(self.environment, self.name.as_ptr(), status, category.as_ptr(), text.as_ptr()) }
        }
    }
}

/// The logger takes a format of `printf` in which `#` refers to variables: a host expands `%` and `#`, or forgets to.
/// So neither may occur, not even in a name that came from the host; nor can a null byte.
fn c_string(text: &str) -> CString {
    let harmless = text.chars().map(|c| if matches!(c, '%' | '#') || c.is_control() { '?' } else { c });
    CString::new(harmless.collect::<String>()).unwrap_or_default()
}

impl From<&Failure> for fmi2Status {
    fn from(failure: &Failure) -> Self {
        match failure {
            // A master that gets fmi2Discard for a step repeats it for ever, so only a status inquiry gets it.
            Failure::NothingPending { .. } => Self::DISCARD,
            Failure::Panic { .. } => Self::FATAL,
            _ => Self::ERROR,
        }
    }
}

fn category(status: fmi2Status) -> &'static str {
    match status {
        fmi2Status::FATAL => "logStatusFatal",
        fmi2Status::DISCARD => "logStatusDiscard",
        _ => "logStatusError",
    }
}

/// Runs `body`; a panic becomes a failure.
fn catch<T>(body: impl FnOnce() -> Result<T, Failure>) -> Result<T, Failure> {
    catch_unwind(AssertUnwindSafe(body)).unwrap_or_else(|payload| {
        let text = payload.downcast_ref::<&str>().map(|text| (*text).to_owned());
        let message = text.or_else(|| payload.downcast_ref().cloned()).unwrap_or_default();
        // A payload may panic in turn when it is dropped; its few bytes are not worth that.
        std::mem::forget(payload);
        Err(Failure::Panic { message })
    })
}

/// The guard.
///
/// # Safety
/// `component` is null or a live handle, and no other call with it is under way.
unsafe fn call(component: fmi2Component, function: Function, body: impl FnOnce(&mut Instance) -> Answer) -> fmi2Status {
    let Some(Component { instance, log }) = (unsafe { component.cast::<Component>().as_mut() }) else {
        return fmi2Status::ERROR;
    };
    let answer = catch(|| {
        instance.admits(function)?;
        body(instance)
    });
    match answer {
        Ok(None) => fmi2Status::OK,
        Ok(Some(note)) => {
            let status = if let Note::Warning(_) = note { fmi2Status::WARNING } else { fmi2Status::OK };
            if instance.wants(&note) {
                unsafe { log.line(status, note.category(), &format!("{function}: {note}")) };
            }
            status
        }
        Err(failure) => {
            let status = fmi2Status::from(&failure);
            if status == fmi2Status::FATAL {
                instance.give_up();
            }
            let line = format!("{function} at {} s: {failure}", instance.time());
            unsafe { log.line(status, category(status), &line) };
            status
        }
    }
}

/// # Safety
/// If `pointer` is neither null nor misaligned, it points to `count` values that nobody changes meanwhile.
unsafe fn slice<'a, T>(pointer: *const T, count: usize, argument: &'static str) -> Result<&'a [T], Failure> {
    match count {
        0 => Ok(&[]),
        _ if unusable(pointer, count) => Err(Failure::NullPointer { argument }),
        _ => Ok(unsafe { std::slice::from_raw_parts(pointer, count) }),
    }
}

/// # Safety
/// As for [`slice`], and nobody reads them meanwhile.
unsafe fn slice_mut<'a, T>(pointer: *mut T, count: usize, argument: &'static str) -> Result<&'a mut [T], Failure> {
    match count {
        0 => Ok(&mut []),
        _ if unusable(pointer, count) => Err(Failure::NullPointer { argument }),
        _ => Ok(unsafe { std::slice::from_raw_parts_mut(pointer, count) }),
    }
}

/// # Safety
/// As for [`slice_mut`], of one value.
unsafe fn one<'a, T>(pointer: *mut T, argument: &'static str) -> Result<&'a mut T, Failure> {
    match unusable(pointer, 1) {
        true => Err(Failure::NullPointer { argument }),
        false => Ok(unsafe { &mut *pointer }),
    }
}

fn unusable<T>(pointer: *const T, count: usize) -> bool {
    pointer.is_null() || !pointer.is_aligned() || count > isize::MAX as usize / size_of::<T>()
}

/// # Safety
/// `string` is null or ends with a null byte.
unsafe fn text(string: fmi2String, argument: &'static str) -> Result<String, Failure> {
    if string.is_null() {
        return Err(Failure::NullPointer { argument });
    }
    Ok(unsafe { CStr::from_ptr(string) }.to_string_lossy().into_owned())
}

/// # Safety
/// As for [`slice`] and [`call`].
unsafe fn get<T: Scalar>(
    component: fmi2Component,
    function: Function,
    references: *const fmi2ValueReference,
    count: usize,
    values: *mut T,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let (references, values) = unsafe { (slice(references, count, "vr")?, slice_mut(values, count, "value")?) };
        instance.get(references, values)
    };
    unsafe { call(component, function, body) }
}

/// # Safety
/// As for [`slice`] and [`call`].
unsafe fn set<T: Scalar>(
    component: fmi2Component,
    function: Function,
    references: *const fmi2ValueReference,
    count: usize,
    values: *const T,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let (references, values) = unsafe { (slice(references, count, "vr")?, slice(values, count, "value")?) };
        instance.set(references, values)
    };
    unsafe { call(component, function, body) }
}

/// # Safety
/// As for [`slice`] and [`call`].
unsafe fn no_strings(
    component: fmi2Component,
    function: Function,
    references: *const fmi2ValueReference,
    count: usize,
) -> fmi2Status {
    unsafe { call(component, function, |instance| instance.no_strings(slice(references, count, "vr")?)) }
}

/// # Safety
/// As for [`call`].
unsafe fn not_supported(component: fmi2Component, function: Function, what: &'static str) -> fmi2Status {
    unsafe { call(component, function, |_| Err(Failure::NotSupported { what })) }
}

/// Answers a status inquiry.
///
/// # Safety
/// As for [`slice`] and [`call`].
unsafe fn status<T>(
    component: fmi2Component,
    function: Function,
    kind: c_int,
    value: *mut T,
    read: impl FnOnce(&Instance, StatusKind) -> Result<T, Failure>,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let value = unsafe { slice_mut(value, 1, "value")? };
        value[0] = read(instance, StatusKind::new(kind)?)?;
        Ok(None)
    };
    unsafe { call(component, function, body) }
}

const CANCEL: &str = "asynchronous steps, and so cancelling one, are";

#[unsafe(no_mangle)]
extern "C" fn fmi2GetTypesPlatform() -> fmi2String {
    c"default".as_ptr()
}

#[unsafe(no_mangle)]
extern "C" fn fmi2GetVersion() -> fmi2String {
    c"2.0".as_ptr()
}

/// The rod of this library. What is compiled is the unit itself; another may have been written into the file since, of
/// which the compiler must not think that it knows.
#[used]
static MODEL: model::Place = model::empty();

fn model() -> Result<model::Model, Failure> {
    let byte = |k: usize| Some(unsafe { ptr::read_volatile(MODEL.get(k)?) });
    model::read(byte).map_err(Failure::NoModel)
}

/// The resource location is not looked at, for the unit has no resources.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Instantiate(
    instanceName: fmi2String,
    fmuType: c_int,
    fmuGUID: fmi2String,
    _fmuResourceLocation: fmi2String,
    functions: *const fmi2CallbackFunctions,
    _visible: fmi2Boolean,
    loggingOn: fmi2Boolean,
) -> fmi2Component {
    // Without the structure there is no way to say what is wrong, nor would there be later.
    let Some(functions) = (unsafe { functions.as_ref() }) else {
        return ptr::null_mut();
    };
    let name = unsafe { text(instanceName, "instanceName") };
    let log = Log {
        name: c_string(name.as_deref().unwrap_or_default()),
        logger: functions.logger,
        environment: functions.componentEnvironment,
    };
    let instance = catch(|| {
        if fmuType != CO_SIMULATION {
            return Err(Failure::WrongType { given: fmuType });
        }
        Instance::new(model()?, name?, &unsafe { text(fmuGUID, "fmuGUID") }?, loggingOn.0 != 0)
    });
    match instance {
        Ok(instance) => Box::into_raw(Box::new(Component { instance, log })).cast(),
        Err(failure) => {
            let status = fmi2Status::from(&failure);
            unsafe { log.line(status, category(status), &format!("fmi2Instantiate: {failure}")) };
            ptr::null_mut()
        }
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeInstance(c: fmi2Component) {
    if !c.is_null() {
        let component = unsafe { Box::from_raw(c.cast::<Component>()) };
        // Nobody is left to be told.
        let _ = catch(|| {
            drop(component);
            Ok(())
        });
    }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetDebugLogging(
    c: fmi2Component,
    loggingOn: fmi2Boolean,
    nCategories: usize,
    categories: *const fmi2String,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let categories = unsafe { slice(categories, nCategories, "categories")? };
        let names: Result<Vec<_>, _> = categories.iter().map(|name| unsafe { text(*name, "category") }).collect();
        instance.set_debug_logging(loggingOn.0 != 0, &names?)
    };
    unsafe { call(c, Function::SetDebugLogging, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetupExperiment(
    c: fmi2Component,
    toleranceDefined: fmi2Boolean,
    tolerance: fmi2Real,
    startTime: fmi2Real,
    stopTimeDefined: fmi2Boolean,
    stopTime: fmi2Real,
) -> fmi2Status {
    let given = |defined: fmi2Boolean, value| (defined.0 != 0).then_some(value);
    let (tolerance, stop) = (given(toleranceDefined, tolerance), given(stopTimeDefined, stopTime));
    unsafe { call(c, Function::SetupExperiment, |instance| instance.setup_experiment(tolerance, startTime, stop)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2EnterInitializationMode(c: fmi2Component) -> fmi2Status {
    unsafe { call(c, Function::EnterInitializationMode, Instance::enter_initialization_mode) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2ExitInitializationMode(c: fmi2Component) -> fmi2Status {
    unsafe { call(c, Function::ExitInitializationMode, Instance::exit_initialization_mode) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Terminate(c: fmi2Component) -> fmi2Status {
    unsafe { call(c, Function::Terminate, Instance::terminate) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2Reset(c: fmi2Component) -> fmi2Status {
    unsafe { call(c, Function::Reset, Instance::reset) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetReal(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    value: *mut fmi2Real,
) -> fmi2Status {
    unsafe { get(c, Function::GetReal, vr, nvr, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetInteger(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    value: *mut fmi2Integer,
) -> fmi2Status {
    unsafe { get(c, Function::GetInteger, vr, nvr, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBoolean(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    value: *mut fmi2Boolean,
) -> fmi2Status {
    unsafe { get(c, Function::GetBoolean, vr, nvr, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetString(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    _value: *mut fmi2String,
) -> fmi2Status {
    unsafe { no_strings(c, Function::GetString, vr, nvr) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetReal(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    value: *const fmi2Real,
) -> fmi2Status {
    unsafe { set(c, Function::SetReal, vr, nvr, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetInteger(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    value: *const fmi2Integer,
) -> fmi2Status {
    unsafe { set(c, Function::SetInteger, vr, nvr, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetBoolean(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    value: *const fmi2Boolean,
) -> fmi2Status {
    unsafe { set(c, Function::SetBoolean, vr, nvr, value) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetString(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    _value: *const fmi2String,
) -> fmi2Status {
    unsafe { no_strings(c, Function::SetString, vr, nvr) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetFMUstate(c: fmi2Component, FMUstate: *mut fmi2FMUstate) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let state = unsafe { one(FMUstate, "FMUstate")? };
        *state = ptr::without_provenance_mut(instance.save_state(state.addr())?);
        Ok(None)
    };
    unsafe { call(c, Function::GetFMUstate, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetFMUstate(c: fmi2Component, FMUstate: fmi2FMUstate) -> fmi2Status {
    unsafe { call(c, Function::SetFMUstate, |instance| instance.load_state(FMUstate.addr())) }
}

/// Nothing to free is nothing to do, wherever it is said.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2FreeFMUstate(c: fmi2Component, FMUstate: *mut fmi2FMUstate) -> fmi2Status {
    let body = |instance: &mut Instance| {
        if !FMUstate.is_null() {
            let state = unsafe { one(FMUstate, "FMUstate")? };
            instance.free_state(state.addr())?;
            *state = ptr::null_mut();
        }
        Ok(None)
    };
    unsafe { call(c, Function::FreeFMUstate, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializedFMUstateSize(
    c: fmi2Component,
    FMUstate: fmi2FMUstate,
    size: *mut usize,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let size = unsafe { one(size, "size")? };
        *size = instance.state_size(FMUstate.addr())?;
        Ok(None)
    };
    unsafe { call(c, Function::SerializedFMUstateSize, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SerializeFMUstate(
    c: fmi2Component,
    FMUstate: fmi2FMUstate,
    serializedState: *mut fmi2Byte,
    size: usize,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let bytes = unsafe { slice_mut(serializedState.cast(), size, "serializedState")? };
        instance.serialize(FMUstate.addr(), bytes)
    };
    unsafe { call(c, Function::SerializeFMUstate, body) }
}

/// The state is always a new one: only of `fmi2GetFMUstate` the standard says what stands where it is to be put.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DeSerializeFMUstate(
    c: fmi2Component,
    serializedState: *const fmi2Byte,
    size: usize,
    FMUstate: *mut fmi2FMUstate,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let bytes = unsafe { slice(serializedState.cast(), size, "serializedState")? };
        let state = unsafe { one(FMUstate, "FMUstate")? };
        *state = ptr::without_provenance_mut(instance.deserialize(bytes)?);
        Ok(None)
    };
    unsafe { call(c, Function::DeSerializeFMUstate, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetDirectionalDerivative(
    c: fmi2Component,
    vUnknown_ref: *const fmi2ValueReference,
    nUnknown: usize,
    vKnown_ref: *const fmi2ValueReference,
    nKnown: usize,
    dvKnown: *const fmi2Real,
    dvUnknown: *mut fmi2Real,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let unknown = unsafe { slice(vUnknown_ref, nUnknown, "vUnknown_ref")? };
        let known = unsafe { slice(vKnown_ref, nKnown, "vKnown_ref")? };
        let direction = unsafe { slice(dvKnown, nKnown, "dvKnown")? };
        let derivatives = unsafe { slice_mut(dvUnknown, nUnknown, "dvUnknown")? };
        instance.directional_derivative(unknown, known, direction, derivatives)
    };
    unsafe { call(c, Function::GetDirectionalDerivative, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2SetRealInputDerivatives(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    order: *const fmi2Integer,
    value: *const fmi2Real,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let (references, orders) = unsafe { (slice(vr, nvr, "vr")?, slice(order, nvr, "order")?) };
        instance.set_input_derivatives(references, orders, unsafe { slice(value, nvr, "value")? })
    };
    unsafe { call(c, Function::SetRealInputDerivatives, body) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealOutputDerivatives(
    c: fmi2Component,
    vr: *const fmi2ValueReference,
    nvr: usize,
    order: *const fmi2Integer,
    value: *mut fmi2Real,
) -> fmi2Status {
    let body = |instance: &mut Instance| {
        let (references, orders) = unsafe { (slice(vr, nvr, "vr")?, slice(order, nvr, "order")?) };
        instance.output_derivatives(references, orders, unsafe { slice_mut(value, nvr, "value")? })
    };
    unsafe { call(c, Function::GetRealOutputDerivatives, body) }
}

/// States are kept as long as the host does not free them, whatever the last argument says of going back to them.
#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2DoStep(
    c: fmi2Component,
    currentCommunicationPoint: fmi2Real,
    communicationStepSize: fmi2Real,
    _noSetFMUStatePriorToCurrentPoint: fmi2Boolean,
) -> fmi2Status {
    unsafe { call(c, Function::DoStep, |instance| instance.do_step(currentCommunicationPoint, communicationStepSize)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2CancelStep(c: fmi2Component) -> fmi2Status {
    unsafe { not_supported(c, Function::CancelStep, CANCEL) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetStatus(c: fmi2Component, kind: c_int, value: *mut fmi2Status) -> fmi2Status {
    unsafe { status(c, Function::GetStatus, kind, value, |_, kind| kind.pending(StatusKind::DoStepStatus)) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetRealStatus(c: fmi2Component, kind: c_int, value: *mut fmi2Real) -> fmi2Status {
    unsafe { status(c, Function::GetRealStatus, kind, value, Instance::last_successful_time) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetIntegerStatus(c: fmi2Component, kind: c_int, value: *mut fmi2Integer) -> fmi2Status {
    unsafe { status(c, Function::GetIntegerStatus, kind, value, |_, kind| Err(kind.mismatch())) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetBooleanStatus(c: fmi2Component, kind: c_int, value: *mut fmi2Boolean) -> fmi2Status {
    unsafe { status(c, Function::GetBooleanStatus, kind, value, Instance::wants_to_terminate) }
}

#[unsafe(no_mangle)]
unsafe extern "C" fn fmi2GetStringStatus(c: fmi2Component, kind: c_int, value: *mut fmi2String) -> fmi2Status {
    unsafe { status(c, Function::GetStringStatus, kind, value, |_, kind| kind.pending(StatusKind::PendingStatus)) }
}
