//! The archive: what lies in it, how it is packed, and that it is what the repository shows.

use cosserat_rod::fmi2::description;
use cosserat_rod::fmi2::host::Fmu;
use cosserat_rod::fmi2::model::Model;
use cosserat_rod::fmi2::variables::{self, Variable};
use cosserat_rod::package::{self, documentation, raster, sketch, terminals};
use quick_xml::Reader;
use quick_xml::events::Event;
use std::collections::{BTreeMap, BTreeSet};
use std::io::{Read, Write};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};
use zip::write::SimpleFileOptions;
use zip::{CompressionMethod, ZipArchive, ZipWriter};

/// An empty directory of this test.
fn directory(test: &str) -> PathBuf {
    let directory = Path::new(env!("CARGO_TARGET_TMPDIR")).join(test);
    match fs::remove_dir_all(&directory) {
        Err(error) if error.kind() != io::ErrorKind::NotFound => panic!("{error}"),
        _ => fs::create_dir_all(&directory).unwrap(),
    }
    directory
}

fn cosserat(directory: &Path, arguments: &[&str]) -> (bool, String) {
    let output = Command::new(env!("CARGO_BIN_EXE_cosserat")).current_dir(directory).args(arguments).output().unwrap();
    (output.status.success(), String::from_utf8(output.stderr).unwrap())
}

#[test]
fn the_committed_model_description_is_the_rendered_one() {
    let path = Path::new(env!("CARGO_MANIFEST_DIR")).join("modelDescription/modelDescription.xml");
    if env::var_os("UPDATE").is_some() {
        fs::write(&path, description::xml(&Model::default())).unwrap();
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == description::xml(&Model::default()),
        "UPDATE=1 cargo test rewrites modelDescription.xml; commit it with its cause"
    );
}

#[test]
fn the_command_writes_the_default_archive_and_any_other() {
    let directory = directory("command");
    assert_eq!(cosserat(&directory, &["package"]), (true, String::new()));
    assert_eq!(cosserat(&directory, &["package", "-o", "a/b/rod.fmu"]), (true, String::new()));
    let [first, second] = ["target/CosseratRod.fmu", "a/b/rod.fmu"].map(|name| fs::read(directory.join(name)).unwrap());
    assert!(first == second, "the same files give the same bytes");
    fs::write(directory.join("file"), "").unwrap();
    let (success, error) = cosserat(&directory, &["package", "-o", "file/rod.fmu"]);
    assert!(!success && error.starts_with("cosserat: file") && error.lines().count() == 1, "{error}");
}

#[test]
fn the_archive_is_what_the_standard_asks_for() {
    let archive = directory("archive").join("rod.fmu");
    package::package(&archive, &Model::default()).unwrap();
    let bytes = fs::read(&archive).unwrap();
    let mut zip = ZipArchive::new(io::Cursor::new(&bytes)).unwrap();
    let names: BTreeSet<String> = zip.file_names().map(|name| name.unwrap().into_owned()).collect();
    let binary = description::binary(description::MODEL_IDENTIFIER);
    let expected = [
        "modelDescription.xml",
        "model.png",
        &binary,
        "documentation/index.html",
        "documentation/licenses/LICENSE-APACHE.txt",
        "documentation/licenses/LICENSE-MIT.txt",
        "documentation/licenses/THIRD-PARTY.txt",
        "terminalsAndIcons/terminalsAndIcons.xml",
        "extra/com.open-simulation-platform/CosseratRod_OspModelDescription.xml",
        "extra/io.github.cosserat-rod/CosseratRod_in.csv",
        "extra/io.github.cosserat-rod/CosseratRod_ref.csv",
        "extra/io.github.cosserat-rod/CosseratRod_ref.opt",
    ];
    assert_eq!(names, expected.map(str::to_owned).into());
    for index in 0..zip.len() {
        let file = zip.by_index(index).unwrap();
        let name = file.name().unwrap();
        assert!(name.is_ascii() && !name.contains('\\'));
        assert!(
            file.is_file() && matches!(file.compression(), CompressionMethod::Deflated | CompressionMethod::Stored)
        );
        // Version needed to extract, in tenths: the two bytes after the signature of the local header.
        let header = usize::try_from(file.header_start()).unwrap();
        assert_eq!(bytes[header..header + 4], *b"PK\x03\x04");
        assert!(u16::from_le_bytes([bytes[header + 4], bytes[header + 5]]) <= 20, "{name}");
    }
    let xml = io::read_to_string(zip.by_name("modelDescription.xml").unwrap()).unwrap();
    assert!(xml == description::xml(&Model::default()));
}

