//! A tip that is driven: the rod hangs between two ends, goes with them, is caught and let go.

use cosserat_rod::archive::{are_same, load, save};
use cosserat_rod::so3;
use cosserat_rod::unit::{Error, Inputs, Outputs, Parameters, Tunable, Unit};
use nalgebra::{Vector3, Vector4};
use std::f64::consts::PI;

type Vec3 = Vector3<f64>;

fn driven() -> Parameters {
    Parameters { tip_mode: 1, ..Parameters::default() }
}

fn mass(parameters: &Parameters) -> f64 {
    parameters.rod().mass_per_length * parameters.length
}

/// Along +x, turned by `angle` about y: down for a positive one.
fn sloping(angle: f64) -> Vector4<f64> {
    let half = 0.25 * PI + 0.5 * angle;
    Vector4::new(half.cos(), 0.0, half.sin(), 0.0)
}

fn of_mode(mode: i32) -> Parameters {
    Parameters { tip_mode: mode, ..Parameters::default() }
}

fn switch(unit: &mut Unit, parameters: &Parameters, mode: i32) {
    unit.tune(&Tunable { tip_mode: mode, ..parameters.tunable() }).unwrap();
}

/// The motion of the tip as inputs that drive one.
fn following(outputs: &Outputs, rest: &Inputs) -> Inputs {
    Inputs {
        tip_position: outputs.tip_position,
        tip_orientation: outputs.tip_orientation,
        tip_velocity: outputs.tip_velocity,
        tip_angular_velocity: outputs.tip_angular_velocity,
        ..rest.clone()
    }
}

#[test]
fn a_rod_between_two_ends_hangs_evenly_and_stays() {
    let unit = || Unit::new(&driven(), &Inputs::default(), None).unwrap();
    let mut unit = unit();
    let start = unit.outputs().clone();
    let weight = mass(&driven()) * 9.81;
    let check = |outputs: &Outputs, rounding: f64| {
        let [base, tip] = [outputs.base_reaction_force, outputs.tip_reaction_force];
        // half of the weight each, and one thrust: outwards, so stiff is it
        assert!((base.z + 0.5 * weight).abs() < rounding * weight, "{base}");
        assert!((tip.z + 0.5 * weight).abs() < rounding * weight, "{tip}");
        assert!((base.x + tip.x).abs() < rounding * weight && base.x < 0.0, "{base} {tip}");
        let [base, tip] = [outputs.base_reaction_moment, outputs.tip_reaction_moment];
        assert!((base + tip).norm() < rounding * weight, "{base} {tip}");
        let lowest = outputs.stations[5];
        assert!((lowest.x - 0.25).abs() < rounding && lowest.z < -0.35, "{lowest}");
    };
    check(&start, 1e-9);
    for _ in 0..50 {
        unit.advance(&Inputs::default(), 0.01).unwrap();
    }
    check(unit.outputs(), 1e-7);
    assert!((unit.outputs().tip_position - Vec3::x() * 0.5).norm() < 1e-12);
    assert!((unit.outputs().stations[5] - start.stations[5]).norm() < 1e-8);
}

#[test]
fn a_stiff_beam_between_two_clamps_sags_as_the_closed_form_says() {
    // w L⁴/(384 EI) at the middle and w L²/12 at the ends, of a beam whose ends may come nearer so that it is not stretched:
    // here it is extensible, and its tension by so small a sag (a tenth of the radius) adds less than 1e-2 of that
    let parameters = Parameters {
        radius: 0.02,
        youngs_modulus: 2e9,
        shear_modulus: 8e8,
        density: 2000.0,
        extensible: true,
        ..driven()
    };
    let inputs = Inputs { tip_position: Vec3::x(), ..Inputs::default() };
    let rod = parameters.rod();
    let (weight, stiffness) = (rod.mass_per_length * 9.81, rod.stiffness.x);
    let unit = Unit::new(&parameters, &inputs, None).unwrap();
    let outputs = unit.outputs();
    // Timoshenko's share of the sag, w L²/(8 GA), is 3 (E/G) (a/L)² 16/0.9 of it
    let shear = weight * rod.compliance.x / 8.0;
    let sag = weight / (384.0 * stiffness) + shear;
    assert!((outputs.stations[5].z / -sag - 1.0).abs() < 1e-2, "{} {sag}", outputs.stations[5].z);
    let moment = weight / 12.0;
    assert!((outputs.base_reaction_moment.y.abs() / moment - 1.0).abs() < 1e-2, "{}", outputs.base_reaction_moment);
    assert!((outputs.base_reaction_moment + outputs.tip_reaction_moment).norm() < 1e-6 * moment);
}

