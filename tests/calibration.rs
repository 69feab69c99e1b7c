//! A tolerance is met: the built-in scenes, moved as the unit moves them, against their references.
#![allow(missing_docs)]

#[allow(dead_code)]
#[path = "../src/cli/chart/scenes.rs"]
mod scenes;

use nalgebra::Vector3;
use scenes::Scene;
use serde_json::Value;

/// Tips at a hundred equal intervals and the start, and by which they may be wrong themselves over the length.
fn reference(scene: Scene) -> (Vec<Vector3<f64>>, f64) {
    let path = format!("{}/benches/peers/reference/{}.json", env!("CARGO_MANIFEST_DIR"), scene.name());
    let content: Value = serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap();
    let vector = |v: &Value| Vector3::from_fn(|i, _| v[i].as_f64().unwrap());
    let tips = content["tip"].as_array().unwrap().iter().map(vector).collect();
    (tips, content["tip_uncertainty"].as_f64().unwrap())
}

#[test]
fn the_tip_is_within_three_times_the_tolerance() {
    for scene in Scene::ALL {
        let (tips, uncertainty) = reference(scene);
        let length = scene.parameters().length;
        // as far as the reference can tell
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5, 1e-6].into_iter().filter(|tolerance| *tolerance >= 3.0 * uncertainty)
        {
            let mut rod = scene.parameters().start(&scene.boundary(0.0), tolerance).unwrap();
            let interval = scene.duration() / (tips.len() - 1) as f64;
            let mut sum = 0.0;
            for (k, tip) in tips[1..].iter().enumerate() {
                let begin = k as f64 * interval;
                rod.advance(&|since| scene.drive(begin + since), interval).unwrap();
                sum += (rod.ends().position - tip).norm_squared();
            }
            let error = (sum / (tips.len() - 1) as f64).sqrt() / length;
            assert!(error < 3.0 * tolerance, "{}, {tolerance:e}: {error:.1e}", scene.name());
            // a scene in a plane was found to be one
            let planar = matches!(scene, Scene::Rope | Scene::Wire | Scene::Hair | Scene::Umbilical);
            assert_eq!(rod.effort().planar, planar, "{}, {tolerance:e}", scene.name());
        }
    }
}
