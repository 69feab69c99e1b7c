//! Whether a rod in a plane would stay there: a disturbance out of the plane, carried along and watched.
//!
//! The disturbance is as small as one likes and obeys linear equations. It shifts the centreline by w along the normal b
//! and turns the sections by φ about axes in the plane, of which d is the tangent and d⊥ = b × d:
//!
//! ```text
//! w_s = −d⊥ · φ
//! 2 V = ∫ GJ (d · φ_s)² + EI (d⊥ · φ_s)² + m b · (φ_s × φ) + n·d (d⊥ · φ)² − n·d⊥ (d · φ)(d⊥ · φ) ds
//! 2 T = ∫ ρA w_t² + ρI_d (d · φ_t)² + ρI_⊥ (d⊥ · φ_t)² ds
//! ```
//!
//! with n and m of the motion in the plane. It is the virtual power of the rod in space to first order, but for the rotary
//! inertia of the motion in the plane and its damping. Every Gauss point has an interval as long as its weight, or three
//! where there are few, with φ linear and the rest constant in it; in time it follows Newmark's method with γ = 1 and β = 9/16,
//!
//! ```text
//! y = y₀ + h y_t0 + h² ((½ − β) y_tt0 + β y_tt)          y_t = y_t0 + h y_tt
//! ```
//!
//! whose damping keeps waves that the step does not resolve from feeding on forces that change from step to step. An
//! elimination from tip to base, which carries the energy that the rod beyond a section adds, ½ xᵀP x − qᵀx with
//! x = (w, φ), finds the new disturbance. Where one of its pivots is not positive the disturbance grows within the step,
//! and a shorter one tells how much. What buckles lets it grow without bounds; all else does not.

use crate::archive::archived;
use crate::plane::{Lateral, Plane, Slice};
use crate::pose::State;
use nalgebra::{Matrix2, Matrix3, SMatrix, SVector, Vector2, Vector3};
use std::f64::consts::FRAC_1_SQRT_2;
use std::iter::repeat_n;

/// 1/β.
const WEIGHT: f64 = 16.0 / 9.0;
/// Halvings of a step in which the disturbance grows.
const HALVINGS: u32 = 6;

/// Intervals up to which each is taken as three: of four a critical load is off by a tenth.
const FEW: usize = 11;

/// w and φ.
type Vec3 = Vector3<f64>;
/// Those of the section nearer to the base, and the turn within the interval.
type Vec5 = SVector<f64, 5>;

/// y, its rate, and that of its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Motion {
    value: Vec3,
    rate: Vec3,
    rate_t: Vec3,
}

impl Motion {
    /// The part `x` of the way to another.
    fn towards(&self, other: &Self, x: f64) -> Self {
        let between = |a: Vec3, b: Vec3| a + (b - a) * x;
        Self {
            value: between(self.value, other.value),
            rate: between(self.rate, other.rate),
            rate_t: between(self.rate_t, other.rate_t),
        }
    }

    /// After a step of `h` s to `value`.
    fn to(&self, value: Vec3, h: f64) -> Self {
        let rate_t = value * (WEIGHT / (h * h)) - self.known(h);
        Self { value, rate: self.rate + rate_t * h, rate_t }
    }

    /// What is known of the acceleration beforehand: y_tt = y/βh² − this.
    fn known(&self, h: f64) -> Vec3 {
        (self.value + self.rate * h) * (WEIGHT / (h * h)) + self.rate_t * (0.5 * WEIGHT - 1.0)
    }
}

/// The turn within an interval as a function of x at its beginning: u = constant − gain x.
#[derive(Clone, Copy, Debug, Default)]
struct Pivot {
    constant: Vector2<f64>,
    gain: SMatrix<f64, 2, 3>,
}

/// The intervals of a rod in a plane from base to tip.
fn intervals(plane: &Plane) -> impl DoubleEndedIterator<Item = Slice> {
    let each = if plane.slices().len() > FEW { 1 } else { 3 };
    let part = move |slice: Slice| repeat_n(Slice { length: slice.length / each as f64, ..slice }, each);
    plane.slices().flat_map(part)
}

/// The disturbance of a rod in a plane, with its storage.
#[derive(Clone, Debug)]
pub struct Disturbance {
    points: Vec<Motion>,
    tip: Motion,
    pivots: Vec<Pivot>,
    /// Arc lengths of the points, m; and these and the points of the last mesh.
    arcs: Vec<f64>,
    before: (Vec<f64>, Vec<Motion>),
}

