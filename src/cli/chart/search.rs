//! Which resolutions to run: from cheap to dear, as long as they gain and the budget lasts.

use super::front::{Measure, Point};
use super::method::{Method, Resolution, Run, Steps};
use nalgebra::Vector3;
use std::error::Error;
use std::fs;
use std::path::Path;

type Vec3 = Vector3<f64>;

/// What runs are held against.
#[derive(Clone)]
pub struct Reference {
    pub tip: Vec<Vec3>,
    pub reaction: Vec<Vec3>,
    /// By which it may be wrong itself, in the measures of the errors.
    pub tip_uncertainty: f64,
    pub reaction_uncertainty: f64,
    /// In words.
    pub source: String,
}

impl Reference {
    /// As `benches/peers/reference` has them.
    pub fn read(path: &Path, scene: &str) -> Result<Self, Box<dyn Error>> {
        let name = path.display();
        let text = fs::read_to_string(path).map_err(|error| format!("{name}: {error}"))?;
        let content: serde_json::Value = serde_json::from_str(&text).map_err(|error| format!("{name}: {error}"))?;
        if content["scene"].as_str() != Some(scene) {
            return Err(format!("{name}: not of the scene {scene}").into());
        }
        let number = |key: &str| content[key].as_f64().ok_or_else(|| format!("{name}: {key} is no number"));
        let vectors = |key: &str| -> Result<Vec<Vec3>, String> {
            let vector =
                |value: &serde_json::Value| Some(Vec3::new(value[0].as_f64()?, value[1].as_f64()?, value[2].as_f64()?));
            let values = content[key].as_array().and_then(|values| values.iter().map(vector).collect());
            values.ok_or_else(|| format!("{name}: {key} is no list of vectors"))
        };
        Ok(Self {
            tip: vectors("tip")?,
            reaction: vectors("base_force")?,
            tip_uncertainty: number("tip_uncertainty")?,
            reaction_uncertainty: number("force_uncertainty")?,
            source: name.to_string(),
        })
    }

    pub fn uncertainty(&self, measure: Measure) -> f64 {
        match measure {
            Measure::Tip => self.tip_uncertainty,
            Measure::Reaction => self.reaction_uncertainty,
        }
    }

    fn errors(&self, run: &Run, problem: &Problem) -> Errors {
        let peak = self.reaction.iter().map(Vec3::norm).fold(0.0, f64::max);
        Errors {
            tip: distance(&run.tip, &self.tip) / problem.length,
            reaction: problem.reaction.then(|| distance(&run.reaction, &self.reaction) / peak),
        }
    }
}

/// Root mean square.
fn distance(a: &[Vec3], b: &[Vec3]) -> f64 {
    let sum: f64 = a.iter().zip(b).map(|(a, b)| (a - b).norm_squared()).sum();
    (sum / b.len() as f64).sqrt()
}

#[derive(Clone, Copy)]
struct Errors {
    tip: f64,
    reaction: Option<f64>,
}

impl Errors {
    /// Whether both are far below what the reference can tell.
    fn unknown(&self, reference: &Reference) -> bool {
        let part = 1.0 / 3.0;
        self.tip < part * reference.tip_uncertainty
            && self.reaction.is_none_or(|error| error < part * reference.reaction_uncertainty)
    }

    /// Whether nothing is resolved yet, and a loss says nothing.
    fn coarse(&self) -> bool {
        self.tip > 0.02 || self.reaction.is_some_and(|error| error > 0.1)
    }
}

/// A rod and its motion, and the ways to integrate it.
pub struct Problem<'a> {
    pub name: String,
    /// m.
    pub length: f64,
    /// Whether its reaction is compared.
    pub reaction: bool,
    pub methods: Vec<Method<'a>>,
}

/// What was found.
pub struct Outcome {
    pub points: Vec<Point>,
    pub reference: Reference,
    /// What was left out, and why.
    pub notes: Vec<String>,
}