#[test]
fn ends_that_move_as_one_body_take_the_rod_along() {
    // no gravity, a bent rod: at a constant velocity nothing is felt
    let parameters = Parameters { gravity: Vec3::zeros(), ..driven() };
    let velocity = Vec3::new(0.2, -0.3, 0.1);
    let inputs = |t: f64| Inputs {
        base_position: velocity * t,
        base_velocity: velocity,
        tip_position: Vec3::x() * 0.5 + velocity * t,
        tip_velocity: velocity,
        ..Inputs::default()
    };
    let mut unit = Unit::new(&parameters, &inputs(0.0), None).unwrap();
    let start = unit.outputs().clone();
    let thrust = start.base_reaction_force.norm();
    assert!(thrust > 0.0);
    for i in 0..30 {
        unit.advance(&inputs(0.01 * f64::from(i)), 0.01).unwrap();
        let now = unit.outputs();
        let t = 0.01 * f64::from(i + 1);
        assert!((now.base_reaction_force - start.base_reaction_force).norm() < 1e-6 * thrust, "step {i}");
        assert!((now.tip_reaction_force - start.tip_reaction_force).norm() < 1e-6 * thrust, "step {i}");
        assert!((now.stations[5] - start.stations[5] - velocity * t).norm() < 1e-8, "step {i}");
    }
    // falling with gravity, it has no weight
    let fall = |t: f64| Inputs {
        base_position: Vec3::z() * (-0.5 * 9.81 * t * t),
        base_velocity: Vec3::z() * (-9.81 * t),
        tip_position: Vec3::new(0.5, 0.0, -0.5 * 9.81 * t * t),
        tip_velocity: Vec3::z() * (-9.81 * t),
        ..Inputs::default()
    };
    let mut unit = Unit::new(&driven(), &fall(0.0), None).unwrap();
    for i in 0..40 {
        unit.advance(&fall(0.005 * f64::from(i)), 0.005).unwrap();
    }
    let outputs = unit.outputs();
    let held = outputs.base_reaction_force.z + outputs.tip_reaction_force.z;
    assert!(held.abs() < 0.2 * mass(&driven()) * 9.81, "{held}");
}

#[test]
fn a_tip_driven_as_a_loaded_one_moved_feels_that_load() {
    // a loaded run, and one whose tip is driven by what the first has recorded: what drives it feels the load that it
    // takes the place of, with the other sign
    let h = 2e-3;
    let load = |t: f64| Inputs {
        tip_force: Vec3::new(0.05 * (1.0 - (8.0 * t).cos()), 0.1 * (1.0 - (6.0 * t).cos()), 0.3),
        ..Inputs::default()
    };
    let resting = Parameters { start_in_equilibrium: true, tolerance: 1e-5, ..Parameters::default() };
    let mut loaded = Unit::new(&resting, &load(0.0), None).unwrap();
    let start = loaded.outputs().clone();
    let mut record = vec![start];
    for i in 0..200 {
        loaded.advance(&load(f64::from(i) * h), h).unwrap();
        record.push(loaded.outputs().clone());
    }
    let parameters = Parameters { tip_mode: 1, ..resting };
    let mut driven = Unit::new(&parameters, &following(&record[0], &Inputs::default()), None).unwrap();
    let first = driven.outputs().tip_reaction_force + load(0.0).tip_force;
    assert!(first.norm() < 1e-2 * 0.3, "{first}");
    let mut worst = 0.0f64;
    for i in 0..200 {
        driven.advance(&following(&record[i], &Inputs::default()), h).unwrap();
        let off = driven.outputs().tip_reaction_force + load(h * i as f64).tip_force;
        if i > 20 {
            worst = worst.max(off.norm());
        }
        let away = (driven.outputs().stations[5] - record[i + 1].stations[5]).norm();
        assert!(away < 1e-3, "step {i}: {away}");
    }
    println!("load missed by {worst}");
    assert!(worst < 0.05 * 0.5, "{worst}");
}

