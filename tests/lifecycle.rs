//! The unit through its C interface: every function in every state, everything a host can get wrong, and what must come
//! out the same bit for bit.
#![allow(unsafe_code)]

use cosserat_rod::fmi2::host::{
    CO_SIMULATION, Error, Fmu, Line, Log, Slave, fmi2Boolean, fmi2CallbackFunctions, fmi2Component, fmi2Status,
    fmi2String, fmi2ValueReference,
};
use cosserat_rod::fmi2::variables::Kind;
use cosserat_rod::package;
use std::collections::BTreeSet;
use std::ffi::CString;
use std::{fs, ptr, thread};

fn fmu() -> Fmu {
    Fmu::from_library(&package::library().unwrap()).unwrap()
}

/// The four states a host can reach without breaking anything.
#[derive(Clone, Copy, Debug, PartialEq)]
enum State {
    Instantiated,
    Initialization,
    StepComplete,
    Terminated,
}

use State::{Initialization, Instantiated, StepComplete, Terminated};

/// What is tested here is the interface: a coarse rod is soon computed, even by a debug build.
fn coarse(fmu: &Fmu, slave: &Slave) {
    for (name, value) in [("cells", 3.0), ("stages", 1.0), ("step", 0.02)] {
        set(fmu, slave, name, value).unwrap();
    }
}

fn slave(fmu: &Fmu, state: State) -> Slave<'_> {
    let slave = fmu.instantiate("rod", false).unwrap();
    coarse(fmu, &slave);
    if state == Instantiated {
        return slave;
    }
    slave.setup_experiment(0.0, Some(1.0), None).unwrap();
    slave.enter_initialization_mode().unwrap();
    if state == Initialization {
        return slave;
    }
    slave.exit_initialization_mode().unwrap();
    if state == Terminated {
        slave.terminate().unwrap();
    }
    slave
}

/// The one line that a refusal writes.
fn single(log: Vec<Line>) -> String {
    let [line] = log.as_slice() else { panic!("not one line: {log:?}") };
    assert_eq!((line.status, line.category.as_str()), (fmi2Status::ERROR, "logStatusError"), "{line:?}");
    assert!(!line.text.contains(['%', '#']), "{line:?}");
    line.text.clone()
}

fn refusal(result: Result<(), Error>) -> String {
    match result {
        Err(Error::Refused { status: fmi2Status::ERROR, log, .. }) => single(log),
        other => panic!("not refused: {other:?}"),
    }
}

/// Asserts that the line names all of these.
fn names(line: &str, what: &[&str]) {
    for word in what {
        assert!(line.contains(word), "'{word}' is missing in '{line}'");
    }
}

fn real(fmu: &Fmu, name: &str) -> fmi2ValueReference {
    fmu.description.reference(name, Kind::Real).unwrap()
}

fn set(fmu: &Fmu, slave: &Slave, name: &str, value: f64) -> Result<(), Error> {
    let variable = &fmu.description.variables[name];
    match variable.kind {
        Kind::Integer => slave.set_integer(&[variable.reference], &[value as i32]),
        Kind::Boolean => slave.set_boolean(&[variable.reference], &[fmi2Boolean(value as i32)]),
        _ => slave.set_real(&[variable.reference], &[value]),
    }
}

/// Every Real variable, as bits.
fn snapshot(fmu: &Fmu, slave: &Slave) -> Vec<u64> {
    let variables = fmu.description.variables.values();
    let references: Vec<_> = variables.filter(|v| v.kind == Kind::Real).map(|v| v.reference).collect();
    let mut values = vec![0.0; references.len()];
    slave.get_real(&references, &mut values).unwrap();
    values.into_iter().map(f64::to_bits).collect()
}

