//! Rods from files: what is refused and where, the shapes that come of them, and the units that hold them.

use cosserat_rod::fmi2::description;
use cosserat_rod::fmi2::host::{Error, Fmu, Slave};
use cosserat_rod::fmi2::model::Model;
use cosserat_rod::package::{self, rod_file};
use cosserat_rod::unit::{Inputs, Parameters, STATIONS, Unit};
use cosserat_rod::{rest, so3};
use nalgebra::{Matrix3, Vector3};
use std::f64::consts::{FRAC_PI_2, TAU};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{fs, io, ptr};

type Vec3 = Vector3<f64>;

/// An empty directory of this test.
fn directory(test: &str) -> PathBuf {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("rod_file").join(test);
    match fs::remove_dir_all(&directory) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => panic!("{error}"),
        _ => fs::create_dir_all(&directory).unwrap(),
    }
    directory
}

fn written(test: &str, text: &str) -> PathBuf {
    let path = directory(test).join("rod.toml");
    fs::write(&path, text).unwrap();
    path
}

/// The model of a rod with these lines.
fn model(test: &str, lines: &str) -> Model {
    rod_file::read(&written(test, &format!("name = \"Rod\"\n{lines}"))).unwrap()
}

#[test]
fn errors_name_place_key_value_and_what_is_allowed() {
    let cases = [
        ("radius = ", "1:10: string values must be quoted, expected literal string"),
        ("radius = 1\nradius = 2", "2:1: duplicate key"),
        ("radius = 1", "1:1: a rod needs name"),
        (
            "name = \"coil hose\"",
            "1:8: name = \"coil hose\" is not allowed: \"...\" of up to 100 letters, digits and _, no digit first: it names \
             the library, too",
        ),
        (
            "name = 5",
            "1:8: name = 5 is not allowed: \"...\" of up to 100 letters, digits and _, no digit first: it names the library, too",
        ),
        (
            "description = \"\"\"a\nb\"\"\"",
            "1:15: description = \"\"\"a b\"\"\" is not allowed: \"...\" of up to 1000 characters in one line",
        ),
        // unknown keys, at every level
        ("\n  radios = 0.01", "2:3: radios is unknown; is radius what is meant?"),
        ("[damping]\nbendin = 0.01", "2:1: damping.bendin is unknown; is damping.bending what is meant?"),
        ("dampin.bending = 0.01", "1:1: dampin is unknown; is damping what is meant?"),
        ("damping.mass = 0.01", "1:9: damping.mass is unknown: only damping.bending, damping.twist, damping.drag"),
        (
            "experiment = { stop = 1 }",
            "1:16: experiment.stop is unknown: only experiment.stop_time, experiment.step_size, experiment.tolerance",
        ),
        ("name = \"R\"\n[[shape]]\nkind = \"arc\"\nradus = 1", "4:1: radus is unknown; is radius what is meant?"),
        ("tip.position = [0, 0, 0]", "1:5: tip.position is an output, which is never set"),
        // values
        ("radius = -0.005", "1:10: radius = -0.005 is not allowed: finite and > 0"),
        ("radius = \"thick\"", "1:10: radius = \"thick\" is not allowed: finite and > 0"),
        ("gravity = [0, 0, nan]", "1:18: gravity[3] = nan is not allowed: finite"),
        ("gravity = [0, 0, \"g\"]", "1:18: gravity[3] = \"g\" is not allowed: a number"),
        ("gravity = 9.81", "1:11: gravity = 9.81 is not allowed: [...] of 3 numbers"),
        ("gravity = [0, -9.81]", "1:11: gravity = [0, -9.81] is not allowed: [...] of 3 numbers"),
        ("section = 3", "1:11: section = 3 is not allowed: a table, or the names in it after a dot"),
        ("planar = 1", "1:10: planar = 1 is not allowed: true or false"),
        ("cells = 2.5", "1:9: cells = 2.5 is not allowed: a whole number from 0 to 100000"),
        ("experiment.step_size = 0", "1:24: experiment.step_size = 0 is not allowed: finite and > 0"),
        ("experiment = 2", "1:14: experiment = 2 is not allowed: a table of stop_time, step_size, tolerance"),
        // what only the unit knows
        (
            "name = \"R\"\n\nbase.orientation = [0, 0, 0, 0]",
            "3:20: base.orientation = 0 is not allowed: a quaternion other than zero, normalised on use",
        ),
        (
            "name = \"R\"\ncells = 1\nrest_curvature = [4, 0, 0]",
            "2:9: cells = 1 is not allowed: as many that the rest curvature turns less than 3 rad in each",
        ),
        // stations
        ("name = \"R\"\nstations = 0.5", "2:12: stations = 0.5 is not allowed: [...] of 1 to 11 arc lengths"),
        ("name = \"R\"\nstations = []", "2:12: stations = [] is not allowed: [...] of 1 to 11 arc lengths"),
        (
            "name = \"R\"\nstations = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0]",
            "2:12: stations = [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0] is not allowed: [...] of 1 to 11 arc lengths",
        ),
        ("name = \"R\"\nstations = [0, 1.2]", "2:16: stations[2] = 1.2 is not allowed: from 0 to 1"),
        (
            "name = \"R\"\nlength = 2\nstations = [0, 1.2,\n -0.1]",
            "4:2: stations[3] = -0.1 is not allowed: from 0 to 2",
        ),
        ("name = \"R\"\nstations = [\"tip\"]", "2:13: stations[1] = \"tip\" is not allowed: from 0 to 1"),
        ("station = [0]", "1:1: station is unknown; is stations what is meant?"),
        // shapes
        (
            "name = \"R\"\nlength = 2\nshape = [{ kind = \"straight\", length = 1 }]",
            "2:10: length and shape say the same: give only one of them",
        ),
        ("name = \"R\"\nshape = []", "2:9: shape = [] is not allowed: [[shape]] once or more, or a list of tables"),
        ("name = \"R\"\nshape = [1]", "2:10: shape = 1 is not allowed: a table with its kind"),
        ("name = \"R\"\nshape = [{ length = 1 }]", "2:10: a piece of the shape needs kind"),
        (
            "name = \"R\"\n[[shape]]\nkind = \"spiral\"",
            "3:8: kind = \"spiral\" is not allowed: \"straight\", \"arc\", \"helix\" or \"points\"",
        ),
        ("name = \"R\"\nshape = [{ kind = \"straight\" }]", "2:10: straight needs length"),
        ("name = \"R\"\nshape = [{ kind = \"arc\", degrees = 9 }]", "2:10: arc needs radius or curvature"),
        (
            "name = \"R\"\nshape = [{ kind = \"arc\", radius = 1, length = 2, degrees = 9 }]",
            "2:47: degrees and length say the same: give only one of them",
        ),
        (
            "name = \"R\"\nshape = [{ kind = \"arc\", radius = 1, length = 2, towards = [0, 0] }]",
            "2:60: towards = [0, 0] is not allowed: parts of d1 and d2, not both 0",
        ),
        (
            "name = \"R\"\nshape = [{ kind = \"helix\", radius = 1, pitch = 1, turns = 1, hand = \"r\" }]",
            "2:69: hand = \"r\" is not allowed: \"right\" or \"left\"",
        ),
        ("name = \"R\"\nshape = [{ kind = \"helix\", radius = 1, turns = 1 }]", "2:10: helix needs pitch"),
        ("name = \"R\"\nshape = [{ kind = \"points\" }]", "2:10: points needs points"),
        (
            "name = \"R\"\nshape = [{ kind = \"points\", points = 3 }]",
            "2:38: points = 3 is not allowed: [[x, y, z], ...]",
        ),
        ("name = \"R\"\nshape = [{ kind = \"points\", points = [[0, 0, 0]] }]", "2:38: a curve needs two points"),
        (
            "name = \"R\"\n[[shape]]\nkind = \"points\"\npoints = [\n[0, 0, 0],\n[0, 1],\n]",
            "6:1: points = [0, 1] is not allowed: [...] of 3 numbers",
        ),
        (
            "name = \"R\"\n[[shape]]\nkind = \"points\"\npoints = [\n[0, 0, 0],\n[0, 0, 1],\n[0, 0, 1],\n]",
            "7:1: this point is where the one before is",
        ),
        (
            "name = \"R\"\nshape = [{ kind = \"points\", d1 = [0, 0, 1], points = [[0, 0, 0], [0, 0, 2]] }]",
            "2:34: d1 is to be across the curve where that begins",
        ),
    ];
    let mut wrong = Vec::new();
    for (text, expected) in cases {
        let path = written("errors", text);
        let error = rod_file::read(&path).map(|_| ()).expect_err(text).to_string();
        let error = error.strip_prefix(&format!("{}:", path.display())).unwrap_or(&error).to_owned();
        if error != expected {
            wrong.push(format!("{text}\n{error}\n{expected}"));
        }
    }
    assert!(wrong.is_empty(), "{}", wrong.join("\n\n"));
    let error = rod_file::read(Path::new("no/rod.toml")).unwrap_err().to_string();
    assert!(error.starts_with("no/rod.toml: "), "{error}");
}

