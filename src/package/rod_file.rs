//! A rod in a file: TOML, whose keys are the parameters and inputs of the unit by their names, the shape of the unstressed
//! rod as a list of pieces, and the arc lengths of its stations. Errors say where in the file they are.

use super::centreline::{Curve, NoCurve, Stretch};
use crate::fmi2::model::Model;
use crate::fmi2::variables::{self, Kind, ROWS, Row, Variable};
use crate::rest::{self, Piece, RestShape};
use crate::unit::{self, Allowed, STATIONS, Unit};
use nalgebra::Vector3;
use std::f64::consts::TAU;
use std::ops::Range;
use std::path::{Path, PathBuf};
use std::{fmt, fs, io};
use toml::Spanned;
use toml::de::{DeTable, DeValue};

type Vec3 = Vector3<f64>;
type Value<'t> = Spanned<DeValue<'t>>;

/// Part of the tolerance of the tip by which the pieces may leave a curve through points.
const SHARE: f64 = 0.2;
/// Most characters of a name and of a description.
const LONGEST: [usize; 2] = [100, 1000];

/// Keys beside those of the variables.
const OTHER: [&str; 5] = ["name", "description", "shape", "stations", "experiment"];
const EXPERIMENT: [&str; 3] = ["stop_time", "step_size", "tolerance"];

/// The kinds of pieces, each with its keys.
const KINDS: [(&str, &[&str]); 4] = [
    ("straight", &["kind", "length"]),
    ("arc", &["kind", "radius", "curvature", "degrees", "length", "towards"]),
    ("helix", &["kind", "radius", "pitch", "turns", "hand", "towards"]),
    ("points", &["kind", "points", "d1"]),
];

/// Why a file gives no rod.
#[derive(Debug)]
pub enum Error {
    /// It cannot be read.
    File {
        /// Which.
        path: PathBuf,
        /// Why.
        error: io::Error,
    },
    /// Something in it is not allowed.
    Rod {
        /// Which file.
        path: PathBuf,
        /// From 1.
        line: usize,
        /// Characters from the beginning of the line, from 1.
        column: usize,
        /// What is wrong there.
        problem: Problem,
    },
}

/// What is wrong at a place of a file.
#[derive(Debug)]
pub enum Problem {
    /// It is no TOML.
    Syntax {
        /// In the words of the parser.
        message: String,
    },
    /// There is no such key.
    UnknownKey {
        /// With those of the tables around it.
        key: String,
        /// The most similar one that there is.
        nearest: Option<String>,
        /// All there are.
        known: Vec<String>,
    },
    /// The key is that of an output.
    Output {
        /// Its name.
        key: String,
    },
    /// A value is not allowed.
    NotAllowed {
        /// Of which key.
        key: String,
        /// As it stands in the file.
        value: String,
        /// What is.
        needed: Needed,
    },
    /// A key is missing.
    Missing {
        /// What it would belong to.
        of: &'static str,
        /// The key, or those of which it takes one.
        keys: &'static [&'static str],
    },
    /// Keys say the same twice.
    Both {
        /// Which.
        keys: [&'static str; 2],
    },
    /// Points make no curve.
    NoCurve(NoCurve),
    /// Pieces make no rest shape.
    NoShape(rest::Invalid),
    /// The unit does not start.
    Unit(unit::Error),
}

/// What a value is to be.
#[derive(Debug)]
pub enum Needed {
    /// What may be set.
    Allowed(Allowed),
    /// As many numbers.
    Numbers(usize),
    /// What the words say.
    Such(&'static str),
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::File { path, error } => write!(f, "{}: {error}", path.display()),
            Self::Rod { path, line, column, problem } => write!(f, "{}:{line}:{column}: {problem}", path.display()),
        }
    }
}

impl fmt::Display for Problem {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Syntax { message } => f.write_str(message),
            Self::UnknownKey { key, nearest: Some(nearest), .. } => {
                write!(f, "{key} is unknown; is {nearest} what is meant?")
            }
            Self::UnknownKey { key, nearest: None, known } => write!(f, "{key} is unknown: only {}", known.join(", ")),
            Self::Output { key } => write!(f, "{key} is an output, which is never set"),
            Self::NotAllowed { key, value, needed } => write!(f, "{key} = {value} is not allowed: {needed}"),
            Self::Missing { of, keys } => write!(f, "{of} needs {}", keys.join(" or ")),
            Self::Both { keys: [one, other] } => write!(f, "{one} and {other} say the same: give only one of them"),
            Self::NoCurve(error) => error.fmt(f),
            Self::NoShape(error) => error.fmt(f),
            Self::Unit(error) => error.fmt(f),
        }
    }
}

