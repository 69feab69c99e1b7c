//! Points of error and CPU time, the fronts among them, and one code against another.

use std::error::Error;
use std::path::Path;

/// Whose error.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Measure {
    /// Of the tip's position, relative to the length.
    Tip,
    /// Of the force on the base, relative to its peak.
    Reaction,
}

impl Measure {
    pub const ALL: [Self; 2] = [Self::Tip, Self::Reaction];

    pub fn name(self) -> &'static str {
        match self {
            Self::Tip => "tip",
            Self::Reaction => "reaction",
        }
    }
}

/// A run of a code on a scene.
#[derive(Clone, Debug, Default)]
pub struct Point {
    pub scene: String,
    pub code: String,
    /// `spatial` or `planar`.
    pub kind: String,
    pub setting: String,
    /// s.
    pub cpu: f64,
    /// Root mean squares over the samples; none where nothing is compared.
    pub tip_error: Option<f64>,
    pub reaction_error: Option<f64>,
    /// What the code was asked for, if that and nothing else.
    pub tolerance: Option<f64>,
    /// The time of that over the time of the cheapest cells and steps that the unit may be given and that are as accurate.
    pub over_cheapest: Option<f64>,
}

/// The columns of its tables; a tolerance is in the setting.
const HEADER: [&str; 7] = ["scene", "code", "kind", "setting", "cpu_s", "tip_error", "reaction_error"];

impl Point {
    pub fn error(&self, measure: Measure) -> Option<f64> {
        match measure {
            Measure::Tip => self.tip_error,
            Measure::Reaction => self.reaction_error,
        }
    }

    /// The points of a table; runs that failed have no time or no error there, and are left out.
    pub fn read(path: &Path) -> Result<Vec<Self>, Box<dyn Error>> {
        let name = path.display();
        let mut reader = csv::Reader::from_path(path).map_err(|error| format!("{name}: {error}"))?;
        let header = reader.headers().map_err(|error| format!("{name}: {error}"))?;
        if header.iter().ne(HEADER) {
            return Err(format!("{name}: the header is not {}", HEADER.join(",")).into());
        }
        let mut points = Vec::new();
        for record in reader.records() {
            let record = record.map_err(|error| format!("{name}: {error}"))?;
            let line = record.position().map_or(0, csv::Position::line);
            let number = |column: usize| match record[column].trim() {
                "" => Ok(None),
                text => match text.parse::<f64>() {
                    Ok(value) if value.is_finite() && value > 0.0 => Ok(Some(value)),
                    _ => {
                        Err(format!("{name}, line {line}: {} = {text} is not allowed: finite and > 0", HEADER[column]))
                    }
                },
            };
            let (cpu, tip_error, reaction_error) = (number(4)?, number(5)?, number(6)?);
            let [scene, code, kind, setting] = [0, 1, 2, 3].map(|column| record[column].to_owned());
            if let Some(cpu) = cpu.filter(|_| tip_error.is_some() || reaction_error.is_some()) {
                let own = Self { scene, code, kind, setting, cpu, tip_error, reaction_error, ..Self::default() };
                points.push(own);
            }
        }
        Ok(points)
    }
}

/// The table of the points.
pub fn table(points: &[Point]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(HEADER)?;
    for point in points {
        let error = |error: Option<f64>| error.map_or(String::new(), |error| format!("{error:.3e}"));
        let numbers = [format!("{:.3e}", point.cpu), error(point.tip_error), error(point.reaction_error)];
        let words = [&point.scene, &point.code, &point.kind, &point.setting];
        writer.write_record(words.into_iter().chain(&numbers))?;
    }
    Ok(writer.into_inner()?)
}

/// The points that no cheaper one beats: time rises, error falls.
pub fn front<'a>(points: impl IntoIterator<Item = &'a Point>, measure: Measure) -> Vec<&'a Point> {
    let mut sorted: Vec<(f64, &Point)> =
        points.into_iter().filter_map(|point| Some((point.error(measure)?, point))).collect();
    sorted.sort_by(|(a, p), (b, q)| p.cpu.total_cmp(&q.cpu).then(a.total_cmp(b)));
    let mut least = f64::INFINITY;
    sorted.retain(|(error, _)| {
        let better = *error < least;
        least = least.min(*error);
        better
    });
    sorted.into_iter().map(|(_, point)| point).collect()
}

/// CPU time for an error, s: between the points of the front as powers, and at an easier one than they have, the time of
/// the cheapest.
pub fn time_at(front: &[&Point], measure: Measure, level: f64) -> Option<f64> {
    let error = |point: &Point| point.error(measure).unwrap_or(f64::INFINITY);
    let after = front.iter().position(|point| error(point) <= level)?;
    let fine = front[after];
    let Some(coarse) = after.checked_sub(1).map(|before| front[before]) else { return Some(fine.cpu) };
    let part = (error(coarse) / level).ln() / (error(coarse) / error(fine)).ln();
    Some(coarse.cpu * (fine.cpu / coarse.cpu).powf(part))
}

/// What a code is to be compared as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Kind {
    Spatial,
    Planar,
    StrainModes,
}

impl Kind {
    pub const ALL: [Self; 3] = [Self::Spatial, Self::Planar, Self::StrainModes];