archived!(Motion { value, rate, rate_t });
// [`Disturbance::copy_from`] makes the room for the pivots
archived!(Disturbance { points, tip, arcs } but { pivots, before });

impl Disturbance {
    /// Room for that of a rod with so many Gauss points at most; [`Self::begin`] comes next.
    pub fn new(points: usize) -> Self {
        let most = points.max(3 * FEW);
        let (room, arcs) = (|| Vec::with_capacity(most), || Vec::with_capacity(most));
        let (tip, pivots) = (Motion::default(), Vec::with_capacity(most));
        Self { points: room(), tip, pivots, arcs: arcs(), before: (arcs(), room()) }
    }

    /// Begins anew, at rest, on the rod where `plane` looks at: with turns that grow from the base to `size` at the tip.
    pub fn begin(&mut self, plane: &Plane, size: f64) {
        let at = |w: f64, turn: f64| Motion { value: Vec3::new(w, turn, turn), ..Motion::default() };
        self.measure(plane);
        let grown = size * FRAC_1_SQRT_2 / plane.slices().map(|slice| slice.length).sum::<f64>();
        let mut w = 0.0;
        for ((slice, point), arc) in intervals(plane).zip(&mut self.points).zip(&self.arcs) {
            let Slice { length, tangent: [cos, sin], .. } = slice;
            let half = -0.5 * length * grown * arc * (cos - sin);
            *point = at(w + half, grown * arc);
            w += 2.0 * half;
        }
        self.tip = at(w, size * FRAC_1_SQRT_2);
    }

    /// Makes room on the points of `plane`.
    fn measure(&mut self, plane: &Plane) {
        self.arcs.clear();
        let mut arc = 0.0;
        self.arcs.extend(intervals(plane).map(|slice| {
            arc += slice.length;
            arc - 0.5 * slice.length
        }));
        self.points.resize(self.arcs.len(), Motion::default());
        self.pivots.resize(self.arcs.len(), Pivot::default());
    }

    /// Goes on in another mesh of the same rod, linear between its points.
    pub fn go_on(&mut self, plane: &Plane) {
        std::mem::swap(&mut self.before.0, &mut self.arcs);
        std::mem::swap(&mut self.before.1, &mut self.points);
        self.measure(plane);
        let length: f64 = plane.slices().map(|slice| slice.length).sum();
        let (arcs, points) = (&self.before.0, &self.before.1);
        let mut next = 0;
        for (arc, point) in self.arcs.iter().zip(&mut self.points) {
            while next < arcs.len() && arcs[next] < *arc {
                next += 1;
            }
            // nothing moves at the base
            let (from, begin) = if next == 0 { (0.0, Motion::default()) } else { (arcs[next - 1], points[next - 1]) };
            let (to, end) = arcs.get(next).map_or((length, self.tip), |to| (*to, points[next]));
            *point = begin.towards(&end, (arc - from) / (to - from));
        }
    }

    /// Copies, without allocating where there is room for as many points.
    pub fn copy_from(&mut self, other: &Self) {
        self.points.clone_from(&other.points);
        self.arcs.clone_from(&other.arcs);
        self.pivots.resize(other.points.len(), Pivot::default());
        self.tip = other.tip;
    }

    /// The largest turn.
    pub fn size(&self) -> f64 {
        self.points.iter().map(|point| point.value.yz().norm()).fold(0.0, f64::max)
    }

    /// Carries it on by `time` s, with the forces and moments of `plane` where that looks at, as long as it is smaller than
    /// `most`. Whether it is to the end; otherwise it has grown as far as that, or within the shortest step.
    pub fn advance(&mut self, plane: &Plane, time: f64, most: f64) -> bool {
        let mut halvings = 0;
        let mut left = 1u32;
        while left > 0 && self.size() < most {
            let parts = 1u32 << halvings;
            if self.step(plane, time / f64::from(parts)).is_some() {
                left -= 1;
            } else if halvings < HALVINGS {
                halvings += 1;
                left *= 2;
            } else {
                return false;
            }
        }
        left == 0 && self.size() < most
    }