#[test]
fn more_pieces_than_a_rod_may_have_are_refused() {
    let zigzag = |k: i32| format!("{{ kind = \"arc\", radius = 1, length = 0.001, towards = [{}, 1] }},", k % 2);
    let shape: String = (0..1001).map(zigzag).collect();
    let error = rod_file::read(&written("many", &format!("name = \"R\"\nshape = [{shape}]"))).unwrap_err().to_string();
    assert!(error.ends_with(":2:9: a rest shape of 1001 pieces is not allowed: up to 1000"), "{error}");
}

/// Where a rod of these pieces hangs without gravity: its stations, and its tip.
fn unloaded(parameters: &Parameters) -> ([Vec3; STATIONS], Matrix3<f64>) {
    // a base at the origin whose section has the axes of the world
    let inputs = Inputs { base_orientation: [1.0, 0.0, 0.0, 0.0].into(), ..Inputs::default() };
    let parameters = Parameters { gravity: Vec3::zeros(), ..parameters.clone() };
    let mut unit = Unit::new(&parameters, &inputs, None).unwrap();
    let start = unit.outputs().clone();
    unit.advance(&inputs, 0.1).unwrap();
    let after = unit.outputs();
    for (before, after) in start.stations.iter().zip(&after.stations) {
        assert!((before - after).norm() < 1e-9 * parameters.length, "nothing moves it");
    }
    assert!(after.energy.elastic < 1e-12 && after.base_reaction_force.norm() < 1e-9);
    (start.stations, so3::from_quaternion(&start.tip_orientation))
}

