//! The packaged unit, driven by an importer that shares no line with it, gives the numbers of the library bit for bit.
//!
//! Needs what the build leaves in `target`: `CosseratRod.fmu` and the table of `examples/trajectory.rs`.

use fmi::fmi2::import::Fmi2Import;
use fmi::fmi2::instance::{CoSimulation, Common};
use fmi::fmi2::schema::Fmi2ModelDescription;
use fmi::traits::FmiImport;
use std::path::Path;

fn built(name: &str) -> std::path::PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../target").join(name)
}

/// Value references and columns of the table, of the variables of one kind.
struct Columns(Vec<u32>, Vec<usize>);

fn columns(header: &csv::StringRecord, wanted: impl Fn(&str) -> Option<u32>) -> Columns {
    let found = header.iter().enumerate().filter_map(|(column, name)| Some((wanted(name)?, column)));
    let (references, columns) = found.unzip();
    Columns(references, columns)
}

#[test]
fn the_default_rod_moves_as_in_the_library() {
    let import: Fmi2Import = fmi::import::from_path(built("CosseratRod.fmu")).expect("cosserat package writes it");
    let mut table = csv::Reader::from_path(built("trajectory.csv")).expect("the example trajectory writes it");
    let header = table.headers().unwrap().clone();
    let description: &Fmi2ModelDescription = import.model_description();
    let reference = |name: &str, causality: &str, kind: &str| {
        let variables = &description.model_variables.variables;
        let found = variables.iter().find(|variable| variable.name == name)?;
        let fits = format!("{:?}", found.causality) == causality && format!("{:?}", found.elem).starts_with(kind);
        fits.then_some(found.value_reference)
    };
    let inputs = columns(&header, |name| reference(name, "Input", "Real"));
    let outputs = columns(&header, |name| reference(name, "Output", "Real"));
    let counts = columns(&header, |name| reference(name, "Output", "Integer"));
    assert_eq!(1 + inputs.0.len() + outputs.0.len() + counts.0.len(), header.len());

    let mut instance = import.instantiate_cs("rod", false, true).unwrap();
    instance.setup_experiment(None, 0.0, Some(2.0)).unwrap();
    instance.enter_initialization_mode().unwrap();
    instance.exit_initialization_mode().unwrap();
    let (mut time, mut rows) = (0.0, 0);
    for record in table.records().map(Result::unwrap) {
        let numbers: Vec<f64> = record.iter().map(|text| text.parse().unwrap()).collect();
        let pick = |columns: &[usize]| columns.iter().map(|&column| numbers[column]).collect::<Vec<f64>>();
        if rows > 0 {
            instance.set_real(&inputs.0, &pick(&inputs.1)).unwrap();
            instance.do_step(time, 0.01, true).unwrap();
            time += 0.01;
        }
        assert_eq!(time, numbers[0]);
        let (mut reals, mut integers) = (vec![0.0; outputs.0.len()], vec![0; counts.0.len()]);
        instance.get_real(&outputs.0, &mut reals).unwrap();
        instance.get_integer(&counts.0, &mut integers).unwrap();
        let bits = |values: &[f64]| values.iter().map(|value| value.to_bits()).collect::<Vec<u64>>();
        assert_eq!(bits(&reals), bits(&pick(&outputs.1)), "at {time} s");
        assert_eq!(integers.iter().copied().map(f64::from).collect::<Vec<f64>>(), pick(&counts.1), "at {time} s");
        rows += 1;
    }
    assert_eq!(rows, 201);
    instance.terminate().unwrap();
}
