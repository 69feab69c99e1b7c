//! The table of variables as `modelDescription.xml`, with the names and start values of a model.
//!
//! The GUID is a fingerprint of the text without it, and of what that does not tell: the shape of the unstressed rod, and
//! where exactly the stations lie.
//! The library computes it from the table it was built with and the model that it holds: a description and a library
//! that do not belong together cannot be instantiated.

use super::model::{Experiment, Model};
use super::variables::{self, Kind, Row, Slot, UNITS, Variable};
use crate::rest::Piece;
use crate::unit::Parameters;
use quick_xml::Writer;
use quick_xml::events::{BytesDecl, Event};
use quick_xml::writer::ElementWriter;
use std::io;

/// Where in an archive the model description lies.
pub const FILE: &str = "modelDescription.xml";

/// Name of the library in the archive of the unit itself, and that of its model.
pub const MODEL_IDENTIFIER: &str = "CosseratRod";

/// Where in an archive the library of a model lies for the platform this was compiled for, with forward slashes.
pub fn binary(identifier: &str) -> String {
    binary_for(identifier, std::env::consts::OS, std::env::consts::ARCH)
}

/// The same for a platform by the names that Rust has for it.
pub fn binary_for(identifier: &str, os: &str, arch: &str) -> String {
    let short = match os {
        "windows" => "win",
        "macos" => "darwin",
        other => other,
    };
    let suffix = match os {
        "windows" => "dll",
        "macos" => "dylib",
        _ => "so",
    };
    // The names from before revision 2.0.4 of the standard are those of the two Intel architectures.
    let platform = match arch {
        "x86_64" => format!("{short}64"),
        "x86" => format!("{short}32"),
        other => format!("{other}-{short}"),
    };
    format!("binaries/{platform}/{identifier}.{suffix}")
}

/// End of the default experiment, s; it starts at 0.
pub const STOP_TIME: f64 = 2.0;

/// Communication step of the default experiment, s. Some importers coarsen the step until there are no more than 1000.
pub const STEP_SIZE: f64 = 0.01;

/// Tolerance of the default experiment.
pub const TOLERANCE: f64 = 1e-3;

/// Log categories with their meaning.
pub const LOG_CATEGORIES: [(&str, &str); 7] = [
    ("logEvents", "start and end of a run"),
    ("logNonlinearSystems", "internal steps that had to be tried again"),
    ("logStatusWarning", "lines of calls that answer fmi2Warning"),
    ("logStatusDiscard", "lines of calls that answer fmi2Discard"),
    ("logStatusError", "lines of calls that answer fmi2Error"),
    ("logStatusFatal", "lines of calls that answer fmi2Fatal"),
    (ALL, "all of them"),
];

/// The category that stands for all others.
pub const ALL: &str = "logAll";

/// The whole text.
pub fn xml(model: &Model) -> String {
    render(model, &guid(model))
}

/// The GUID, in braces.
pub fn guid(model: &Model) -> String {
    let mut text = render(model, "").into_bytes();
    let Parameters { rest_shape, stations, .. } = &model.parameters;
    let numbers = |piece: &Piece| [piece.part, piece.turn.x, piece.turn.y, piece.turn.z];
    let numbers = rest_shape.pieces().iter().flat_map(numbers).chain(stations.iter().copied());
    text.extend(numbers.flat_map(f64::to_le_bytes));
    let [a, b, c, d, e] = {
        let hash = format!("{:032x}", fingerprint(&text));
        [0..8, 8..12, 12..16, 16..20, 20..32].map(|range| hash[range].to_owned())
    };
    format!("{{{a}-{b}-{c}-{d}-{e}}}")
}

/// FNV-1a, 128 bits: tells descriptions apart, protects from nobody.
fn fingerprint(text: &[u8]) -> u128 {
    const OFFSET: u128 = 0x6c62_272e_07bb_0142_62b8_2175_6295_c58d;
    const PRIME: u128 = 0x0000_0000_0100_0000_0000_0000_0000_013b;
    text.iter().fold(OFFSET, |hash, &byte| (hash ^ u128::from(byte)).wrapping_mul(PRIME))
}

