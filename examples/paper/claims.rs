//! The claims of the paper that are numbers, measured. What they mean is in `examples/README.md`.

use crate::draw::{self, Axes, Curve, Picture};
use crate::report::{Example, Numbers};
use crate::scene::{self, DT, GRAVITY, PAPER, SEGMENTS, Vec3};
use crate::stability::explicit::{self, Explicit};
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::formulation::Formulation;
use cosserat_rod::mesh::Mesh;
use cosserat_rod::modes;
use cosserat_rod::pose::State;
use cosserat_rod::rate::{self, Curvature, Options};
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use indicatif::ProgressBar;
use nalgebra::Matrix3;
use std::error::Error;
use std::f64::consts::TAU;
use std::time::Instant;

const LENGTH: f64 = 1.0;

fn rod() -> Rod {
    scene::rubber(5e-3, 5e6)
}

/// A rod that hangs from a base which starts very smoothly (x ~ t⁴) to swing by 20 cm.
fn swung(time: f64) -> Boundary {
    let down = Matrix3::from_columns(&[Vec3::x(), -Vec3::y(), -Vec3::z()]);
    let mut base = Support::at_rest(Vec3::zeros(), down);
    let (amplitude, w) = (0.05, TAU / 0.8);
    let (sin, cos) = (w * time).sin_cos();
    base.position.x = amplitude * (1.0 - cos).powi(2);
    base.velocity.x = amplitude * 2.0 * (1.0 - cos) * w * sin;
    base.acceleration.x = amplitude * 2.0 * w * w * (sin * sin + (1.0 - cos) * cos);
    Boundary::hanging_from(base, -Vec3::z() * GRAVITY)
}

fn by_rates(mesh: Mesh, options: Options) -> Result<Box<dyn Formulation>, Box<dyn Error>> {
    Ok(Box::new(rate::Stepper::new(mesh, rod(), &swung(0.0), options)?))
}

fn by_poses(mesh: Mesh) -> Result<Box<dyn Formulation>, Box<dyn Error>> {
    let boundary = swung(0.0);
    let state = State::at_rest_shape(&mesh, &boundary.base);
    let mut stepper = Stepper::new(mesh, rod(), state);
    stepper.equilibrium(&boundary)?;
    stepper.start(&boundary)?;
    Ok(Box::new(stepper))
}

/// Tip and reaction of the swing every 8 ms up to 0.4 s.
type Motion = Vec<(Vec3, Vec3)>;

const SEEN: f64 = 8e-3;

fn swing(rod: &mut dyn Formulation, scheme: Scheme, dt: f64) -> Result<Motion, Box<dyn Error>> {
    let every = (SEEN / dt).round() as usize;
    let mut motion = Motion::new();
    for i in 1..=50 * every {
        rod.step(&swung(i as f64 * dt), scheme, dt)?;
        if i % every == 0 {
            motion.push((rod.tip().position, rod.section(0).force));
        }
    }
    Ok(motion)
}

/// RMS of the tip / length and of the reaction / weight.
fn difference(motion: &Motion, exact: &Motion) -> (f64, f64) {
    let weight = rod().mass_per_length * LENGTH * GRAVITY;
    let rms = |part: &dyn Fn(&(Vec3, Vec3)) -> Vec3, scale: f64| {
        let sum: f64 = motion.iter().zip(exact).map(|(a, b)| (part(a) - part(b)).norm_squared()).sum();
        (sum / motion.len() as f64).sqrt() / scale
    };
    (rms(&|sample| sample.0, LENGTH), rms(&|sample| sample.1, weight))
}

/// The slope of ln y over ln x by least squares.
fn fitted_order(points: &[(f64, f64)]) -> f64 {
    let count = points.len() as f64;
    let mean = |f: &dyn Fn(&(f64, f64)) -> f64| points.iter().map(f).sum::<f64>() / count;
    let (x, y) = (mean(&|p| p.0.ln()), mean(&|p| p.1.ln()));
    let covariance = mean(&|p| (p.0.ln() - x) * (p.1.ln() - y));
    covariance / mean(&|p| (p.0.ln() - x).powi(2))
}

