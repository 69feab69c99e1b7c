//! The commands, as one types them.

use cosserat_rod::fmi2::description::{MODEL_IDENTIFIER, STEP_SIZE, STOP_TIME, binary, guid};
use cosserat_rod::fmi2::model::Model;
use cosserat_rod::package;
use std::collections::BTreeMap;
use std::f64::consts::{PI, TAU};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};
use std::{fs, io};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// An empty directory of this test.
fn directory(test: &str) -> PathBuf {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join("commands").join(test);
    match fs::remove_dir_all(&directory) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => panic!("{error}"),
        _ => fs::create_dir_all(&directory).unwrap(),
    }
    directory
}

fn call(directory: &Path, arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_cosserat")).current_dir(directory).args(arguments).output().unwrap()
}

/// What it prints.
fn cosserat(directory: &Path, arguments: &[&str]) -> String {
    let output = call(directory, arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && error.is_empty(), "{arguments:?}: {error}");
    String::from_utf8(output.stdout).unwrap()
}

/// The one line in which it refuses.
fn refusal(directory: &Path, arguments: &[&str]) -> String {
    let output = call(directory, arguments);
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(!output.status.success() && error.lines().count() == 1, "{arguments:?}: {error}");
    error
}

/// The columns of a CSV, each with its name.
fn columns(text: &str) -> Vec<(String, Vec<f64>)> {
    let mut lines = text.lines();
    let mut columns: Vec<_> = lines.next().unwrap().split(',').map(|name| (name.to_owned(), Vec::new())).collect();
    for line in lines {
        for ((_, values), text) in columns.iter_mut().zip(line.split(',')) {
            values.push(text.parse().unwrap());
        }
    }
    columns
}

fn column<'a>(columns: &'a [(String, Vec<f64>)], name: &str) -> &'a [f64] {
    &columns.iter().find(|(other, _)| other == name).unwrap().1
}

/// Few cells and long steps: here only the command is tested.
const COARSE: [&str; 4] = ["--set", "cells=2", "--set", "stages=2"];

fn coarse<'a>(arguments: &[&'a str]) -> Vec<&'a str> {
    [arguments, &COARSE].concat()
}

#[test]
fn simulate_runs_the_default_experiment() {
    let directory = directory("default");
    let table = columns(&cosserat(&directory, &["simulate"]));
    let times = column(&table, "time");
    assert_eq!(times.len(), 1 + (STOP_TIME / STEP_SIZE).round() as usize);
    assert_eq!((times[0], times[times.len() - 1]), (0.0, STOP_TIME));
    assert_eq!(table.len(), 1 + 13 + 12 + 33 + 6 + 14 + 8);
    assert!(table.iter().all(|(_, values)| values.iter().all(|value| value.is_finite())));
    let height = column(&table, "tip.position[3]");
    assert!(height[0].abs() < 1e-12 && height[height.len() - 1] < -0.3);
}