fn render(model: &Model, guid: &str) -> String {
    document(|xml| root(xml, model, guid))
}

/// Where markup is written to.
pub(crate) type Xml = Writer<Vec<u8>>;

/// The text of an XML file with these contents.
pub(crate) fn document(contents: impl FnOnce(&mut Xml) -> io::Result<()>) -> String {
    markup(|xml| {
        xml.write_event(Event::Decl(BytesDecl::new("1.0", Some("UTF-8"), None)))?;
        contents(xml)
    })
}

/// The text that `contents` writes.
pub(crate) fn markup(contents: impl FnOnce(&mut Xml) -> io::Result<()>) -> String {
    let mut writer = Writer::new_with_indent(Vec::new(), b' ', 2);
    let written = contents(&mut writer);
    debug_assert!(written.is_ok(), "memory takes every write");
    String::from_utf8_lossy(&writer.into_inner()).into_owned() + "\n"
}

fn root(xml: &mut Xml, model: &Model, guid: &str) -> io::Result<()> {
    xml.create_element("fmiModelDescription")
        .with_attributes([
            ("fmiVersion", "2.0"),
            ("modelName", model.name.as_str()),
            ("guid", guid),
            ("description", model.description.as_str()),
            ("version", env!("CARGO_PKG_VERSION")),
            ("license", env!("CARGO_PKG_LICENSE")),
            ("generationTool", concat!(env!("CARGO_PKG_NAME"), " ", env!("CARGO_PKG_VERSION"))),
            ("variableNamingConvention", "structured"),
        ])
        .write_inner_content(|xml| {
            let listed = variables::all().into_iter().enumerate();
            let listed: Vec<(usize, Variable)> = listed.filter(|(_, one)| one.is_of(&model.parameters)).collect();
            co_simulation(xml, &model.name)?;
            units(xml)?;
            log_categories(xml)?;
            default_experiment(xml, &model.experiment)?;
            xml.create_element("ModelVariables").write_inner_content(|xml| {
                let mut starts = model.starts();
                listed.iter().try_for_each(|(reference, variable)| {
                    let meaning = variable.description(&model.parameters);
                    scalar(xml, *reference, variable, &meaning, starts(variable))
                })
            })?;
            structure(xml, &listed)
        })?;
    Ok(())
}

fn co_simulation(xml: &mut Xml, identifier: &str) -> io::Result<()> {
    xml.create_element("CoSimulation")
        .with_attributes([
            ("modelIdentifier", identifier),
            ("needsExecutionTool", "false"),
            ("canHandleVariableCommunicationStepSize", "true"),
            ("canInterpolateInputs", "true"),
            ("maxOutputDerivativeOrder", "1"),
            ("canRunAsynchronuously", "false"),
            ("canBeInstantiatedOnlyOncePerProcess", "false"),
            ("canNotUseMemoryManagementFunctions", "true"),
            ("canGetAndSetFMUstate", "true"),
            ("canSerializeFMUstate", "true"),
            ("providesDirectionalDerivative", "true"),
        ])
        .write_empty()?;
    Ok(())
}

fn units(xml: &mut Xml) -> io::Result<()> {
    xml.create_element("UnitDefinitions").write_inner_content(|xml| {
        UNITS.iter().try_for_each(|(name, exponents)| {
            xml.create_element("Unit").with_attribute(("name", *name)).write_inner_content(|xml| {
                let base = ["kg", "m", "s", "rad"].into_iter().zip(exponents);
                base.filter(|(_, exponent)| **exponent != 0)
                    .fold(xml.create_element("BaseUnit"), |element, (symbol, exponent)| {
                        number(element, symbol, exponent)
                    })
                    .write_empty()?;
                Ok(())
            })?;
            Ok(())
        })
    })?;
    Ok(())
}

fn log_categories(xml: &mut Xml) -> io::Result<()> {
    xml.create_element("LogCategories").write_inner_content(|xml| {
        LOG_CATEGORIES.iter().try_for_each(|(name, description)| {
            xml.create_element("Category")
                .with_attributes([("name", *name), ("description", *description)])
                .write_empty()?;
            Ok(())
        })
    })?;
    Ok(())
}