impl fmt::Display for Needed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Allowed(allowed) => allowed.fmt(f),
            Self::Numbers(count) => write!(f, "[...] of {count} numbers"),
            Self::Such(words) => f.write_str(words),
        }
    }
}

impl std::error::Error for Error {}

/// Where in the text, in bytes, and what is wrong there.
#[derive(Debug)]
struct Fault {
    at: Range<usize>,
    problem: Problem,
}

type Found<T> = Result<T, Fault>;

/// Reads the rod in a file.
///
/// # Errors
/// [`Error`]
pub fn read(path: &Path) -> Result<Model, Error> {
    let text = fs::read_to_string(path).map_err(|error| Error::File { path: path.to_owned(), error })?;
    parse(&text).map_err(|Fault { at, problem }| {
        let before = text.get(..at.start).unwrap_or(&text);
        let begin = before.rfind('\n').map_or(0, |newline| newline + 1);
        let (line, column) = (before.matches('\n').count() + 1, before[begin..].chars().count() + 1);
        Error::Rod { path: path.to_owned(), line, column, problem }
    })
}

fn parse(text: &str) -> Found<Model> {
    let table = DeTable::parse(text).map_err(|error| {
        let message = error.message().split_whitespace().collect::<Vec<_>>().join(" ");
        Fault { at: error.span().unwrap_or_default(), problem: Problem::Syntax { message } }
    })?;
    let mut file = File { text, model: Model::default(), set: Vec::new() };
    file.model.name.clear();
    file.model.description = "an elastic rod".to_owned();
    let table = table.get_ref();
    file.table("", table)?;
    if file.model.name.is_empty() {
        return Err(Fault { at: 0..0, problem: Problem::Missing { of: "a rod", keys: &["name"] } });
    }
    if let Some(shape) = table.get("shape") {
        file.shape(shape)?;
    }
    if let Some(stations) = table.get("stations") {
        file.stations(stations)?;
    }
    let Model { parameters, inputs, experiment, .. } = &file.model;
    match Unit::new(parameters, inputs, Some(experiment.tolerance)) {
        Ok(_) => Ok(file.model),
        Err(error) => {
            let name = match &error {
                unit::Error::NotAllowed { name, .. } => name.split('[').next().unwrap_or_default(),
                _ if parameters.quasi_static => "quasi_static",
                _ => "start_in_equilibrium",
            };
            Err(Fault { at: file.place(name).unwrap_or(0..0), problem: Problem::Unit(error) })
        }
    }
}

/// What is read so far.
struct File<'t> {
    text: &'t str,
    model: Model,
    /// The variables given, and where.
    set: Vec<(&'static str, Range<usize>)>,
}

/// Keys and values as they stand in the file, where tables are sorted by key.
fn entries<'a, 't>(table: &'a DeTable<'t>) -> Vec<(&'a str, Range<usize>, &'a Value<'t>)> {
    let mut entries: Vec<_> = table.iter().map(|(key, value)| (key.get_ref().as_ref(), key.span(), value)).collect();
    entries.sort_by_key(|(_, at, _)| at.start);
    entries
}

/// The rows that are set.
fn given() -> impl Iterator<Item = &'static Row> {
    ROWS.iter().filter(|row| !Variable { row, element: 0 }.is_output())
}

/// A key in the table `within`, which has those that are `known`, or groups of them with a dot.
fn unknown(within: &str, key: &str, at: Range<usize>, known: Vec<String>) -> Fault {
    let inner = known.iter().filter_map(|name| name.strip_prefix(within));
    let inner = inner.flat_map(|name| [name, name.split('.').next().unwrap_or_default()]);
    let distance = |other: &&str| strsim::damerau_levenshtein(key, other);
    let nearest = inner.min_by_key(distance).filter(|other| distance(other) <= 1 + key.chars().count() / 4);
    let nearest = nearest.map(|other| format!("{within}{other}"));
    Fault { at, problem: Problem::UnknownKey { key: format!("{within}{key}"), nearest, known } }
}