fn run(fmu: &Fmu, slave: &Slave, steps: i32) -> Vec<Vec<u64>> {
    coarse(fmu, slave);
    slave.setup_experiment(0.0, None, None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    let step = |k: i32| {
        set(fmu, slave, "tip.force[2]", 0.01 * f64::from(k)).unwrap();
        slave.do_step(0.01 * f64::from(k), 0.01).unwrap();
        snapshot(fmu, slave)
    };
    (0..steps).map(step).collect()
}

type Call = Box<dyn Fn(fmi2Component) -> fmi2Status>;

/// All functions that take an instance, each with harmless arguments, and the states that allow it according to the
/// table of calling sequences in the standard.
fn functions(fmu: &Fmu) -> Vec<(&'static str, Call, &'static [State])> {
    const ALWAYS: &[State] = &[Instantiated, Initialization, StepComplete, Terminated];
    const SET: &[State] = &[Instantiated, Initialization, StepComplete];
    const GET: &[State] = &[Initialization, StepComplete, Terminated];
    const AFTER: &[State] = &[StepComplete, Terminated];
    let f = *fmu.functions();
    let off = fmi2Boolean(0);
    unsafe {
        vec![
            ("fmi2SetDebugLogging", Box::new(move |c| (f.SetDebugLogging)(c, off, 0, ptr::null())), ALWAYS),
            (
                "fmi2SetupExperiment",
                Box::new(move |c| (f.SetupExperiment)(c, off, 0.0, 0.0, off, 0.0)),
                &[Instantiated] as &[_],
            ),
            ("fmi2EnterInitializationMode", Box::new(move |c| (f.EnterInitializationMode)(c)), &[Instantiated]),
            ("fmi2ExitInitializationMode", Box::new(move |c| (f.ExitInitializationMode)(c)), &[Initialization]),
            ("fmi2Terminate", Box::new(move |c| (f.Terminate)(c)), &[StepComplete]),
            ("fmi2Reset", Box::new(move |c| (f.Reset)(c)), ALWAYS),
            ("fmi2GetReal", Box::new(move |c| (f.GetReal)(c, ptr::null(), 0, ptr::null_mut())), GET),
            ("fmi2GetInteger", Box::new(move |c| (f.GetInteger)(c, ptr::null(), 0, ptr::null_mut())), GET),
            ("fmi2GetBoolean", Box::new(move |c| (f.GetBoolean)(c, ptr::null(), 0, ptr::null_mut())), GET),
            ("fmi2GetString", Box::new(move |c| (f.GetString)(c, ptr::null(), 0, ptr::null_mut())), GET),
            ("fmi2SetReal", Box::new(move |c| (f.SetReal)(c, ptr::null(), 0, ptr::null())), SET),
            ("fmi2SetInteger", Box::new(move |c| (f.SetInteger)(c, ptr::null(), 0, ptr::null())), SET),
            ("fmi2SetBoolean", Box::new(move |c| (f.SetBoolean)(c, ptr::null(), 0, ptr::null())), SET),
            ("fmi2SetString", Box::new(move |c| (f.SetString)(c, ptr::null(), 0, ptr::null())), SET),
            ("fmi2GetFMUstate", Box::new(move |c| (f.GetFMUstate)(c, &mut ptr::null_mut())), ALWAYS),
            ("fmi2SetFMUstate", Box::new(move |c| (f.SetFMUstate)(c, ptr::null_mut())), ALWAYS),
            ("fmi2FreeFMUstate", Box::new(move |c| (f.FreeFMUstate)(c, &mut ptr::null_mut())), ALWAYS),
            (
                "fmi2SerializedFMUstateSize",
                Box::new(move |c| (f.SerializedFMUstateSize)(c, ptr::null_mut(), &mut 0)),
                ALWAYS,
            ),
            (
                "fmi2SerializeFMUstate",
                Box::new(move |c| (f.SerializeFMUstate)(c, ptr::null_mut(), ptr::null_mut(), 0)),
                ALWAYS,
            ),
            (
                "fmi2DeSerializeFMUstate",
                Box::new(move |c| (f.DeSerializeFMUstate)(c, ptr::null(), 0, &mut ptr::null_mut())),
                ALWAYS,
            ),
            (
                "fmi2GetDirectionalDerivative",
                Box::new(move |c| {
                    (f.GetDirectionalDerivative)(c, ptr::null(), 0, ptr::null(), 0, ptr::null(), ptr::null_mut())
                }),
                GET,
            ),
            (
                "fmi2SetRealInputDerivatives",
                Box::new(move |c| (f.SetRealInputDerivatives)(c, ptr::null(), 0, ptr::null(), ptr::null())),
                SET,
            ),
            (
                "fmi2GetRealOutputDerivatives",
                Box::new(move |c| (f.GetRealOutputDerivatives)(c, ptr::null(), 0, ptr::null(), ptr::null_mut())),
                AFTER,
            ),
            ("fmi2DoStep", Box::new(move |c| (f.DoStep)(c, 0.0, 0.01, off)), &[StepComplete]),
            ("fmi2CancelStep", Box::new(move |c| (f.CancelStep)(c)), &[StepComplete]),
            ("fmi2GetStatus", Box::new(move |c| (f.GetStatus)(c, 0, &mut fmi2Status(0))), AFTER),
            ("fmi2GetRealStatus", Box::new(move |c| (f.GetRealStatus)(c, 2, &mut 0.0)), AFTER),
            ("fmi2GetIntegerStatus", Box::new(move |c| (f.GetIntegerStatus)(c, 2, &mut 0)), AFTER),
            ("fmi2GetBooleanStatus", Box::new(move |c| (f.GetBooleanStatus)(c, 3, &mut fmi2Boolean(0))), AFTER),
            ("fmi2GetStringStatus", Box::new(move |c| (f.GetStringStatus)(c, 1, &mut ptr::null())), AFTER),
        ]
    }
}

/// Capabilities that the model description denies.
const NOT_SUPPORTED: [&str; 1] = ["fmi2CancelStep"];

#[test]
fn every_function_in_every_state() {
    let fmu = fmu();
    for (name, call, states) in functions(&fmu) {
        for state in [Instantiated, Initialization, StepComplete, Terminated] {
            let slave = slave(&fmu, state);
            let status = call(slave.component());
            let log = slave.log.take();
            let refused = log.iter().any(|line| line.text.contains("not allowed in the state"));
            assert_eq!(refused, !states.contains(&state), "{name} in {state:?}: {log:?}");
            if refused {
                assert_eq!(status, fmi2Status::ERROR);
                names(&single(log), &[name]);
                // The state is what it was: the next call of its kind is still allowed.
                match state {
                    Instantiated => slave.setup_experiment(0.0, None, None).unwrap(),
                    Initialization => slave.exit_initialization_mode().unwrap(),
                    StepComplete => slave.do_step(0.0, 0.01).unwrap(),
                    Terminated => slave.get_real(&[], &mut []).unwrap(),
                }
            } else if NOT_SUPPORTED.contains(&name) {
                assert_eq!(status, fmi2Status::ERROR);
                names(&single(log), &[name, "not supported"]);
            }
        }
    }
}

#[test]
fn the_null_instance_is_an_error_for_every_function_but_free() {
    let fmu = fmu();
    for (name, call, _) in functions(&fmu) {
        assert_eq!(call(ptr::null_mut()), fmi2Status::ERROR, "{name}");
    }
    unsafe { (fmu.functions().FreeInstance)(ptr::null_mut()) }
}

#[test]
fn status_inquiries_of_a_unit_without_pending_steps() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    slave.do_step(0.0, 0.25).unwrap();
    let (c, f) = (slave.component(), fmu.functions());
    let (mut time, mut end) = (0.0, fmi2Boolean(7));
    unsafe {
        assert_eq!((f.GetRealStatus)(c, 2, &mut time), fmi2Status::OK);
        assert_eq!((f.GetBooleanStatus)(c, 3, &mut end), fmi2Status::OK);
        assert_eq!((time, end), (0.25, fmi2Boolean(0)));
        assert_eq!((f.GetStatus)(c, 0, &mut fmi2Status(0)), fmi2Status::DISCARD);
        assert_eq!((f.GetStringStatus)(c, 1, &mut ptr::null()), fmi2Status::DISCARD);
        let log = slave.log.take();
        assert!(log.len() == 2 && log.iter().all(|line| line.category == "logStatusDiscard"), "{log:?}");
        // A kind of another type, one that does not exist, and nowhere to write.
        assert_eq!((f.GetRealStatus)(c, 3, &mut time), fmi2Status::ERROR);
        assert_eq!((f.GetIntegerStatus)(c, 2, &mut 0), fmi2Status::ERROR);
        assert_eq!((f.GetRealStatus)(c, 99, &mut time), fmi2Status::ERROR);
        assert_eq!((f.GetRealStatus)(c, 2, ptr::null_mut()), fmi2Status::ERROR);
    }
    assert_eq!(slave.log.take().len(), 4);
}