/// A copy of an archive with other names and contents, as `change` gives them.
fn altered(archive: &Path, to: &Path, change: impl Fn(&str, Vec<u8>) -> (String, Vec<u8>)) {
    let mut zip = ZipArchive::new(fs::File::open(archive).unwrap()).unwrap();
    let mut writer = ZipWriter::new(fs::File::create(to).unwrap());
    for index in 0..zip.len() {
        let mut file = zip.by_index(index).unwrap();
        let (name, mut content) = (file.name().unwrap().into_owned(), Vec::new());
        file.read_to_end(&mut content).unwrap();
        let (name, content) = change(&name, content);
        writer.start_file(name, SimpleFileOptions::default()).unwrap();
        writer.write_all(&content).unwrap();
    }
    writer.finish().unwrap();
}

/// Archives of other platforms, which are made up: merging reads no library.
#[test]
fn archives_of_several_platforms_become_one() {
    let directory = directory("merge");
    let [here, elsewhere, other, newer] =
        ["here.fmu", "elsewhere.fmu", "other.fmu", "newer.fmu"].map(|name| directory.join(name));
    package::package(&here, &Model::default()).unwrap();
    let binary = description::binary(description::MODEL_IDENTIFIER);
    let away = "binaries/elsewhere64/CosseratRod.so";
    altered(&here, &elsewhere, |name, content| match name {
        name if name == binary => (away.to_owned(), b"a library".to_vec()),
        // what is not a library is that of the first
        documentation::INDEX => (name.to_owned(), Vec::new()),
        _ => (name.to_owned(), content),
    });
    assert_eq!(
        cosserat(&directory, &["package", "--merge", "here.fmu", "elsewhere.fmu", "-o", "all.fmu"]),
        (true, String::new())
    );
    let all = directory.join("all.fmu");
    let mut expected: BTreeSet<String> = package::names(&here).unwrap().into_iter().collect();
    expected.insert(away.to_owned());
    assert_eq!(package::names(&all).unwrap().into_iter().collect::<BTreeSet<_>>(), expected);
    assert_eq!(package::read(&all, away).unwrap(), "a library");
    assert_eq!(package::read(&all, documentation::INDEX).unwrap(), documentation::index(&Model::default()));
    assert!(cosserat(&directory, &["check", "all.fmu"]).0);

    // the same library twice is one, a different one of the same name is an error, and so is another model
    package::merge(&[here.clone(), all.clone()], &all).unwrap();
    assert_eq!(package::names(&all).unwrap().len(), expected.len());
    altered(&elsewhere, &newer, |name, content| {
        (name.to_owned(), if name == away { b"another".to_vec() } else { content })
    });
    let guid = description::guid(&Model::default());
    altered(&elsewhere, &other, |name, content| {
        let text = String::from_utf8(content.clone()).unwrap_or_default().replace(&guid, "{another}");
        (name.to_owned(), if name == description::FILE { text.into_bytes() } else { content })
    });
    for (file, expected) in [
        ("newer.fmu", vec!["newer.fmu", away, "differs"]),
        ("other.fmu", vec!["other.fmu", "GUID {another}", &guid, "all.fmu"]),
        ("none.fmu", vec!["none.fmu"]),
    ] {
        let (success, error) = cosserat(&directory, &["package", "--merge", "all.fmu", file, "-o", "not.fmu"]);
        assert!(!success && expected.iter().all(|word| error.contains(word)), "{error}");
        assert!(!directory.join("not.fmu").exists());
    }
}

