//! `cosserat chart`: error over CPU time, of the built-in scenes or of the user's own rod, and what follows from it:
//! which settings to use for which accuracy, and how other codes compare.

mod draw;
mod front;
mod method;
mod scenes;
mod search;

use super::page;
use super::simulate::Experiment;
use front::{Comparison, Kind, Measure, Point};
use scenes::Scene;
use search::{Outcome, Problem, Reference};
use std::error::Error;
use std::fmt::Write as _;
use std::io::{self, Write as _};
use std::path::{Path, PathBuf};

/// Which scene, and against what.
#[derive(clap::Args)]
pub struct Arguments {
    /// A built-in scene, or `all`; without it, they are listed.
    scene: Option<String>,
    /// In place of a scene, a rod of your own: a CSV of inputs as `simulate` takes it, at whose rows the unit
    /// communicates.
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scene", "reference"])]
    inputs: Option<PathBuf>,
    /// Sets a parameter of that rod, or the start value of an input, as in `simulate`. Cells, stages, step and tolerance
    /// vary unless set.
    #[arg(short, long, value_name = "NAME=VALUE", requires = "inputs")]
    set: Vec<String>,
    /// What errors are taken against. Without it, benches/peers/reference/SCENE.json if there is one, else the finest run.
    #[arg(long, value_name = "FILE", requires = "scene")]
    reference: Option<PathBuf>,
    /// The points of other codes, in a CSV like those written here; may be repeated.
    #[arg(long, value_name = "FILE")]
    with: Vec<PathBuf>,
    /// CPU time for a scene, s; what takes longer is left out.
    #[arg(long, value_name = "TIME", default_value_t = 20.0)]
    budget: f64,
    /// Where to write a picture of all scenes that were run, SVG or (where the name ends in .png) PNG.
    #[arg(long, value_name = "FILE")]
    overview: Option<PathBuf>,
    /// Where to write a picture of how the tolerances were met, and at what cost.
    #[arg(long, value_name = "FILE")]
    calibration: Option<PathBuf>,
}

/// Where tables and pictures go.
const FOLDER: &str = "target/chart";
/// Where references are looked for.
const REFERENCES: &str = "benches/peers/reference";
/// Accuracies to give settings for.
const LEVELS: [f64; 5] = [1e-2, 1e-3, 1e-4, 1e-5, 1e-6];

/// A scene and what was found.
struct Chart {
    name: String,
    /// In a line.
    about: String,
    /// Whether the reaction is compared.
    reaction: bool,
    outcome: Outcome,
}

/// Runs it.
pub fn run(arguments: &Arguments) -> Result<(), Box<dyn Error>> {
    if !(arguments.budget.is_finite() && arguments.budget > 0.0) {
        return Err(format!("--budget {} is not allowed: finite and > 0", arguments.budget).into());
    }
    let mut others = Vec::new();
    for path in &arguments.with {
        others.extend(Point::read(path)?);
    }
    let charts = match (&arguments.inputs, arguments.scene.as_deref()) {
        (Some(inputs), _) => vec![own(inputs, arguments, &others)?],
        (None, None) => {
            return Ok(write!(io::stdout(), "{}", list())?);
        }
        (None, Some("all")) if arguments.reference.is_some() => {
            return Err("--reference is of one scene, not of all".into());
        }
        (None, Some(name)) => {
            let scenes: Vec<Scene> =
                Scene::ALL.into_iter().filter(|scene| name == "all" || name == scene.name()).collect();
            if scenes.is_empty() {
                let known = Scene::ALL.map(Scene::name).join(", ");
                return Err(format!("{name} is no scene: {known}, or all").into());
            }
            scenes.into_iter().map(|scene| built_in(scene, arguments, &others)).collect::<Result<_, _>>()?
        }
    };
    if !others.is_empty() {
        let comparisons: Vec<Comparison> = charts.iter().flat_map(|chart| compare(chart, &others)).collect();
        let mut out = io::stdout().lock();
        let path = Path::new(FOLDER).join("ratios.csv");
        page::write(&path, &front::ratio_table(&comparisons)?)?;
        writeln!(out, "\n{}\n{}", markdown(&comparisons), path.display())?;
    }
    if let Some(path) = &arguments.overview {
        draw::overview(&charts, &others)?.write(path)?;
        writeln!(io::stdout(), "{}", path.display())?;
    }
    if let Some(path) = &arguments.calibration {
        draw::calibration(&charts)?.write(path)?;
        writeln!(io::stdout(), "{}", path.display())?;
    }
    Ok(())
}

fn list() -> String {
    Scene::ALL.iter().map(|scene| format!("{:10} {}\n", scene.name(), scene.about())).collect()
}

fn built_in(scene: Scene, arguments: &Arguments, others: &[Point]) -> Result<Chart, Box<dyn Error>> {
    let found = Path::new(REFERENCES).join(scene.name()).with_extension("json");
    let path = arguments.reference.clone().or_else(|| found.exists().then_some(found));
    let reference = path.map(|path| Reference::read(&path, scene.name())).transpose()?;
    let problem = Problem {
        name: scene.name().to_owned(),
        length: scene.parameters().length,
        reaction: scene.starts_at_rest(),
        methods: method::of_scene(scene),
    };
    chart(&problem, scene.about(), reference, arguments, others)
}

fn own(inputs: &Path, arguments: &Arguments, others: &[Point]) -> Result<Chart, Box<dyn Error>> {
    let experiment = Experiment::new(Some(inputs), None, &arguments.set, None, None)?;
    if experiment.steps() == 0 {
        return Err(format!("{}: one row only, nothing moves", inputs.display()).into());
    }
    let problem = Problem {
        name: inputs.file_stem().map_or_else(|| "own".to_owned(), |stem| stem.to_string_lossy().into_owned()),
        length: experiment.parameters.length,
        reaction: true,
        methods: method::of_unit(&experiment),
    };
    chart(&problem, &arguments.set.join(" "), None, arguments, others)
}