#[test]
fn version_and_platform() {
    let fmu = fmu();
    let text = |string: fmi2String| unsafe { std::ffi::CStr::from_ptr(string) }.to_str().unwrap().to_owned();
    unsafe {
        assert_eq!(text((fmu.functions().GetVersion)()), "2.0");
        assert_eq!(text((fmu.functions().GetTypesPlatform)()), "default");
    }
}

/// Instance name, GUID, resource location.
type Strings<'a> = [Option<&'a str>; 3];

/// Calls `fmi2Instantiate` with whatever it is given, and frees what it gets.
fn instantiate(fmu: &Fmu, [name, guid, uri]: Strings, kind: i32, callbacks: Option<&fmi2CallbackFunctions>) -> bool {
    let strings = [name, guid, uri].map(|text| text.map(|text| CString::new(text).unwrap()));
    let [name, guid, uri] = strings.each_ref().map(|text| text.as_ref().map_or(ptr::null(), |text| text.as_ptr()));
    let callbacks = callbacks.map_or(ptr::null(), ptr::from_ref);
    let (f, off) = (fmu.functions(), fmi2Boolean(0));
    unsafe {
        let component = (f.Instantiate)(name, kind, guid, uri, callbacks, off, off);
        (f.FreeInstance)(component);
        !component.is_null()
    }
}

#[test]
fn bad_arguments_of_instantiate_give_no_instance_and_one_line() {
    let fmu = fmu();
    let good = fmu.description.guid.as_str();
    let log = Log::default();
    let callbacks = log.callbacks();
    let cases: [(Strings, i32, &[&str]); 7] = [
        ([None, Some(good), None], CO_SIMULATION, &["instanceName"]),
        ([Some(""), Some(good), None], CO_SIMULATION, &["instanceName"]),
        ([Some("rod"), None, None], CO_SIMULATION, &["fmuGUID"]),
        ([Some("rod"), Some("{0}"), None], CO_SIMULATION, &["fmuGUID", "{0}", good]),
        ([Some("rod"), Some("100%s#r1#\n"), None], CO_SIMULATION, &["fmuGUID", "100?s?r1??"]),
        ([Some("rod"), Some(good), None], 0, &["fmuType = 0", "fmi2CoSimulation"]),
        ([Some("rod"), Some(good), None], 17, &["fmuType = 17"]),
    ];
    for (strings, kind, words) in cases {
        assert!(!instantiate(&fmu, strings, kind, Some(&callbacks)));
        names(&single(log.take()), words);
    }
    assert!(!instantiate(&fmu, [Some("rod"), Some(good), None], CO_SIMULATION, None));
}

#[test]
fn any_resource_location_will_do() {
    let fmu = fmu();
    let log = Log::default();
    for uri in [
        None,
        Some(""),
        Some("file:///nowhere/resources"),
        Some("file:/nowhere/resources"),
        Some("file://localhost/nowhere/a%20b%25"),
        Some("file:///C:/Users/x/resources"),
        Some("no uri \u{fc} at all"),
    ] {
        assert!(instantiate(&fmu, [Some("rod"), Some(&fmu.description.guid), uri], 1, Some(&log.callbacks())));
    }
    assert_eq!(log.take(), []);
}

