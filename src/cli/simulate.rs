//! `cosserat simulate`: inputs from a CSV, outputs to a CSV, for those without an importer.
//!
//! The communication points are the rows of the input table, or equal steps if `--step` says so; between rows an input
//! is interpolated, and it is held over the step that begins there. The numbers are those of the FMU, bit for bit,
//! where the host steps from each of these times to the next.

use super::{Error as ValueError, Progress};
use cosserat_rod::fmi2::description::{STEP_SIZE, STOP_TIME};
use cosserat_rod::fmi2::variables::{self, Kind, Variable};
use cosserat_rod::unit::{self, Inputs, Outputs, Parameters, Unit, Warning};
use std::fs::File;
use std::io::{self, IsTerminal, Write};
use std::path::{Path, PathBuf};
use std::{error, fmt};

/// What to run.
#[derive(clap::Args)]
pub struct Arguments {
    /// CSV with a column `time` and columns named as inputs (or as gravity); what has no column keeps its start value.
    /// Without a file: the default experiment.
    inputs: Option<PathBuf>,
    /// Where to write the outputs as CSV; without it, to standard output.
    #[arg(short, long, value_name = "FILE")]
    out: Option<PathBuf>,
    /// A rod in a file, as `package` takes it, in place of the unit's own.
    #[arg(long, value_name = "FILE")]
    rod: Option<PathBuf>,
    /// Sets a parameter, or the start value of an input; arrays by element (gravity[3]=0) or as a whole
    /// (gravity=0,0,0).
    #[arg(short, long, value_name = "NAME=VALUE")]
    set: Vec<String>,
    /// An output to write, an array if named without index; may be repeated. Without it, all are written.
    #[arg(long, value_name = "NAME")]
    output: Vec<String>,
    /// Time of the end, s; without it, that of the last row.
    #[arg(long, value_name = "TIME", allow_negative_numbers = true)]
    stop: Option<f64>,
    /// Communication step, s; without it, from row to row.
    #[arg(long, value_name = "TIME", allow_negative_numbers = true)]
    step: Option<f64>,
}

/// Why there is no result.
#[derive(Debug)]
enum Error {
    File { path: PathBuf, error: io::Error },
    Table { path: PathBuf, error: csv::Error },
    NoTime { path: PathBuf },
    NoRows { path: PathBuf },
    UnknownColumn { path: PathBuf, error: ValueError },
    FixedColumn { path: PathBuf, name: String },
    TwiceColumn { path: PathBuf, name: String },
    Field { path: PathBuf, line: u64, error: ValueError },
    Time { path: PathBuf, line: u64, text: String },
    NotAscending { path: PathBuf, line: u64, time: f64, before: f64 },
    UnknownOutput { name: String },
    Step { value: f64 },
    Stop { value: f64, start: f64 },
    Start(unit::Error),
    Diverged { time: f64, error: unit::Error },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, error } => write!(f, "{}: {error}", path.display()),
            Self::Table { path, error } => write!(f, "{}: {error}", path.display()),
            Self::NoTime { path } => write!(f, "{}: no column time", path.display()),
            Self::NoRows { path } => write!(f, "{}: no row below the header", path.display()),
            Self::UnknownColumn { path, error } => write!(f, "{}: column {error}", path.display()),
            Self::FixedColumn { path, name } => write!(
                f,
                "{}: column {name} is not allowed: it is fixed while the rod moves, give it by --set",
                path.display()
            ),
            Self::TwiceColumn { path, name } => write!(f, "{}: two columns {name}", path.display()),
            Self::Field { path, line, error } => write!(f, "{}, line {line}: {error}", path.display()),
            Self::Time { path, line, text } => {
                write!(f, "{}, line {line}: time = {text} is not allowed: a finite number", path.display())
            }
            Self::NotAscending { path, line, time, before } => write!(
                f,
                "{}, line {line}: time = {time} is not allowed: above that of the row before, {before}",
                path.display()
            ),
            Self::UnknownOutput { name } => {
                write!(f, "--output {name} is no output of the unit:")?;
                let outputs = variables::ROWS.iter().map(|row| Variable { row, element: 0 });
                let mut names = outputs.filter(Variable::is_output).map(|variable| variable.row.name);
                names.try_for_each(|name| write!(f, " {name}"))
            }
            Self::Step { value } => write!(f, "--step {value} is not allowed: finite and > 0"),
            Self::Stop { value, start } => write!(f, "--stop {value} is not allowed: finite and >= {start}, the start"),
            Self::Start(error) => error.fmt(f),
            Self::Diverged { time, error } => write!(f, "the step from {time} s failed: {error}"),
        }
    }
}

impl error::Error for Error {}

/// The inputs over time.
#[derive(Default)]
struct Table {
    columns: Vec<Variable>,
    times: Vec<f64>,
    /// As many values in a row as columns.
    rows: Vec<Vec<f64>>,
}

