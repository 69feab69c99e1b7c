//! A smooth curve through points, and the pieces of constant curvature and twist that follow it.
//!
//! The curve is the cubic spline over the chords whose end slopes are those of the polynomials through the outermost four
//! points: it follows a smooth centreline with an error of fourth order in the distance of its points. The sections turn
//! along it as little as they can (the rotation-minimising frame, by double reflection: W. Wang, B. Jüttler, D. Zheng, Y. Liu:
//! Computation of rotation minimizing frames, ACM Transactions on Graphics 27, 2008), so the unstressed rod is bent and not
//! twisted.

use crate::so3;
use nalgebra::{Matrix3, Vector3};
use std::fmt;

type Vec3 = Vector3<f64>;

/// A piece of constant curvature and twist.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Stretch {
    /// m.
    pub length: f64,
    /// Curvature and twist times the length, body frame, rad.
    pub turn: Vec3,
}

/// Samples between two points: so many, or fewer of many points.
const SAMPLES: usize = 64;
/// About as many samples of a curve at most, if its points are not more than an eighth of that.
const MOST_SAMPLES: usize = 40_000;
/// Turn of one piece, rad: its rotation vector has to be found from its ends.
const MOST_TURN: f64 = 2.0;
/// Slope of the curve, over the distance of its points, below which it has no direction.
const STANDSTILL: f64 = 1e-6;

/// Why there is no curve; points are counted from 0.
#[derive(Clone, Debug, PartialEq, Eq)]
pub enum NoCurve {
    /// There are less than two.
    TooFew,
    /// This one is where the one before is.
    Same {
        /// Which.
        point: usize,
    },
    /// Behind this one the curve turns back on itself.
    TurnsBack {
        /// Which.
        point: usize,
    },
    /// The first direction of the section lies along the curve.
    Along,
}

impl fmt::Display for NoCurve {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::TooFew => write!(f, "a curve needs two points"),
            Self::Same { .. } => write!(f, "this point is where the one before is"),
            Self::TurnsBack { .. } => write!(f, "behind this point the curve turns back on itself"),
            Self::Along => write!(f, "d1 is to be across the curve where that begins"),
        }
    }
}

/// A section of the curve.
#[derive(Clone, Copy, Debug)]
struct Sample {
    arc: f64,
    position: Vec3,
    /// d₁, d₂, d₃.
    rotation: Matrix3<f64>,
    /// Turn of the tangent from the beginning on.
    turned: f64,
}

/// A curve through points.
#[derive(Clone, Debug)]
pub struct Curve {
    samples: Vec<Sample>,
}

/// The slopes of the spline at its points.
fn slopes(points: &[Vec3], chords: &[f64]) -> Vec<Vec3> {
    let count = points.len();
    let mut slopes = vec![Vec3::zeros(); count];
    let near = count.min(4);
    let (first, last) = (&points[..near], &points[count - near..]);
    slopes[0] = end_slope(first.iter(), chords[..near - 1].iter());
    slopes[count - 1] = -end_slope(last.iter().rev(), chords[count - near..].iter().rev());
    // continuous curvature: a tridiagonal system, eliminated from the first to the last
    let mut upper = vec![0.0; count];
    for i in 1..count - 1 {
        let (before, after) = (1.0 / chords[i - 1], 1.0 / chords[i]);
        let rise =
            (points[i] - points[i - 1]) * (3.0 * before * before) + (points[i + 1] - points[i]) * (3.0 * after * after);
        let pivot = 2.0 * (before + after) - before * upper[i - 1];
        upper[i] = if i + 2 < count { after / pivot } else { 0.0 };
        let known = if i + 2 < count { Vec3::zeros() } else { slopes[i + 1] * after };
        slopes[i] = (rise - slopes[i - 1] * before - known) / pivot;
    }
    for i in (1..count.saturating_sub(2)).rev() {
        let next = slopes[i + 1];
        slopes[i] -= next * upper[i];
    }
    slopes
}

