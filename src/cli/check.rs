//! `cosserat check`: whether an FMU of FMI 2.0 co-simulation, of this crate or another, is whole and runs.
//!
//! Its library is loaded into this process, and trusted as every host trusts it.

use super::info::platforms;
use cosserat_rod::fmi2::description;
use cosserat_rod::fmi2::host::{Description, Fmu, Variable, fmi2ValueReference};
use cosserat_rod::fmi2::variables::Kind;
use cosserat_rod::package;
use std::collections::{BTreeMap, BTreeSet};
use std::error::Error;
use std::path::{MAIN_SEPARATOR, Path, PathBuf};
use std::{env, fs, io, process};

/// Of which file.
#[derive(clap::Args)]
pub struct Arguments {
    /// The FMU.
    file: PathBuf,
}

/// What a check found, or what is wrong.
type Found = Result<String, String>;

/// The lines so far.
#[derive(Default)]
struct Checks {
    failed: Vec<String>,
}

impl Checks {
    /// Prints a line; whether the check passed.
    fn note(&mut self, name: &str, found: Found) -> io::Result<bool> {
        use io::Write;
        let mut out = io::stdout().lock();
        // a foreign log may have line breaks
        let flat = |text: String| text.split_whitespace().collect::<Vec<_>>().join(" ");
        match found {
            Ok(text) => writeln!(out, "ok      {name:<16}{text}").map(|()| true),
            Err(text) => {
                let text = flat(text);
                writeln!(out, "FAILED  {name:<16}{text}")?;
                self.failed.push(format!("{name}: {text}"));
                Ok(false)
            }
        }
    }
}

/// A directory for the time of the check.
struct Unpacked(PathBuf);

impl Unpacked {
    fn new() -> Result<Self, String> {
        let directory = env::temp_dir().join(format!("cosserat-check-{}", process::id()));
        fs::create_dir(&directory).map_err(|error| format!("{}: {error}", directory.display()))?;
        Ok(Self(directory))
    }
}

impl Drop for Unpacked {
    fn drop(&mut self) {
        // what cannot be removed is left to the system
        let _ = fs::remove_dir_all(&self.0);
    }
}

/// Prints a line for each check.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    let mut checks = Checks::default();
    let directory = Unpacked::new()?;
    all(&mut checks, &arguments.file, &directory.0)?;
    match checks.failed.as_slice() {
        [] => Ok(()),
        failed => Err(format!("{}: {}", arguments.file.display(), failed.join("; ")).into()),
    }
}

/// As far as one check allows the next.
fn all(checks: &mut Checks, file: &Path, directory: &Path) -> io::Result<()> {
    let plain = |error: package::Error| match error {
        package::Error::File { error, .. } => error.to_string(),
        package::Error::Missing { name, .. } => format!("no {name} in the archive"),
        error => error.to_string(),
    };
    let names = match package::names(file).and_then(|names| package::unpack(file, directory).map(|()| names)) {
        Ok(names) => names,
        Err(error) => return checks.note("archive", Err(plain(error))).map(drop),
    };
    checks.note("archive", Ok(format!("{} files", names.len())))?;
    let read = package::read(file, description::FILE).map_err(plain);
    let model = match read.and_then(|xml| Description::parse(&xml).map_err(|error| error.to_string())) {
        Ok(model) => model,
        Err(error) => return checks.note("description", Err(error)).map(drop),
    };
    if !checks.note("description", kind(&model))? {
        return Ok(());
    }
    checks.note("names", unique(&model))?;
    checks.note("references", references(&model))?;
    checks.note("start values", starts(&model))?;
    checks.note("outputs", outputs(&model))?;
    if !checks.note("binary", binary(&model, &names))? {
        return Ok(());
    }
    match Fmu::open(directory) {
        Ok(fmu) => {
            let version = fmu.version();
            let right = version == "2.0";
            checks.note(
                "library",
                if right { Ok("all 34 functions".to_owned()) } else { Err(format!("of FMI {version:?}")) },
            )?;
            life(checks, &fmu)
        }
        Err(error) => {
            // as it is named in the archive
            let text = error.to_string().replace(&format!("{}{MAIN_SEPARATOR}", directory.display()), "");
            checks.note("library", Err(text)).map(drop)
        }
    }
}

fn kind(model: &Description) -> Found {
    match (model.fmi_version.as_str(), model.capability("modelIdentifier")) {
        ("2.0", "") => Err("no co-simulation".to_owned()),
        ("2.0", identifier) if identifier.contains(['/', '\\']) => Err(format!("model identifier {identifier}")),
        ("2.0", _) => Ok(format!("{}, FMI 2.0, co-simulation", model.model_name)),
        ("", _) => Err("no model description of FMI".to_owned()),
        (version, _) => Err(format!("of FMI {version}, not 2.0")),
    }
}