fn default_experiment(xml: &mut Xml, experiment: &Experiment) -> io::Result<()> {
    let Experiment { stop_time, step_size, tolerance } = *experiment;
    let attributes = [("startTime", 0.0), ("stopTime", stop_time), ("tolerance", tolerance), ("stepSize", step_size)];
    attributes
        .into_iter()
        .fold(xml.create_element("DefaultExperiment"), |element, (name, value)| number(element, name, value))
        .write_empty()?;
    Ok(())
}

/// Numbers are written with as many digits as it takes to read the same number back.
fn number<'a>(element: ElementWriter<'a, Vec<u8>>, name: &str, value: impl ToString) -> ElementWriter<'a, Vec<u8>> {
    element.with_attribute((name, value.to_string().as_str()))
}

fn scalar(xml: &mut Xml, reference: usize, variable: &Variable, meaning: &str, start: Option<f64>) -> io::Result<()> {
    let (causality, variability, initial) = triple(variable.row);
    let element = xml.create_element("ScalarVariable").with_attributes([
        ("name", variable.to_string().as_str()),
        ("valueReference", reference.to_string().as_str()),
        ("description", meaning),
        ("causality", causality),
        ("variability", variability),
    ]);
    let element = match initial {
        Some(initial) => element.with_attribute(("initial", initial)),
        None => element,
    };
    element.write_inner_content(|xml| {
        let mut element = xml.create_element(variable.kind().name());
        if !variable.row.unit.is_empty() {
            element = element.with_attribute(("unit", variable.row.unit));
        }
        if variable.kind() != Kind::Boolean {
            for (name, bound) in [("min", variable.allowed().min()), ("max", variable.allowed().max())] {
                element = match bound {
                    Some(bound) => number(element, name, bound),
                    None => element,
                };
            }
        }
        if let Some(start) = start {
            element = match variable.kind() {
                Kind::Boolean => number(element, "start", start != 0.0),
                _ => number(element, "start", start),
            };
        }
        element.write_empty()?;
        Ok(())
    })?;
    Ok(())
}

/// Causality, variability and initial, as the standard allows them together.
pub(crate) fn triple(row: &Row) -> (&'static str, &'static str, Option<&'static str>) {
    match row.slot {
        Slot::Parameter(..) | Slot::IntegerParameter(..) | Slot::BooleanParameter(_) => {
            ("parameter", "fixed", Some("exact"))
        }
        Slot::Tunable(..) | Slot::TunableInteger(_) => ("parameter", "tunable", Some("exact")),
        Slot::Input(_) => ("input", "continuous", None),
        Slot::Output(..) => ("output", "continuous", Some("calculated")),
        Slot::IntegerOutput(..) | Slot::BooleanOutput(..) => ("output", "discrete", Some("calculated")),
    }
}

/// The dependencies are argued at [`variables::Initially`]; indices are places among what is listed, from 1.
fn structure(xml: &mut Xml, listed: &[(usize, Variable)]) -> io::Result<()> {
    let place = |index: usize| (index + 1).to_string();
    let variables = || listed.iter().map(|(_, variable)| variable).enumerate();
    let outputs = || variables().filter(|(_, variable)| variable.is_output());
    xml.create_element("ModelStructure").write_inner_content(|xml| {
        xml.create_element("Outputs").write_inner_content(|xml| {
            outputs().try_for_each(|(index, _)| {
                xml.create_element("Unknown")
                    .with_attributes([("index", place(index).as_str()), ("dependencies", "")])
                    .write_empty()?;
                Ok(())
            })
        })?;
        xml.create_element("InitialUnknowns").write_inner_content(|xml| {
            outputs().try_for_each(|(index, unknown)| {
                let known: Vec<String> = variables()
                    .filter(|(_, known)| !known.is_output() && unknown.depends_initially_on(known))
                    .map(|(index, _)| place(index))
                    .collect();
                xml.create_element("Unknown")
                    .with_attributes([("index", place(index).as_str()), ("dependencies", known.join(" ").as_str())])
                    .write_empty()?;
                Ok(())
            })
        })?;
        Ok(())
    })?;
    Ok(())
}