/// An order: who, by what, errors of tip and reaction over the step or cell.
struct Order {
    name: String,
    tip: Vec<(f64, f64)>,
    reaction: Vec<(f64, f64)>,
    /// From which cells on Newton is lost.
    lost: Option<usize>,
}

const HALF: Scheme = Scheme { alpha: 1.0 / 6.0, beta: 1.0 / 3.0, gamma: 2.0 / 3.0 };

fn orders_in_time(bar: &ProgressBar) -> Result<Vec<Order>, Box<dyn Error>> {
    const STEPS: [f64; 4] = [8e-3, 4e-3, 2e-3, 1e-3];
    const FINE: f64 = 1.25e-4;
    let mesh = || Mesh::uniform(LENGTH, 20, 1, Vec3::zeros());
    let schemes = [
        ("λ = 0", Scheme::from_spectral_radius(0.0)),
        ("λ = −0.5", HALF),
        ("λ = −1", Scheme::from_spectral_radius(1.0)),
        ("(0.3, 0, 0.7)", PAPER),
        ("(0.4, 0, 1)", Scheme { alpha: 0.4, beta: 0.0, gamma: 1.0 }),
    ];
    let mut orders = Vec::new();
    for (who, begin) in [
        (
            "rate, as printed",
            &(|| by_rates(mesh(), Options::AS_PRINTED)) as &dyn Fn() -> Result<Box<dyn Formulation>, _>,
        ),
        ("rate, mended", &|| by_rates(mesh(), Options::MENDED)),
        ("pose", &|| by_poses(mesh())),
    ] {
        let exact = swing(begin()?.as_mut(), HALF, FINE)?;
        for (what, scheme) in schemes {
            let mut order = Order { name: format!("{who}, {what}"), tip: Vec::new(), reaction: Vec::new(), lost: None };
            for dt in STEPS {
                let (tip, reaction) = difference(&swing(begin()?.as_mut(), scheme, dt)?, &exact);
                order.tip.push((dt, tip));
                order.reaction.push((dt, reaction));
                bar.inc(1);
            }
            orders.push(order);
        }
    }
    Ok(orders)
}

fn orders_in_space(bar: &ProgressBar) -> Result<Vec<Order>, Box<dyn Error>> {
    const CELLS: [usize; 4] = [10, 20, 40, 80];
    // a rod whose unstressed shape bends and twists: then every term of the equations takes part
    let mesh = |cells: usize| Mesh::uniform(LENGTH, cells, 1, Vec3::new(1.0, 0.5, 2.0));
    let first = Options { curvature: Curvature::First, ..Options::MENDED };
    let uneven = |gamma: f64| {
        let space = Scheme { alpha: 1.0 - gamma, beta: 1.0 - gamma, gamma };
        Options { space, ..Options::MENDED }
    };
    let mut orders = Vec::new();
    let exact = swing(by_rates(mesh(320), Options::MENDED)?.as_mut(), HALF, SEEN)?;
    for (what, options) in [
        ("rate, mended: γ_s = ½, mean κ in eq 23", Options::MENDED),
        ("rate, κ_j in eq 23 as printed", first),
        ("rate, γ_s = 0.55", uneven(0.55)),
        ("rate, γ_s = 0.7", uneven(0.7)),
    ] {
        let mut order = Order { name: what.to_owned(), tip: Vec::new(), reaction: Vec::new(), lost: None };
        for cells in CELLS {
            let Ok(motion) = swing(by_rates(mesh(cells), options)?.as_mut(), HALF, SEEN) else {
                order.lost = Some(cells);
                break;
            };
            let (tip, reaction) = difference(&motion, &exact);
            order.tip.push((LENGTH / cells as f64, tip));
            order.reaction.push((LENGTH / cells as f64, reaction));
            bar.inc(1);
        }
        orders.push(order);
    }
    Ok(orders)
}