/// Searches, writes the table and the pictures, and prints what it says.
fn chart(
    problem: &Problem,
    about: &str,
    reference: Option<Reference>,
    arguments: &Arguments,
    others: &[Point],
) -> Result<Chart, Box<dyn Error>> {
    let outcome = search::search(problem, reference, arguments.budget)?;
    let chart = Chart { name: problem.name.clone(), about: about.to_owned(), reaction: problem.reaction, outcome };
    let path = |extension: &str| Path::new(FOLDER).join(&chart.name).with_extension(extension);
    page::write(&path("csv"), &front::table(&chart.outcome.points)?)?;
    let picture = draw::scene(&chart, others)?;
    for extension in ["svg", "png"] {
        picture.write(&path(extension))?;
    }
    writeln!(io::stdout(), "{}{}, .svg, .png\n", summary(&chart)?, path("csv").display())?;
    Ok(chart)
}

/// The front, the settings for each accuracy, and what was left out.
fn summary(chart: &Chart) -> Result<String, std::fmt::Error> {
    let Chart { name, about, reaction, outcome: Outcome { points, reference, notes } } = chart;
    let mut out = String::new();
    let known = |measure| format!("{} to {:.1e}", Measure::name(measure), reference.uncertainty(measure));
    let measures = if *reaction { &Measure::ALL[..] } else { &Measure::ALL[..1] };
    let known: Vec<String> = measures.iter().map(|&measure| known(measure)).collect();
    writeln!(out, "{name}: {about}")?;
    writeln!(out, "errors against {}, which is known {}", reference.source, known.join(", "))?;
    notes.iter().try_for_each(|note| writeln!(out, "{note}"))?;

    let fronts = [Measure::Tip, Measure::Reaction].map(|measure| front::front(points, measure));
    let on = |k: usize, point: &Point| fronts[k].iter().any(|other| std::ptr::eq(*other, point));
    let mut sorted: Vec<&Point> = points.iter().filter(|point| on(0, point) || on(1, point)).collect();
    sorted.sort_by(|a, b| a.cpu.total_cmp(&b.cpu));
    writeln!(out, "\n      CPU        tip   reaction  front of    setting")?;
    for point in sorted {
        let of = match (on(0, point), on(1, point)) {
            (true, true) => "both",
            (true, false) => "tip",
            _ => "reaction",
        };
        let error = |measure| point.error(measure).map_or("-".to_owned(), |error| format!("{error:.1e}"));
        let (tip, reaction) = (error(Measure::Tip), error(Measure::Reaction));
        writeln!(out, "{:>9} {tip:>10} {reaction:>10}  {of:8}    {}", duration(point.cpu), point.setting)?;
    }
    for &measure in measures {
        writeln!(out, "\n{} error     CPU    setting", measure.name())?;
        for level in LEVELS {
            let best = points.iter().filter(|point| point.error(measure).is_some_and(|error| error <= level));
            let best = best.min_by(|a, b| a.cpu.total_cmp(&b.cpu));
            match best {
                _ if level < reference.uncertainty(measure) => {
                    writeln!(out, "{level:>9.0e}       -    not known by the reference")?
                }
                None => writeln!(out, "{level:>9.0e}       -    not reached")?,
                Some(point) => writeln!(out, "{level:>9.0e} {:>9}    {}", duration(point.cpu), point.setting)?,
            }
        }
    }
    writeln!(out, "\ntolerance        tip    time over that of the cheapest cells and steps given")?;
    for (point, tolerance) in points.iter().filter_map(|point| Some((point, point.tolerance?))) {
        let error = point.tip_error.map_or("-".to_owned(), |error| format!("{error:.1e}"));
        let times = point.over_cheapest.map_or("-".to_owned(), |times| format!("{times:.2}"));
        writeln!(out, "{tolerance:>9.0e} {error:>10}    {times}")?;
    }
    Ok(out)
}

/// Three digits, with a unit.
fn duration(seconds: f64) -> String {
    let (value, unit) = match seconds {
        1.0.. => (seconds, "s"),
        1e-3.. => (1e3 * seconds, "ms"),
        _ => (1e6 * seconds, "µs"),
    };
    let decimals = (2.0 - value.log10().floor()).clamp(0.0, 2.0);
    format!("{value:.*} {unit}", decimals as usize)
}

fn compare(chart: &Chart, others: &[Point]) -> Vec<Comparison> {
    let Outcome { points, reference, .. } = &chart.outcome;
    front::compare(points, others, &chart.name, |measure| reference.uncertainty(measure))
}

/// CPU time of the fastest other code of each kind over ours.
fn markdown(comparisons: &[Comparison]) -> String {
    let mut out = String::from("| scene | error | ours | spatial / ours | planar / ours | strain modes / ours |\n");
    out.push_str("|---|---|---|---|---|---|\n");
    for Comparison { scene, measure, level, cpu, ratios } in comparisons {
        let cell = |kind: Kind| {
            let found = ratios.iter().find(|ratio| ratio.kind == kind);
            found.map_or("–".to_owned(), |ratio| format!("{:.2} ({})", ratio.ratio, ratio.code))
        };
        let ours = cpu.map_or("not reached".to_owned(), duration);
        let [spatial, planar, strain] = Kind::ALL.map(cell);
        let measure = measure.name();
        // nothing fails that writes to a string
        let _ = writeln!(out, "| {scene} | {measure} {level:e} | {ours} | {spatial} | {planar} | {strain} |");
    }
    out
}
