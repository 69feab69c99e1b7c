//! What a run leaves: samples of tip and reaction, their errors against a reference, and the files of both.

use crate::dense::TILE;
use crate::planar::Planar;
use crate::rule::Rule;
use crate::scenes::{SAMPLES, Scene};
use crate::spatial::Spatial;
use crate::time::{Motion, RungeKutta};
use cpu_time::ProcessTime;
use serde_json::Value;
use std::fmt::Write;

/// Gauss points of an element beyond its modes, in the plane. With none the mass matrix is not integrated: the error is
/// three times as large, and the steps are a third of what they are with two. More change little.
pub const EXTRA_PLANAR: usize = 2;
/// The same in space, where with two the error is still three times what it is with four.
pub const EXTRA_SPATIAL: usize = 4;

/// 101 samples of a scene.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Record {
    /// World, m.
    pub tip: Vec<[f64; 3]>,
    /// Of the rod on its base, N.
    pub force: Vec<[f64; 3]>,
}

/// A run: its samples and the process time of its steps.
#[derive(Clone, Debug, Default)]
pub struct Run {
    /// The samples.
    pub record: Record,
    /// s, without the set-up.
    pub cpu: f64,
    /// Whether all numbers are.
    pub finite: bool,
}

/// The rod of a scene with `modes` a component.
pub fn motion(scene: &Scene, modes: usize, cuts: &[f64]) -> Box<dyn Motion> {
    let extra = if scene.planar { EXTRA_PLANAR } else { EXTRA_SPATIAL };
    let rule = Rule::new(scene.length, cuts, modes, extra);
    let padded = modes.next_multiple_of(TILE);
    let more = rule.points.len().next_multiple_of(TILE) - padded;
    macro_rules! planar {
        ($($m:literal)*) => {
            match (padded, more) {
                $(($m, 0) => Box::new(Planar::<$m, $m>::new(scene, &rule)) as Box<dyn Motion>,
                ($m, 4) => Box::new(Planar::<{ $m + 4 }, $m>::new(scene, &rule)),
                ($m, 8) => Box::new(Planar::<{ $m + 8 }, $m>::new(scene, &rule)),)*
                _ => panic!("more modes than are compiled in"),
            }
        };
    }
    macro_rules! spatial {
        ($($m:literal)*) => {
            match (padded, more) {
                $(($m, 4) => {
                    Box::new(Spatial::<{ $m + 4 }, $m, { 2 * ($m + 4) }, { 3 * $m }>::new(scene, &rule)) as Box<dyn Motion>
                })*
                _ => panic!("more modes than are compiled in"),
            }
        };
    }
    if scene.planar { planar!(4 8 12 16 20 24 28 32 36 40 48) } else { spatial!(4 8 12 16 20 24 32) }
}

/// Steps between two samples, none longer than `dt`, and their length, s.
pub fn step(scene: &Scene, dt: f64) -> (usize, f64) {
    let span = scene.duration / SAMPLES as f64;
    let count = (span / dt * (1.0 - 1e-9)).ceil();
    (count as usize, span / count)
}

/// Runs a scene with steps of at most `dt` s that end on the samples.
pub fn run(scene: &Scene, modes: usize, cuts: &[f64], dt: f64) -> Run {
    let mut motion = motion(scene, modes, cuts);
    let mut y = motion.start();
    let mut steps = RungeKutta::new(y.len());
    let span = scene.duration / SAMPLES as f64;
    let (count, h) = step(scene, dt);
    let mut run = Run::default();
    let sample = |motion: &mut dyn Motion, run: &mut Run, t: f64, y: &[f64]| {
        let (tip, force) = motion.sample(t, y);
        run.record.tip.push(tip);
        run.record.force.push(force);
        run.finite = tip.iter().chain(&force).all(|x| x.is_finite() && x.abs() < 1e9);
        run.finite
    };
    let start = ProcessTime::now();
    sample(&mut *motion, &mut run, 0.0, &y);
    for i in 0..SAMPLES {
        let t = i as f64 * span;
        for i in 0..count {
            steps.step(&mut *motion, t + i as f64 * h, &mut y, h);
        }
        if !sample(&mut *motion, &mut run, t + span, &y) {
            break;
        }
    }
    run.cpu = start.elapsed().as_secs_f64();
    run
}

/// [`run`], and the least of three times where one takes less than a second.
pub fn timed(scene: &Scene, modes: usize, cuts: &[f64], dt: f64) -> Run {
    let mut first = run(scene, modes, cuts, dt);
    let mut repeats = 2;
    while repeats > 0 && first.finite && first.cpu < 1.0 {
        first.cpu = first.cpu.min(run(scene, modes, cuts, dt).cpu);
        repeats -= 1;
    }
    first
}

impl Record {
    /// Tip error over the length and reaction error over the largest reaction, RMS over all samples.
    pub fn errors(&self, reference: &Self, length: f64) -> (f64, f64) {
        let distance = |(a, b): (&[f64; 3], &[f64; 3])| (0..3).map(|c| (a[c] - b[c]).powi(2)).sum::<f64>();
        let rms = |a: &[[f64; 3]], b: &[[f64; 3]]| (a.iter().zip(b).map(distance).sum::<f64>() / b.len() as f64).sqrt();
        if self.tip.len() != reference.tip.len() {
            return (f64::INFINITY, f64::INFINITY);
        }
        let zero = [0.0; 3];
        let peak = reference.force.iter().map(|f| distance((f, &zero)).sqrt()).fold(0.0, f64::max);
        (rms(&self.tip, &reference.tip) / length, rms(&self.force, &reference.force) / peak)
    }

    /// From a file with "tip" and "base_force".
    pub fn read(path: &str) -> Self {
        let text = std::fs::read_to_string(path).unwrap_or_else(|error| panic!("{path}: {error}"));
        let value: Value = serde_json::from_str(&text).expect("JSON");
        let number = |x: &Value| x.as_f64().unwrap_or(f64::NAN);
        let vectors = |name: &str| -> Vec<[f64; 3]> {
            let list = value[name].as_array().map_or(&[][..], |list| list);
            list.iter().map(|v| std::array::from_fn(|c| number(&v[c]))).collect()
        };
        Self { tip: vectors("tip"), force: vectors("base_force") }
    }

    /// The samples as JSON lists, one a line, to ten digits.
    pub fn lists(&self) -> String {
        let list = |name: &str, vectors: &[[f64; 3]]| {
            let lines: Vec<String> = vectors.iter().map(|v| format!("[{}]", v.map(digits).join(","))).collect();
            format!("\"{name}\":[\n{}]", lines.join(",\n"))
        };
        let mut text = list("tip", &self.tip);
        write!(text, ",\n{}", list("base_force", &self.force)).expect("a string");
        text
    }
}

/// Ten significant digits, as short as they go.
pub fn digits(x: f64) -> String {
    if !x.is_finite() {
        return "null".into();
    }
    let rounded: f64 = format!("{x:.9e}").parse().expect("a number");
    let (plain, scientific) = (format!("{}", rounded + 0.0), format!("{:e}", rounded + 0.0));
    if plain.len() <= scientific.len() { plain } else { scientific }
}