/// Below this a run is repeated, s.
const SHORT: f64 = 0.1;
const REPEATS: usize = 3;
/// How many are timed in turn with what chose its own, and how often: few µs are soon those of a cold cache.
const RIVALS: usize = 3;
const ROUNDS: usize = 9;
/// Of the budget, for a reference of our own, for the tolerances, and for the grids.
const FOR_REFERENCE: f64 = 0.5;
const FOR_TOLERANCES: f64 = 0.25;
const FOR_GRIDS: f64 = 0.75;
/// Factor of the errors above those of cheaper runs, from which on a run is not refined further; and the same where
/// nothing is resolved yet.
const FAR: f64 = 1.4;
const FAR_WHERE_COARSE: f64 = 2.0;

/// What was run, and what it took.
struct Ledger<'a, 'b> {
    problem: &'b Problem<'a>,
    budget: f64,
    spent: f64,
    done: Vec<(usize, Resolution, Run)>,
    failed: Vec<String>,
    /// How many, the cheapest of them and its time, s.
    skipped: Option<(usize, String, f64)>,
}

/// Proportional to the time of a grid.
fn work(resolution: Resolution) -> f64 {
    match resolution {
        Resolution::Grid { cells, stages, steps } => steps.fineness() * (cells + 1) as f64 * (stages as f64).powf(1.5),
        Resolution::Tolerance(_) => f64::INFINITY,
    }
}

impl Ledger<'_, '_> {
    fn find(&self, method: usize, resolution: Resolution) -> Option<&Run> {
        self.done.iter().find(|(m, r, _)| *m == method && *r == resolution).map(|(.., run)| run)
    }

    /// From the cheaper ones, s.
    fn predicted(&self, method: usize, resolution: Resolution) -> f64 {
        let own = self.done.iter().filter(|(m, ..)| *m == method);
        match resolution {
            Resolution::Grid { stages, .. } => {
                let grids = own.filter(|(_, r, _)| matches!(r, Resolution::Grid { .. }));
                let alike = |r: &Resolution| matches!(r, Resolution::Grid { stages: s, .. } if *s == stages);
                let (alike, others): (Vec<_>, Vec<_>) = grids.partition(|(_, r, _)| alike(r));
                let base = alike.last().or(others.last());
                base.map_or(0.0, |(_, r, run)| run.cpu * work(resolution) / work(*r))
            }
            Resolution::Tolerance(_) => {
                let times: Vec<f64> =
                    own.filter(|(_, r, _)| matches!(r, Resolution::Tolerance(_))).map(|(.., run)| run.cpu).collect();
                match times[..] {
                    [] => 0.0,
                    [only] => 4.0 * only,
                    [.., before, last] => last * (last / before).max(2.0),
                }
            }
        }
    }

    /// Runs it if `most`, s, lasts for it.
    fn take(&mut self, method: usize, resolution: Resolution, most: f64) {
        let predicted = self.predicted(method, resolution);
        let repeated = if predicted < SHORT { REPEATS as f64 * predicted } else { predicted };
        if self.spent + repeated > most {
            self.skip(resolution, predicted);
            return;
        }
        let solve = || (self.problem.methods[method].solve)(resolution);
        match solve() {
            Err(error) => self.failed.push(format!("{resolution}: {error}")),
            Ok(mut run) => {
                self.spent += run.cpu;
                for _ in 1..if run.cpu < SHORT { REPEATS } else { 1 } {
                    if let Ok(again) = solve() {
                        self.spent += again.cpu;
                        run.cpu = run.cpu.min(again.cpu);
                    }
                }
                self.done.push((method, resolution, run));
            }
        }
    }

