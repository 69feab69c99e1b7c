//! Example 7: a hair tress under gravity, and its kinetic energy for several α and γ with β = 0.
//!
//! With β = 0 the spectral radius at infinite frequency is (1 − γ)/γ, so γ ≥ ½ or the scheme is unstable; α + γ = 1 is
//! implicit Euler, α + γ = ½ is second order. Chosen here: the tress grows 45° below the horizontal and is let go in
//! the shape it has without load; four members of second order, one of them unstable, stand beside the paper's two.
//! The scheme is the subject, so it is used as asked, without the unit's net; a curve ends where Newton is lost.
//!
//! The decay is fitted to the peaks of the kinetic energy; what a scheme does to an oscillation has a closed form
//! ([`scene::growth`]), here for the first mode about the equilibrium.

use crate::draw::{self, Axes, COLORS, Curve, Eye, Picture, Space};
use crate::report::{self, Example, Numbers};
use crate::scene::{self, AS_PRINTED, Case, DT, GRAVITY, MENDED, Method, PAPER, PLAIN, Run, Scene, Start, Vec3};
use crate::tress;
use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::Boundary;
use cosserat_rod::modes::modes;
use indicatif::ProgressBar;
use nalgebra::Rotation3;
use plotters::style::text_anchor::HPos;
use std::error::Error;
use std::f64::consts::{FRAC_PI_4, TAU};

const SCHEMES: [Scheme; 6] = [
    PAPER,
    Scheme { alpha: 0.4, beta: 0.0, gamma: 1.0 },
    Scheme { alpha: 0.0, beta: 0.0, gamma: 0.5 },
    Scheme { alpha: -0.1, beta: 0.0, gamma: 0.6 },
    Scheme { alpha: -0.3, beta: 0.0, gamma: 0.8 },
    Scheme { alpha: 0.1, beta: 0.0, gamma: 0.4 },
];
/// The methods that use the scheme as asked.
const COMPARED: [&Method; 3] = [&AS_PRINTED, &MENDED, &PLAIN];
const DURATION: f64 = 3.0;
/// Steps in one of the paper's, of the second set of runs.
const FINER: usize = 4;

fn boundary() -> Boundary {
    let tilt = Rotation3::from_axis_angle(&Vec3::y_axis(), -FRAC_PI_4);
    let base = tress::CURL.support(tilt * -Vec3::z(), Vec3::y());
    Boundary::hanging_from(base, -Vec3::z() * GRAVITY)
}

fn scene(scheme: Scheme, finer: usize) -> Scene {
    let dt = DT / finer as f64;
    Scene {
        rod: scene::keratin(),
        mesh: tress::mesh(),
        boundary: Box::new(|_| boundary()),
        start: Start::Unstressed,
        scheme,
        dt,
        steps: Scene::steps_in(DURATION, dt),
        every: 1,
    }
}

/// The rate at which the kinetic energy decays, 1/s: the slope of the logarithm of its largest values, one of every
/// swing of `swing` s.
fn decay(run: &Run, swing: f64) -> Option<f64> {
    let mut peaks: Vec<(f64, f64)> = Vec::new();
    for frame in run.frames.iter().filter(|frame| frame.energy.kinetic > 0.0) {
        let (time, log) = (frame.time, frame.energy.kinetic.ln());
        let window = (time / swing) as usize;
        match peaks.get_mut(window) {
            Some(peak) if peak.1 >= log => {}
            Some(peak) => *peak = (time, log),
            None => peaks.push((time, log)),
        }
    }
    // the last swing may not have come to its peak
    peaks.pop();
    let count = peaks.len() as f64;
    let mean = |of: &dyn Fn(&(f64, f64)) -> f64| peaks.iter().map(of).sum::<f64>() / count;
    let (time, log) = (mean(&|peak| peak.0), mean(&|peak| peak.1));
    let slope = mean(&|peak| (peak.0 - time) * (peak.1 - log)) / mean(&|peak| (peak.0 - time).powi(2));
    (run.lost.is_none() && slope.is_finite()).then_some(-slope)
}