#[test]
fn a_library_built_elsewhere_is_packaged_if_it_fits() {
    let directory = directory("library");
    fs::copy(package::library().unwrap(), directory.join("built")).unwrap();
    assert_eq!(cosserat(&directory, &["package", "--library", "built", "-o", "a.fmu"]), (true, String::new()));
    package::package(&directory.join("b.fmu"), &Model::default()).unwrap();
    let [a, b] = ["a.fmu", "b.fmu"].map(|name| fs::read(directory.join(name)).unwrap());
    assert!(a == b);
    fs::write(directory.join("text"), "no library").unwrap();
    let (success, error) = cosserat(&directory, &["package", "--library", "text", "-o", "c.fmu"]);
    assert!(!success && error.contains("the library does not fit"), "{error}");
    assert!(!directory.join("c.fmu").exists());
}

/// As little of a DLL as exports these functions: headers, one section whose addresses are offsets in the file, and in it
/// the directory of exports, its three tables and the names.
fn dll(functions: &[String]) -> Vec<u8> {
    const SECTION: usize = 0x200;
    let count = functions.len();
    let tables = SECTION + 40;
    let texts = tables + 10 * count;
    let mut bytes = vec![0; texts];
    for (k, name) in functions.iter().enumerate() {
        let at = bytes.len() as u32;
        // an address in the section, but not in the directory, where it would name another library
        bytes[tables + 4 * k..][..4].copy_from_slice(&(u32::MAX / 2).to_le_bytes());
        bytes[tables + 4 * (count + k)..][..4].copy_from_slice(&at.to_le_bytes());
        bytes[tables + 8 * count + 2 * k..][..2].copy_from_slice(&(k as u16).to_le_bytes());
        bytes.extend(name.bytes().chain([0]));
    }
    let size = bytes.len() - SECTION;
    let mut put = |at: usize, value: usize| bytes[at..at + 4].copy_from_slice(&(value as u32).to_le_bytes());
    // signatures; x86-64 and one section; 240 bytes of optional header, of a DLL; sixteen directories, of which the first
    for (at, value) in [(0, 0x5a4d), (60, 64), (64, 0x4550), (68, 0x1_8664), (84, 0x2022_00f0), (88, 0x20b)] {
        put(at, value);
    }
    for (at, value) in
        [(196, 16), (200, SECTION), (204, size), (336, size), (340, SECTION), (344, size), (348, SECTION)]
    {
        put(at, value);
    }
    for (field, value) in [(20, count), (24, count), (28, tables), (32, tables + 4 * count), (36, tables + 8 * count)] {
        put(SECTION + field, value);
    }
    bytes
}

#[cfg(not(windows))]
#[test]
fn a_library_for_windows_is_read_instead_of_run() {
    let directory = directory("windows");
    let functions: Vec<String> = (0..34).map(|k| format!("fmi2{k}")).collect();
    fs::write(directory.join("rod.dll"), dll(&functions)).unwrap();
    let (success, notice) = cosserat(&directory, &["package", "--library", "rod.dll", "-o", "win64.fmu"]);
    assert!(success && notice.contains("rod.dll is for another platform and was not run"), "{notice}");
    let windows = "binaries/win64/CosseratRod.dll";
    let names = package::names(&directory.join("win64.fmu")).unwrap();
    assert_eq!(names.iter().filter(|name| name.starts_with("binaries/")).collect::<Vec<_>>(), [windows]);

    // with that of this platform
    package::package(&directory.join("here.fmu"), &Model::default()).unwrap();
    let both = cosserat(&directory, &["package", "--merge", "here.fmu", "win64.fmu", "-o", "both.fmu"]);
    assert_eq!(both, (true, String::new()));
    assert!(package::names(&directory.join("both.fmu")).unwrap().contains(&windows.to_owned()));

    fs::write(directory.join("old.dll"), dll(&functions[1..])).unwrap();
    let (success, error) = cosserat(&directory, &["package", "--library", "old.dll", "-o", "old.fmu"]);
    assert!(!success && error.contains("exports 33 functions of FMI, 34 are needed"), "{error}");
    assert!(!directory.join("old.fmu").exists());
}