#[test]
fn simulate_follows_the_rows_of_its_inputs() {
    let directory = directory("rows");
    fs::write(
        directory.join("in.csv"),
        "time, base.position[2], base.velocity[2], tip.force[3]\n0.5,0,0.2,0\n0.6, 0.02, 0.2, 0.01\n0.65,0.03,0.2,0\n",
    )
    .unwrap();
    let names = ["--output", "station[1].position[2]", "--output", "tip.position"];
    let arguments = [&coarse(&["simulate", "in.csv", "-o", "out.csv"])[..], &names].concat();
    assert_eq!(cosserat(&directory, &arguments), "");
    let table = columns(&fs::read_to_string(directory.join("out.csv")).unwrap());
    let header: Vec<&str> = table.iter().map(|(name, _)| name.as_str()).collect();
    let tip = ["tip.position[1]", "tip.position[2]", "tip.position[3]"];
    assert_eq!(header, [&["time", "station[1].position[2]"][..], &tip].concat());
    assert_eq!(column(&table, "time"), [0.5, 0.6, 0.65]);
    let base = column(&table, "station[1].position[2]");
    assert!(base.iter().zip([0.0, 0.02, 0.03]).all(|(a, b)| (a - b).abs() < 1e-12), "{base:?}");

    // between rows, equal steps; beyond the last one, its values
    let arguments = coarse(&["simulate", "in.csv", "--step", "0.04", "--stop", "0.7", "--output", "time_"]);
    assert!(refusal(&directory, &arguments).contains("--output time_ is no output of the unit: tip.position"));
    let arguments = coarse(&["simulate", "in.csv", "--step", "0.04", "--stop", "0.7"]);
    let table = columns(&cosserat(&directory, &arguments));
    let times = column(&table, "time");
    assert!(times.iter().zip([0.5, 0.54, 0.58, 0.62, 0.66, 0.7]).all(|(a, b)| (a - b).abs() < 1e-12), "{times:?}");

    // the end comes where it is asked for, before or after the last row
    for (stop, rows) in [("0.5", 1), ("0.55", 2), ("0.6", 2), ("0.9", 4)] {
        let table = columns(&cosserat(&directory, &coarse(&["simulate", "in.csv", "--stop", stop])));
        assert_eq!(column(&table, "time").len(), rows);
        assert_eq!(column(&table, "time")[rows - 1], stop.parse::<f64>().unwrap());
    }
}

#[test]
fn what_has_no_column_keeps_its_start_value() {
    let directory = directory("start");
    fs::write(directory.join("in.csv"), "time\n0\n0.01\n").unwrap();
    let set =
        ["--set", "base.position=1,2,3", "--set", "length=0.25", "--set", "extensible=true", "--set", "gravity[3]=0"];
    let table = columns(&cosserat(&directory, &[&coarse(&["simulate", "in.csv"])[..], &set].concat()));
    for (name, expected) in [("tip.position[1]", 1.25), ("tip.position[2]", 2.0), ("tip.position[3]", 3.0)] {
        assert!(column(&table, name).iter().all(|value| (value - expected).abs() < 1e-9), "{name}");
    }
}

#[test]
fn gravity_may_change_while_the_rod_moves() {
    let directory = directory("gravity");
    fs::write(directory.join("in.csv"), "time,gravity[3]\n0,0\n0.1,-9.81\n0.2,-9.81\n").unwrap();
    let table = columns(&cosserat(&directory, &coarse(&["simulate", "in.csv"])));
    let height = column(&table, "tip.position[3]");
    assert!(height[1].abs() < 1e-12 && height[2] < -1e-3, "{height:?}");
}