    pub fn of(point: &Point) -> Self {
        match (point.code.starts_with("strain modes"), &*point.kind) {
            (true, _) => Self::StrainModes,
            (false, "planar") => Self::Planar,
            (false, _) => Self::Spatial,
        }
    }

    pub fn name(self) -> &'static str {
        match self {
            Self::Spatial => "spatial",
            Self::Planar => "planar",
            Self::StrainModes => "strain modes",
        }
    }
}

/// The codes among the points, each once, in the order of their kinds.
pub fn codes(points: &[Point]) -> Vec<(&str, Kind)> {
    let mut codes: Vec<(&str, Kind)> = Vec::new();
    for point in points {
        if !codes.iter().any(|(code, _)| *code == point.code) {
            codes.push((&point.code, Kind::of(point)));
        }
    }
    codes.sort_by_key(|(_, kind)| Kind::ALL.iter().position(|other| other == kind));
    codes
}

/// The time of the fastest code of a kind over ours, at an error: in space, over that of our rod in space.
pub struct Ratio {
    pub kind: Kind,
    pub code: String,
    /// Its time and ours, s.
    pub cpu: [f64; 2],
    pub ratio: f64,
}

/// Ours at an error, and what others take for it.
pub struct Comparison {
    pub scene: String,
    pub measure: Measure,
    pub level: f64,
    /// s; none where we do not reach it.
    pub cpu: Option<f64>,
    pub ratios: Vec<Ratio>,
}

/// At every level that the references, known to `uncertainty`, can tell.
pub fn compare(ours: &[Point], others: &[Point], scene: &str, uncertainty: impl Fn(Measure) -> f64) -> Vec<Comparison> {
    let others: Vec<Point> = others.iter().filter(|point| point.scene == scene).cloned().collect();
    let mut comparisons = Vec::new();
    for (measure, levels) in [(Measure::Tip, &[1e-2, 1e-3, 1e-4, 1e-5][..]), (Measure::Reaction, &[1e-2, 1e-3, 1e-4])] {
        let own = front(ours, measure);
        let in_space = front(ours.iter().filter(|point| point.kind == "spatial"), measure);
        for &level in levels.iter().filter(|&&level| !own.is_empty() && level >= 3.0 * uncertainty(measure)) {
            let cpu = time_at(&own, measure, level);
            let times = codes(&others).into_iter().filter_map(|(code, kind)| {
                let theirs = front(others.iter().filter(|point| point.code == code), measure);
                Some((kind, code, time_at(&theirs, measure, level)?))
            });
            let times: Vec<(Kind, &str, f64)> = times.collect();
            let fastest = |kind| times.iter().filter(move |time| time.0 == kind).min_by(|a, b| a.2.total_cmp(&b.2));
            let ratio = |kind| {
                let &(kind, code, time) = fastest(kind)?;
                let own = if kind == Kind::Spatial { time_at(&in_space, measure, level)? } else { cpu? };
                Some(Ratio { kind, code: code.to_owned(), cpu: [time, own], ratio: time / own })
            };
            let ratios = Kind::ALL.into_iter().filter_map(ratio).collect();
            comparisons.push(Comparison { scene: scene.to_owned(), measure, level, cpu, ratios });
        }
    }
    comparisons
}

/// One line for every code compared.
pub fn ratio_table(comparisons: &[Comparison]) -> Result<Vec<u8>, Box<dyn Error>> {
    let mut writer = csv::Writer::from_writer(Vec::new());
    writer.write_record(["scene", "measure", "level", "cpu_s", "kind", "code", "code_cpu_s", "ratio"])?;
    for Comparison { scene, measure, level, ratios, .. } in comparisons {
        for Ratio { kind, code, cpu: [theirs, ours], ratio } in ratios {
            let numbers = [format!("{theirs:.3e}"), format!("{ratio:.3}")];
            let words = [scene, measure.name(), &format!("{level:e}"), &format!("{ours:.3e}"), kind.name(), code];
            writer.write_record(words.into_iter().chain(numbers.iter().map(String::as_str)))?;
        }
    }
    Ok(writer.into_inner()?)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn points(numbers: &[(f64, f64)]) -> Vec<Point> {
        numbers.iter().map(|&(cpu, error)| Point { cpu, tip_error: Some(error), ..Point::default() }).collect()
    }

    #[test]
    fn a_front_falls_and_is_read_between_its_points() {
        let points = points(&[(4.0, 1e-4), (1.0, 1e-2), (2.0, 2e-2), (1.0, 3e-2), (8.0, 1e-4), (16.0, 1e-6)]);
        let front = front(&points, Measure::Tip);
        let costs: Vec<f64> = front.iter().map(|point| point.cpu).collect();
        assert_eq!(costs, [1.0, 4.0, 16.0]);
        let time = |level| time_at(&front, Measure::Tip, level);
        assert_eq!((time(1e-1), time(1e-2), time(1e-7)), (Some(1.0), Some(1.0), None));
        assert!((time(1e-3).unwrap() - 2.0).abs() < 1e-12 && (time(1e-6).unwrap() - 16.0).abs() < 1e-12);
    }
}