#[test]
fn a_null_logger_is_no_reason_to_fall_over() {
    let fmu = fmu();
    let callbacks = fmi2CallbackFunctions { logger: None, ..Log::default().callbacks() };
    assert!(!instantiate(&fmu, [Some("rod"), Some("wrong"), None], CO_SIMULATION, Some(&callbacks)));
    let (f, on) = (fmu.functions(), fmi2Boolean(1));
    let guid = CString::new(fmu.description.guid.as_str()).unwrap();
    unsafe {
        let c = (f.Instantiate)(c"rod".as_ptr(), CO_SIMULATION, guid.as_ptr(), ptr::null(), &callbacks, on, on);
        assert_eq!((f.DoStep)(c, 0.0, 0.1, on), fmi2Status::ERROR);
        assert_eq!((f.EnterInitializationMode)(c), fmi2Status::OK);
        assert_eq!((f.ExitInitializationMode)(c), fmi2Status::OK);
        assert_eq!((f.DoStep)(c, 0.0, 0.01, on), fmi2Status::OK);
        (f.FreeInstance)(c);
    }
}

#[test]
fn null_arrays_are_refused_unless_they_are_empty() {
    let fmu = fmu();
    let slave = slave(&fmu, Initialization);
    let (c, f) = (slave.component(), fmu.functions());
    let reference = real(&fmu, "length");
    unsafe {
        for status in [
            (f.GetReal)(c, ptr::null(), 1, &mut 0.0),
            (f.GetReal)(c, &reference, 1, ptr::null_mut()),
            (f.SetReal)(c, ptr::null(), 1, &1.0),
            (f.SetReal)(c, &reference, 1, ptr::null()),
            (f.SetReal)(c, &reference, usize::MAX, &1.0),
            (f.SetString)(c, ptr::null(), 1, ptr::null()),
            (f.SetDebugLogging)(c, fmi2Boolean(1), 1, ptr::null()),
            (f.SetDebugLogging)(c, fmi2Boolean(1), 1, &ptr::null()),
        ] {
            assert_eq!(status, fmi2Status::ERROR);
        }
        let log = slave.log.take();
        assert!(log.len() == 8 && log.iter().all(|line| line.text.contains("null pointer")), "{log:?}");
        assert_eq!((f.GetReal)(c, ptr::null(), 0, ptr::null_mut()), fmi2Status::OK);
        assert_eq!((f.SetReal)(c, ptr::null(), 0, ptr::null()), fmi2Status::OK);
    }
}

#[test]
fn values_out_of_range_are_refused_and_named() {
    let fmu = fmu();
    let (inf, nan) = (f64::INFINITY, f64::NAN);
    let cases: &[(&[&str], &[f64], &str)] = &[
        (&["length", "radius", "density", "youngs_modulus", "shear_modulus"], &[0.0, -1.0, inf, nan], "> 0"),
        (&["section.shear_correction"], &[0.0, -1.0, nan], "> 0"),
        (&["section.area", "section.second_moment[2]", "section.torsion_constant"], &[-1e-9, inf, nan], ">= 0"),
        (&["damping.bending", "damping.twist", "damping.drag"], &[-1e-9, inf, nan], ">= 0"),
        (&["tip.mass", "tip.inertia", "step", "tolerance"], &[-1e-9, inf, nan], ">= 0"),
        (&["spectral_radius"], &[-0.1, 1.1, nan], "from 0 to 1"),
        (&["rest_curvature[3]", "gravity[1]"], &[inf, -inf, nan], "finite"),
        (&["base.position[1]", "base.orientation[4]", "base.velocity[2]"], &[inf, -inf, nan], "finite"),
        (&["base.angular_velocity[3]", "tip.force[1]", "tip.moment[1]"], &[inf, -inf, nan], "finite"),
        (&["cells"], &[-1.0], "from 0 to"),
        (&["stages"], &[-1.0, 5.0], "from 0 to 4"),
        (&["base.motion"], &[-1.0, 3.0], "from 0 to 2"),
        (&["extensible", "start_in_equilibrium"], &[-1.0, 2.0], "from 0 to 1"),
    ];
    for state in [Instantiated, Initialization] {
        let slave = slave(&fmu, state);
        for (variables, values, allowed) in cases {
            for (name, value) in variables.iter().flat_map(|name| values.iter().map(move |value| (name, *value))) {
                let line = refusal(set(&fmu, &slave, name, value));
                names(&line, &[&format!("{name} = {value} is not allowed"), allowed]);
            }
        }
    }
    let slave = slave(&fmu, StepComplete);
    for name in ["gravity[2]", "base.position[1]", "tip.moment[3]"] {
        names(&refusal(set(&fmu, &slave, name, f64::NAN)), &[name, "NaN", "finite"]);
    }
    slave.do_step(0.0, 0.01).unwrap();
}

#[test]
fn a_refused_set_writes_nothing() {
    let fmu = fmu();
    let slave = slave(&fmu, Initialization);
    let before = snapshot(&fmu, &slave);
    let [length, radius, tip] = ["length", "radius", "tip.position[1]"].map(|name| real(&fmu, name));
    let unknown = u32::try_from(fmu.description.variables.len()).unwrap();
    refusal(slave.set_real(&[length, radius], &[2.0, -1.0]));
    names(&refusal(slave.set_real(&[length, tip], &[2.0, 1.0])), &["tip.position[1] = 1", "output"]);
    names(&refusal(slave.set_real(&[length, unknown], &[2.0, 1.0])), &[&unknown.to_string(), "unknown"]);
    names(&refusal(slave.set_real(&[length, u32::MAX], &[2.0, 1.0])), &["4294967295", "unknown"]);
    let cells = fmu.description.reference("cells", Kind::Integer).unwrap();
    names(&refusal(slave.set_real(&[length, cells], &[2.0, 1.0])), &["cells", "Integer", "Real"]);
    names(&refusal(slave.set_integer(&[length], &[2])), &["length", "Real", "Integer"]);
    names(&refusal(slave.set_boolean(&[length], &[fmi2Boolean(1)])), &["length", "Real", "Boolean"]);
    names(&refusal(slave.get_real(&[length, unknown], &mut [0.0; 2])), &["unknown"]);
    let status = unsafe { (fmu.functions().GetString)(slave.component(), &length, 1, &mut ptr::null()) };
    assert_eq!(status, fmi2Status::ERROR);
    names(&single(slave.log.take()), &["length", "Real", "String"]);
    assert_eq!(snapshot(&fmu, &slave), before);
}

