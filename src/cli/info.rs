//! `cosserat info`: what is in an FMU, from its model description and the names of its files.

use cosserat_rod::fmi2::description;
use cosserat_rod::fmi2::host::{Description, Variable};
use cosserat_rod::package;
use std::collections::BTreeSet;
use std::error::Error;
use std::io::{self, Write};
use std::path::PathBuf;

/// Of which file.
#[derive(clap::Args)]
pub struct Arguments {
    /// The FMU.
    file: PathBuf,
}

/// The platforms that an archive with these files has a library for.
pub fn platforms(names: &[String]) -> BTreeSet<&str> {
    let inside = names.iter().filter_map(|name| name.strip_prefix("binaries/"));
    inside.filter_map(|name| name.split_once('/')).map(|(platform, _)| platform).collect()
}

/// Words in a row, or that there are none.
fn list<'a>(words: impl IntoIterator<Item = &'a str>) -> String {
    let words: Vec<&str> = words.into_iter().collect();
    if words.is_empty() { "none".to_owned() } else { words.join(", ") }
}

/// Prints it.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let file = &arguments.file;
    let names = package::names(file)?;
    let xml = package::read(file, description::FILE)?;
    let model = Description::parse(&xml).map_err(|error| format!("{}: {error}", file.display()))?;
    let of = |causality: &str| -> Vec<(&String, &Variable)> {
        let variables = model.order.iter().filter_map(|name| Some((name, model.variables.get(name)?)));
        variables.filter(|(_, variable)| variable.causality == causality).collect()
    };
    let (parameters, inputs, outputs) = (of("parameter"), of("input"), of("output"));
    let others = model.order.len() - parameters.len() - inputs.len() - outputs.len();

    let mut out = io::stdout().lock();
    let mut row =
        |name: &str, text: &str| writeln!(out, "{name:<16}{}", if text.is_empty() { "not given" } else { text });
    row("model", &model.model_name)?;
    row("FMI", &model.fmi_version)?;
    row("GUID", &model.guid)?;
    row("generation tool", &model.generation_tool)?;
    row("platforms", &list(platforms(&names)))?;
    let able = model.co_simulation.iter().filter(|(_, value)| matches!(value.as_str(), "true" | "1"));
    match model.co_simulation.is_empty() {
        true => row("co-simulation", "no")?,
        false => row("capabilities", &list(able.map(|(name, _)| name.as_str())))?,
    }
    if model.step_size > 0.0 {
        row(
            "experiment",
            &format!("{} s to {} s in steps of {} s", model.start_time, model.stop_time, model.step_size),
        )?;
    }
    let counts =
        [(parameters.len(), "parameters"), (inputs.len(), "inputs"), (outputs.len(), "outputs"), (others, "others")];
    let counts = counts.iter().filter(|(count, _)| *count > 0).map(|(count, name)| format!("{count} {name}"));
    row("variables", &list(counts.collect::<Vec<_>>().iter().map(String::as_str)))?;
    let further =
        names.iter().map(String::as_str).filter(|name| *name != description::FILE && !name.starts_with("binaries/"));
    row("further files", &list(further))?;
    if parameters.is_empty() {
        return Ok(());
    }
    let width = parameters.iter().map(|(name, _)| name.chars().count()).max().unwrap_or_default();
    writeln!(out, "\n{:<width$}  start", "parameter")?;
    for (name, variable) in parameters {
        writeln!(out, "{}", format!("{name:<width$}  {} {}", variable.start, variable.unit).trim_end())?;
    }
    Ok(())
}
