//! The hair tress of examples 6 and 7: one guide of keratin, 25 cm, and 180 fibres interpolated about it.
//!
//! Chosen here: the hair is wavy, a helix of radius 8 mm and pitch 5 cm when it is free of load. A fibre keeps its place
//! in the sections of the guide but for a phase that drifts along it; the tress is 13 mm wide at the root, fans out a
//! little in the middle, and narrows to the tip. The variations are fixed, so that every picture is the same.

use crate::draw::{RGBColor, Strand};
use crate::scene::{Frame, Helix, SEGMENTS, Vec3};
use cosserat_rod::mesh::Mesh;
use std::f64::consts::TAU;

/// The guide as it grows.
pub const CURL: Helix = Helix { radius: 8e-3, pitch: 0.05, length: 0.25 };
const FIBRES: usize = 180;
/// Of the tress at its root, m.
const RADIUS: f64 = 6.5e-3;

pub fn mesh() -> Mesh {
    Mesh::uniform(CURL.length, SEGMENTS, 1, CURL.kappa_rest())
}

/// The guide and its fibres in front of each other, in tones of `color`, moved by `shift`.
pub fn strands(frame: &Frame, color: RGBColor, shift: Vec3) -> Vec<Strand> {
    // the logistic map, chaotic at 3.99: no generator of random numbers, the same everywhere
    let mut x = 0.37f64;
    let mut next = move || {
        x *= 3.99 * (1.0 - x);
        x
    };
    let last = (frame.centreline.len() - 1) as f64;
    let mut strands: Vec<Strand> = (0..FIBRES)
        .map(|fibre| {
            // evenly over the disc: the golden angle
            let part = (fibre as f64 + 0.5) / FIBRES as f64;
            let (angle, radius) = (fibre as f64 * TAU * 0.381_966, part.sqrt() * RADIUS);
            let (drift, stretch, tone) = (1.6 * (next() - 0.5), 0.75 + 0.5 * next(), next());
            let at = |(j, (r, rotation)): (usize, (&Vec3, &nalgebra::Matrix3<f64>))| {
                let s = j as f64 / last;
                let spread = radius * stretch.powf(4.0 * s * (1.0 - s) + s) * (1.0 + 0.5 * s - 1.25 * s * s * s);
                let (sin, cos) = (angle + drift * s).sin_cos();
                r + rotation * Vec3::new(cos, sin, 0.0) * spread + shift
            };
            let points = frame.centreline.iter().zip(&frame.rotations).enumerate().map(at).collect();
            // from the shade to the light
            let shade = |channel: u8| {
                let dark = 0.45 * f64::from(channel);
                (dark + (0.35 + 0.65 * tone) * (0.75 * f64::from(channel) + 50.0 - dark)).min(255.0) as u8
            };
            Strand { points, color: RGBColor(shade(color.0), shade(color.1), shade(color.2)), width: 0.9, rim: false }
        })
        .collect();
    let points = frame.centreline.iter().map(|r| r + shift).collect();
    strands.push(Strand { points, color: RGBColor(color.0 / 3, color.1 / 3, color.2 / 3), width: 1.4, rim: false });
    strands
}