#[test]
fn fixed_parameters_are_fixed_after_initialization_and_gravity_is_not() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    for (name, variable) in &fmu.description.variables {
        let value: f64 = variable.start.parse().unwrap_or(1.0);
        let result = set(&fmu, &slave, name, value);
        if variable.causality == "input" || variable.variability == "tunable" {
            result.unwrap();
        } else {
            names(&refusal(result), &[name, " is not allowed: "]);
        }
    }
    let gravity = real(&fmu, "gravity[3]");
    slave.set_real(&[gravity], &[-1.62]).unwrap();
    slave.do_step(0.0, 0.01).unwrap();
    let mut value = [0.0];
    slave.get_real(&[gravity], &mut value).unwrap();
    assert_eq!(value, [-1.62]);
}

#[test]
fn a_zero_quaternion_is_refused_where_it_is_used() {
    let fmu = fmu();
    let orientation = fmu.description.array::<4>("base.orientation").unwrap();
    let slave = slave(&fmu, Initialization);
    slave.set_real(&orientation, &[0.0; 4]).unwrap();
    names(&refusal(slave.exit_initialization_mode()), &["base.orientation", "zero"]);
    names(&refusal(slave.get_real(&[real(&fmu, "tip.position[1]")], &mut [0.0])), &["base.orientation"]);
    slave.set_real(&orientation, &[2.0, 0.0, 0.0, 0.0]).unwrap();
    slave.exit_initialization_mode().unwrap();
    slave.set_real(&orientation, &[0.0; 4]).unwrap();
    names(&refusal(slave.do_step(0.0, 0.01)), &["base.orientation", "zero"]);
    slave.terminate().unwrap();
}

#[test]
fn the_experiment_is_checked() {
    let fmu = fmu();
    let slave = slave(&fmu, Instantiated);
    let (inf, nan) = (f64::INFINITY, f64::NAN);
    for (start, stop, tolerance, words) in [
        (nan, None, None, ["startTime = NaN", "finite"]),
        (inf, None, None, ["startTime = inf", "finite"]),
        (0.0, Some(nan), None, ["stopTime = NaN", "startTime = 0"]),
        (0.0, Some(inf), None, ["stopTime = inf", "startTime = 0"]),
        (1.0, Some(0.5), None, ["stopTime = 0.5", "startTime = 1"]),
        (0.0, None, Some(-1e-3), ["tolerance = -0.001", ">= 0"]),
        (0.0, None, Some(nan), ["tolerance = NaN", ">= 0"]),
    ] {
        names(&refusal(slave.setup_experiment(start, stop, tolerance)), &words);
    }
    slave.setup_experiment(0.0, None, Some(0.0)).unwrap();
}

#[test]
fn a_failed_step_leaves_no_trace_and_can_be_repeated() {
    let fmu = fmu();
    let straight = slave(&fmu, StepComplete);
    let disturbed = slave(&fmu, StepComplete);
    let (nan, inf) = (f64::NAN, f64::INFINITY);
    let orientation = fmu.description.array::<4>("base.orientation").unwrap();
    let mut kept = [0.0; 4];
    disturbed.get_real(&orientation, &mut kept).unwrap();
    for k in 0..5 {
        let time = 0.1 * f64::from(k);
        for (tc, h, word) in [
            (time, 0.0, "communicationStepSize = 0"),
            (time, -0.1, "communicationStepSize = -0.1"),
            (time, nan, "communicationStepSize = NaN"),
            (time, inf, "communicationStepSize = inf"),
            (nan, 0.1, "currentCommunicationPoint = NaN"),
            (inf, 0.1, "currentCommunicationPoint = inf"),
            (time + 0.05, 0.1, "currentCommunicationPoint"),
            (time - 0.1, 0.1, "currentCommunicationPoint"),
            (time, 1.1 - time, "stopTime = 1"),
        ] {
            let before = snapshot(&fmu, &disturbed);
            names(&refusal(disturbed.do_step(tc, h)), &[word, "is not allowed"]);
            assert_eq!(snapshot(&fmu, &disturbed), before);
        }
        disturbed.set_real(&orientation, &[0.0; 4]).unwrap();
        refusal(disturbed.do_step(time, 0.1));
        disturbed.set_real(&orientation, &kept).unwrap();
        straight.do_step(time, 0.1).unwrap();
        disturbed.do_step(time, 0.1).unwrap();
        assert_eq!(snapshot(&fmu, &disturbed), snapshot(&fmu, &straight));
    }
    refusal(disturbed.do_step(0.0, 0.1));
    disturbed.terminate().unwrap();
}

#[test]
fn rounded_times_are_right_times() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    let mut sum = 0.0;
    for k in 0..10 {
        // Once as a sum, once as a product: ten times 0.1 is not quite 1.
        let tc = if k % 2 == 0 { sum } else { f64::from(k) * 0.1 };
        slave.do_step(tc, 0.1).unwrap();
        sum += 0.1;
    }
    names(&refusal(slave.do_step(1.0, 1e-3)), &["stopTime = 1"]);
}