#[test]
fn the_energy_balance_closes() {
    let inputs = |t: f64| {
        let (sin, cos) = (5.0 * t).sin_cos();
        Inputs {
            base_position: Vec3::y() * (0.03 * (1.0 - cos)),
            base_velocity: Vec3::y() * (0.15 * sin),
            tip_position: Vec3::new(0.5 - 0.05 * (1.0 - cos), 0.0, 0.04 * (1.0 - cos)),
            tip_velocity: Vec3::new(-0.25 * sin, 0.0, 0.2 * sin),
            tip_force: Vec3::new(0.2, 0.1, 0.0),
            ..Inputs::default()
        }
    };
    let missing = |parameters: &Parameters| {
        let mut unit = Unit::new(parameters, &inputs(0.0), None).unwrap();
        let start = unit.outputs().energy;
        let (mut missing, mut power) = (0.0f64, 0.0);
        let mut worked = 0.0f64;
        for i in 0..100 {
            let before = unit.outputs().power_tip;
            unit.advance(&inputs(0.005 * f64::from(i)), 0.005).unwrap();
            power += 0.5 * 0.005 * (before + unit.outputs().power_tip);
            let energy = unit.outputs().energy;
            missing = missing.max(energy.residual(&start).abs());
            worked = worked.max(energy.work_tip.abs());
        }
        let work = unit.outputs().energy.work_tip;
        println!("{missing:e} of {worked:e}, power {power} work {work}");
        assert!((power - work).abs() < 0.02 * worked, "{power} {work}");
        missing / worked
    };
    let coarse = missing(&Parameters { step: 2.5e-3, ..driven() });
    let fine = missing(&Parameters { step: 1.25e-3, ..driven() });
    assert!(coarse < 2e-2 && fine < 0.4 * coarse, "{coarse} {fine}");
}