#[test]
fn the_unpacked_archive_runs() {
    let directory = directory("unpacked");
    let archive = directory.join("rod.fmu");
    package::package(&archive, &Model::default()).unwrap();
    package::unpack(&archive, &directory.join("rod")).unwrap();
    let fmu = Fmu::open(&directory.join("rod")).unwrap();
    let slave = fmu.instantiate("rod", true).unwrap();
    slave.setup_experiment(0.0, Some(fmu.description.stop_time), None).unwrap();
    slave.enter_initialization_mode().unwrap();
    slave.exit_initialization_mode().unwrap();
    slave.do_step(0.0, fmu.description.step_size).unwrap();
    let mut tip = [f64::NAN; 3];
    slave.get_real(&fmu.description.array::<3>("tip.position").unwrap(), &mut tip).unwrap();
    assert!(tip.iter().all(|x| x.is_finite()));
    slave.terminate().unwrap();
}

#[test]
fn the_default_experiment_has_200_steps() {
    let steps = description::STOP_TIME / description::STEP_SIZE;
    assert_eq!((steps.round() as i32, (steps - steps.round()).abs() < 1e-9), (200, true));
}

/// The elements of a text that is well-formed, each with the texts of its attributes; those that only hold others too.
fn elements(xml: &str) -> Vec<(String, BTreeMap<String, String>)> {
    let mut reader = Reader::from_str(xml);
    let (mut elements, mut open) = (Vec::new(), 0);
    loop {
        let event = reader.read_event().unwrap();
        match &event {
            Event::Start(element) | Event::Empty(element) => {
                open += i32::from(matches!(event, Event::Start(_)));
                let attributes = element.attributes().map(|attribute| attribute.unwrap());
                let attributes = attributes.map(|one| (one.key.as_ref().to_owned(), one.value.to_string()));
                elements.push((element.name().as_ref().to_owned(), attributes.collect()));
            }
            Event::End(_) => open -= 1,
            Event::Eof => break,
            _ => {}
        }
    }
    assert_eq!(open, 0, "every element is closed");
    elements
}

#[test]
fn the_documentation_has_every_variable() {
    let html = documentation::index(&Model::default());
    let elements = elements(&html);
    let count = |name: &str| elements.iter().filter(|(element, _)| element == name).count();
    assert_eq!((count("table"), count("svg"), count("h1")), (3, 1, 1));
    // rows below the three headers
    assert_eq!(count("tr"), variables::ROWS.len() + 3);
    for row in variables::ROWS {
        let text = |text: &str| quick_xml::escape::escape(text).into_owned();
        let cells = [row.to_string(), row.unit.to_owned()].map(|cell| format!("<td>{}</td>", text(&cell)));
        let line = html.split("<tr>").find(|line| line.contains(&cells[0]) && line.contains(&cells[1]));
        let line = line.unwrap_or_else(|| panic!("{row}"));
        assert!(line.contains(&text(&row.meaning(&Model::default().parameters.stations))), "{row}");
        let first = Variable { row, element: 0 };
        assert!(first.is_output() || line.contains(&text(&first.allowed().to_string())), "{row}");
    }
    for start in ["<td>0, 0, -9.81</td>", "<td>5000000</td>", "<td>false</td>", "<td>1100</td>"] {
        assert!(html.contains(start), "{start}");
    }
}

#[test]
fn the_icon_is_the_sketch() {
    assert!(elements(&sketch::svg()).len() > 30);
    let png = raster::png(&sketch::svg(), 1).unwrap();
    // width and height of the header
    assert_eq!((&png[..4], &png[16..24]), (&b"\x89PNG"[..], &[0, 0, 2, 128, 0, 0, 1, 124][..]));
}

