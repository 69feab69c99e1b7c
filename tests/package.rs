//! The archive: what lies in it, how it is packed, and that it is what the repository shows.

use cosserat_rod::fmi2::description;
use cosserat_rod::fmi2::host::Fmu;
use cosserat_rod::package;
use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::{env, fs, io};
use zip::{CompressionMethod, ZipArchive};

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
        fs::write(&path, description::xml()).unwrap();
    }
    let committed = fs::read_to_string(&path).unwrap_or_default();
    assert!(
        committed == description::xml(),
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
    package::package(&archive).unwrap();
    let bytes = fs::read(&archive).unwrap();
    let mut zip = ZipArchive::new(io::Cursor::new(&bytes)).unwrap();
    let names: BTreeSet<String> = zip.file_names().map(|name| name.unwrap().into_owned()).collect();
    let licenses = ["APACHE", "MIT"].map(|name| format!("documentation/licenses/LICENSE-{name}.txt"));
    let expected = ["modelDescription.xml".to_owned(), description::binary()].into_iter().chain(licenses);
    assert_eq!(names, expected.collect());
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
    assert!(xml == description::xml());
}

#[test]
fn the_unpacked_archive_runs() {
    let directory = directory("unpacked");
    let archive = directory.join("rod.fmu");
    package::package(&archive).unwrap();
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