impl Table {
    fn read(path: &Path) -> Result<Self, Error> {
        let owned = || path.to_owned();
        let in_table = |error| Error::Table { path: owned(), error };
        let file = File::open(path).map_err(|error| Error::File { path: owned(), error })?;
        let mut reader = csv::ReaderBuilder::new().trim(csv::Trim::All).from_reader(file);
        let header = reader.headers().map_err(in_table)?.clone();
        let time = header.iter().position(|name| name == "time").ok_or_else(|| Error::NoTime { path: owned() })?;

        let known = variables::all();
        let mut table = Self::default();
        let mut places = Vec::new();
        for (place, name) in header.iter().enumerate() {
            if header.iter().take(place).any(|other| other == name) {
                return Err(Error::TwiceColumn { path: owned(), name: name.to_owned() });
            }
            if place == time {
                continue;
            }
            let variable = known.iter().find(|variable| variable.to_string() == name && !variable.is_output());
            let Some(variable) = variable else {
                let error = ValueError::Unknown { name: name.to_owned() };
                return Err(Error::UnknownColumn { path: owned(), error });
            };
            if !variable.is_settable_while_stepping() {
                return Err(Error::FixedColumn { path: owned(), name: name.to_owned() });
            }
            table.columns.push(*variable);
            places.push(place);
        }

        for record in reader.records() {
            let record = record.map_err(in_table)?;
            let line = record.position().map_or(0, csv::Position::line);
            let now = record[time].parse().ok().filter(|now: &f64| now.is_finite());
            let text = || record[time].to_owned();
            let now = now.ok_or_else(|| Error::Time { path: owned(), line, text: text() })?;
            if let Some(&before) = table.times.last().filter(|&&before| now <= before) {
                return Err(Error::NotAscending { path: owned(), line, time: now, before });
            }
            let values = table.columns.iter().zip(&places).map(|(column, &place)| super::parse(column, &record[place]));
            let values =
                values.collect::<Result<_, _>>().map_err(|error| Error::Field { path: owned(), line, error })?;
            table.times.push(now);
            table.rows.push(values);
        }
        if table.times.is_empty() { Err(Error::NoRows { path: owned() }) } else { Ok(table) }
    }

    /// Sets the values at `time`; those of the first and the last row go on beyond them.
    fn apply(&self, time: f64, parameters: &mut Parameters, inputs: &mut Inputs) {
        let after = self.times.partition_point(|&row| row <= time);
        for (k, column) in self.columns.iter().enumerate() {
            let value = match after {
                0 => self.rows[0][k],
                after if after == self.times.len() => self.rows[after - 1][k],
                after => {
                    let (t_0, t_1) = (self.times[after - 1], self.times[after]);
                    let (x_0, x_1) = (self.rows[after - 1][k], self.rows[after][k]);
                    // at a row, exactly its value
                    x_0 + (x_1 - x_0) * ((time - t_0) / (t_1 - t_0))
                }
            };
            column.set(parameters, inputs, value);
        }
    }
}

/// The communication points.
enum Points {
    Rows(Vec<f64>),
    Equal { start: f64, stop: f64, step: f64, count: usize },
}

impl Points {
    fn new(table: Option<&Table>, stop: Option<f64>, step: Option<f64>) -> Result<Self, Error> {
        let start = table.map_or(0.0, |table| table.times[0]);
        if let Some(value) = stop.filter(|stop| !(stop.is_finite() && *stop >= start)) {
            return Err(Error::Stop { value, start });
        }
        if let Some(value) = step.filter(|step| !(step.is_finite() && *step > 0.0)) {
            return Err(Error::Step { value });
        }
        match (table, step) {
            (Some(table), None) => {
                let stop = stop.unwrap_or(f64::INFINITY);
                let mut times: Vec<f64> = table.times.iter().copied().filter(|&time| time <= stop).collect();
                if stop.is_finite() && times.last() != Some(&stop) {
                    times.push(stop);
                }
                Ok(Self::Rows(times))
            }
            _ => {
                let last = table.map_or(STOP_TIME, |table| table.times[table.times.len() - 1]);
                let (stop, step) = (stop.unwrap_or(last), step.unwrap_or(STEP_SIZE));
                // round-off does not cost a step
                let count = ((stop - start) / step * (1.0 - 1e-9)).ceil() as usize;
                Ok(Self::Equal { start, stop, step, count })
            }
        }
    }

    /// How many steps there are.
    fn count(&self) -> usize {
        match self {
            Self::Rows(times) => times.len() - 1,
            Self::Equal { count, .. } => *count,
        }
    }

    /// Where step `k` begins, or the last one ends.
    fn time(&self, k: usize) -> f64 {
        match self {
            Self::Rows(times) => times[k],
            Self::Equal { stop, count, .. } if k > 0 && k == *count => *stop,
            Self::Equal { start, step, .. } => start + k as f64 * step,
        }
    }
}