fn unique(model: &Description) -> Found {
    let mut seen = BTreeSet::new();
    match model.order.iter().find(|name| !seen.insert(*name)) {
        Some(name) => Err(format!("two variables {name}")),
        None => Ok(format!("{} variables", model.order.len())),
    }
}

fn is_given(variable: &Variable) -> bool {
    matches!(variable.causality.as_str(), "input" | "parameter")
}

/// Variables may share a reference as names of one quantity, but only one of them may be set.
fn references(model: &Description) -> Found {
    let mut set: BTreeMap<(&str, fmi2ValueReference), &String> = BTreeMap::new();
    for (name, variable) in model.variables.iter().filter(|(_, variable)| is_given(variable)) {
        if let Some(other) = set.insert((variable.kind.name(), variable.reference), name) {
            return Err(format!("{other} and {name} share {}", variable.reference));
        }
    }
    Ok(format!("{} that can be set", set.len()))
}

fn starts(model: &Description) -> Found {
    let mut given = model.variables.iter().filter(|(_, variable)| is_given(variable));
    let missing = given.find(|(_, variable)| variable.start.is_empty() && variable.kind != Kind::String);
    missing.map_or(Ok("of all inputs and parameters".to_owned()), |(name, _)| Err(format!("{name} has none")))
}

fn outputs(model: &Description) -> Found {
    let mut listed = BTreeSet::new();
    for &index in &model.outputs {
        let name = index.checked_sub(1).and_then(|place| model.order.get(place));
        let name = name.ok_or_else(|| format!("ModelStructure lists variable {index} of {}", model.order.len()))?;
        if model.variables.get(name).is_none_or(|variable| variable.causality != "output") {
            return Err(format!("ModelStructure lists {name}, which is no output"));
        }
        if !listed.insert(name) {
            return Err(format!("ModelStructure lists {name} twice"));
        }
    }
    let mut outputs = model.variables.iter().filter(|(_, variable)| variable.causality == "output");
    match outputs.find(|(name, _)| !listed.contains(name)) {
        Some((name, _)) => Err(format!("ModelStructure does not list {name}")),
        None => Ok(format!("{} in ModelStructure", listed.len())),
    }
}

fn binary(model: &Description, names: &[String]) -> Found {
    let binary = model.binary();
    let platforms: Vec<&str> = platforms(names).into_iter().collect();
    let platforms = if platforms.is_empty() { "no platform".to_owned() } else { platforms.join(", ") };
    match names.contains(&binary) {
        true => Ok(format!("{binary} in the archive, which is for {platforms}")),
        false => Err(format!("no {binary} in the archive, which is for {platforms}")),
    }
}

/// From the first call to the last, with one step between.
fn life(checks: &mut Checks, fmu: &Fmu) -> io::Result<()> {
    let model = &fmu.description;
    let slave = match fmu.instantiate("check", false) {
        Ok(slave) => slave,
        Err(error) => return checks.note("instance", Err(error.to_string())).map(drop),
    };
    checks.note("instance", Ok(format!("GUID {}", model.guid)))?;
    let start = model.start_time;
    let stop = Some(model.stop_time).filter(|stop| *stop > start);
    // a hundredth of an experiment that does not say
    let step =
        Some(model.step_size).filter(|step| *step > 0.0).or(stop.map(|stop| (stop - start) / 100.0)).unwrap_or(0.01);
    let ready = slave
        .setup_experiment(start, stop, None)
        .and_then(|()| slave.enter_initialization_mode())
        .and_then(|()| slave.exit_initialization_mode());
    if !checks.note("initialisation", ready.map(|()| format!("at {start} s")).map_err(|error| error.to_string()))? {
        return Ok(());
    }
    let stepped = slave.do_step(start, step).map(|()| format!("of {step} s")).map_err(|error| error.to_string());
    if !checks.note("step", stepped)? {
        return Ok(());
    }
    let reals =
        model.variables.iter().filter(|(_, variable)| variable.causality == "output" && variable.kind == Kind::Real);
    let (names, references): (Vec<&String>, Vec<_>) = reals.map(|(name, variable)| (name, variable.reference)).unzip();
    let mut values = vec![f64::NAN; references.len()];
    let got = slave.get_real(&references, &mut values).map_err(|error| error.to_string());
    let wrong = names.iter().zip(&values).find(|(_, value)| !value.is_finite());
    let finite = got.and_then(|()| match wrong {
        Some((name, value)) => Err(format!("{name} = {value}")),
        None => Ok(format!("{} finite after it", values.len())),
    });
    checks.note("values", finite)?;
    let ended = slave.terminate().map_err(|error| error.to_string());
    drop(slave);
    checks.note("end", ended.map(|()| "terminated and freed".to_owned())).map(drop)
}