#[test]
fn each_refusal_names_the_thing_its_value_and_what_is_allowed() {
    let directory = directory("refusals");
    let settings = [
        ("length", "--set length: not of the form name=value"),
        ("lenght=1", "lenght is no parameter or input of the unit: length, radius, density"),
        ("tip.position[1]=1", "tip.position[1] is no parameter or input"),
        ("length=-1", "length = -1 is not allowed: finite and > 0"),
        ("length=one", "length = one is not allowed: a number"),
        ("density=nan", "density = NaN is not allowed: finite and > 0"),
        ("cells=1.5", "cells = 1.5 is not allowed: a whole number"),
        ("base.motion=3", "base.motion = 3 is not allowed: a whole number from 0 to 2"),
        ("extensible=maybe", "extensible = maybe is not allowed: true or false"),
        ("gravity=0,0", "gravity has 3 elements, but 2 values are given"),
        ("gravity[4]=0", "gravity[4] is no parameter or input"),
    ];
    for (setting, expected) in settings {
        for command in ["simulate", "modes"] {
            let error = refusal(&directory, &[command, "--set", setting]);
            assert!(error.starts_with(&format!("cosserat: {expected}")), "{error}");
        }
    }
    let options = [
        (["--step", "0"], "--step 0 is not allowed: finite and > 0"),
        (["--step", "inf"], "--step inf is not allowed: finite and > 0"),
        (["--stop", "-1"], "--stop -1 is not allowed: finite and >= 0, the start"),
        (["--output", "length"], "--output length is no output of the unit: tip.position"),
        (["--set", "base.orientation=0,0,0,0"], "base.orientation = 0 is not allowed: a quaternion"),
        (["-o", "missing/out.csv"], "missing/out.csv: "),
    ];
    for (option, expected) in options {
        let error = refusal(&directory, &["simulate", option[0], option[1]]);
        assert!(error.starts_with(&format!("cosserat: {expected}")), "{error}");
    }
    let tables = [
        ("", "in.csv: no column time"),
        ("time\n", "in.csv: no row below the header"),
        ("t,tip.force[1]\n0,0\n", "in.csv: no column time"),
        ("time,tip.force\n0,0\n", "in.csv: column tip.force is no parameter or input of the unit: length"),
        ("time,tip.position[1]\n0,0\n", "in.csv: column tip.position[1] is no parameter or input"),
        ("time,length\n0,1\n", "in.csv: column length is not allowed: it is fixed while the rod moves"),
        ("time,tip.force[1],tip.force[1]\n0,1,1\n", "in.csv: two columns tip.force[1]"),
        ("time,tip.force[1]\n0,0\n0.1,x\n", "in.csv, line 3: tip.force[1] = x is not allowed: a number"),
        ("time,tip.force[1]\n0,0\n0.1,inf\n", "in.csv, line 3: tip.force[1] = inf is not allowed: finite"),
        ("time\n0\nnoon\n", "in.csv, line 3: time = noon is not allowed: a finite number"),
        ("time\n0\n0.1\n0.1\n", "in.csv, line 4: time = 0.1 is not allowed: above that of the row before, 0.1"),
        ("time,tip.force[1]\n0\n", "in.csv: CSV error: record 1 (line: 2"),
    ];
    for (table, expected) in tables {
        fs::write(directory.join("in.csv"), table).unwrap();
        let error = refusal(&directory, &["simulate", "in.csv"]);
        assert!(error.starts_with(&format!("cosserat: {expected}")), "{error}");
    }
    assert!(refusal(&directory, &["simulate", "none.csv"]).starts_with("cosserat: none.csv: "));
}

#[test]
fn pose_and_twist_that_disagree_are_told_once() {
    let directory = directory("disagree");
    fs::write(directory.join("in.csv"), "time,base.velocity[1]\n0,0\n0.1,1\n0.2,1\n0.3,1\n0.4,1\n0.5,1\n").unwrap();
    let output = call(&directory, &coarse(&["simulate", "in.csv"]));
    let error = String::from_utf8(output.stderr).unwrap();
    assert!(output.status.success() && error.lines().count() == 1, "{error}");
    assert!(error.contains("base.position and the motion that base.velocity describes"), "{error}");
}

#[test]
fn modes_are_those_of_a_cantilever() {
    let directory = directory("modes");
    // Roots of cos x cosh x = −1; a round rod has each mode twice.
    let roots = [1.8751040687, 4.6940911330, 7.8547574382];
    let (length, radius, density, modulus): (f64, f64, f64, f64) = (1.0, 0.005, 1100.0, 5e6);
    let (area, moment) = (PI * radius.powi(2), PI * radius.powi(4) / 4.0);
    let beam = (modulus * moment / (density * area * length.powi(4))).sqrt() / TAU;
    let text = cosserat(&directory, &["modes", "--set", "gravity=0,0,0", "--count", "6"]);
    let rows: Vec<Vec<&str>> = text.lines().map(|line| line.split_whitespace().collect()).collect();
    let rows: Vec<&Vec<&str>> = rows.iter().filter(|row| row[0].parse::<usize>().is_ok()).collect();
    assert_eq!(rows.len(), 6, "{text}");
    for (k, row) in rows.iter().enumerate() {
        let frequency: f64 = row[1].parse().unwrap();
        let expected = roots[k / 2] * roots[k / 2] * beam;
        // rotary inertia, which the closed form leaves out, lowers it by a few (x a/L)², a the radius
        let slack = 2.0 * (roots[k / 2] * radius / length).powi(2) + 1e-5;
        assert!((frequency / expected - 1.0).abs() < slack, "{frequency} {expected}");
        assert!((frequency * row[2].parse::<f64>().unwrap() - 1.0).abs() < 1e-4, "{text}");
        assert_eq!(row[3], "bending");
    }
    assert!(
        refusal(&directory, &["modes", "--count", "1", "--set", "base.orientation=1,0,0,0"]).contains("equilibrium")
    );
}