/// A rod, its inputs over time, and the communication points.
pub struct Experiment {
    /// Of the rod.
    pub parameters: Parameters,
    inputs: Inputs,
    table: Option<Table>,
    points: Points,
}

impl Experiment {
    /// From what the command line gives: a table, a rod, settings, the end and the communication step.
    pub fn new(
        table: Option<&Path>,
        rod: Option<&Path>,
        set: &[String],
        stop: Option<f64>,
        step: Option<f64>,
    ) -> Result<Self, Box<dyn error::Error>> {
        let (parameters, inputs) = super::settings(rod, set)?;
        let table = table.map(Table::read).transpose()?;
        let points = Points::new(table.as_ref(), stop, step)?;
        Ok(Self { parameters, inputs, table, points })
    }

    /// How many communication steps there are.
    pub fn steps(&self) -> usize {
        self.points.count()
    }

    /// From the first communication point to the last, s.
    pub fn duration(&self) -> f64 {
        self.points.time(self.points.count()) - self.points.time(0)
    }

    /// Runs the unit with `parameters`; `tell` gets what it says at every communication point.
    pub fn run(
        &self,
        parameters: &Parameters,
        mut tell: impl FnMut(f64, &Outputs, Option<Warning>) -> Result<(), Box<dyn error::Error>>,
    ) -> Result<(), Box<dyn error::Error>> {
        let (mut parameters, mut inputs) = (parameters.clone(), self.inputs.clone());
        let mut apply = |time: f64, parameters: &mut Parameters| {
            if let Some(table) = &self.table {
                table.apply(time, parameters, &mut inputs);
            }
            inputs.clone()
        };
        let start = apply(self.points.time(0), &mut parameters);
        let mut unit = Unit::new(&parameters, &start, None).map_err(Error::Start)?;
        tell(self.points.time(0), unit.outputs(), None)?;
        let mut clock = self.points.time(0);
        for k in 0..self.points.count() {
            let (time, end) = (self.points.time(k), self.points.time(k + 1));
            // as the FMU takes a host's rounded times: its own clock goes on from where it is
            let step = (time - clock) + (end - time);
            clock = time + (end - time);
            let now = apply(time, &mut parameters);
            let warning = (unit.tune(&parameters.tunable()).and_then(|()| unit.advance(&now, step)))
                .map_err(|error| Error::Diverged { time, error })?;
            tell(end, unit.outputs(), warning)?;
        }
        Ok(())
    }
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn error::Error>> {
    let Arguments { inputs, rod, set, stop, step, .. } = arguments;
    let experiment = Experiment::new(inputs.as_deref(), rod.as_deref(), set, *stop, *step)?;
    let columns = outputs(&arguments.output, &experiment.parameters)?;
    let sink: Box<dyn Write> = match &arguments.out {
        Some(path) => Box::new(File::create(path).map_err(|error| Error::File { path: path.clone(), error })?),
        None => Box::new(io::stdout().lock()),
    };
    let mut writer = csv::Writer::from_writer(sink);
    let header = columns.iter().map(Variable::to_string);
    writer.write_record(["time".to_owned()].into_iter().chain(header))?;
    // not into the middle of the table
    let quiet = arguments.out.is_none() && io::stdout().is_terminal();
    let mut progress = (!quiet).then(|| Progress::new(experiment.steps() as u64 + 1));
    experiment.run(&experiment.parameters, |time, outputs, warning| {
        if let Some(warning) = warning {
            eprintln!("cosserat: at {time} s: {warning}");
        }
        let values = columns.iter().map(|column| text(column, outputs));
        writer.write_record([format!("{time:?}")].into_iter().chain(values))?;
        progress.iter_mut().for_each(Progress::step);
        Ok(())
    })?;
    writer.flush()?;
    Ok(())
}

/// The outputs of these names, in the order of the names; all that the rod has if there are none.
fn outputs(names: &[String], parameters: &Parameters) -> Result<Vec<Variable>, Error> {
    let known = variables::all().into_iter();
    let known: Vec<Variable> = known.filter(|one| one.is_output() && one.is_of(parameters)).collect();
    if names.is_empty() {
        return Ok(known);
    }
    let mut found = Vec::new();
    for name in names {
        let before = found.len();
        found.extend(known.iter().filter(|variable| variable.to_string() == *name || variable.row.name == *name));
        if found.len() == before {
            return Err(Error::UnknownOutput { name: name.clone() });
        }
    }
    Ok(found)
}

/// With as many digits as it takes to read it back unchanged.
fn text(column: &Variable, outputs: &Outputs) -> String {
    let value = column.computed(outputs).unwrap_or(f64::NAN);
    if column.kind() == Kind::Real { format!("{value:?}") } else { format!("{value}") }
}