    /// CPU time of what chose its own cells and steps to a tolerance, over that of the cheapest that the unit may be given and
    /// that are as accurate; none where `most`, s, does not last for it. The speed of a machine changes from one second to
    /// the next: those that seem the cheapest are run in turn with it.
    fn over_cheapest(&mut self, chosen: usize, errors: &[Errors], most: f64) -> Option<f64> {
        let Resolution::Tolerance(tolerance) = self.done[chosen].1 else { return None };
        let methods = &self.problem.methods;
        let is_given = |(method, resolution, _): &(usize, Resolution, Run)| {
            methods[*method].of_unit && matches!(resolution, Resolution::Grid { .. })
        };
        let enough = |&i: &usize| is_given(&self.done[i]) && errors[i].tip <= tolerance;
        let mut rivals: Vec<usize> = (0..self.done.len()).filter(enough).collect();
        rivals.sort_by(|&a, &b| self.done[a].2.cpu.total_cmp(&self.done[b].2.cpu));
        rivals.truncate(RIVALS);
        let solve = |i: usize| (methods[self.done[i].0].solve)(self.done[i].1).ok().map(|run| run.cpu);
        let mut largest: Option<f64> = None;
        for rival in rivals {
            let mut ratios = Vec::new();
            let round = self.done[chosen].2.cpu + self.done[rival].2.cpu;
            while ratios.len() < ROUNDS && self.spent + round <= most {
                self.spent += round;
                ratios.push(solve(chosen)? / solve(rival)?);
            }
            ratios.sort_by(f64::total_cmp);
            let median = ratios.get(ratios.len() / 2).copied();
            largest = if median > largest { median } else { largest };
        }
        largest
    }

    fn skip(&mut self, resolution: Resolution, time: f64) {
        let (count, setting, least) = self.skipped.take().unwrap_or((0, String::new(), f64::INFINITY));
        let cheaper = time < least;
        self.skipped = Some((count + 1, if cheaper { resolution.to_string() } else { setting }, least.min(time)));
    }

    /// The run, where the budget lasts for it.
    fn solved(&mut self, resolution: Resolution, most: f64) -> Option<Run> {
        if self.find(0, resolution).is_none() {
            self.take(0, resolution, most);
        }
        self.find(0, resolution).cloned()
    }

    /// The finest run of the first method that its part of the budget allows, where mesh and step are halved in turn,
    /// whichever changes the result more.
    fn finest(&mut self) -> Result<Reference, Box<dyn Error>> {
        let resolutions = &self.problem.methods[0].resolutions;
        let (cells, steps) = axes(resolutions);
        let cells: Vec<usize> = cells.into_iter().step_by(2).collect();
        let stages = resolutions.iter().filter_map(|resolution| match resolution {
            Resolution::Grid { stages, .. } => Some(*stages),
            Resolution::Tolerance(_) => None,
        });
        let stages = stages.max().unwrap_or(1);
        let most = FOR_REFERENCE * self.budget;
        let at = |[i, j]: [usize; 2]| Some(Resolution::Grid { cells: *cells.get(i)?, stages, steps: *steps.get(j)? });

        let mut place = [0, 0];
        // what is too coarse to be solved is refined in both
        let mut best = loop {
            let Some(resolution) = at(place) else { return Err(self.no_reference()) };
            match self.solved(resolution, most) {
                Some(run) => break run,
                None if self.skipped.is_some() => return Err(self.no_reference()),
                None => place = place.map(|size| size + 1),
            }
        };
        // the change of tip and reaction when mesh (step) was halved last; it is measured again after it was
        let (mut changes, mut measured) = ([None; 2], [false; 2]);
        loop {
            let solved_finer = |this: &mut Self, axis: usize| {
                let mut finer = place;
                finer[axis] += 1;
                Some((finer, this.solved(at(finer)?, most)?))
            };
            for axis in [0, 1] {
                if !measured[axis] {
                    measured[axis] = true;
                    if let Some((_, finer)) = solved_finer(self, axis) {
                        changes[axis] = Some(self.change(&best, &finer));
                    }
                }
            }
            let size = |axis: usize| changes[axis].map_or(0.0, |(tip, _)| tip);
            let axis = if size(0) > size(1) { 0 } else { 1 };
            let Some((finer, run)) = solved_finer(self, axis) else { break };
            (place, best, measured[axis]) = (finer, run, false);
        }
        let known: Vec<(f64, f64)> = changes.into_iter().flatten().collect();
        if known.is_empty() {
            return Err(self.no_reference());
        }
        Ok(Reference {
            tip_uncertainty: known.iter().map(|change| change.0).fold(0.0, f64::max),
            reaction_uncertainty: known.iter().map(|change| change.1).fold(0.0, f64::max),
            source: format!("the finest run, {}", best.setting),
            tip: best.tip,
            reaction: best.reaction,
        })
    }