#[test]
fn outputs_between_set_and_step_are_those_of_the_last_step() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    slave.do_step(0.0, 0.01).unwrap();
    let outputs: Vec<_> =
        (fmu.description.variables.values()).filter(|v| v.causality == "output" && v.kind == Kind::Real).collect();
    let references: Vec<_> = outputs.iter().map(|variable| variable.reference).collect();
    let (mut before, mut after) = (vec![0.0; references.len()], vec![0.0; references.len()]);
    slave.get_real(&references, &mut before).unwrap();
    set(&fmu, &slave, "base.velocity[1]", 1.0).unwrap();
    set(&fmu, &slave, "tip.force[3]", 1.0).unwrap();
    slave.get_real(&references, &mut after).unwrap();
    assert_eq!(before, after);
}

#[test]
fn a_reset_instance_is_as_fresh() {
    let fmu = fmu();
    let fresh = run(&fmu, &fmu.instantiate("fresh", false).unwrap(), 5);
    for state in [Instantiated, Initialization, StepComplete, Terminated] {
        let slave = slave(&fmu, state);
        if matches!(state, Instantiated | Initialization) {
            set(&fmu, &slave, "length", 0.5).unwrap();
            set(&fmu, &slave, "cells", 7.0).unwrap();
            set(&fmu, &slave, "base.velocity[2]", 0.1).unwrap();
        } else if state == StepComplete {
            set(&fmu, &slave, "gravity[1]", 3.0).unwrap();
            slave.do_step(0.0, 0.02).unwrap();
        }
        slave.reset().unwrap();
        assert_eq!(run(&fmu, &slave, 5), fresh, "from {state:?}");
    }
}

/// All that a saved state holds.
fn state(slave: &Slave) -> Vec<u8> {
    let mut state = ptr::null_mut();
    slave.get_state(&mut state).unwrap();
    let bytes = slave.serialize(state).unwrap();
    slave.free_state(&mut state).unwrap();
    assert!(state.is_null());
    bytes
}

#[test]
fn a_reset_instance_is_fresh_to_the_bit() {
    let fmu = fmu();
    let fresh = state(&fmu.instantiate("fresh", false).unwrap());
    for at in [Instantiated, Initialization, StepComplete, Terminated] {
        let slave = slave(&fmu, at);
        assert!(state(&slave) != fresh);
        slave.reset().unwrap();
        assert!(state(&slave) == fresh, "from {at:?}");
    }
}

#[test]
fn a_state_is_taken_back_from_every_state_to_every_state() {
    let fmu = fmu();
    for from in [Instantiated, Initialization, StepComplete, Terminated] {
        let saved = slave(&fmu, from);
        if from != Terminated {
            set(&fmu, &saved, "base.velocity[1]", 0.1).unwrap();
        }
        if from == StepComplete {
            saved.do_step(0.0, 0.1).unwrap();
        }
        let bytes = state(&saved);
        for to in [Instantiated, Initialization, StepComplete, Terminated] {
            let slave = slave(&fmu, to);
            let handle = slave.deserialize(&bytes).unwrap();
            for _ in 0..2 {
                slave.set_state(handle).unwrap();
                assert!(state(&slave) == bytes, "{from:?} in {to:?}");
                // it goes on as what was saved, and the state stays good
                match from {
                    Instantiated => slave.enter_initialization_mode().unwrap(),
                    Initialization => slave.exit_initialization_mode().unwrap(),
                    StepComplete => slave.do_step(0.1, 0.1).unwrap(),
                    Terminated => assert_eq!(snapshot(&fmu, &slave), snapshot(&fmu, &saved)),
                }
            }
        }
    }
}

#[test]
fn a_state_that_is_none_is_refused() {
    let fmu = fmu();
    let [slave, other] = [(); 2].map(|()| slave(&fmu, StepComplete));
    let before = state(&slave);
    let (mut freed, mut of_other) = (ptr::null_mut(), ptr::null_mut());
    slave.get_state(&mut freed).unwrap();
    other.get_state(&mut of_other).unwrap();
    let gone = freed;
    slave.free_state(&mut freed).unwrap();
    assert!(freed.is_null());
    slave.free_state(&mut freed).unwrap();
    let foreign = ptr::without_provenance_mut(0x1008);
    for handle in [gone, of_other, foreign] {
        for result in [
            slave.set_state(handle),
            slave.free_state(&mut handle.clone()),
            slave.get_state(&mut handle.clone()),
            slave.serialize(handle).map(drop),
        ] {
            names(&refusal(result), &["FMUstate", "instance"]);
        }
    }
    for result in [slave.set_state(ptr::null_mut()), slave.serialize(ptr::null_mut()).map(drop)] {
        names(&refusal(result), &["FMUstate", "null"]);
    }
    let (c, f) = (slave.component(), fmu.functions());
    let mut good = ptr::null_mut();
    slave.get_state(&mut good).unwrap();
    let mut bytes = slave.serialize(good).unwrap();
    let (start, size) = (bytes.as_mut_ptr().cast(), bytes.len());
    let null: *mut u8 = ptr::null_mut();
    unsafe {
        assert_eq!((f.FreeFMUstate)(c, null.cast()), fmi2Status::OK);
        for status in [
            (f.GetFMUstate)(c, null.cast()),
            (f.SerializedFMUstateSize)(c, good, null.cast()),
            (f.SerializeFMUstate)(c, good, null.cast(), size),
            (f.SerializeFMUstate)(c, good, start, size - 1),
            (f.DeSerializeFMUstate)(c, null.cast(), size, &mut null.cast()),
            (f.DeSerializeFMUstate)(c, start, size, null.cast()),
        ] {
            assert_eq!(status, fmi2Status::ERROR);
        }
    }
    let log = slave.log.take();
    assert_eq!(log.len(), 6, "{log:?}");
    for (i, line) in log.iter().enumerate() {
        names(&line.text, &[if i == 3 { "size" } else { "null pointer" }]);
    }
    assert!(state(&slave) == before);
    slave.do_step(0.0, 0.1).unwrap();
}

