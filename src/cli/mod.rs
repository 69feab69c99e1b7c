//! The sub-commands, one file or folder each, and what they share. Only the program carries them, not the unit.

pub mod chart;
pub mod check;
pub mod demo;
pub mod info;
pub mod modes;
mod page;
mod picture;
pub mod simulate;

use cosserat_rod::fmi2::model::Model;
use cosserat_rod::fmi2::variables::{self, Kind, Variable};
use cosserat_rod::package::rod_file;
use cosserat_rod::unit::{Inputs, Parameters};
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::fmt;
use std::path::Path;
use std::time::{Duration, Instant};

/// Why a value given in words cannot be taken.
#[derive(Debug)]
pub enum Error {
    /// No `=` in the argument of `--set`.
    NoAssignment { text: String },
    /// Nothing that may be set has this name.
    Unknown { name: String },
    /// An array needs as many values as it has elements.
    Length { name: &'static str, given: usize, needed: usize },
    /// The text does not stand for a value of this type.
    NotAValue { name: String, text: String, kind: Kind },
    /// A value that is not allowed.
    NotAllowed { variable: Variable, value: f64 },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAssignment { text } => write!(f, "--set {text}: not of the form name=value"),
            Self::Unknown { name } => {
                write!(f, "{name} is no parameter or input of the unit:")?;
                let settable = variables::ROWS.iter().map(|row| Variable { row, element: 0 });
                for (k, variable) in settable.filter(|variable| !variable.is_output()).enumerate() {
                    write!(f, "{} {}", if k == 0 { "" } else { "," }, variable.row)?;
                }
                Ok(())
            }
            Self::Length { name, given, needed } => {
                write!(f, "{name} has {needed} elements, but {given} values are given")
            }
            Self::NotAValue { name, text, kind } => {
                let needed = match kind {
                    Kind::Boolean => "true or false",
                    Kind::Integer => "a whole number",
                    Kind::Real | Kind::String => "a number",
                };
                write!(f, "{name} = {text} is not allowed: {needed}")
            }
            Self::NotAllowed { variable, value } => {
                write!(f, "{variable} = {value} is not allowed: {}", variable.allowed())
            }
        }
    }
}

impl std::error::Error for Error {}

/// Parameters and the start values of inputs, from the file of `--rod` and the arguments of `--set`.
pub fn settings(rod: Option<&Path>, arguments: &[String]) -> Result<(Parameters, Inputs), Box<dyn std::error::Error>> {
    let Model { mut parameters, mut inputs, .. } = rod.map(rod_file::read).transpose()?.unwrap_or_default();
    let known = variables::all();
    for text in arguments {
        let (name, value) = text.split_once('=').ok_or_else(|| Error::NoAssignment { text: text.clone() })?;
        let (name, value) = (name.trim(), value.trim());
        let mut set = |variable: &Variable, text: &str| -> Result<(), Error> {
            variable.set(&mut parameters, &mut inputs, parse(variable, text)?);
            Ok(())
        };
        let mut named = known.iter().filter(|variable| !variable.is_output());
        if let Some(variable) = named.clone().find(|variable| variable.to_string() == name) {
            set(variable, value)?;
            continue;
        }
        // a whole array at once
        let row = named.find(|variable| variable.row.name == name).map(|variable| variable.row);
        let row = row.ok_or_else(|| Error::Unknown { name: name.to_owned() })?;
        let values: Vec<&str> = value.split(',').map(str::trim).collect();
        let (given, needed) = (values.len(), row.components.len());
        if given != needed {
            return Err(Error::Length { name: row.name, given, needed }.into());
        }
        for (element, value) in values.into_iter().enumerate() {
            set(&Variable { row, element }, value)?;
        }
    }
    Ok((parameters, inputs))
}

/// The value of this variable that a text stands for.
fn parse(variable: &Variable, text: &str) -> Result<f64, Error> {
    let kind = variable.kind();
    let value = match (kind, text) {
        (Kind::Boolean, "true") => Some(1.0),
        (Kind::Boolean, "false") => Some(0.0),
        (Kind::Boolean | Kind::Integer, _) => text.parse::<i32>().ok().map(f64::from),
        (Kind::Real | Kind::String, _) => text.parse::<f64>().ok(),
    };
    match value {
        None => Err(Error::NotAValue { name: variable.to_string(), text: text.to_owned(), kind }),
        Some(value) if !variable.allowed().contains(value) => Err(Error::NotAllowed { variable: *variable, value }),
        Some(value) => Ok(value),
    }
}

/// A bar on the terminal for what takes longer than a second.
struct Progress {
    bar: ProgressBar,
    start: Instant,
    shown: bool,
}

impl Progress {
    fn new(steps: u64) -> Self {
        let bar = ProgressBar::with_draw_target(Some(steps), ProgressDrawTarget::hidden());
        if let Ok(style) = ProgressStyle::with_template("{bar:40} {percent:>3} %  {elapsed} of {duration}") {
            bar.set_style(style);
        }
        Self { bar, start: Instant::now(), shown: false }
    }

    /// One step more is done.
    fn step(&mut self) {
        if !self.shown && self.start.elapsed() > Duration::from_secs(1) {
            self.bar.set_draw_target(ProgressDrawTarget::stderr());
            self.shown = true;
        }
        self.bar.inc(1);
    }
}

impl Drop for Progress {
    fn drop(&mut self) {
        self.bar.finish_and_clear();
    }
}