#[test]
fn ports_and_terminals_name_variables_with_their_units() {
    let known: BTreeMap<String, Variable> =
        variables::all().into_iter().map(|variable| (variable.to_string(), variable)).collect();
    let members: Vec<_> = elements(&terminals::terminals());
    let members: Vec<_> = members.iter().filter(|(name, _)| name == "TerminalMemberVariable").collect();
    assert_eq!(members.len(), 3 * 19);
    for (_, attributes) in members {
        assert!(known.contains_key(&attributes["variableName"]), "{attributes:?}");
    }
    let elements = elements(&terminals::ports());
    let references: Vec<_> = elements.iter().filter(|(name, _)| name == "Variable").collect();
    assert_eq!(references.len(), 3 * 19);
    for (_, attributes) in references {
        let unit = attributes.get("unit").map_or("", String::as_str);
        assert_eq!(known[&attributes["ref"]].row.unit, unit);
    }
    let names: Vec<&String> = elements.iter().filter_map(|(_, attributes)| attributes.get("name")).collect();
    assert_eq!(names.iter().collect::<BTreeSet<_>>().len(), names.len(), "names of groups are unique");
}

/// Direct dependencies that the library of the unit uses: all that its modules name but those for packaging and hosts.
fn linked() -> BTreeSet<String> {
    let root = Path::new(env!("CARGO_MANIFEST_DIR"));
    let manifest = fs::read_to_string(root.join("Cargo.toml")).unwrap();
    let section = manifest.split("[dependencies]\n").nth(1).unwrap().split("\n\n").next().unwrap();
    let dependencies: Vec<&str> =
        section.lines().filter_map(|line| line.split_once(" = ")).map(|(name, _)| name).collect();
    let mut directories = vec![root.join("src")];
    let mut used = BTreeSet::new();
    while let Some(directory) = directories.pop() {
        for path in fs::read_dir(directory).unwrap().map(|entry| entry.unwrap().path()) {
            let name = path.file_name().unwrap().to_str().unwrap();
            if path.is_dir() && !["cli", "package"].contains(&name) {
                directories.push(path);
            } else if path.is_file() && !["main.rs", "host.rs"].contains(&name) {
                let text = fs::read_to_string(&path).unwrap();
                let named = |dependency: &&&str| text.contains(&format!("{}::", dependency.replace('-', "_")));
                used.extend(dependencies.iter().filter(named).map(|name| (*name).to_owned()));
            }
        }
    }
    used
}

#[test]
fn the_list_of_linked_crates_is_that_of_the_lock_file() {
    let mut arguments: Vec<String> = [
        "tree",
        "--locked",
        "--offline",
        "--edges",
        "normal,no-proc-macro",
        "--prefix",
        "none",
        "--format",
        "{p}: {l}",
    ]
    .map(str::to_owned)
    .into();
    let linked = linked();
    assert!(linked.contains("nalgebra"), "{linked:?}");
    arguments.extend(linked.into_iter().flat_map(|name| ["--package".to_owned(), name]));
    let output = Command::new(env!("CARGO")).current_dir(env!("CARGO_MANIFEST_DIR")).args(arguments).output().unwrap();
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let text = String::from_utf8(output.stdout).unwrap();
    let crates: BTreeSet<String> = text
        .lines()
        .filter(|line| !line.is_empty())
        .map(|line| line.replace(" (*)", "").replacen(" v", " ", 1))
        .collect();
    let list = include_str!("../THIRD-PARTY.txt").split("\n\n").nth(1).unwrap();
    assert_eq!(list.lines().map(str::to_owned).collect::<BTreeSet<_>>(), crates, "what THIRD-PARTY.txt has to list");
    // each may be used under a licence whose text is in the archive
    for line in list.lines() {
        assert!(["Apache-2.0", "MIT"].iter().any(|license| line.contains(license)), "{line}");
    }
}