#[test]
fn modes_tell_twist_and_stretch_from_bending() {
    // c/(4 L) with c = √(GJ/ρIp); short, so that twist is among the lowest
    let (length, modulus, density): (f64, f64, f64) = (0.05, 5e6 / 3.0, 1100.0);
    let expected = (modulus / density).sqrt() / (4.0 * length);
    let text =
        cosserat(&directory("twist"), &["modes", "--set", "length=0.05", "--count", "3", "--set", "gravity=0,0,0"]);
    let twist: Vec<&str> = text.lines().filter(|line| line.contains("twist")).collect();
    assert_eq!(twist.len(), 1, "{text}");
    let frequency: f64 = twist[0].split_whitespace().nth(1).unwrap().parse().unwrap();
    assert!((frequency / expected - 1.0).abs() < 1e-4, "{frequency} {expected}");

    let set = ["--set", "length=0.05", "--set", "gravity=0,0,0", "--set", "extensible=true"];
    let text = cosserat(&directory("stretch"), &[&["modes", "--count", "7"][..], &set].concat());
    let stretch: Vec<&str> = text.lines().filter(|line| line.contains("stretch")).collect();
    assert_eq!(stretch.len(), 1, "{text}");
    let frequency: f64 = stretch[0].split_whitespace().nth(1).unwrap().parse().unwrap();
    // the same with √(E/ρ)
    let expected = (5e6 / density).sqrt() / (4.0 * length);
    assert!((frequency / expected - 1.0).abs() < 1e-4, "{frequency} {expected}");
}

#[test]
fn demo_drives_the_unit_out_of_its_archive_and_draws_it() {
    let directory = directory("demo");
    let text = cosserat(&directory, &["demo", "-o", "pictures/demo.svg"]);
    assert!(text.contains("real-time factor") && text.contains("tip position"), "{text}");
    assert!(directory.join("target/CosseratRod.fmu").is_file());
    let picture = fs::read_to_string(directory.join("pictures/demo.svg")).unwrap();
    assert!(picture.starts_with("<svg width=\"1200\"") && picture.trim_end().ends_with("</svg>"));
    assert!(picture.len() < 300_000, "{} bytes are too many for a README", picture.len());
    for name in ["tip position", "force on the base", "energy", "kinetic", "base"] {
        assert!(picture.contains(name), "{name}");
    }
    assert!(!picture.contains("NaN"));
}

/// The errors of the front that a chart prints, over CPU times that rise.
fn front(text: &str) -> Vec<f64> {
    let rows = text.lines().skip_while(|line| !line.contains("front of")).skip(1).take_while(|line| !line.is_empty());
    let tips = rows.filter(|row| row.contains(" both ") || row.contains(" tip "));
    tips.map(|row| row.split_whitespace().nth(2).unwrap().parse().unwrap()).collect()
}

/// As far as two digits show.
fn falls(errors: &[f64]) -> bool {
    errors.len() > 2 && errors.windows(2).all(|pair| pair[1] <= pair[0]) && errors[errors.len() - 1] < errors[0]
}

/// The least time in which a front has more than a point.
const TINY: [&str; 2] = ["--budget", "0.5"];