/// The slope at the first of these points of the polynomial through them.
fn end_slope<'a>(points: impl Iterator<Item = &'a Vec3>, chords: impl Iterator<Item = &'a f64>) -> Vec3 {
    let mut at = 0.0;
    let ends = chords.map(|chord| {
        at += chord;
        at
    });
    let knots: Vec<f64> = [0.0].into_iter().chain(ends).collect();
    // Newton's divided differences, of which the derivative at the first knot takes products of the distances to it
    let mut differences: Vec<Vec3> = points.copied().collect();
    let (mut slope, mut product) = (Vec3::zeros(), 1.0);
    for order in 1..knots.len() {
        for i in 0..knots.len() - order {
            differences[i] = (differences[i + 1] - differences[i]) / (knots[i + order] - knots[i]);
        }
        slope += differences[0] * product;
        product *= -knots[order];
    }
    slope
}

/// A frame whose third direction is `tangent`, by the shortest turn from that whose third is z.
fn upright(tangent: &Vec3) -> Vec3 {
    let axis = Vec3::z().cross(tangent);
    let angle = axis.norm().atan2(tangent.z);
    if axis.norm() > 0.0 { so3::exp(&(axis.normalize() * angle)) * Vec3::x() } else { Vec3::x() * tangent.z.signum() }
}

impl Curve {
    /// The curve through `points`, with the first direction of its first section along `d_1`, as far as that is across it;
    /// without one, by the shortest turn from the section whose directions are x, y and z.
    ///
    /// # Errors
    /// [`NoCurve`]
    pub fn through(points: &[Vec3], d_1: Option<Vec3>) -> Result<Self, NoCurve> {
        if points.len() < 2 {
            return Err(NoCurve::TooFew);
        }
        let chords: Vec<f64> = points.windows(2).map(|pair| (pair[1] - pair[0]).norm()).collect();
        if let Some(point) = chords.iter().position(|chord| *chord <= 0.0) {
            return Err(NoCurve::Same { point: point + 1 });
        }
        let slopes = slopes(points, &chords);
        let tangent = slopes[0].normalize();
        let d_1 = d_1.unwrap_or_else(|| upright(&tangent));
        let across = d_1 - tangent * tangent.dot(&d_1);
        if across.norm() <= 1e-6 * d_1.norm() {
            return Err(NoCurve::Along);
        }
        let section = |d_1: Vec3, d_3: Vec3| {
            let d_1 = (d_1 - d_3 * d_3.dot(&d_1)).normalize();
            Matrix3::from_columns(&[d_1, d_3.cross(&d_1), d_3])
        };
        let mut last = Sample { arc: 0.0, position: points[0], rotation: section(across, tangent), turned: 0.0 };
        let mut samples = vec![last];
        let each = (MOST_SAMPLES / chords.len()).clamp(8, SAMPLES);
        for (i, &chord) in chords.iter().enumerate() {
            let ends = [points[i], points[i + 1]];
            let (rise, out, into) = (ends[1] - ends[0], slopes[i] * chord, slopes[i + 1] * chord);
            // Hermite's cubic, and its slope by the arc of the chord
            let [square, cube] = [rise * 3.0 - out * 2.0 - into, out + into - rise * 2.0];
            let velocity = |x: f64| (out + (square * 2.0 + cube * (3.0 * x)) * x) / chord;
            for k in 1..=each {
                let [from, to] = [k - 1, k].map(|k| k as f64 / each as f64);
                let (middle, half) = (0.5 * (from + to), 0.5 * (to - from) * 0.6f64.sqrt());
                // the Gauss rule of three points
                let speeds = [velocity(middle - half), velocity(middle), velocity(middle + half)].map(|v| v.norm());
                let way = chord * (to - from) * (5.0 * (speeds[0] + speeds[2]) + 8.0 * speeds[1]) / 18.0;
                let slope = velocity(to);
                if !(speeds.iter().all(|speed| *speed > STANDSTILL) && slope.norm() > STANDSTILL) {
                    return Err(NoCurve::TurnsBack { point: i });
                }
                let (position, d_3) = (ends[0] + (out + (square + cube * to) * to) * to, slope.normalize());
                let reflected =
                    |vector: Vec3, across: &Vec3| vector - across * (2.0 * across.dot(&vector) / across.norm_squared());
                let [d_1, _, before] = [0, 1, 2].map(|k| last.rotation.column(k).into_owned());
                let step = position - last.position;
                let across = d_3 - reflected(before, &step);
                let d_1 = reflected(reflected(d_1, &step), &across);
                let turned = last.turned + before.cross(&d_3).norm().atan2(before.dot(&d_3));
                last = Sample { arc: last.arc + way, position, rotation: section(d_1, d_3), turned };
                samples.push(last);
            }
        }
        Ok(Self { samples })
    }