pub fn run(bar: &ProgressBar) -> Result<Example, Box<dyn Error>> {
    let kinds: Vec<(Scheme, usize)> =
        [1, FINER].into_iter().flat_map(|finer| SCHEMES.map(|scheme| (scheme, finer))).collect();
    let case = |method: &'static Method| {
        let case = move |&(scheme, finer): &(Scheme, usize)| Case {
            name: String::new(),
            method,
            scene: scene(scheme, finer),
            color: None,
        };
        kinds.iter().map(case)
    };
    let cases: Vec<Case> = COMPARED.into_iter().flat_map(case).collect();
    let all = scene::run_all(&cases, bar)?;
    // those of the pose formulation come last
    let runs = &all[(COMPARED.len() - 1) * kinds.len()..];

    let mut hanging = cases[0].scene.rod_at_start()?;
    hanging.equilibrium(&boundary())?;
    let first = modes(&mut hanging, &boundary(), 1)?[0].frequency();
    let mut numbers = Numbers {
        chosen: vec![
            format!(
                "keratin, 25 cm, radius 21.85 µm, curled to radius {} mm and pitch {} cm; 100 box cells",
                tress::CURL.radius * 1e3,
                tress::CURL.pitch * 1e2
            ),
            format!("first mode about the equilibrium: {first:.2} Hz"),
        ],
        head: report::head(&["scheme", "order", "radius at ∞", "Δt, s", "first mode, 1/s"]),
        rows: Vec::new(),
    };
    numbers.chosen.push("decay and Newton iterations per step:".to_owned());
    for method in COMPARED {
        numbers.head.extend([format!("{}, 1/s", method.name), "Newton".to_owned()]);
    }
    for (k, &(scheme, _)) in kinds.iter().enumerate() {
        let dt = cases[k].scene.dt;
        let predicted = -2.0 * scene::growth(scheme, TAU * first * dt).ln() / dt;
        let mut row = vec![
            scene::name(scheme),
            if scheme.is_second_order() { "2" } else { "1" }.to_owned(),
            format!("{:.2}", (1.0 - scheme.gamma) / scheme.gamma),
            format!("1/{:.0}", 1.0 / dt),
            format!("{predicted:.2}"),
        ];
        for run in all[k..].iter().step_by(kinds.len()) {
            row.extend([decay(run, 0.5 / first).map_or("–".to_owned(), |decay| format!("{decay:.2}")), run.newton()]);
        }
        numbers.rows.push(row);
    }

    let picture = Picture::new(900, "7  Hair tress under gravity", &numbers.chosen[0], |area| {
        let (width, height) = draw::size(area);
        let left = draw::part(area, (0.0, 0.0), (330.0, height));
        let times = [0.0, 0.1, 0.2, 1.0];
        let steady = SCHEMES.len() + 3;
        let strands: Vec<_> = times
            .into_iter()
            .enumerate()
            .flat_map(|(k, time)| {
                tress::strands(runs[steady].at(time), draw::time_color(k as f64 / 4.0), Vec3::zeros())
            })
            .collect();
        let base = boundary().base;
        draw::space(
            &left,
            &Space {
                eye: Eye { azimuth: -80.0, elevation: 6.0 },
                strands: &strands,
                clamps: &[(base.position, base.rotation, 0.012)],
                ways: &[],
                floor: None,
            },
        )?;
        draw::text(&left, "at 0, 0.1, 0.2, 1 s", (26.0, 8.0), 14.0, draw::INK, HPos::Left)?;
        for (row, (title, from)) in
            [("kinetic energy of a hair, nJ: Δt = 1/30 s", 0), ("the same: Δt = 1/120 s", SCHEMES.len())]
                .into_iter()
                .enumerate()
        {
            let curves: Vec<Curve> = (0..SCHEMES.len())
                .map(|k| {
                    let energy = runs[from + k].curve(|frame| frame.energy.kinetic * 1e9);
                    Curve::new(scene::name(SCHEMES[k]), COLORS[k], energy)
                })
                .collect();
            let place = draw::part(area, (330.0, row as f64 * 0.5 * height), (width - 330.0, 0.5 * height - 4.0));
            draw::chart(&place, Axes { y: Some((0.0, 200.0)), ..Axes::linear(title, "time, s") }, &curves)?;
        }
        Ok(())
    })?;
    Ok(Example { name: "7-hair", picture, numbers })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Frame;
    use cosserat_rod::energy::Energy;

    #[test]
    fn the_decay_of_a_damped_swing_is_found_from_its_peaks() {
        let (rate, swing) = (0.7, 0.25);
        let frame = |i: u32| {
            let time = 1e-3 * f64::from(i);
            let kinetic = (-rate * time).exp() * (std::f64::consts::PI * time / swing).sin().powi(2);
            Frame { time, energy: Energy { kinetic, ..Energy::default() }, ..Frame::default() }
        };
        let run = Run { frames: (0..3000).map(frame).collect(), steps: 0, iterations: 0, lost: None };
        // the peaks are all at the same part of their swing, to the distance of two frames
        assert!((decay(&run, swing).unwrap() / rate - 1.0).abs() < 1e-2, "{:?}", decay(&run, swing));
    }
}