/// What each mending buys by itself, and what is lost without it: the swing with 40 cells, λ = −0.5 and 4 ms, beside the
/// pose formulation on 10 cells of 4 stages at 0.5 ms.
fn mendings(rows: &mut Vec<Vec<String>>) -> Result<(), Box<dyn Error>> {
    const CELLS: usize = 40;
    const STEP: f64 = 4e-3;
    let (printed, mended) = (Options::AS_PRINTED, Options::MENDED);
    // one switch of `from` set as in `to`
    let switched = |from: Options, to: Options| {
        [
            ("orientation in Newton", Options { orientation: to.orientation, ..from }),
            ("mean curvature in eq 23", Options { curvature: to.curvature, ..from }),
            ("positions rebuilt from the base", Options { positions: to.positions, ..from }),
            ("balance at the end of the step", Options { balance: to.balance, ..from }),
            ("consistent start", Options { start: to.start, ..from }),
            ("adaptive relaxation", Options { relaxation: to.relaxation, ..from }),
        ]
    };
    let mut cases = vec![("as printed".to_owned(), printed)];
    cases.extend(switched(printed, mended).map(|(name, options)| (format!("as printed, with {name}"), options)));
    cases.push(("mended".to_owned(), mended));
    cases.extend(switched(mended, printed).map(|(name, options)| (format!("mended, without {name}"), options)));

    let exact = swing(by_poses(Mesh::uniform(LENGTH, 10, 4, Vec3::zeros()))?.as_mut(), HALF, 5e-4)?;
    for (name, options) in cases {
        let mut rod = rate::Stepper::new(Mesh::uniform(LENGTH, CELLS, 1, Vec3::zeros()), rod(), &swung(0.0), options)?;
        let (mut motion, mut iterations, mut steps) = (Motion::new(), 0, 0);
        for _ in 0..exact.len() * 2 {
            steps += 1;
            iterations += rod.step(&swung(steps as f64 * STEP), HALF, STEP)?.iterations;
            if steps % 2 == 0 {
                motion.push((rod.tip().position, rod.section(0).force));
            }
        }
        let (tip, reaction) = difference(&motion, &exact);
        let value = format!(
            "{:.1} iterations, tip {tip:.1e}, reaction {reaction:.1e}, length of a cell {:.0e}",
            iterations as f64 / steps as f64,
            length_error(&rod, LENGTH / CELLS as f64)
        );
        rows.push(vec![name, value]);
    }
    Ok(())
}

/// A rod of 100 segments released from the horizontal, at the paper's step: iterations and time, s, of a step.
fn cost(rod: &mut dyn Formulation, boundary: &Boundary, dt: f64, steps: usize) -> Result<(f64, f64), Box<dyn Error>> {
    let begin = Instant::now();
    let mut iterations = 0;
    for _ in 0..steps {
        iterations += rod.step(boundary, PAPER, dt)?.iterations;
    }
    Ok((iterations as f64 / steps as f64, begin.elapsed().as_secs_f64() / steps as f64))
}

/// The median of the times of five runs.
fn median_cost(
    begin: &dyn Fn() -> Result<Box<dyn Formulation>, Box<dyn Error>>,
    boundary: &Boundary,
    dt: f64,
    steps: usize,
) -> Result<(f64, f64), Box<dyn Error>> {
    let mut runs = Vec::new();
    for _ in 0..5 {
        runs.push(cost(begin()?.as_mut(), boundary, dt, steps)?);
    }
    runs.sort_by(|a, b| a.1.total_cmp(&b.1));
    Ok(runs[2])
}