    /// Of tip and reaction.
    fn change(&self, from: &Run, to: &Run) -> (f64, f64) {
        let peak = to.reaction.iter().map(Vec3::norm).fold(0.0, f64::max);
        (distance(&from.tip, &to.tip) / self.problem.length, distance(&from.reaction, &to.reaction) / peak)
    }

    fn no_reference(&self) -> Box<dyn Error> {
        let cause = self.failed.first().map_or(String::new(), |error| format!(": {error}"));
        format!("no two runs within the budget of {} s{cause}", self.budget).into()
    }
}

/// The cells and the steps of the grids, ascending.
fn axes(resolutions: &[Resolution]) -> (Vec<usize>, Vec<Steps>) {
    let (mut all_cells, mut all_steps) = (Vec::new(), Vec::new());
    for resolution in resolutions {
        if let Resolution::Grid { cells, steps, .. } = resolution {
            all_cells.push(*cells);
            all_steps.push(*steps);
        }
    }
    all_cells.sort_unstable();
    all_cells.dedup();
    all_steps.sort_by(|a, b| a.fineness().total_cmp(&b.fineness()));
    all_steps.dedup();
    (all_cells, all_steps)
}

/// What comes next on an axis.
fn after<T: Copy + PartialEq>(axis: &[T], value: T) -> Option<T> {
    axis.iter().copied().skip_while(|&other| other != value).nth(1)
}

/// Runs what is worth it; `budget` is CPU time, s.
///
/// # Errors
/// Without a reference, where no two runs are within the budget.
pub fn search(problem: &Problem, reference: Option<Reference>, budget: f64) -> Result<Outcome, Box<dyn Error>> {
    let mut ledger = Ledger { problem, budget, spent: 0.0, done: vec![], failed: vec![], skipped: None };
    let reference = match reference {
        Some(reference) => reference,
        None => ledger.finest()?,
    };
    ledger.skipped = None;
    for (method, Method { resolutions, .. }) in problem.methods.iter().enumerate() {
        let most = ledger.spent + FOR_TOLERANCES * (budget - ledger.spent);
        for &resolution in resolutions.iter().filter(|resolution| matches!(resolution, Resolution::Tolerance(_))) {
            ledger.take(method, resolution, most);
        }
    }
    for (method, Method { resolutions, .. }) in problem.methods.iter().enumerate() {
        // methods that remain share what remains
        let most = ledger.spent + (FOR_GRIDS * budget - ledger.spent) / (problem.methods.len() - method) as f64;
        grids(&mut ledger, method, resolutions, &reference, most);
        // steps that no unit can take, past communication points, are not all there is to know
        let others: Vec<_> = resolutions
            .iter()
            .copied()
            .filter(|resolution| !resolution.is_longer_than(reference.tip.len() - 1))
            .collect();
        grids(&mut ledger, method, &others, &reference, most);
    }

    let mut points = Vec::new();
    let all_errors: Vec<Errors> = ledger.done.iter().map(|(.., run)| reference.errors(run, problem)).collect();
    // grids may have taken more than was predicted
    let most = ledger.spent + (1.0 - FOR_GRIDS) * budget;
    let over_cheapest: Vec<_> = (0..all_errors.len()).map(|i| ledger.over_cheapest(i, &all_errors, most)).collect();
    for (((method, resolution, run), errors), over_cheapest) in ledger.done.iter().zip(all_errors).zip(over_cheapest) {
        // the reference itself
        if errors.tip == 0.0 {
            continue;
        }
        points.push(Point {
            scene: problem.name.clone(),
            code: problem.methods[*method].code.to_owned(),
            kind: if run.planar { "planar" } else { "spatial" }.to_owned(),
            setting: run.setting.clone(),
            cpu: run.cpu,
            tip_error: Some(errors.tip),
            reaction_error: errors.reaction,
            tolerance: match resolution {
                Resolution::Tolerance(tolerance) => Some(*tolerance),
                Resolution::Grid { .. } => None,
            },
            over_cheapest,
        });
    }
    let mut notes = Vec::new();
    if let Some((count, setting, time)) = &ledger.skipped {
        notes.push(format!(
            "left out for the budget of {budget} s: {count} settings, the cheapest {setting}, about {time:.2} s (see --budget)"
        ));
    }
    if let Some(first) = ledger.failed.first() {
        notes.push(format!("failed: {} settings, the first {first}", ledger.failed.len()));
    }
    Ok(Outcome { points, reference, notes })
}