#[test]
fn chart_measures_a_scene_and_draws_it() {
    let directory = directory("chart");
    let list = cosserat(&directory, &["chart"]);
    assert!(list.lines().count() == 7 && list.starts_with("rope "), "{list}");

    let header = "scene,code,kind,setting,cpu_s,tip_error,reaction_error";
    // a code that is as exact as one likes in an hour, and one that is fast and coarse
    let others = format!(
        "{header}\nspin,slow,spatial,fine,3600,1e-9,1e-9\nspin,strain modes (RK4),spatial,coarse,1e-6,2e-3,\n\
         spin,slow,spatial,n=1 (failed at t=0.1),1,,\nrope,slow,spatial,fine,3600,1e-9,\n"
    );
    fs::write(directory.join("others.csv"), others).unwrap();
    let with = ["--with", "others.csv", "--overview", "pictures/all.svg"];
    let text = cosserat(&directory, &[&["chart", "spin"][..], &TINY, &with].concat());
    assert!(text.contains("errors against the finest run") && text.contains("left out for the budget"), "{text}");
    assert!(falls(&front(&text)), "{text}");

    let table = fs::read_to_string(directory.join("target/chart/spin.csv")).unwrap();
    assert_eq!(table.lines().next(), Some(header));
    assert!(table.lines().skip(1).all(|line| line.starts_with("spin,cosserat-rod ")), "{table}");
    for picture in ["target/chart/spin.svg", "pictures/all.svg"] {
        let picture = fs::read_to_string(directory.join(picture)).unwrap();
        assert!(picture.starts_with("<svg ") && picture.contains("strain modes") && !picture.contains("NaN"));
    }
    assert!(fs::read(directory.join("target/chart/spin.png")).unwrap().starts_with(b"\x89PNG"));

    let ratios = fs::read_to_string(directory.join("target/chart/ratios.csv")).unwrap();
    let rows: Vec<Vec<&str>> = ratios.lines().map(|line| line.split(',').collect()).collect();
    assert_eq!(rows[0], ["scene", "measure", "level", "cpu_s", "kind", "code", "code_cpu_s", "ratio"]);
    let row = |measure: &str, level: &str, code: &str| {
        rows.iter().find(|row| row[1] == measure && row[2] == level && row[5] == code)
    };
    let slow = row("tip", "1e-2", "slow").unwrap();
    let (ours, theirs, ratio): (f64, f64, f64) =
        (slow[3].parse().unwrap(), slow[6].parse().unwrap(), slow[7].parse().unwrap());
    assert!(theirs == 3600.0 && (ratio * ours / theirs - 1.0).abs() < 1e-2, "{slow:?}");
    assert_eq!(row("tip", "1e-2", "strain modes (RK4)").unwrap()[6], "1.000e-6");
    // not as exact as that, and without a reaction
    assert!(row("tip", "1e-3", "strain modes (RK4)").is_none());
    assert!(row("reaction", "1e-2", "strain modes (RK4)").is_none() && row("reaction", "1e-2", "slow").is_some());
    assert!(rows[1..].iter().all(|row| row[0] == "spin"), "{ratios}");
}

#[test]
fn chart_takes_a_rod_and_inputs_of_ones_own() {
    let directory = directory("chart_own");
    let row = |k: u32| format!("{},{}\n", 0.02 * f64::from(k), 0.01 * f64::from(k));
    fs::write(directory.join("pull.csv"), format!("time,tip.force[2]\n{}", (0..11).map(row).collect::<String>()))
        .unwrap();
    let set = ["--set", "length=0.5", "--set", "stages=2"];
    let text = cosserat(&directory, &[&["chart", "--inputs", "pull.csv"][..], &set, &TINY].concat());
    assert!(falls(&front(&text)), "{text}");
    let table = fs::read_to_string(directory.join("target/chart/pull.csv")).unwrap();
    assert!(table.lines().skip(1).all(|line| line.contains("tolerance=") || line.contains("stages=2 ")), "{table}");
}