fn costs(rows: &mut Vec<Vec<String>>) -> Result<(), Box<dyn Error>> {
    let boundary = scene::horizontal();
    for (material, rod, length) in
        [("hair", scene::keratin(), 0.25), ("rubber", rod(), 1.0), ("steel", scene::steel(1e-3), 1.0)]
    {
        let mesh = Mesh::uniform(length, SEGMENTS, 1, Vec3::zeros());
        let rates = |options: Options| -> Result<Box<dyn Formulation>, Box<dyn Error>> {
            Ok(Box::new(rate::Stepper::new(mesh.clone(), rod.clone(), &boundary, options)?))
        };
        let poses = || -> Result<Box<dyn Formulation>, Box<dyn Error>> {
            let mut stepper = Stepper::new(mesh.clone(), rod.clone(), State::at_rest_shape(&mesh, &boundary.base));
            stepper.start(&boundary)?;
            Ok(Box::new(stepper))
        };
        let mut row = |name: &str, (iterations, time): (f64, f64)| {
            let value = format!(
                "{iterations:.1} iterations, {:.3} ms a step, {:.1} µs an iteration, 135 ms / ours = {:.0}",
                time * 1e3,
                time * 1e6 / iterations,
                0.135 / time
            );
            rows.push(vec![format!("{material}, 100 segments, Δt = 1/30 s, {name}"), value]);
        };
        row("rate as printed", median_cost(&|| rates(Options::AS_PRINTED), &boundary, DT, 60)?);
        row("rate mended", median_cost(&|| rates(Options::MENDED), &boundary, DT, 60)?);
        let implicit = median_cost(&poses, &boundary, DT, 60)?;
        row("pose", implicit);

        // the initial value problem: explicit steps of the same cells, as long as they may be
        let compliant = scene::compliant(&rod);
        let dt = explicit::longest_step(&compliant, length / SEGMENTS as f64);
        let begin = || -> Result<Box<dyn Formulation>, Box<dyn Error>> {
            Ok(Box::new(Explicit::new(&mesh, &compliant, &boundary)))
        };
        let (_, time) = median_cost(&begin, &boundary, dt, 2000)?;
        let value = format!(
            "{:.1} µs a step of {dt:.1e} s; over 1/30 s {:.3} s, {:.0} times a step of pose",
            time * 1e6,
            time * DT / dt,
            time * DT / dt / implicit.1
        );
        rows.push(vec![format!("{material}, the same cells, explicit"), value]);
    }
    Ok(())
}

/// How few cells of four stages are as near to the rod as the paper's segments, at the paper's step: the hair released, RMS
/// of the tip over 2 s beside the same steps on far more cells.
fn fewest(rows: &mut Vec<Vec<String>>) -> Result<(), Box<dyn Error>> {
    const LENGTH: f64 = 0.25;
    let boundary = scene::horizontal();
    let begin = |cells: usize, stages: usize| -> Result<Box<dyn Formulation>, Box<dyn Error>> {
        let mesh = Mesh::uniform(LENGTH, cells, stages, Vec3::zeros());
        let mut stepper = Stepper::new(mesh.clone(), scene::keratin(), State::at_rest_shape(&mesh, &boundary.base));
        stepper.start(&boundary)?;
        Ok(Box::new(stepper))
    };
    let tips = |cells: usize, stages: usize| -> Result<Vec<Vec3>, Box<dyn Error>> {
        let mut rod = begin(cells, stages)?;
        let tip = |_| rod.step(&boundary, PAPER, DT).map(|_| rod.tip().position);
        Ok((0..60).map(tip).collect::<Result<_, _>>()?)
    };
    let exact = tips(60, 4)?;
    let error = |cells: usize, stages: usize| -> Result<f64, Box<dyn Error>> {
        let sum: f64 = tips(cells, stages)?.iter().zip(&exact).map(|(a, b)| (a - b).norm_squared()).sum();
        Ok((sum / exact.len() as f64).sqrt() / LENGTH)
    };
    let mut row = |cells: usize, stages: usize, error: f64| -> Result<(), Box<dyn Error>> {
        let (iterations, time) = median_cost(&|| begin(cells, stages), &boundary, DT, 60)?;
        let value = format!(
            "{} Gauss points, tip off by {error:.1e} of the length, {iterations:.1} iterations, {:.3} ms a step, 135 ms / ours = {:.0}",
            cells * stages,
            time * 1e3,
            0.135 / time
        );
        rows.push(vec![format!("hair, Δt = 1/30 s, pose, {cells} cells of {stages}"), value]);
        Ok(())
    };
    let segments = error(SEGMENTS, 1)?;
    row(SEGMENTS, 1, segments)?;
    for cells in 1..SEGMENTS {
        let few = error(cells, 4)?;
        if few <= segments {
            return row(cells, 4, few);
        }
    }
    Err("no mesh is as near as the segments".into())
}

