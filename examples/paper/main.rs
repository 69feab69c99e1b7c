//! The seven examples of section 5 of the paper, its claims measured, and the map of where the methods end: runs them,
//! draws them, and prints what can be checked of each. What came of it is in `examples/README.md`.
//!
//! `cargo run --release --example paper [-- names]` writes to `target/paper/`; without names it runs everything and puts
//! the examples on one sheet, arranged like the paper's Figure 1.

mod buckling;
mod claims;
mod draw;
mod hair;
mod helix;
mod pull;
mod report;
mod scene;
mod sine;
mod spring;
mod stability;
mod torque;
mod tress;

use clap::{Parser, ValueEnum};
use draw::Picture;
use indicatif::{ProgressBar, ProgressStyle};
use report::Example;
use std::error::Error;
use std::fs;
use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

/// The examples of section 5 of Sobottka, Lay and Weber (2008).
#[derive(Parser)]
struct Arguments {
    /// Which; all if none is named.
    names: Vec<Name>,
}

#[derive(Clone, Copy, PartialEq, Eq, ValueEnum)]
enum Name {
    /// 1: a sine-shaped rod released under gravity.
    #[value(alias = "1")]
    Sine,
    /// 2: a helical rod under a changing end load.
    #[value(alias = "2")]
    Helix,
    /// 3: a straight rod under an end torque.
    #[value(alias = "3")]
    Torque,
    /// 4: a coil spring, pulled and released.
    #[value(alias = "4")]
    Spring,
    /// 5: buckling under an axial torque.
    #[value(alias = "5")]
    Buckling,
    /// 6: a hair tress, drawn out and let go.
    #[value(alias = "6")]
    Pull,
    /// 7: a hair tress under gravity.
    #[value(alias = "7")]
    Hair,
    /// What the paper claims, measured.
    Claims,
    /// The stability map.
    Stability,
    /// The seven examples, on one sheet.
    Sheet,
}

impl Name {
    /// The examples as they stand on the sheet, row by row.
    const SHEET: [&[Self]; 3] =
        [&[Self::Sine, Self::Helix, Self::Torque], &[Self::Spring, Self::Buckling], &[Self::Pull, Self::Hair]];
    /// What is drawn by itself.
    const OTHERS: [Self; 2] = [Self::Claims, Self::Stability];

    fn run(self, bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
        match self {
            Self::Sine => sine::run(bar),
            Self::Helix => helix::run(bar),
            Self::Torque => torque::run(bar),
            Self::Spring => spring::run(bar),
            Self::Buckling => buckling::run(bar),
            Self::Pull => pull::run(bar),
            Self::Hair => hair::run(bar),
            Self::Claims => claims::run(bar),
            Self::Stability => stability::run(bar),
            Self::Sheet => Err("a sheet is no example".into()),
        }
    }
}

fn main() -> ExitCode {
    match run(&Arguments::parse().names) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error) => {
            eprintln!("paper: {error}");
            ExitCode::FAILURE
        }
    }
}

fn run(names: &[Name]) -> Result<(), Box<dyn Error>> {
    let folder = Path::new(env!("CARGO_MANIFEST_DIR")).join("target/paper");
    fs::create_dir_all(&folder)?;
    let wanted = |name: Name| names.is_empty() || names.contains(&name);
    let mut rows: Vec<Vec<Example>> = Vec::new();
    for row in Name::SHEET {
        let shown = row.iter().filter(|name| wanted(**name) || wanted(Name::Sheet));
        rows.push(shown.map(|name| make(*name, &folder)).collect::<Result<_, _>>()?);
    }
    if wanted(Name::Sheet) {
        let pictures: Vec<Vec<&Picture>> =
            rows.iter().map(|row| row.iter().map(|example| &example.picture).collect()).collect();
        report::write_picture(&folder, "sheet", &Picture::sheet(&pictures))?;
    }
    for name in Name::OTHERS.into_iter().filter(|name| wanted(*name)) {
        make(name, &folder)?;
    }
    println!("{}", folder.display());
    Ok(())
}

/// Runs one, writes what it made, and prints its numbers.
fn make(name: Name, folder: &Path) -> Result<Example, Box<dyn Error>> {
    let label = name.to_possible_value().map_or(String::new(), |value| value.get_name().to_owned());
    let style = ProgressStyle::with_template("{msg:10} {bar:40} {percent:>3} %  {elapsed}")?;
    let bar = ProgressBar::no_length().with_style(style).with_message(label);
    let begin = Instant::now();
    let example = name.run(&bar)?;
    bar.finish_and_clear();
    example.write(folder)?;
    println!("{}, {:.1} s\n{}", example.name, begin.elapsed().as_secs_f64(), example.numbers);
    Ok(example)
}