#[test]
fn chart_says_what_is_wrong() {
    let directory = directory("chart_wrong");
    fs::write(directory.join("table.csv"), "time,tip\n0,1\n").unwrap();
    fs::write(directory.join("rope.json"), "{\"scene\":\"rope\"}").unwrap();
    fs::write(directory.join("one.csv"), "time\n0\n").unwrap();
    let cases: [(&[&str], &str); 9] = [
        (&["rop"], "rop is no scene: rope, wire, pulse, spring, hair, spin, umbilical, or all"),
        (&["rope", "--with", "none.csv"], "none.csv: "),
        (&["rope", "--with", "table.csv"], "table.csv: the header is not scene,code,kind,setting,cpu_s"),
        (&["rope", "--reference", "none.json"], "none.json: "),
        (&["wire", "--reference", "rope.json"], "rope.json: not of the scene wire"),
        (&["all", "--reference", "rope.json"], "--reference is of one scene, not of all"),
        (&["rope", "--budget", "0"], "--budget 0 is not allowed: finite and > 0"),
        (&["--inputs", "none.csv"], "none.csv: "),
        (&["--inputs", "one.csv"], "one.csv: one row only, nothing moves"),
    ];
    for (arguments, expected) in cases {
        let error = refusal(&directory, &[&["chart"][..], arguments].concat());
        assert!(error.starts_with(&format!("cosserat: {expected}")), "{error}");
    }
}

/// Files by their names in an archive.
type Files = BTreeMap<String, Vec<u8>>;

fn unzipped(archive: &Path) -> Files {
    let mut zip = ZipArchive::new(fs::File::open(archive).unwrap()).unwrap();
    let mut files = Files::new();
    for index in 0..zip.len() {
        let mut file = zip.by_index(index).unwrap();
        let mut bytes = Vec::new();
        file.read_to_end(&mut bytes).unwrap();
        files.insert(file.name().unwrap().into_owned(), bytes);
    }
    files
}

fn zipped(files: &Files, archive: &Path) {
    let options = SimpleFileOptions::default().compression_method(CompressionMethod::Stored);
    let mut writer = ZipWriter::new(fs::File::create(archive).unwrap());
    for (name, content) in files {
        writer.start_file(name.as_str(), options).unwrap();
        writer.write_all(content).unwrap();
    }
    writer.finish().unwrap();
}

const XML: &str = "modelDescription.xml";

#[test]
fn info_tells_what_is_in_the_archive() {
    let directory = directory("info");
    package::package(&directory.join("rod.fmu"), &Model::default()).unwrap();
    let text = cosserat(&directory, &["info", "rod.fmu"]);
    let platform = binary(MODEL_IDENTIFIER).split('/').nth(1).unwrap().to_owned();
    let able = "canGetAndSetFMUstate, canHandleVariableCommunicationStepSize";
    let version = format!("cosserat-rod {}", env!("CARGO_PKG_VERSION"));
    let guid = guid(&Model::default());
    for words in ["CosseratRod", "2.0", &guid, &version, &platform, able, "32 inputs", "documentation/index.html"] {
        assert!(text.contains(words), "{words}: {text}");
    }
    let row = |name: &str| -> Vec<String> {
        let line = text.lines().find(|line| line.starts_with(&format!("{name} "))).unwrap();
        line.split_whitespace().map(str::to_owned).collect()
    };
    assert_eq!(row("radius"), ["radius", "0.005", "m"]);
    assert_eq!(row("gravity[3]"), ["gravity[3]", "-9.81", "m/s2"]);
    assert_eq!(row("planar"), ["planar", "true"]);
    assert!(refusal(&directory, &["info", "none.fmu"]).starts_with("cosserat: none.fmu: "));
}