    /// A step of `h` s; none, and nothing has changed, if the disturbance grows within it.
    fn step(&mut self, plane: &Plane, h: f64) -> Option<()> {
        let weight = WEIGHT / (h * h);
        let Lateral { bending, twist, mass, inertia, tip_mass, tip_inertia } = plane.lateral();
        let body = Vec3::new(tip_mass, tip_inertia, tip_inertia);
        let mut stiffness = Matrix3::from_diagonal(&(body * weight));
        let mut load = body.component_mul(&self.tip.known(h));
        let parts = intervals(plane).rev().zip(self.points.iter().rev()).zip(self.pivots.iter_mut().rev());
        for ((slice, point), pivot) in parts {
            let Slice { length, tangent: d, force: n, moment: m } = slice;
            let (d, across) = (Vector2::from(d), Vector2::new(-d[1], d[0]));
            let n = Vector2::from(n);
            // the middle of the interval, and x at its end, by z = (w, φ, u) of its beginning
            let turn = SMatrix::<f64, 2, 5>::new(0.0, 1.0, 0.0, 0.5, 0.0, 0.0, 0.0, 1.0, 0.0, 0.5);
            let slope = turn.tr_mul(&across) * length;
            let shift = Vec5::x() - slope * 0.5;
            let mut end = SMatrix::<f64, 3, 5>::new(
                1.0, 0.0, 0.0, 0.0, 0.0, //
                0.0, 1.0, 0.0, 1.0, 0.0, //
                0.0, 0.0, 1.0, 0.0, 1.0,
            );
            end.row_mut(0).tr_copy_from(&(Vec5::x() - slope));

            let outer = |a: &Vector2<f64>, b: &Vector2<f64>| a * b.transpose();
            let (along, square, mixed) = (outer(&d, &d), outer(&across, &across), outer(&d, &across));
            let spin = along * inertia[0] + square * inertia[1];
            let geometric = square * n.dot(&d) - (mixed + mixed.transpose()) * (0.5 * n.dot(&across));
            let middle = (geometric + spin * weight) * length;
            let mut form = end.tr_mul(&(stiffness * end)) + turn.tr_mul(&(middle * turn));
            form += shift * shift.transpose() * (length * weight * mass);
            let elastic = (along * twist + square * bending) / length;
            let couple = Matrix2::new(0.0, 1.0, -1.0, 0.0) * (0.5 * m);
            let mut own = form.fixed_view_mut::<2, 2>(3, 3);
            own += elastic;
            let mut to_turn = form.fixed_view_mut::<2, 2>(3, 1);
            to_turn += couple;
            let mut to_end = form.fixed_view_mut::<2, 2>(1, 3);
            to_end += couple.transpose();
            let known = point.known(h);
            let right =
                end.tr_mul(&load) + shift * (length * mass * known.x) + turn.tr_mul(&(spin * known.yz() * length));

            let own: Matrix2<f64> = form.fixed_view::<2, 2>(3, 3).into_owned();
            let inverse = own.try_inverse().filter(|_| own[(0, 0)] > 0.0 && own.determinant() > 0.0)?;
            let by_x: SMatrix<f64, 2, 3> = form.fixed_view::<2, 3>(3, 0).into_owned();
            let (of_x, of_u) = (right.fixed_rows::<3>(0), right.fixed_rows::<2>(3));
            *pivot = Pivot { constant: inverse * of_u, gain: inverse * by_x };
            stiffness = form.fixed_view::<3, 3>(0, 0) - by_x.tr_mul(&pivot.gain);
            load = of_x - by_x.tr_mul(&pivot.constant);
        }

        let mut x = Vec3::zeros();
        for ((slice, point), Pivot { constant, gain }) in intervals(plane).zip(&mut self.points).zip(&self.pivots) {
            let Slice { length, tangent: [cos, sin], .. } = slice;
            let u = constant - gain * x;
            let middle = x.yz() + u * 0.5;
            let way = -length * (middle.y * cos - middle.x * sin);
            *point = point.to(Vec3::new(x.x + 0.5 * way, middle.x, middle.y), h);
            x += Vec3::new(way, u.x, u.y);
        }
        self.tip = self.tip.to(x, h);
        Some(())
    }

    /// Adds `part` of its rates to the spins of `state`, which is that of `plane` in space, or as much of them as changes no
    /// spin by more than `most` rad/s.
    pub fn disturb(&self, plane: &Plane, part: f64, most: f64, state: &mut State) {
        let each = self.points.len() / plane.slices().len();
        // the Gauss points are the middles
        let motions = || self.points.iter().skip(each / 2).step_by(each).chain([&self.tip]);
        let part = part.min(most / motions().map(|motion| motion.rate.yz().norm()).fold(0.0, f64::max));
        for (i, motion) in motions().enumerate() {
            let spin = plane.in_world([motion.rate.y * part, motion.rate.z * part]);
            let turned = state.remembering(i).rotation.tr_mul(&spin);
            state.memory[i].spin.velocity.value += turned;
        }
    }
}