#[test]
fn a_tip_is_caught_and_let_go_without_a_jump() {
    type Case = (&'static str, Parameters);
    let cases: [Case; 6] = [
        ("accurate", of_mode(0)),
        ("in space", Parameters { planar: false, ..of_mode(0) }),
        ("equal steps", Parameters { step: 2e-3, ..of_mode(0) }),
        ("extensible", Parameters { extensible: true, cells: 6, ..of_mode(0) }),
        ("with a body", Parameters { tip_mass: 0.02, tip_inertia: 1e-5, ..of_mode(0) }),
        ("from the other side", of_mode(1)),
    ];
    for (name, parameters) in cases {
        let swinging = Inputs { tip_force: Vec3::y() * 0.05, ..Inputs::default() };
        let parameters = Parameters { start_in_equilibrium: true, ..parameters };
        let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
        let h = 1e-3;
        let mut before = unit.outputs().clone();
        let (mut mode, mut inputs, mut moment) = (parameters.tip_mode, swinging.clone(), 0.0f64);
        for i in 0..400 {
            if i == 100 || i == 200 || i == 300 {
                mode = 1 - mode;
                switch(&mut unit, &parameters, mode);
                // caught where it is, and brought to rest within the feed time
                inputs = following(&before, &swinging);
                if mode == 1 {
                    (inputs.tip_velocity, inputs.tip_angular_velocity) = (Vec3::zeros(), Vec3::zeros());
                }
            }
            unit.advance(&inputs, h).unwrap_or_else(|error| panic!("{name}, step {i}: {error}"));
            let now = unit.outputs();
            let way = (now.tip_position - before.tip_position).norm();
            let turned = so3::log(
                &(so3::from_quaternion(&before.tip_orientation).transpose()
                    * so3::from_quaternion(&now.tip_orientation)),
            );
            let most = before.tip_velocity.norm().max(now.tip_velocity.norm());
            let most_turn = before.tip_angular_velocity.norm().max(now.tip_angular_velocity.norm());
            // what the velocities at both ends of the step let expect, and their change
            assert!(way <= h * (1.1 * most + 0.02), "{name}, step {i}: moved by {way:e} at {most}");
            assert!(turned.norm() <= h * (1.1 * most_turn + 0.5), "{name}, step {i}: {turned} at {most_turn}");
            if mode == 0 {
                // nothing pulls it at once: no more than 10 g of a free end, and where a moment M was let go, the wave that
                // goes out from there at M/√(EI ρA)
                let rod = parameters.rod();
                let wave = moment / (rod.stiffness.x * rod.mass_per_length).sqrt();
                let change = (now.tip_velocity - before.tip_velocity).norm();
                assert!(change < 100.0 * h + wave, "{name}, step {i}: {change}");
                assert_eq!(now.tip_reaction_force, Vec3::zeros());
            } else {
                assert!(now.tip_reaction_force.norm() > 0.0, "{name}, step {i}");
                moment = now.tip_reaction_moment.norm();
            }
            before = now.clone();
        }
        println!("{name}: {} cells, {} steps", before.cells, before.solver.steps);
    }
}

#[test]
fn a_saved_state_goes_on_bit_for_bit_across_a_switch() {
    for parameters in [of_mode(0), of_mode(1), Parameters { quasi_static: true, ..of_mode(0) }] {
        let inputs = |i: usize, mode: i32| Inputs {
            tip_position: Vec3::new(0.5, 0.02 * (0.1 * i as f64).sin(), -0.3),
            tip_velocity: Vec3::y() * (0.2 * (0.1 * i as f64).cos() * f64::from(mode)),
            ..Inputs::default()
        };
        let other = 1 - parameters.tip_mode;
        let begun = Unit::new(&parameters, &inputs(0, 1), None).unwrap();
        let mut unit = Some(Box::new(begun));
        let run = |unit: &mut Option<Box<Unit>>, steps: std::ops::Range<usize>| {
            let unit = unit.as_mut().unwrap();
            steps
                .map(|i| {
                    if i == 15 {
                        switch(unit, &parameters, other);
                    }
                    let mode = if i < 15 { parameters.tip_mode } else { other };
                    unit.advance(&inputs(i, mode), 0.005).unwrap();
                    format!("{:?}", unit.outputs())
                })
                .collect::<Vec<_>>()
        };
        run(&mut unit, 0..10);
        for (from, to) in [(10, 20), (20, 30)] {
            let mut bytes = Vec::new();
            save(&mut unit, &mut bytes);
            let first = run(&mut unit, from..to);
            let mut made = None;
            load(&mut made, &bytes).unwrap();
            assert_eq!(run(&mut made, from..to), first);
            load(&mut unit, &bytes).unwrap();
            assert_eq!(run(&mut unit, from..to), first);
            assert!(are_same(&mut unit, &mut made));
        }
    }
}

#[test]
fn an_undriven_rod_does_not_see_the_inputs_of_a_driven_tip() {
    let strange = Inputs { tip_orientation: Vector4::zeros(), tip_position: Vec3::x() * 1e9, ..Inputs::default() };
    let [mut plain, mut other] =
        [Inputs::default(), strange.clone()].map(|inputs| Unit::new(&of_mode(0), &inputs, None).unwrap());
    for _ in 0..20 {
        plain.advance(&Inputs::default(), 0.01).unwrap();
        other.advance(&strange, 0.01).unwrap();
        assert_eq!(format!("{:?}", plain.outputs()), format!("{:?}", other.outputs()));
    }
}

#[test]
fn what_is_out_of_reach_is_refused_and_changes_nothing() {
    let far = Inputs { tip_position: Vec3::x() * 1.2, ..Inputs::default() };
    let error = Unit::new(&driven(), &far, None).unwrap_err();
    assert_eq!(error, Error::OutOfReach { distance: 1.2, length: 1.0 });
    let text = error.to_string();
    assert!(["1.200000 m", "length = 1 m", "extensible"].iter().all(|part| text.contains(part)), "{text}");
    // a straight rod as good as taut
    let taut = Inputs { tip_position: Vec3::x(), ..Inputs::default() };
    assert!(matches!(Unit::new(&driven(), &taut, None), Err(Error::OutOfReach { .. })));

    let bad = Inputs { tip_orientation: Vector4::zeros(), ..Inputs::default() };
    assert!(Unit::new(&driven(), &bad, None).unwrap_err().to_string().contains("tip.driven_orientation"));

    // pulled out of reach under way, by pose and by twist
    for quasi_static in [false, true] {
        let parameters = Parameters { tip_motion: 2, quasi_static, ..driven() };
        let mut unit = Unit::new(&parameters, &Inputs::default(), None).unwrap();
        let pull = Inputs { tip_velocity: Vec3::x() * 1.0, ..Inputs::default() };
        let error = (0..200).find_map(|_| {
            let before = format!("{unit:?}");
            let refused = unit.advance(&pull, 0.02).err();
            if refused.is_some() {
                let after = format!("{:?}", unit.outputs());
                assert!(before.contains(&after));
            }
            refused
        });
        let error = error.expect("it cannot go on for ever");
        assert!(matches!(error, Error::OutOfReach { distance, .. } if distance > 0.98), "{error}");
        // and goes on from there
        let still = Inputs { tip_velocity: Vec3::x() * -0.5, ..Inputs::default() };
        for _ in 0..10 {
            unit.advance(&still, 0.02).unwrap();
        }
    }

    // what a refused catch has done is undone
    let mut unit = Unit::new(&of_mode(0), &Inputs::default(), None).unwrap();
    for _ in 0..5 {
        unit.advance(&Inputs::default(), 0.01).unwrap();
    }
    let mut bytes = Vec::new();
    let mut unit = Some(Box::new(unit));
    switch(unit.as_mut().unwrap(), &of_mode(0), 1);
    save(&mut unit, &mut bytes);
    let off = Inputs { tip_velocity: Vec3::x() * 1e3, ..Inputs::default() };
    unit.as_mut().unwrap().advance(&off, 0.01).unwrap_err();
    let mut after = Vec::new();
    save(&mut unit, &mut after);
    assert!(bytes == after);
}

#[test]
fn an_extensible_rod_is_stretched() {
    let parameters = Parameters { extensible: true, gravity: Vec3::zeros(), ..driven() };
    let inputs = |way: f64| Inputs { tip_position: Vec3::x() * (1.0 + way), ..Inputs::default() };
    let unit = Unit::new(&parameters, &inputs(0.05), None).unwrap();
    let stiffness = 1.0 / parameters.rod().compliance.z;
    let pull = -unit.outputs().tip_reaction_force.x;
    assert!((pull / (0.05 * stiffness) - 1.0).abs() < 1e-9, "{pull} {stiffness}");
    assert!((unit.outputs().base_reaction_force.x / pull - 1.0).abs() < 1e-9);
    // and under way
    let parameters = Parameters { tip_motion: 2, gravity: Vec3::z() * -9.81, ..parameters };
    let mut unit = Unit::new(&parameters, &inputs(-0.01), None).unwrap();
    let moving = |velocity: f64| Inputs { tip_velocity: Vec3::x() * velocity, ..inputs(-0.01) };
    for i in 0..100 {
        unit.advance(&moving(if i < 60 { 0.1 } else { 0.0 }), 0.01).unwrap();
    }
    assert!(unit.outputs().tip_position.x > 1.04 && -unit.outputs().tip_reaction_force.x > 0.03 * stiffness);
}

#[test]
fn a_chain_like_rod_hangs_in_a_catenary() {
    // ends that slope as the catenary does: T₀ = w a with 2 a sinh(d/2a) = L
    let parameters = Parameters { radius: 1e-3, youngs_modulus: 1e6, shear_modulus: 4e5, tolerance: 1e-4, ..driven() };
    let (length, span) = (1.0, 0.6);
    let (mut low, mut high) = (0.05, 1.0);
    for _ in 0..100 {
        let a: f64 = 0.5 * (low + high);
        if 2.0 * a * (0.5 * span / a).sinh() > length { low = a } else { high = a }
    }
    let a = low;
    let slope = (0.5 * span / a).sinh().atan();
    let inputs = Inputs {
        base_orientation: sloping(slope),
        tip_position: Vec3::x() * span,
        tip_orientation: sloping(-slope),
        ..Inputs::default()
    };
    let unit = Unit::new(&parameters, &inputs, None).unwrap();
    let outputs = unit.outputs();
    let weight = parameters.rod().mass_per_length * 9.81;
    let sag = a * ((0.5 * span / a).cosh() - 1.0);
    // of the order of what the bending stiffness adds: EI/(w a³) is 7e-3
    assert!((outputs.base_reaction_force.x / (weight * a) - 1.0).abs() < 7e-3, "{}", outputs.base_reaction_force.x);
    assert!((outputs.stations[5].z + sag).abs() < 2e-3, "{} {sag}", outputs.stations[5].z);
}