/// Cells of four Gauss points and up to 2.5 rad follow an arc so far, over the length: enough for a tolerance of 1e-3.
/// Shorter ones are exact but for rounding soon, as their error is of eighth order.
const COARSE: f64 = 2e-4;

#[test]
fn an_arc_bends_to_where_its_centre_lies() {
    for (towards, centre) in [("[1, 0]", Vec3::x()), ("[0, -2]", -Vec3::y())] {
        let bent =
            format!("shape = [{{ kind = \"arc\", radius = 0.2, degrees = 135, towards = {towards} }}]\ncells = 40");
        let model = model("arc", &bent);
        assert!((model.parameters.length - 0.2 * 0.75 * TAU / 2.0).abs() < 1e-15);
        let (stations, tip) = unloaded(&model.parameters);
        for (k, station) in stations.iter().enumerate() {
            let (sin, cos) = (0.375 * TAU * k as f64 / 10.0).sin_cos();
            let expected = centre * (0.2 * (1.0 - cos)) + Vec3::z() * (0.2 * sin);
            assert!((station - expected).norm() < 1e-9, "{station} {expected}");
        }
        // the section is carried along and not twisted
        let axis = Vec3::z().cross(&centre);
        assert!((tip - so3::exp(&(axis * (0.375 * TAU)))).norm() < 1e-12);
    }
}

#[test]
fn a_helix_has_its_radius_pitch_and_hand() {
    for (hand, sign) in [("right", 1.0), ("left", -1.0)] {
        let coil = format!(
            "shape = [{{ kind = \"helix\", radius = 0.05, pitch = 0.03, turns = 3, hand = \"{hand}\" }}]\ncells = 40"
        );
        let model = model("helix", &coil);
        let (radius, rise) = (0.05f64, 0.03 / TAU);
        let way = radius.hypot(rise);
        assert!((model.parameters.length - 3.0 * TAU * way).abs() < 1e-14);
        // it begins along z, and its axis lies beside the base along x
        let (sin, cos) = (rise / way, radius / way);
        let axis = Vec3::z() * sin + Vec3::y() * (sign * cos);
        let (stations, _) = unloaded(&model.parameters);
        for (k, station) in stations.iter().enumerate() {
            let angle = 3.0 * TAU * k as f64 / 10.0;
            let normal = -Vec3::x();
            // about the axis, against the clock for a right-handed one
            let around = axis.cross(&normal) * sign;
            let expected = Vec3::x() * radius
                + normal * (radius * angle.cos())
                + around * (radius * angle.sin())
                + axis * (rise * angle);
            assert!((station - expected).norm() < 1e-8, "{hand} {k}: {station} {expected}");
        }
    }
}

