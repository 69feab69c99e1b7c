//! The command: runs a scene in strain modes, finds its front of cost and error, or puts a reference together.
//!
//! ```text
//! strain <scene> <nb> <dt> [--cuts s,s,..] [--reference out.json] [--against reference.json]
//! strain front <scene> <reference.json> [nb,nb,..]
//! strain reference <scene> <record.json> <other.json>.. --how <text>
//! ```

use strain::record::{self, Record};
use strain::scenes::{NAMES, SAMPLES, Scene};

fn scene(name: &str) -> Scene {
    Scene::new(name).unwrap_or_else(|| panic!("no scene {name}; there are {}", NAMES.join(", ")))
}

fn option<'a>(arguments: &'a [String], name: &str) -> Option<&'a str> {
    let at = arguments.iter().position(|argument| argument == name)?;
    arguments.get(at + 1).map(String::as_str)
}

fn main() {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    let usage = "strain <scene> <nb> <dt> [--cuts s,s] [--reference out] [--against file]\n\
                 strain front <scene> <reference> [nb,nb]\n\
                 strain reference <scene> <record> <other>.. --how <text>";
    match arguments.first().map(String::as_str) {
        Some("reference") if arguments.len() > 3 => reference(&scene(&arguments[1]), &arguments[2..]),
        Some("front") if arguments.len() > 2 => front(&scene(&arguments[1]), &arguments[2..]),
        Some(name) if arguments.len() > 2 => one(&scene(name), &arguments[1..]),
        _ => eprintln!("{usage}"),
    }
}

fn one(scene: &Scene, arguments: &[String]) {
    let modes: usize = arguments[0].parse().expect("nb, a whole number");
    let dt: f64 = arguments[1].parse().expect("dt, s");
    let given: Option<Vec<f64>> =
        option(arguments, "--cuts").map(|list| list.split(',').filter_map(|s| s.parse().ok()).collect());
    let cuts = given.unwrap_or_default();
    let run = record::timed(scene, modes, &cuts, dt);
    let mut line = format!(
        "{{\"scene\":\"{}\",\"nb\":{modes},\"dt\":{dt:e},\"cpu_s\":{:.3e},\"finite\":{}",
        scene.name, run.cpu, run.finite
    );
    if let Some(path) = option(arguments, "--against") {
        let (tip, force) = run.record.errors(&Record::read(path), scene.length);
        line += &format!(",\"tip_error\":{tip:.3e},\"reaction_error\":{force:.3e}");
    } else {
        line += &format!(",{}", run.record.lists().replace('\n', ""));
    }
    println!("{line}}}");
    if let Some(path) = option(arguments, "--reference") {
        let text = format!("{{\"scene\":\"{}\",\n{}}}\n", scene.name, run.record.lists());
        std::fs::write(path, text).expect("a file that can be written");
    }
}

/// The front of a scene as CSV: for each number of modes the cheapest step that is stable and whose error in time does
/// not show.
fn front(scene: &Scene, arguments: &[String]) {
    let reference = Record::read(&arguments[0]);
    let list = arguments.get(1).map_or("2,3,4,5,6,7,8,10,12,14,16,20,24", String::as_str);
    println!("scene,code,kind,setting,cpu_s,tip_error,reaction_error");
    let kind = if scene.planar { "planar" } else { "spatial" };
    let mut dt = scene.duration / 100.0;
    for modes in list.split(',').map(|nb| nb.parse().expect("nb,nb,..")) {
        let errors = |dt: f64| {
            let run = record::run(scene, modes, &[], dt);
            if run.finite { run.record.errors(&reference, scene.length) } else { (f64::INFINITY, f64::INFINITY) }
        };
        // more modes, smaller steps
        while !errors(dt).0.is_finite() {
            dt *= 0.8;
        }
        let mut found = (0.8 * dt, errors(0.8 * dt));
        loop {
            let finer = errors(0.7 * found.0);
            let same = |a: f64, b: f64| a < 1.1 * b;
            if same(found.1.0, finer.0) && same(found.1.1, finer.1) {
                break;
            }
            found = (0.7 * found.0, finer);
        }
        let (nominal, (tip, force)) = found;
        let cpu = record::timed(scene, modes, &[], nominal).cpu;
        let (step, name) = (record::step(scene, nominal).1, scene.name);
        let force = if scene.reaction { format!("{force:.3e}") } else { String::new() };
        println!("{name},strain modes (RK4),{kind},nb={modes} dt={step:.2e},{cpu:.3e},{tip:.3e},{force}");
    }
}

/// A reference on the standard output: the first record, and as its uncertainty the largest of its distances to the
/// others.
fn reference(scene: &Scene, arguments: &[String]) {
    let record = Record::read(&arguments[0]);
    let others = arguments[1..].iter().take_while(|argument| *argument != "--how");
    let (mut tip, mut force) = (0.0f64, 0.0f64);
    for path in others {
        let (of_tip, of_force) = Record::read(path).errors(&record, scene.length);
        eprintln!("{}: {path}: tip {of_tip:.1e}, reaction {of_force:.1e}", scene.name);
        (tip, force) = (tip.max(of_tip), force.max(of_force));
    }
    let how = option(arguments, "--how").expect("--how, the resolutions and the codes");
    let times: Vec<String> =
        (0..=SAMPLES).map(|i| record::digits(scene.duration * i as f64 / SAMPLES as f64)).collect();
    println!("{{\"scene\":\"{}\",\"model\":\"inextensible\",\"length\":{},", scene.name, record::digits(scene.length));
    println!("\"tip_uncertainty\":{tip:.1e},\"force_uncertainty\":{force:.1e},");
    println!("\"how\":\"{how}\",\n\"t\":[{}],\n{}}}", times.join(","), record.lists());
}