#[test]
fn check_passes_what_is_packaged_and_names_what_is_wrong() {
    let directory = directory("check");
    let archive = directory.join("rod.fmu");
    package::package(&archive, &Model::default()).unwrap();
    let text = cosserat(&directory, &["check", "rod.fmu"]);
    assert!(text.lines().count() == 13 && text.lines().all(|line| line.starts_with("ok  ")), "{text}");
    let library = binary(MODEL_IDENTIFIER);
    let platform = library.split('/').nth(1).unwrap();
    assert!(text.contains(&format!("{library} in the archive, which is for {platform}\n")), "{text}");

    let files = unzipped(&archive);
    let check = |name: &str, change: &dyn Fn(&mut Files), expected: &str| {
        let mut files = files.clone();
        change(&mut files);
        zipped(&files, &directory.join(name));
        let error = refusal(&directory, &["check", name]);
        assert!(error.starts_with(&format!("cosserat: {name}: {expected}")), "{error}");
        fs::remove_file(directory.join(name)).unwrap();
    };
    let edited = |from: &str, to: &str| {
        let xml = String::from_utf8(files[XML].clone()).unwrap();
        assert!(xml.contains(from), "{from}");
        xml.replacen(from, to, 1).into_bytes()
    };
    let edit = |name: &str, from: &str, to: &str, expected: &str| {
        let xml = edited(from, to);
        check(name, &|files| drop(files.insert(XML.to_owned(), xml.clone())), expected);
    };
    let missing = format!("binary: no {library} in the archive, which is for none64");
    check("no_xml.fmu", &|files| drop(files.remove(XML)), "description: no modelDescription.xml in the archive");
    let elsewhere = |files: &mut Files| {
        let library = files.remove(&library).unwrap();
        files.insert("binaries/none64/CosseratRod.so".to_owned(), library);
    };
    check("no_binary.fmu", &elsewhere, &missing);
    check(
        "no_library.fmu",
        &|files| drop(files.insert(library.clone(), b"text".to_vec())),
        &format!("library: {library}: "),
    );
    edit("guid.fmu", &guid(&Model::default()), "{1}", "instance: fmi2Instantiate gave no instance; ");
    edit("version.fmu", "fmiVersion=\"2.0\"", "fmiVersion=\"3.0\"", "description: of FMI 3.0, not 2.0");
    edit("exchange.fmu", "<CoSimulation ", "<ModelExchange ", "description: no co-simulation");
    edit("short.fmu", "</fmiModelDescription>", "", "description: the model description ends before its elements do");
    edit("names.fmu", "name=\"radius\"", "name=\"length\"", "names: two variables length");
    edit("shared.fmu", "valueReference=\"1\"", "valueReference=\"0\"", "references: length and radius share 0");
    edit(
        "number.fmu",
        "valueReference=\"1\"",
        "valueReference=\"one\"",
        "description: model description: valueReference = ",
    );
    edit("start.fmu", " start=\"1100\"", "", "start values: density has none");
    let outputs = String::from_utf8(files[XML].clone()).unwrap();
    let first = outputs.split_once("<Outputs>").unwrap().1.trim_start().split_once('\n').unwrap().0;
    edit("unlisted.fmu", first, "", "outputs: ModelStructure does not list tip.position[1]");
    edit("twice.fmu", first, &first.repeat(2), "outputs: ModelStructure lists tip.position[1] twice");
    edit("input.fmu", first, "<Unknown index=\"1\"/>", "outputs: ModelStructure lists length, which is no output");

    let bytes = fs::read(&archive).unwrap();
    fs::write(directory.join("half.fmu"), &bytes[..bytes.len() / 2]).unwrap();
    for command in ["check", "info"] {
        let error = refusal(&directory, &[command, "half.fmu"]);
        assert!(error.starts_with("cosserat: half.fmu: ") && error.contains("Zip"), "{error}");
        assert!(refusal(&directory, &[command, "none.fmu"]).starts_with("cosserat: none.fmu: "));
    }
}