/// Runs the grids of a method, from the cheapest on: the coarsest ones, and what refines, in mesh or step, a run that
/// is not far above the front.
fn grids(ledger: &mut Ledger, method: usize, resolutions: &[Resolution], reference: &Reference, most: f64) {
    let (cells_axis, steps_axis) = axes(resolutions);
    let coarsest = |resolution: &Resolution| match resolution {
        Resolution::Grid { cells, steps, .. } => cells_axis.first() == Some(cells) && steps_axis.first() == Some(steps),
        Resolution::Tolerance(_) => false,
    };
    let mut open: Vec<Resolution> = resolutions.iter().copied().filter(coarsest).collect();
    let mut seen = open.clone();
    let mut closed: Vec<(f64, Errors)> = Vec::new();
    while let Some(place) = (0..open.len()).min_by(|&a, &b| work(open[a]).total_cmp(&work(open[b]))) {
        let resolution = open.swap_remove(place);
        let Resolution::Grid { cells, stages, steps } = resolution else { continue };
        if ledger.find(method, resolution).is_none() {
            ledger.take(method, resolution, most);
        }
        let tried = ledger.find(method, resolution).map(|run| (run.cpu, reference.errors(run, ledger.problem)));
        // one that failed, but not for the budget, is refined as well
        let affordable = ledger.predicted(method, resolution) + ledger.spent <= most;
        let [in_cells, in_steps] = match tried {
            Some((cpu, errors)) => {
                let dominated = |gain: f64| {
                    let cheaper = closed.iter().filter(|(other, _)| *other <= cpu);
                    let (tip, reaction) =
                        cheaper.fold((f64::INFINITY, f64::INFINITY), |(tip, reaction), (_, other)| {
                            (tip.min(other.tip), reaction.min(other.reaction.unwrap_or(f64::INFINITY)))
                        });
                    errors.tip > gain * tip && errors.reaction.is_none_or(|error| error > gain * reaction)
                };
                let far = dominated(if errors.coarse() { FAR_WHERE_COARSE } else { FAR });
                let coarse = errors.coarse();
                closed.push((cpu, errors));
                let worth_it = !far && !errors.unknown(reference);
                // cells with which nothing is resolved tell nothing of more of them
                [worth_it || coarse, worth_it]
            }
            None => [affordable; 2],
        };
        let finer = [
            after(&cells_axis, cells).filter(|_| in_cells).map(|cells| Resolution::Grid { cells, stages, steps }),
            after(&steps_axis, steps).filter(|_| in_steps).map(|steps| Resolution::Grid { cells, stages, steps }),
        ];
        for finer in finer.into_iter().flatten() {
            if !seen.contains(&finer) {
                seen.push(finer);
                open.push(finer);
            }
        }
    }
}