/// Decay per step of the first mode of a steel cantilever, measured and by the spectral radius at ωΔt.
fn damping(rows: &mut Vec<Vec<String>>) -> Result<(), Box<dyn Error>> {
    let rod = scene::steel(1e-3);
    let mesh = Mesh::uniform(LENGTH, 20, 1, Vec3::zeros());
    let still = Boundary::hanging_from(Support::at_rest(Vec3::zeros(), Matrix3::identity()), Vec3::zeros());
    let mut stepper = Stepper::new(mesh.clone(), rod.clone(), State::at_rest_shape(&mesh, &still.base));
    let omega = modes::modes(&mut stepper, &still, 1)?[0].omega_squared.sqrt();
    stepper.equilibrium(&Boundary { tip_force: Vec3::x() * 1e-3, ..still })?;
    let sections = stepper.state.nodes.clone();
    for (name, scheme) in [
        ("λ = 0", Scheme::from_spectral_radius(0.0)),
        ("λ = −0.5", HALF),
        ("λ = −0.8", Scheme::from_spectral_radius(0.8)),
        ("λ = −1", Scheme::from_spectral_radius(1.0)),
        ("(0.3, 0, 0.7)", PAPER),
        ("(0.4, 0, 1)", Scheme { alpha: 0.4, beta: 0.0, gamma: 1.0 }),
    ] {
        let mut words = Vec::new();
        for omega_dt in [0.1, 0.5] {
            let dt = omega_dt / omega;
            let mut rod = rate::Stepper::from_sections(mesh.clone(), rod.clone(), &still, Options::MENDED, &sections)?;
            // what the release shakes besides the first mode is gone, or small, after a few steps
            let (settle, steps) = (60, 40);
            let mut energies = Vec::new();
            for _ in 0..settle + steps {
                rod.step(&still, scheme, dt)?;
                energies.push(Formulation::energy(&rod, &still.gravity).total());
            }
            let decay = (energies[settle + steps - 1] / energies[settle - 1]).powf(0.5 / steps as f64);
            words.push(format!("ωΔt = {omega_dt}: {decay:.4} ({:.4})", scene::growth(scheme, omega_dt)));
        }
        rows.push(vec![
            format!("amplitude kept per step, first mode, {name}"),
            words.join(", ") + " measured (theory)",
        ]);
    }
    Ok(())
}

/// Largest relative change of the length of a cell, `h` m, of a rod in a plane.
fn length_error(rod: &rate::Stepper, h: f64) -> f64 {
    let error = |j: usize| {
        let (before, after) = (rod.section(j - 1), rod.section(j));
        // the arc over its chord
        let half = 0.5 * after.turn.norm();
        let arc = if half > 0.0 { half / half.sin() } else { 1.0 };
        ((after.position - before.position).norm() * arc / h - 1.0).abs()
    };
    (1..rod.nodes()).map(error).fold(0.0, f64::max)
}

