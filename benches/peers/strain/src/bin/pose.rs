//! The second code of the references: the crate's own pose formulation on the same scenes, extrapolated in its step.
//!
//! ```text
//! pose <scene> <cells> <dt> [--graded h] [--reference out.json] [--against reference.json]
//! ```
//!
//! Three runs at dt, dt/2, dt/4 of the second-order scheme, spectral radius 0.5, cells of four stages: equal ones, or
//! growing by a constant factor from a first one of h m.

use cosserat_rod::alpha::Scheme;
use cosserat_rod::boundary::{Boundary, Support};
use cosserat_rod::mesh::Mesh;
use cosserat_rod::pose::State;
use cosserat_rod::rod::Rod;
use cosserat_rod::stepper::Stepper;
use nalgebra::Vector3;
use strain::record::Record;
use strain::scenes::{SAMPLES, Scene};

fn boundary(scene: &Scene, t: f64) -> Boundary {
    let drive = scene.drive(t);
    let base = Support {
        velocity: drive.velocity,
        angular_velocity: drive.angular_velocity,
        acceleration: drive.acceleration,
        ..Support::at_rest(drive.position, drive.rotation)
    };
    Boundary { tip_force: drive.tip_force, tip_moment: drive.tip_moment, ..Boundary::hanging_from(base, scene.gravity) }
}

/// Ends of `cells` cells that grow by a constant factor from `first` and fill `length`.
fn graded(length: f64, cells: usize, first: f64) -> Vec<f64> {
    let sum = |q: f64| (0..cells).map(|i| first * q.powi(i as i32)).sum::<f64>();
    let (mut low, mut high) = (1.0, 100.0);
    for _ in 0..200 {
        let middle = 0.5 * (low + high);
        if sum(middle) < length { low = middle } else { high = middle }
    }
    let mut ends: Vec<f64> = (0..=cells).map(|n| (0..n).map(|i| first * low.powi(i as i32)).sum::<f64>()).collect();
    ends[cells] = length;
    ends
}

fn run(scene: &Scene, mesh: &Mesh, dt: f64) -> Record {
    let rod = Rod {
        stiffness: Vector3::new(scene.bending, scene.bending, scene.torsion),
        compliance: Vector3::zeros(),
        mass_per_length: scene.mass_per_length,
        inertia_per_length: Vector3::new(1.0, 1.0, 2.0) * scene.inertia_per_length,
        damping: Vector3::zeros(),
        drag: 0.0,
        tip_mass: 0.0,
        tip_inertia: 0.0,
    };
    let start = boundary(scene, 0.0);
    let state = State::at_rest_shape(mesh, &start.base);
    let mut stepper = Stepper::new(mesh.clone(), rod, state);
    stepper.start(&start).expect("accelerations at the start");
    let span = scene.duration / SAMPLES as f64;
    let (count, h) = strain::record::step(scene, dt);
    let scheme = Scheme::from_spectral_radius(0.5);
    let mut record = Record::default();
    for i in 0..=SAMPLES {
        // at the start the state has accelerations and no forces yet: a vanishing step tells them
        let force = if i == 0 {
            let mut probe = stepper.clone();
            let tiny = 1e-9 * scene.duration;
            probe
                .advance(&boundary(scene, tiny), scheme, tiny)
                .map_or([f64::NAN; 3], |_| probe.state.nodes[0].force.into())
        } else {
            stepper.state.nodes[0].force.into()
        };
        record.tip.push(stepper.state.tip().position.into());
        record.force.push(force);
        if i == SAMPLES {
            break;
        }
        for step in 1..=count {
            let t = i as f64 * span + step as f64 * h;
            stepper.advance(&boundary(scene, t), scheme, h).unwrap_or_else(|why| panic!("at {t} s: {why}"));
        }
    }
    record
}

/// b + (b − a)/(2ᵖ − 1).
fn extrapolated(a: &Record, b: &Record, order: i32) -> Record {
    let share = 1.0 / (2f64.powi(order) - 1.0);
    let lists = |a: &[[f64; 3]], b: &[[f64; 3]]| {
        a.iter().zip(b).map(|(a, b)| std::array::from_fn(|c| b[c] + share * (b[c] - a[c]))).collect()
    };
    Record { tip: lists(&a.tip, &b.tip), force: lists(&a.force, &b.force) }
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let option = |name: &str| {
        let at = arguments.iter().position(|argument| argument == name)?;
        arguments.get(at + 1)
    };
    let [name, cells, dt, ..] = &arguments[..] else {
        eprintln!("pose <scene> <cells> <dt> [--graded h] [--reference out.json] [--against reference.json]");
        return;
    };
    let scene = Scene::new(name).expect("a scene");
    let (cells, dt): (usize, f64) = (cells.parse().expect("cells"), dt.parse().expect("dt, s"));
    let ends = match option("--graded") {
        Some(first) => graded(scene.length, cells, first.parse().expect("h, m")),
        None => (0..=cells).map(|i| scene.length * i as f64 / cells as f64).collect(),
    };
    let mesh = Mesh::graded(&ends, 4, |_| scene.kappa_rest);
    let levels: Vec<Record> = [1.0, 2.0, 4.0].iter().map(|part| run(&scene, &mesh, dt / part)).collect();
    let once = [extrapolated(&levels[0], &levels[1], 2), extrapolated(&levels[1], &levels[2], 2)];
    let twice = extrapolated(&once[0], &once[1], 3);
    let show = |what: &str, of: &Record, to: &Record| {
        let (tip, force) = of.errors(to, scene.length);
        println!("{name} {cells} cells, dt {dt:e}: {what}: tip {tip:.2e}, reaction {force:.2e}");
    };
    show("dt to dt/2", &levels[0], &levels[1]);
    show("dt/2 to dt/4", &levels[1], &levels[2]);
    show("extrapolated once, dt to dt/2", &once[0], &once[1]);
    show("extrapolated once to twice", &once[1], &twice);
    if let Some(path) = option("--against") {
        let reference = Record::read(path);
        show("dt/4 to the reference", &levels[2], &reference);
        show("once to the reference", &once[1], &reference);
        show("twice to the reference", &twice, &reference);
    }
    if let Some(path) = option("--reference") {
        let text = format!("{{\"scene\":\"{name}\",\n{}}}\n", twice.lists());
        std::fs::write(path, text).expect("a file that can be written");
    }
}