#[test]
fn pieces_go_on_where_the_one_before_ends() {
    let hook = "shape = [
        { kind = \"straight\", length = 0.3 },
        { kind = \"arc\", curvature = 10, degrees = 90 },
        { kind = \"straight\", length = 0.2 },
    ]";
    let model = model("pieces", hook);
    let length = 0.5 + 0.1 * FRAC_PI_2;
    assert!((model.parameters.length - length).abs() < 1e-15);
    let on_hook = |arc: f64| {
        let angle = ((arc - 0.3) / 0.1).clamp(0.0, FRAC_PI_2);
        let before = Vec3::z() * arc.min(0.3);
        let bend = Vec3::new(0.1 * (1.0 - angle.cos()), 0.0, 0.1 * angle.sin());
        before + bend + Vec3::x() * (arc - 0.3 - 0.1 * FRAC_PI_2).max(0.0)
    };
    for (cells, bound) in [(0, COARSE), (3, COARSE), (100, 1e-9)] {
        let (stations, _) = unloaded(&Parameters { cells, ..model.parameters.clone() });
        for (k, station) in stations.iter().enumerate() {
            let expected = on_hook(length * k as f64 / 10.0);
            assert!((station - expected).norm() < bound * length, "{cells} cells: {station} {expected}");
        }
    }
    // the length scales the shape as a whole
    let twice = Parameters { length: 2.0 * length, cells: 100, ..model.parameters.clone() };
    let (stations, _) = unloaded(&twice);
    assert!((stations[10] - on_hook(length) * 2.0).norm() < 1e-8);
    // fewer cells than pieces are none
    let inputs = Inputs::default();
    let error = Unit::new(&Parameters { cells: 2, ..twice }, &inputs, None).unwrap_err().to_string();
    assert_eq!(error, "cells = 2 is not allowed: 0, or at least one for each piece of the rest shape");
}

/// The pieces of a straight rod are one, and so it is the same rod.
#[test]
fn a_straight_rod_in_three_pieces_is_the_plain_one() {
    let straight = "shape = [{ kind = \"straight\", length = 0.25 }, { kind = \"straight\", length = 0.25 },
        { kind = \"straight\", length = 0.5 }]";
    assert_eq!(model("straight", straight).parameters, Parameters::default());
}

/// An arc in pieces that are not found to be one, as their numbers are rounded, moves as an arc in one piece does.
#[test]
fn an_arc_in_pieces_swings_as_in_one() {
    let whole = model("whole", "shape = [{ kind = \"arc\", radius = 0.6, degrees = 60 }]").parameters;
    let parts =
        "shape = [{ kind = \"arc\", radius = 0.6, degrees = 13.1 }, { kind = \"arc\", radius = 0.6, degrees = 46.9 }]";
    let parts = model("parts", parts).parameters;
    for planar in [true, false] {
        let tip = |parameters: &Parameters| {
            let parameters = Parameters { planar, tolerance: 1e-5, ..parameters.clone() };
            let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
            (0..20).for_each(|_| assert_eq!(unit.advance(&Inputs::default(), 0.02), Ok(None)));
            assert_eq!(unit.outputs().solver.planar, planar);
            unit.outputs().tip_position
        };
        let missed = (tip(&whole) - tip(&parts)).norm() / whole.length;
        // each meets its tolerance
        assert!(missed < 2e-5, "{missed:e}");
    }
}

#[test]
fn a_table_of_points_is_the_curve_they_lie_on() {
    let (radius, rise) = (0.05, 0.03 / TAU);
    let point = |k: usize| {
        let angle = 2.0 * TAU * k as f64 / 80.0;
        [radius * f64::cos(angle), radius * f64::sin(angle), rise * angle].map(|x| x.to_string()).join(", ")
    };
    let points: Vec<String> = (0..=80).map(|k| format!("[{}]", point(k))).collect();
    // its first normal is that of the helix
    let table = format!("shape = [{{ kind = \"points\", d1 = [-1, 0, 0], points = [{}] }}]", points.join(", "));
    let table = model("points", &table).parameters;
    let helix = model("coil", "shape = [{ kind = \"helix\", radius = 0.05, pitch = 0.03, turns = 2 }]").parameters;
    assert!((table.length / helix.length - 1.0).abs() < 1e-6, "{} {}", table.length, helix.length);
    let (through, _) = unloaded(&table);
    let (along, _) = unloaded(&Parameters { cells: 40, ..helix });
    for (a, b) in through.iter().zip(&along) {
        // a fifth of the tolerance for the pieces
        assert!((a - b).norm() < 2e-4 * table.length, "{a} {b}");
    }
    assert!(table.rest_shape.pieces().len() < 150, "{}", table.rest_shape.pieces().len());
}

#[test]
fn what_the_host_adds_is_added() {
    let shape = rest::RestShape::new(&[
        rest::Piece { part: 0.5, turn: Vec3::y() },
        rest::Piece { part: 0.5, turn: Vec3::zeros() },
    ]);
    let added =
        Parameters { rest_shape: shape.unwrap(), rest_curvature: -Vec3::y() * 2.0, cells: 4, ..Parameters::default() };
    // the first half is straight then, the second bent the other way
    let (stations, _) = unloaded(&added);
    assert!((stations[5] - Vec3::z() * 0.5).norm() < 1e-12);
    let expected = Vec3::new(-0.5 * (1.0 - 1f64.cos()), 0.0, 0.5 + 0.5 * 1f64.sin());
    assert!((stations[10] - expected).norm() < 1e-8, "{}", stations[10]);
}

fn packaged(test: &str, model: &Model) -> Fmu {
    let directory = directory(test);
    let archive = directory.join("rod.fmu");
    package::package(&archive, model).unwrap();
    let names = package::names(&archive).unwrap();
    let ports = format!("extra/com.open-simulation-platform/{}_OspModelDescription.xml", model.name);
    assert!(names.contains(&description::binary(&model.name)) && names.contains(&ports), "{names:?}");
    let page = package::read(&archive, "documentation/index.html").unwrap();
    assert!(page.contains(&format!("<h1>{}</h1>", model.name)));
    assert!(page.contains(&model.description) || *model == Model::default());
    package::unpack(&archive, &directory.join("rod")).unwrap();
    Fmu::open(&directory.join("rod")).unwrap()
}

fn real(fmu: &Fmu, slave: &Slave, name: &str) -> f64 {
    let mut value = [f64::NAN];
    let reference = fmu.description.reference(name, cosserat_rod::fmi2::variables::Kind::Real).unwrap();
    slave.get_real(&[reference], &mut value).unwrap();
    value[0]
}

fn tip(fmu: &Fmu, slave: &Slave) -> [u64; 3] {
    let mut tip = [f64::NAN; 3];
    slave.get_real(&fmu.description.array::<3>("tip.position").unwrap(), &mut tip).unwrap();
    tip.map(f64::to_bits)
}

/// Five communication steps from the start values, as of the FMU.
fn run(fmu: &Fmu, slave: &Slave) -> [u64; 3] {
    slave.setup_experiment(0.0, None, Some(1e-3)).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    (0..5).for_each(|k| slave.do_step(f64::from(k) * 0.01, 0.01).unwrap());
    tip(fmu, slave)
}

#[test]
fn two_rods_and_the_unit_itself_live_in_one_process() {
    let hose = rod_file::read(&Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/coil_hose.toml")).unwrap();
    let hook = "radius = 0.01\nshape = [{ kind = \"straight\", length = 0.5 }, { kind = \"arc\", radius = 0.2, degrees = 90 }]";
    let hook = model("hook", hook);
    let plain = Model::default();
    let models = [&hose, &hook, &plain];
    let fmus = ["hose", "hook", "plain"].into_iter().zip(models).map(|(name, model)| packaged(name, model));
    let fmus: Vec<Fmu> = fmus.collect();
    let slaves: Vec<Slave> = fmus.iter().map(|fmu| fmu.instantiate("rod", false).unwrap()).collect();
    let tips: Vec<[u64; 3]> = fmus.iter().zip(&slaves).map(|(fmu, slave)| run(fmu, slave)).collect();
    for ((model, fmu), tip) in models.into_iter().zip(&fmus).zip(&tips) {
        assert_eq!(
            (&fmu.description.model_name, fmu.description.capability("modelIdentifier")),
            (&model.name, model.name.as_str())
        );
        assert_eq!(fmu.description.guid, description::guid(model));
        let mut unit = Unit::new(&model.parameters, &model.inputs, Some(1e-3)).unwrap();
        (0..5).for_each(|_| assert_eq!(unit.advance(&model.inputs, 0.01), Ok(None)));
        assert_eq!(unit.outputs().tip_position.map(f64::to_bits).as_slice(), tip, "{}: the same bits", model.name);
    }

    // a description does not fit the library of another
    for (fmu, other) in [(0, 1), (0, 2), (2, 0)] {
        let guid = &fmus[other].description.guid;
        let Err(Error::NoInstance { log }) = fmus[fmu].instantiate_as("rod", guid, false) else {
            panic!("an instance")
        };
        assert!(log[0].text.contains(guid) && log[0].text.contains(&fmus[fmu].description.guid), "{log:?}");
    }

    // nor does a state
    let mut state = ptr::null_mut();
    slaves[0].get_state(&mut state).unwrap();
    let bytes = slaves[0].serialize(state).unwrap();
    let refused = slaves[1].deserialize(&bytes).unwrap_err().to_string();
    assert!(refused.contains(&fmus[0].description.guid) && refused.contains(&fmus[1].description.guid), "{refused}");
    // but into another instance of the same rod
    let other = fmus[0].instantiate("other", false).unwrap();
    other.set_state(other.deserialize(&bytes).unwrap()).unwrap();
    assert_eq!(tip(&fmus[0], &other), tips[0]);
    [&slaves[0], &other].into_iter().for_each(|slave| slave.do_step(0.05, 0.01).unwrap());
    assert_eq!(tip(&fmus[0], &other), tip(&fmus[0], &slaves[0]));

    // after a reset everything begins as it is baked
    let length = fmus[1].description.reference("radius", cosserat_rod::fmi2::variables::Kind::Real).unwrap();
    slaves[1].reset().unwrap();
    slaves[1].set_real(&[length], &[0.02]).unwrap();
    slaves[1].reset().unwrap();
    assert_eq!(run(&fmus[1], &slaves[1]), tips[1]);
    assert_eq!(real(&fmus[1], &slaves[1], "radius"), 0.01);
}

/// Points of the rod itself, in any order, and no others.
#[test]
fn stations_lie_where_the_file_says() {
    let lines = "length = 2\nstations = [2.0, 0.6, 0, 1.4]";
    let [given, plain] = [("some", lines), ("all", "length = 2")].map(|(test, lines)| model(test, lines));
    assert_eq!(given.parameters.stations, [1.0, 0.3, 0.0, 0.7]);
    for (planar, length) in [(true, 2.0), (false, 2.0), (true, 1.5)] {
        let unit = |model: &Model| {
            let parameters = Parameters { planar, length, ..model.parameters.clone() };
            let mut unit = Unit::new(&parameters, &model.inputs, None).unwrap();
            (0..10).for_each(|_| assert_eq!(unit.advance(&model.inputs, 0.02), Ok(None)));
            (unit.outputs().stations, unit.rates().unwrap().stations)
        };
        let (some, all) = (unit(&given), unit(&plain));
        for (k, station) in [10, 3, 0, 7].into_iter().enumerate() {
            assert!((some.0[k] - all.0[station]).norm() < 1e-12, "{planar} {length} {k}");
            assert!((some.1[k] - all.1[station]).norm() < 1e-10, "{planar} {length} {k}");
        }
        assert!(some.0[4..].iter().all(|rest| *rest == Vec3::zeros()));
    }
    let refused = |stations: &[f64]| {
        let parameters = Parameters { stations: stations.to_vec(), ..Parameters::default() };
        Unit::new(&parameters, &Inputs::default(), None).unwrap_err().to_string()
    };
    assert_eq!(refused(&[]), "stations = 0 is not allowed: a whole number from 1 to 11");
    assert_eq!(refused(&[0.0; 12]), "stations = 12 is not allowed: a whole number from 1 to 11");
    assert_eq!(refused(&[0.0, 1.1]), "stations = 1.1 is not allowed: from 0 to 1");

    // the unit has no others, and all else where it was
    let (some, all) = (packaged("some_packaged", &given), packaged("all_packaged", &plain));
    let station = |name: &&String| name.starts_with("station[");
    assert_eq!(some.description.order.iter().filter(station).count(), 12);
    let same =
        |name: &&String| some.description.variables[*name].reference == all.description.variables[*name].reference;
    assert!(some.description.order.iter().all(|name| same(&name)));
    let slave = some.instantiate("rod", false).unwrap();
    run(&some, &slave);
    assert_eq!([1, 4].map(|i| real(&some, &slave, &format!("station[{i}].position[1]")) == 0.0), [false, false]);
    let missing = all.description.reference("station[5].position[1]", cosserat_rod::fmi2::variables::Kind::Real);
    let missing = missing.unwrap();
    let error = slave.get_real(&[missing], &mut [0.0]).unwrap_err().to_string();
    assert!(error.contains(&format!("value reference {missing} is unknown")), "{error}");
    let moved = model("moved", "length = 2\nstations = [2.0, 0.60001, 0, 1.4]");
    assert_ne!(description::guid(&moved), description::guid(&given));
}

#[test]
fn shapes_that_the_description_does_not_show_have_guids_of_their_own() {
    let arc = |radius: &str| model(radius, &format!("shape = [{{ kind = \"arc\", radius = {radius}, length = 1 }}]"));
    assert_ne!(description::guid(&arc("0.5")), description::guid(&arc("0.6")));
    assert_ne!(description::guid(&arc("0.5")), description::guid(&model("no_arc", "")));
}

#[test]
fn the_command_packages_a_file_and_the_others_take_it() {
    let directory = directory("command");
    let example = Path::new(env!("CARGO_MANIFEST_DIR")).join("examples/coil_hose.toml");
    let cosserat = |arguments: &[&str]| {
        let program = env!("CARGO_BIN_EXE_cosserat");
        let output = Command::new(program).current_dir(&directory).args(arguments).output().unwrap();
        let [out, error] = [output.stdout, output.stderr].map(|bytes| String::from_utf8(bytes).unwrap());
        (output.status.success(), out, error)
    };
    let (success, out, error) = cosserat(&["package", example.to_str().unwrap()]);
    assert!(success && out == "target/CoilHose.fmu\n", "{out}{error}");
    let (success, out, error) = cosserat(&["check", "target/CoilHose.fmu"]);
    assert!(success && out.contains("CoilHose") && !out.contains("FAILED"), "{out}{error}");
    let page = package::read(&directory.join("target/CoilHose.fmu"), "documentation/index.html").unwrap();
    assert!(page.contains("<td>station[1..3].position[1..3]</td>"));
    let (success, out, error) = cosserat(&["info", "target/CoilHose.fmu"]);
    assert!(success && out.contains("CoilHose") && out.contains("tip.mass                  0.05 kg"), "{out}{error}");
    // it hangs as the unit says that it does
    let hose = rod_file::read(&example).unwrap();
    let (success, out, error) =
        cosserat(&["simulate", "--rod", example.to_str().unwrap(), "--stop", "0", "--output", "tip.position"]);
    let tip = Unit::new(&hose.parameters, &hose.inputs, None).unwrap().outputs().tip_position;
    let expected =
        format!("time,tip.position[1],tip.position[2],tip.position[3]\n0.0,{:?},{:?},{:?}\n", tip.x, tip.y, tip.z);
    assert!(success && out == expected, "{out}{error}");
    let (success, out, error) = cosserat(&["modes", "--rod", example.to_str().unwrap(), "--count", "1"]);
    assert!(success && out.contains(&format!("{:.4}", tip.z)), "{out}{error}");
    fs::write(directory.join("bad.toml"), "name = \"Bad\"\nradius = 0").unwrap();
    let expected = "cosserat: bad.toml:2:10: radius = 0 is not allowed: finite and > 0\n";
    assert_eq!(cosserat(&["package", "bad.toml"]), (false, String::new(), expected.to_owned()));
    assert!(!directory.join("target/Bad.fmu").exists());
}