/// [`length_error`] over time, rubber released from the horizontal.
fn lengths(rows: &mut Vec<Vec<String>>) -> Result<(), Box<dyn Error>> {
    let boundary = scene::horizontal();
    let mesh = Mesh::uniform(LENGTH, SEGMENTS, 1, Vec3::zeros());
    for dt in [DT, 1e-2, 1e-3] {
        for (name, options) in [("as printed", Options::AS_PRINTED), ("mended", Options::MENDED)] {
            let mut rod = rate::Stepper::new(mesh.clone(), rod(), &boundary, options)?;
            let mut words = Vec::new();
            let mut time = 0.0;
            for end in [0.1, 0.5, 2.0] {
                while time < end - 0.5 * dt {
                    rod.step(&boundary, PAPER, dt)?;
                    time += dt;
                }
                words.push(format!("{:.0e} at {end} s", length_error(&rod, LENGTH / SEGMENTS as f64)));
            }
            rows.push(vec![format!("length of a cell, rubber, Δt = {dt:.4} s, rate {name}"), words.join(", ")]);
        }
    }
    Ok(())
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    bar.set_length(15 * 4 + 4 * 4 + 4);
    let (in_time, in_space) = (orders_in_time(bar)?, orders_in_space(bar)?);
    let mut rows = Vec::new();
    for (what, orders) in [("time", &in_time), ("space", &in_space)] {
        for order in orders {
            let (tip, reaction) = (fitted_order(&order.tip), fitted_order(&order.reaction));
            let last = |points: &[(f64, f64)]| points[points.len() - 1].1;
            let lost = order.lost.map_or(String::new(), |cells| format!("; Newton lost from {cells} cells on"));
            let value = format!(
                "tip {tip:.2}, reaction {reaction:.2}; finest errors {:.1e} of the length, {:.1e} of the weight{lost}",
                last(&order.tip),
                last(&order.reaction)
            );
            rows.push(vec![format!("order in {what}: {}", order.name), value]);
        }
    }
    mendings(&mut rows)?;
    bar.inc(1);
    costs(&mut rows)?;
    fewest(&mut rows)?;
    bar.inc(1);
    damping(&mut rows)?;
    bar.inc(1);
    lengths(&mut rows)?;
    bar.inc(1);

    let subtitle = "a rubber rod of 1 m hanging from a base that swings by 20 cm; RMS over 0.4 s";
    let picture = Picture::new(1300, "Orders of convergence of the tip", subtitle, |area| {
        let (width, height) = draw::size(area);
        let half = 0.5 * width;
        for (k, (orders, axis)) in [(&in_time, "Δt, s"), (&in_space, "Δs, m")].into_iter().enumerate() {
            let place = draw::part(area, (k as f64 * half, 0.0), (half, height));
            let curves: Vec<Curve> = orders
                .iter()
                .filter(|order| k == 1 || !order.name.starts_with("pose"))
                .enumerate()
                .map(|(i, order)| {
                    // schemes have their colours; what is printed is drawn thin
                    let (color, width) =
                        if k == 0 { (draw::COLORS[i % 5], [1.2, 3.0][i / 5]) } else { (draw::COLORS[i], 2.2) };
                    Curve { width, ..Curve::new(order.name.replace("rate, ", ""), color, order.tip.clone()) }
                })
                .collect();
            let title = if k == 0 { "in time: error / length" } else { "in space: error / length" };
            let axes = Axes { log: true, ..Axes::linear(title, axis) };
            draw::chart(&place, axes, &curves)?;
        }
        Ok(())
    })?;
    let chosen = vec!["times: medians of five runs, one thread, this machine".to_owned()];
    Ok(Example {
        name: "claims",
        picture,
        numbers: Numbers { chosen, head: ["what", "measured"].map(str::to_owned).to_vec(), rows },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_order_of_a_power_is_its_exponent() {
        let points = [0.1, 0.2, 0.5, 1.0].map(|x: f64| (x, 3.0 * x.powf(1.7)));
        assert!((fitted_order(&points) - 1.7).abs() < 1e-12);
    }

    #[test]
    fn the_compliance_of_a_round_section_is_that_of_its_moduli() {
        let (radius, youngs, shear) = (2e-3, 206e9, 79.3e9);
        let area = 0.5 * TAU * radius * radius;
        let exact = Vec3::new(1.0 / (shear * area), 1.0 / (shear * area), 1.0 / (youngs * area));
        assert!((scene::compliant(&scene::steel(radius)).compliance - exact).norm() < 1e-12 * exact.norm());
    }

    #[test]
    fn the_base_swings_with_the_rates_of_its_position() {
        for time in [0.05, 0.3, 0.7] {
            // central differences: their error is h²/6 of the third derivative, up to 16 w³ amplitude
            let h = 1e-5;
            let [before, at, after] = [-h, 0.0, h].map(|shift| swung(time + shift).base);
            assert!(((after.position - before.position) / (2.0 * h) - at.velocity).norm() < 1e-7);
            assert!(((after.velocity - before.velocity) / (2.0 * h) - at.acceleration).norm() < 1e-6);
        }
    }
}