#[test]
fn a_state_is_replaced_where_it_stands() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    let mut handle = ptr::null_mut();
    slave.get_state(&mut handle).unwrap();
    let (first, before) = (handle, slave.serialize(handle).unwrap());
    slave.do_step(0.0, 0.1).unwrap();
    slave.get_state(&mut handle).unwrap();
    assert_eq!(handle, first);
    assert!(slave.serialize(handle).unwrap() != before && slave.serialize(handle).unwrap() == state(&slave));
}

/// Bytes before what is saved.
const HEADER: usize = 62;

#[test]
fn bytes_that_are_no_state_are_refused_and_change_nothing() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    slave.do_step(0.0, 0.1).unwrap();
    let (good, values) = (state(&slave), snapshot(&fmu, &slave));
    let refused = |bytes: &[u8], words: &[&str]| {
        let line = refusal(slave.deserialize(bytes).map(drop));
        names(&line, &["fmi2DeSerializeFMUstate", "no saved state"]);
        names(&line, words);
    };
    for length in 0..good.len() {
        refused(&good[..length], &[]);
    }
    refused(&[good.as_slice(), &[0]].concat(), &["bytes"]);
    let changed = |place: usize, bits: u8| {
        let mut bytes = good.clone();
        bytes[place] ^= bits;
        bytes
    };
    // all of what stands before the state, and every seventh byte of that
    for place in (0..HEADER).chain((HEADER..good.len()).step_by(7)) {
        for bits in [1, 0x80, 0xff] {
            refused(&changed(place, bits), &[]);
        }
    }
    refused(&changed(0, 1), &["begin"]);
    refused(&changed(8, 2), &["format is 3"]);
    refused(&changed(20, 1), &["GUID", &fmu.description.guid]);
    refused(&changed(50, 1), &["bytes in place of"]);
    refused(&changed(good.len() - 1, 1), &["checksum"]);
    assert!(state(&slave) == good && snapshot(&fmu, &slave) == values);
    // what it has learnt to refuse it still takes where it is right
    let handle = slave.deserialize(&good).unwrap();
    slave.do_step(0.1, 0.1).unwrap();
    let later = state(&slave);
    slave.set_state(handle).unwrap();
    slave.do_step(0.1, 0.1).unwrap();
    assert!(state(&slave) == later);
}

#[test]
fn what_is_stored_in_another_way_has_another_format() {
    let fmu = fmu();
    let [first, later] = [Instantiated, StepComplete].map(|at| state(&slave(&fmu, at)));
    let format = u32::from_le_bytes(first[8..12].try_into().unwrap());
    let layout = (crc32fast::hash(&first[HEADER..]), later.len());
    assert_eq!(
        (format, layout),
        (1, (259_266_874, 7581)),
        "count FORMAT up, unless nothing of the last one has been released"
    );
}

/// Bytes with a right checksum that no library has written: not by chance, but they are not to take the host with them.
#[test]
fn forged_states_change_nothing_unless_they_are_taken() {
    let fmu = fmu();
    let slave = slave(&fmu, StepComplete);
    slave.do_step(0.0, 0.1).unwrap();
    let good = state(&slave);
    let (mut taken, mut refused) = (0, 0);
    let forged = |change: &dyn Fn(&mut Vec<u8>)| {
        let mut body = good[HEADER..].to_vec();
        change(&mut body);
        let mut bytes = good[..HEADER].to_vec();
        bytes[50..58].copy_from_slice(&(body.len() as u64).to_le_bytes());
        bytes[58..].copy_from_slice(&crc32fast::hash(&body).to_le_bytes());
        bytes.extend(body);
        bytes
    };
    let mut attempt = |bytes: &[u8]| {
        let handle = slave.deserialize(bytes).unwrap();
        match slave.set_state(handle) {
            Ok(()) => {
                taken += 1;
                slave.set_state(slave.deserialize(&good).unwrap()).unwrap();
            }
            Err(Error::Refused { status: fmi2Status::ERROR, log, .. }) => {
                refused += 1;
                names(&single(log), &["fmi2SetFMUstate", "no saved state"]);
            }
            Err(error) => panic!("{error}"),
        }
        assert!(state(&slave) == good);
    };
    for length in (0..good.len() - HEADER).step_by(11) {
        attempt(&forged(&|body| body.truncate(length)));
    }
    for place in (0..good.len() - HEADER).step_by(5) {
        attempt(&forged(&|body| body[place] ^= 1));
    }
    assert!(taken > 100 && refused > 100, "{taken} {refused}");
}