    /// Its pieces, of which each ends in the curve to `tolerance` times its own length, and leaves it by at most `tolerance`
    /// times the length of that: all together do not leave it by more than twice as much. The sections at their ends are
    /// exact.
    pub fn stretches(&self, tolerance: f64) -> Vec<Stretch> {
        let mut stretches = Vec::new();
        let mut open = vec![(0, self.samples.len() - 1)];
        while let Some((first, last)) = open.pop() {
            let (begin, end) = (&self.samples[first], &self.samples[last]);
            let turn = so3::log(&begin.rotation.tr_mul(&end.rotation));
            let stretch = Stretch { length: end.arc - begin.arc, turn };
            if last - first == 1 || self.fits(&self.samples[first..=last], &stretch, tolerance) {
                stretches.push(stretch);
            } else {
                let middle = first.midpoint(last);
                open.extend([(middle, last), (first, middle)]);
            }
        }
        stretches
    }

    /// Whether a piece is good enough for these samples.
    fn fits(&self, samples: &[Sample], Stretch { length, turn }: &Stretch, tolerance: f64) -> bool {
        let [begin, inner @ .., end] = samples else { return true };
        let missed = |sample: &Sample| {
            let part = (sample.arc - begin.arc) / length;
            let way = so3::right_jacobian(&(turn * part)).tr_mul(&Vec3::z()) * (part * length);
            (begin.position + begin.rotation * way - sample.position).norm()
        };
        let whole = self.samples.last().map_or(*length, |sample| sample.arc);
        end.turned - begin.turned < MOST_TURN
            && missed(end) <= tolerance * length
            && inner.iter().all(|sample| missed(sample) <= tolerance * whole)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::{PI, TAU};

    /// Position and rotation of the end of pieces.
    fn end(start: &Matrix3<f64>, stretches: &[Stretch]) -> (Vec3, Matrix3<f64>) {
        stretches.iter().fold((Vec3::zeros(), *start), |(position, rotation), Stretch { length, turn }| {
            let way = so3::right_jacobian(turn).tr_mul(&Vec3::z()) * *length;
            (position + rotation * way, rotation * so3::exp(turn))
        })
    }

    fn helix(points: usize) -> Vec<Vec3> {
        let at = |k: usize| {
            let angle = 3.0 * TAU * k as f64 / (points - 1) as f64;
            Vec3::new(0.1 * angle.cos(), 0.1 * angle.sin(), 0.05 / TAU * angle)
        };
        (0..points).map(at).collect()
    }

    #[test]
    fn two_points_are_a_straight_line_of_one_piece() {
        let curve = Curve::through(&[Vec3::new(1.0, 2.0, 3.0), Vec3::new(1.0, 2.0, 5.0)], None).unwrap();
        let [Stretch { length, turn }] = curve.stretches(1e-6)[..] else { panic!("one piece") };
        assert!((length - 2.0).abs() < 1e-12 && turn.norm() < 1e-12);
    }

    #[test]
    fn three_points_are_a_parabola() {
        let parabola = |x: f64| Vec3::new(x, 0.0, x * x);
        let curve = Curve::through(&[-1.0, 0.0, 1.0].map(parabola), None).unwrap();
        // its length, in closed form
        let length: f64 = curve.stretches(1e-6).iter().map(|stretch| stretch.length).sum();
        assert!((length - (5f64.sqrt() + 2f64.asinh() / 2.0)).abs() < 1e-7, "{length}");
        let plane = curve.stretches(1e-4).iter().all(|Stretch { turn, .. }| turn.x.abs().max(turn.z.abs()) < 1e-12);
        assert!(plane, "it is bent in its plane and not twisted");
    }

    #[test]
    fn the_spline_is_of_fourth_order_and_ends_in_its_points() {
        let length = 3.0 * f64::hypot(0.1 * TAU, 0.05);
        let error = |points: usize| {
            let curve = Curve::through(&helix(points), None).unwrap();
            (curve.samples.last().unwrap().arc - length).abs()
        };
        let errors = [97, 193, 385].map(error);
        assert!(errors.windows(2).all(|pair| pair[0] / pair[1] > 12.0), "{errors:?}");
    }

    /// Its tangent turns about its axis as its curvature does, and the frame that does not twist is left behind by the angle
    /// that the torsion makes of the length.
    #[test]
    fn the_frame_along_a_helix_lags_by_its_torsion() {
        let curve = Curve::through(&helix(200), Some(-Vec3::x())).unwrap();
        let last = curve.samples.last().unwrap();
        let (radius, rise) = (0.1, 0.05 / TAU);
        let torsion = rise / (radius * radius + rise * rise);
        // after whole turns the normal is where it was, towards the axis
        let lag = (-torsion * last.arc).rem_euclid(TAU);
        let (normal, binormal) = (-Vec3::x(), last.rotation.column(2).cross(&-Vec3::x()));
        let d_1 = last.rotation.column(0);
        let angle = d_1.dot(&binormal).atan2(d_1.dot(&normal)).rem_euclid(TAU);
        assert!((angle - lag).abs() < 1e-5, "{angle} {lag}");
    }

    #[test]
    fn pieces_follow_the_curve_to_the_tolerance_with_as_many_as_it_takes() {
        let points = helix(100);
        let curve = Curve::through(&points, None).unwrap();
        let (first, last) = (&curve.samples[0], curve.samples.last().unwrap());
        let mut counts = Vec::new();
        for tolerance in [1e-2, 1e-3, 1e-4, 1e-5] {
            let stretches = curve.stretches(tolerance);
            let (position, rotation) = end(&first.rotation, &stretches);
            let missed = (first.position + position - last.position).norm();
            assert!(missed <= tolerance * last.arc, "{tolerance}: {missed}");
            assert!((rotation - last.rotation).norm() < 1e-12);
            counts.push(stretches.len());
        }
        // the curvature of the frame that does not twist turns within a piece: of second order in its length
        assert!(counts.is_sorted() && counts[3] < 16 * counts[1], "{counts:?}");
    }

    #[test]
    fn the_first_section_is_the_least_turned_or_as_given() {
        let section = |to: Vec3, d_1| Curve::through(&[Vec3::zeros(), to], d_1).unwrap().samples[0].rotation;
        let near = |a: Matrix3<f64>, b: [[f64; 3]; 3]| {
            let b = Matrix3::from_columns(&b.map(Vec3::from));
            assert!((a - b).norm() < 1e-12, "{a}");
        };
        near(section(Vec3::z(), None), [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]);
        near(section(-Vec3::z(), None), [[-1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, -1.0]]);
        // that of the unit's own start
        near(section(Vec3::x(), None), [[0.0, 0.0, -1.0], [0.0, 1.0, 0.0], [1.0, 0.0, 0.0]]);
        near(section(Vec3::x(), Some(Vec3::new(5.0, 0.0, 2.0))), [[0.0, 0.0, 1.0], [0.0, -1.0, 0.0], [1.0, 0.0, 0.0]]);
    }

    #[test]
    fn what_is_no_curve_is_refused() {
        let why = |points: &[Vec3], d_1| Curve::through(points, d_1).unwrap_err();
        let [a, b] = [Vec3::zeros(), Vec3::x()];
        assert_eq!(why(&[a], None), NoCurve::TooFew);
        assert_eq!(why(&[a, b, b], None), NoCurve::Same { point: 2 });
        assert_eq!(why(&[a, b, a], None), NoCurve::TurnsBack { point: 0 });
        assert_eq!(why(&[a, b], Some(-b)), NoCurve::Along);
        // a circle does not
        let circle = |k: i32| Vec3::new((f64::from(k) * PI / 8.0).cos(), (f64::from(k) * PI / 8.0).sin(), 0.0);
        assert!(Curve::through(&(0..=16).map(circle).collect::<Vec<_>>(), None).is_ok());
    }
}
