//! The packaged unit, driven by an importer that shares no line with it, gives the numbers of the library bit for bit.
//!
//! Needs what `tests/run` leaves in `target`: `CosseratRod.fmu`, the inputs `drive.csv`, and `trajectory.csv`, which
//! `cosserat simulate` makes of them.

use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common};
use fmi::fmi2::schema::Fmi2ModelDescription;
use fmi::traits::FmiImport;
use std::path::Path;

fn built(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target").join(name)
}

/// The names of the columns, and the rows.
fn table(name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let mut reader = csv::Reader::from_path(built(name)).unwrap();
    let names = reader.headers().unwrap().iter().map(str::to_owned).collect();
    let rows = reader.records().map(|record| record.unwrap().iter().map(|text| text.parse().unwrap()).collect());
    (names, rows.collect())
}

/// Value references and columns of a table, of the variables of one kind.
struct Columns(Vec<u32>, Vec<usize>);

impl Columns {
    fn new(header: &[String], wanted: impl Fn(&str) -> Option<u32>) -> Self {
        let found = header.iter().enumerate().filter_map(|(column, name)| Some((wanted(name)?, column)));
        let (references, columns) = found.unzip();
        Self(references, columns)
    }

    fn of(&self, row: &[f64]) -> Vec<f64> {
        self.1.iter().map(|&column| row[column]).collect()
    }
}

#[test]
fn the_default_rod_moves_as_in_the_library() {
    let import: Fmi2Import = fmi::import::from_path(built("CosseratRod.fmu")).expect("cosserat package writes it");
    let ((driven, drive), (header, expected)) = (table("drive.csv"), table("trajectory.csv"));
    let description: &Fmi2ModelDescription = import.model_description();
    let reference = |name: &str, causality: &str, kind: &str| {
        let variables = &description.model_variables.variables;
        let found = variables.iter().find(|variable| variable.name == name)?;
        let fits = format!("{:?}", found.causality) == causality && format!("{:?}", found.elem).starts_with(kind);
        fits.then_some(found.value_reference)
    };
    let inputs = Columns::new(&driven, |name| reference(name, "Input", "Real"));
    let outputs = Columns::new(&header, |name| reference(name, "Output", "Real"));
    let counts = Columns::new(&header, |name| reference(name, "Output", "Integer"));
    let flags = Columns::new(&header, |name| reference(name, "Output", "Boolean"));
    assert_eq!(1 + inputs.0.len(), driven.len());
    assert_eq!(1 + outputs.0.len() + counts.0.len() + flags.0.len(), header.len());
    assert_eq!((drive.len(), expected.len()), (201, 201));

    let mut instance = import.instantiate_cs("rod", false, true).unwrap();
    instance.setup_experiment(None, 0.0, Some(2.0)).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.set_real(&inputs.0, &inputs.of(&drive[0])).unwrap();
    instance.exit_initialization_mode().unwrap();
    for (k, row) in expected.iter().enumerate() {
        let time = drive[k][0];
        assert_eq!(row[0], time);
        let (mut reals, mut integers) = (vec![0.0; outputs.0.len()], vec![0; counts.0.len()]);
        let mut booleans = vec![0; flags.0.len()];
        instance.get_real(&outputs.0, &mut reals).unwrap();
        instance.get_integer(&counts.0, &mut integers).unwrap();
        instance.get_boolean(&flags.0, &mut booleans).unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(&reals), bits(&outputs.of(row)), "at {time} s");
        let numbers = |values: &[i32]| values.iter().copied().map(f64::from).collect::<Vec<f64>>();
        assert_eq!(numbers(&integers), counts.of(row), "at {time} s");
        assert_eq!(numbers(&booleans), flags.of(row), "at {time} s");
        if let Some(next) = drive.get(k + 1) {
            instance.set_real(&inputs.0, &inputs.of(&drive[k])).unwrap();
            instance.do_step(time, next[0] - time, true).unwrap();
        }
    }
    let (tip, force) = (reference("tip.position[2]", "Output", "Real"), reference("tip.force[2]", "Input", "Real"));
    let mut yields = [0.0];
    instance.get_directional_derivative(&[tip.unwrap()], &[force.unwrap()], &[1.0], &mut yields).unwrap();
    assert!(yields[0] > 0.0, "{yields:?}");
    instance.terminate().unwrap();
}