#[test]
fn a_million_steps_do_not_drift() {
    let fmu = fmu();
    let slave = fmu.instantiate("rod", false).unwrap();
    for (name, value) in [("cells", 1.0), ("stages", 1.0), ("step", 1.0), ("base.motion", 2.0)] {
        set(&fmu, &slave, name, value).unwrap();
    }
    // a base that its twist alone moves, at 1 m/s
    set(&fmu, &slave, "base.velocity[1]", 1.0).unwrap();
    slave.setup_experiment(0.0, None, None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    let (count, h) = (1_000_000, 1e-3);
    for k in 0..count {
        slave.do_step(f64::from(k) * h, h).unwrap();
    }
    let base = fmu.description.array::<3>("station[1].position").unwrap();
    let mut position = [0.0; 3];
    slave.get_real(&base, &mut position).unwrap();
    // the roundings of a million sums
    assert!((position[0] - f64::from(count) * h).abs() < 1e-6, "{position:?}");
}

/// A slave that is handed on: FMI lets a host call from any thread, one at a time.
struct HandedOn<'a>(Slave<'a>);

unsafe impl Send for HandedOn<'_> {}

#[test]
fn an_instance_goes_from_thread_to_thread() {
    let fmu = fmu();
    let expected = run(&fmu, &fmu.instantiate("stays", false).unwrap(), 20);
    let made = thread::scope(|scope| {
        let make = scope.spawn(|| HandedOn(fmu.instantiate("goes", false).unwrap()));
        make.join().unwrap()
    });
    let stepped = thread::scope(|scope| {
        let step = scope.spawn(|| {
            let slave = made;
            assert_eq!(run(&fmu, &slave.0, 20), expected);
            slave
        });
        step.join().unwrap()
    });
    thread::scope(|scope| {
        scope.spawn(|| {
            let slave = stepped;
            drop(slave);
        });
    });
}

#[test]
fn instances_do_not_see_each_other() {
    let fmu = fmu();
    let alone = run(&fmu, &fmu.instantiate("alone", false).unwrap(), 20);
    thread::scope(|scope| {
        for _ in 0..8 {
            scope.spawn(|| assert_eq!(run(&fmu, &fmu.instantiate("one of eight", false).unwrap(), 20), alone));
        }
    });
}

#[test]
fn debug_lines_are_filtered_and_errors_are_not() {
    let fmu = fmu();
    let f = fmu.functions();
    let start = |categories: &[fmi2String], on: i32| {
        let slave = slave(&fmu, Initialization);
        let status =
            unsafe { (f.SetDebugLogging)(slave.component(), fmi2Boolean(on), categories.len(), categories.as_ptr()) };
        assert_eq!(status, fmi2Status::OK);
        slave.exit_initialization_mode().unwrap();
        let events = slave.log.take();
        assert!(events.iter().all(|line| line.category == "logEvents" && line.instance == "rod"), "{events:?}");
        refusal(slave.do_step(0.0, 0.0));
        events.len()
    };
    assert_eq!(start(&[], 0), 0);
    assert_eq!(start(&[], 1), 1);
    assert_eq!(start(&[c"logEvents".as_ptr()], 1), 1);
    assert_eq!(start(&[c"logAll".as_ptr()], 1), 1);
    assert_eq!(start(&[c"logStatusError".as_ptr()], 1), 0);
    let slave = slave(&fmu, Instantiated);
    let status = unsafe { (f.SetDebugLogging)(slave.component(), fmi2Boolean(1), 1, &c"gossip".as_ptr()) };
    assert_eq!(status, fmi2Status::ERROR);
    names(&single(slave.log.take()), &["gossip", "logEvents", "logAll"]);
}

/// The name makes the instance panic in builds with debug assertions, so that no host can come upon it by chance.
#[cfg(debug_assertions)]
#[test]
fn a_panic_is_fatal_for_the_instance_and_for_nothing_else() {
    let fmu = fmu();
    let bystander = slave(&fmu, StepComplete);
    let slave = fmu.instantiate("panic in fmi2DoStep", false).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    let Err(Error::Refused { status: fmi2Status::FATAL, log, .. }) = slave.do_step(0.0, 0.1) else { panic!() };
    let [line] = log.as_slice() else { panic!("{log:?}") };
    assert_eq!((line.status, line.category.as_str()), (fmi2Status::FATAL, "logStatusFatal"));
    names(&line.text, &["fmi2DoStep", "panic", "freed"]);
    for (name, call, _) in functions(&fmu) {
        assert_eq!(call(slave.component()), fmi2Status::ERROR, "{name}");
    }
    drop(slave);
    bystander.do_step(0.0, 0.1).unwrap();
}

#[test]
fn the_library_exports_the_functions_of_the_standard_and_nothing_else() {
    use object::Object;
    let bytes = fs::read(package::library().unwrap()).unwrap();
    let file = object::File::parse(bytes.as_slice()).unwrap();
    let symbol = |export: object::Result<object::Export>| match export.unwrap().name() {
        object::NameOrOrdinal::Name(name) => String::from_utf8(name.to_vec()).unwrap(),
        object::NameOrOrdinal::Ordinal(number) => panic!("export {number} has no name"),
    };
    let exported: BTreeSet<_> =
        file.exports().unwrap().map(symbol).map(|name| name.trim_start_matches('_').to_owned()).collect();
    let mut expected: BTreeSet<_> = functions(&fmu()).iter().map(|(name, ..)| (*name).to_owned()).collect();
    expected
        .extend(["fmi2GetTypesPlatform", "fmi2GetVersion", "fmi2Instantiate", "fmi2FreeInstance"].map(str::to_owned));
    assert_eq!(expected.len(), 34);
    assert_eq!(exported, expected);
}