impl File<'_> {
    fn refused<T>(&self, key: &str, value: &Value, needed: Needed) -> Found<T> {
        let text = match value.get_ref() {
            DeValue::Table(_) => "a table".to_owned(),
            _ => self.text.get(value.span()).unwrap_or_default().split_whitespace().collect::<Vec<_>>().join(" "),
        };
        let value_text = match text.char_indices().nth(40) {
            Some((end, _)) => format!("{}...", &text[..end]),
            None => text,
        };
        Err(Fault { at: value.span(), problem: Problem::NotAllowed { key: key.to_owned(), value: value_text, needed } })
    }

    /// Where a variable is given.
    fn place(&self, name: &str) -> Option<Range<usize>> {
        self.set.iter().find(|(known, _)| *known == name).map(|(_, at)| at.clone())
    }

    /// All in a table but the shape; `within` are the keys of the tables around it, each with a dot.
    fn table(&mut self, within: &str, table: &DeTable) -> Found<()> {
        for (key, at, value) in entries(table) {
            let name = format!("{within}{key}");
            let group = format!("{name}.");
            match name.as_str() {
                "name" => {
                    self.model.name = self.name(value)?;
                    continue;
                }
                "description" => {
                    self.model.description = self.words(&name, value, LONGEST[1])?;
                    continue;
                }
                "experiment" => {
                    self.experiment(value)?;
                    continue;
                }
                // once tolerance and length are known
                "shape" | "stations" => continue,
                _ => {}
            }
            if let Some(row) = given().find(|row| row.name == name) {
                self.variable(row, value)?;
                self.set.push((row.name, value.span()));
            } else if given().any(|row| row.name.starts_with(&group)) {
                match value.get_ref() {
                    DeValue::Table(inner) => self.table(&group, inner)?,
                    _ => return self.refused(&name, value, Needed::Such("a table, or the names in it after a dot")),
                }
            } else if ROWS.iter().any(|row| row.name == name) {
                return Err(Fault { at, problem: Problem::Output { key: name } });
            } else {
                let names = given().map(|row| row.name).filter(|known| known.starts_with(within));
                let other = OTHER.into_iter().filter(|_| within.is_empty());
                return Err(unknown(within, key, at, names.chain(other).map(str::to_owned).collect()));
            }
        }
        Ok(())
    }

    fn words(&self, key: &str, value: &Value, longest: usize) -> Found<String> {
        let fits = |text: &&str| text.chars().count() <= longest && !text.chars().any(char::is_control);
        match value.get_ref().as_str().filter(fits) {
            Some(text) => Ok(text.to_owned()),
            None => self.refused(key, value, Needed::Such("\"...\" of up to 1000 characters in one line")),
        }
    }

    fn name(&self, value: &Value) -> Found<String> {
        let is_identifier = |text: &&str| {
            text.chars().all(|c| c.is_ascii_alphanumeric() || c == '_')
                && text.starts_with(|c: char| c.is_ascii_alphabetic() || c == '_')
                && text.len() <= LONGEST[0]
        };
        match value.get_ref().as_str().filter(is_identifier) {
            Some(text) => Ok(text.to_owned()),
            None => {
                let words = "\"...\" of up to 100 letters, digits and _, no digit first: it names the library, too";
                self.refused("name", value, Needed::Such(words))
            }
        }
    }

    /// A number of this kind.
    fn number(&self, key: &str, value: &Value, kind: Kind, allowed: Allowed) -> Found<f64> {
        let integer = || {
            let integer = value.get_ref().as_integer()?;
            i64::from_str_radix(integer.as_str(), integer.radix()).ok().map(|number| number as f64)
        };
        let number = match kind {
            Kind::Boolean => value.get_ref().as_bool().map(|yes| u8::from(yes).into()),
            Kind::Integer => integer(),
            Kind::Real | Kind::String => {
                integer().or_else(|| value.get_ref().as_float().and_then(|float| float.as_str().parse().ok()))
            }
        };
        match number {
            Some(number) if allowed.contains(number) => Ok(number),
            _ if kind == Kind::Boolean => self.refused(key, value, Needed::Such("true or false")),
            None if allowed == Allowed::Finite => self.refused(key, value, Needed::Such("a number")),
            _ => self.refused(key, value, Needed::Allowed(allowed)),
        }
    }

    fn variable(&mut self, row: &'static Row, value: &Value) -> Found<()> {
        let elements = variables::all().into_iter().filter(|variable| variable.row.name == row.name);
        let elements: Vec<Variable> = elements.collect();
        let values: Vec<&Value> = match value.get_ref() {
            DeValue::Array(values) if !row.components.is_empty() => values.iter().collect(),
            _ if row.components.is_empty() => vec![value],
            _ => return self.refused(row.name, value, Needed::Numbers(elements.len())),
        };
        if values.len() != elements.len() {
            return self.refused(row.name, value, Needed::Numbers(elements.len()));
        }
        for (variable, value) in elements.iter().zip(values) {
            let number = self.number(&variable.to_string(), value, variable.kind(), variable.allowed())?;
            variable.set(&mut self.model.parameters, &mut self.model.inputs, number);
        }
        Ok(())
    }

    fn experiment(&mut self, value: &Value) -> Found<()> {
        let DeValue::Table(table) = value.get_ref() else {
            return self.refused("experiment", value, Needed::Such("a table of stop_time, step_size, tolerance"));
        };
        for (key, at, value) in entries(table) {
            let name = format!("experiment.{key}");
            let number = |file: &Self| file.number(&name, value, Kind::Real, Allowed::Positive);
            match key {
                "stop_time" => self.model.experiment.stop_time = number(self)?,
                "step_size" => self.model.experiment.step_size = number(self)?,
                "tolerance" => self.model.experiment.tolerance = number(self)?,
                _ => {
                    let known = EXPERIMENT.map(|known| format!("experiment.{known}"));
                    return Err(unknown("experiment.", key, at, known.into()));
                }
            }
        }
        Ok(())
    }

    fn shape(&mut self, value: &Value) -> Found<()> {
        if let Some(at) = self.place("length") {
            return Err(Fault { at, problem: Problem::Both { keys: ["length", "shape"] } });
        }
        let pieces = match value.get_ref() {
            DeValue::Array(pieces) if !pieces.is_empty() => pieces,
            _ => return self.refused("shape", value, Needed::Such("[[shape]] once or more, or a list of tables")),
        };
        let mut stretches = Vec::new();
        for piece in pieces.iter() {
            let DeValue::Table(table) = piece.get_ref() else {
                return self.refused("shape", piece, Needed::Such("a table with its kind"));
            };
            self.piece(piece, table, &mut stretches)?;
        }
        let length: f64 = stretches.iter().map(|stretch| stretch.length).sum();
        let part = |Stretch { length: own, turn }: &Stretch| Piece { part: own / length, turn: *turn };
        let pieces: Vec<Piece> = stretches.iter().map(part).collect();
        self.model.parameters.length = length;
        self.model.parameters.rest_shape = RestShape::new(&pieces)
            .map_err(|invalid| Fault { at: value.span(), problem: Problem::NoShape(invalid) })?;
        Ok(())
    }

    fn stations(&mut self, value: &Value) -> Found<()> {
        let arcs = match value.get_ref() {
            DeValue::Array(arcs) if (1..=STATIONS).contains(&arcs.len()) => arcs,
            _ => return self.refused("stations", value, Needed::Such("[...] of 1 to 11 arc lengths")),
        };
        let length = self.model.parameters.length;
        let part = |(k, arc): (usize, &Value)| {
            let key = format!("stations[{}]", k + 1);
            Ok(self.number(&key, arc, Kind::Real, Allowed::Between(0.0, length))? / length)
        };
        self.model.parameters.stations = arcs.iter().enumerate().map(part).collect::<Found<_>>()?;
        Ok(())
    }

    fn piece(&self, whole: &Value, table: &DeTable, stretches: &mut Vec<Stretch>) -> Found<()> {
        let missing = |of, keys| Fault { at: whole.span(), problem: Problem::Missing { of, keys } };
        let kind = table.get("kind").ok_or_else(|| missing("a piece of the shape", &["kind"]))?;
        let Some((of, keys)) = KINDS.iter().find(|(known, _)| kind.get_ref().as_str() == Some(known)) else {
            let words = "\"straight\", \"arc\", \"helix\" or \"points\"";
            return self.refused("kind", kind, Needed::Such(words));
        };
        for (key, at, _) in entries(table) {
            if !keys.contains(&key) {
                return Err(unknown("", key, at, keys.iter().map(|key| (*key).to_owned()).collect()));
            }
        }
        let number = |key: &str, allowed: Allowed| {
            table.get(key).map(|value| self.number(key, value, Kind::Real, allowed)).transpose()
        };
        let needed =
            |keys: &'static [&'static str], allowed| number(keys[0], allowed)?.ok_or_else(|| missing(of, keys));
        let one_of = |keys: &'static [&'static str; 2]| match (table.get(keys[0]), table.get(keys[1])) {
            (Some(_), Some(second)) => Err(Fault { at: second.span(), problem: Problem::Both { keys: *keys } }),
            (None, None) => Err(missing(of, keys)),
            _ => Ok([number(keys[0], Allowed::Positive)?, number(keys[1], Allowed::Positive)?]),
        };
        // the curvature turns the tangent to where the centre lies
        let across = || match table.get("towards") {
            None => Ok(Vec3::y()),
            Some(value) => {
                let [d_1, d_2] = self.numbers("towards", value)?;
                let across = Vec3::new(-d_2, d_1, 0.0);
                let needed = Needed::Such("parts of d1 and d2, not both 0");
                if across.norm() > 0.0 { Ok(across.normalize()) } else { self.refused("towards", value, needed) }
            }
        };
        match *of {
            "straight" => {
                let length = needed(&["length"], Allowed::Positive)?;
                stretches.push(Stretch { length, turn: Vec3::zeros() });
            }
            "arc" => {
                let curvature = match one_of(&["radius", "curvature"])? {
                    [Some(radius), _] => 1.0 / radius,
                    [_, curvature] => curvature.unwrap_or_default(),
                };
                let [degrees, length] = one_of(&["degrees", "length"])?;
                let (length, angle) = match degrees {
                    Some(degrees) => (degrees.to_radians() / curvature, degrees.to_radians()),
                    None => (length.unwrap_or_default(), length.unwrap_or_default() * curvature),
                };
                stretches.push(Stretch { length, turn: across()? * angle });
            }
            "helix" => {
                let radius = needed(&["radius"], Allowed::Positive)?;
                let rise = needed(&["pitch"], Allowed::NonNegative)? / TAU;
                let angle = TAU * needed(&["turns"], Allowed::Positive)?;
                let hand = match table.get("hand") {
                    Some(value) => match value.get_ref().as_str() {
                        Some("right") => 1.0,
                        Some("left") => -1.0,
                        _ => return self.refused("hand", value, Needed::Such("\"right\" or \"left\"")),
                    },
                    None => 1.0,
                };
                // curvature r/c² and torsion p/c² along c for each radian about the axis
                let way = radius.hypot(rise);
                let turn = (across()? * radius + Vec3::z() * (hand * rise)) * (angle / way);
                stretches.push(Stretch { length: way * angle, turn });
            }
            _ => {
                stretches.extend(self.curve(table).map_err(|fault| fault.unwrap_or_else(|| missing(of, &["points"])))?)
            }
        }
        Ok(())
    }

    /// Of a piece through points; without points there is no fault to point at.
    fn curve(&self, table: &DeTable) -> Result<Vec<Stretch>, Option<Fault>> {
        let value = table.get("points").ok_or(None)?;
        let rows = match value.get_ref() {
            DeValue::Array(rows) => rows,
            _ => return self.refused("points", value, Needed::Such("[[x, y, z], ...]")).map_err(Some),
        };
        let points: Result<Vec<Vec3>, Fault> =
            rows.iter().map(|row| self.numbers("points", row).map(Vec3::from)).collect();
        let d_1 = table.get("d1").map(|value| self.numbers("d1", value).map(Vec3::from)).transpose()?;
        let curve = Curve::through(&points?, d_1).map_err(|problem| {
            let at = match problem {
                NoCurve::Same { point } | NoCurve::TurnsBack { point } => rows.get(point).map(Spanned::span),
                NoCurve::Along => table.get("d1").map(Spanned::span),
                NoCurve::TooFew => None,
            };
            Fault { at: at.unwrap_or(value.span()), problem: Problem::NoCurve(problem) }
        })?;
        let Model { parameters, experiment, .. } = &self.model;
        let tolerance = if parameters.tolerance > 0.0 { parameters.tolerance } else { experiment.tolerance };
        Ok(curve.stretches(SHARE * tolerance))
    }

    fn numbers<const N: usize>(&self, key: &str, value: &Value) -> Found<[f64; N]> {
        let numbers = match value.get_ref() {
            DeValue::Array(values) if values.len() == N => values,
            _ => return self.refused(key, value, Needed::Numbers(N)),
        };
        let mut found = [0.0; N];
        for (found, value) in found.iter_mut().zip(numbers.iter()) {
            *found = self.number(key, value, Kind::Real, Allowed::Finite)?;
        }
        Ok(found)
    }
}
