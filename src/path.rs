//! The motion of a driven end between communication points: one C¹ path through what the host samples.
//!
//! Within a communication step of length H the acceleration of the path is linear in time; the path begins with the
//! velocity it had and ends with
//!
//! ```text
//! v* = v + v̇ H + (r − r_path)/T
//! ```
//!
//! v is the sampled velocity, v̇ its change over the last step, and the slope of the acceleration the change of v̇. The
//! last term feeds the distance between the sampled position and the path back over the time T: positions rounded by a
//! few digits do not shake the acceleration, and a path that missed something returns. Rotations do the same through
//! exp, in world axes.
//!
//! A host that gives derivatives of what it samples ([`Onward`]) says v̇, and perhaps v̈, itself. The path then ends with
//! v + v̇ H + v̈ H²/2, fed back as before, and v̈ is the slope of its acceleration. A v̈ that is not given is what v + v̇ H of
//! the last step missed: nothing where the host gives the slopes of a table, and else the path gains an order.

use crate::archive::archived;
use crate::boundary::Support;
use crate::so3;
use nalgebra::{Matrix3, Vector3};

type Vec3 = Vector3<f64>;
type Mat3 = Matrix3<f64>;

/// Shortest time over which a distance between samples and path is fed in, s; with a derived twist, whose own errors it
/// corrects.
const FEED_TIME: [f64; 2] = [0.1, 0.02];
/// The same in communication steps, so that the feedback is far from its stability limit of two steps.
const FEED_STEPS: [f64; 2] = [10.0, 5.0];
/// Memory of the tracker that derives a twist from poses, s.
const TRACK_TIME: f64 = 0.01;
/// The same in communication steps.
const TRACK_STEPS: f64 = 1.5;

/// Which samples the host gives.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Given {
    /// Pose and twist.
    PoseAndTwist,
    /// Pose; the twist is derived.
    Pose,
    /// Twist; the pose is integrated from the first one.
    Twist,
}

/// What the host samples at a communication point, world frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Position, m.
    pub position: Vec3,
    /// Orientation.
    pub rotation: Mat3,
    /// Velocity, m/s.
    pub velocity: Vec3,
    /// Angular velocity, rad/s.
    pub angular_velocity: Vec3,
}

/// First and second derivatives by time of what is sampled, world frame, as far as the host gives them; a first one is
/// there where the second is.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Onward {
    /// Of the position, m/s and m/s².
    pub position: [Option<Vec3>; 2],
    /// Angular velocity and acceleration by which the orientation goes on, rad/s and rad/s².
    pub rotation: [Option<Vec3>; 2],
    /// Of the velocity, m/s² and m/s³.
    pub velocity: [Option<Vec3>; 2],
    /// Of the angular velocity, rad/s² and rad/s³.
    pub angular_velocity: [Option<Vec3>; 2],
}

/// What the host says of a velocity, linear or angular, beyond samples: itself, and its derivatives.
#[derive(Clone, Copy, Debug)]
struct Told {
    velocity: Vec3,
    rate: Option<Vec3>,
    jerk: Option<Vec3>,
}

impl Told {
    /// From a sampled velocity and the derivatives of velocity and pose; `None` if there is nothing but samples.
    fn of(given: Given, sampled: Vec3, by_velocity: [Option<Vec3>; 2], by_pose: [Option<Vec3>; 2]) -> Option<Self> {
        let [first, second] = by_pose;
        match (given, by_velocity) {
            (Given::Pose, _) => first.map(|velocity| Self { velocity, rate: second, jerk: None }),
            (_, [Some(rate), jerk]) => Some(Self { velocity: sampled, rate: Some(rate), jerk }),
            (Given::PoseAndTwist, _) => second.map(|rate| Self { velocity: sampled, rate: Some(rate), jerk: None }),
            (Given::Twist, _) => None,
        }
    }

    /// v̇ and v̈ for a step of `step` s, after one of `last_step` s that began with `velocity` and `rate`, which the host had
    /// told if it `was_told`.
    fn rates(&self, step: f64, last_step: f64, velocity: Vec3, rate: Vec3, was_told: bool) -> (Vec3, Vec3) {
        let change = self.velocity - velocity;
        let zero = Vec3::zeros();
        match (self.rate, self.jerk) {
            (Some(rate), Some(jerk)) => (rate, jerk),
            // what was missed in a short step is not to be made a large one in a long step
            (Some(now), None) if was_told => (now, (change - rate * last_step) * (2.0 / step.max(last_step).powi(2))),
            (Some(now), None) => (now, zero),
            (None, _) if last_step > 0.0 => (change / last_step, zero),
            (None, _) => (zero, zero),
        }
    }
}

/// A twist, or its rate.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Twist {
    linear: Vec3,
    angular: Vec3,
}

impl Twist {
    fn map(self, f: impl Fn(Vec3) -> Vec3) -> Self {
        Self { linear: f(self.linear), angular: f(self.angular) }
    }

    fn plus(self, factor: f64, other: Self) -> Self {
        Self { linear: self.linear + other.linear * factor, angular: self.angular + other.angular * factor }
    }
}

/// The path up to the last communication point, and what it remembers of the samples.
#[derive(Clone, Debug, PartialEq)]
pub struct Path {
    given: Given,
    base: Support,
    /// The last sample, or the tracker's estimate of it, with its rate.
    last: Sample,
    rate: Twist,
    /// Change of the rate over the last step.
    jerk: Twist,
    /// Whether the host has told the rate, linear and angular.
    told: [bool; 2],
    /// Length of the last communication step; 0 before the first.
    last_step: f64,
    samples: u32,
}

/// The path within one communication step.
#[derive(Clone, Debug, PartialEq)]
pub struct Segment {
    start: Support,
    /// At the start of the step.
    acceleration: Twist,
    /// The path as it will be at the end.
    next: Path,
    /// Distance of the sampled position from the path at the start of the step, m.
    pub distance: f64,
    /// The same of the orientation, rad.
    pub angle: f64,
}

archived!(Sample { position, rotation, velocity, angular_velocity });
archived!(Twist { linear, angular });
archived!(Path { base, last, rate, jerk, told, last_step, samples } but { given });

impl Sample {
    fn twist(&self) -> Twist {
        Twist { linear: self.velocity, angular: self.angular_velocity }
    }
}

impl Path {
    /// A path that begins at `sample`; at rest if the twist is not given.
    pub fn new(given: Given, sample: Sample) -> Self {
        let mut last = sample;
        if given == Given::Pose {
            (last.velocity, last.angular_velocity) = (Vec3::zeros(), Vec3::zeros());
        }
        let base = Support {
            velocity: last.velocity,
            angular_velocity: last.angular_velocity,
            ..Support::at_rest(sample.position, sample.rotation)
        };
        let (rate, jerk) = Default::default();
        Self { given, base, last, rate, jerk, told: [false; 2], last_step: 0.0, samples: 0 }
    }

    /// A path that begins with the motion `present` of an end, whatever it did before, and is led to the samples of which
    /// `first` is the first one.
    pub fn caught(given: Given, present: &Sample, first: &Sample) -> Self {
        let mut path = Self::new(given, *present);
        (path.base.velocity, path.base.angular_velocity) = (present.velocity, present.angular_velocity);
        // a twist that is not given is that of the end until a second pose tells
        let twist = if given == Given::Pose { present } else { first };
        path.last = Sample { velocity: twist.velocity, angular_velocity: twist.angular_velocity, ..*first };
        path
    }

    /// The end at the last communication point.
    pub fn base(&self) -> &Support {
        &self.base
    }

    /// Whether it has left its beginning.
    pub fn has_begun(&self) -> bool {
        self.samples > 0
    }

    /// The path over the next `step` s, from a sample at its start, and from what the host says of how it goes on.
    pub fn segment(&self, sample: &Sample, onward: &Onward, step: f64) -> Segment {
        let mut next = Self { jerk: Twist::default(), ..self.clone() };
        match self.given {
            Given::Pose => next.track(sample),
            Given::PoseAndTwist | Given::Twist => {
                if self.last_step > 0.0 {
                    let per_step = 1.0 / self.last_step;
                    next.rate = sample.twist().plus(-1.0, self.last.twist()).map(|change| change * per_step);
                    if self.samples > 1 {
                        next.jerk = next.rate.plus(-1.0, self.rate).map(|change| change * per_step);
                    }
                }
                next.last = *sample;
            }
        }
        next.listen(self, sample, onward, step);
        let mut away = Twist {
            linear: next.last.position - self.base.position,
            angular: so3::log(&(next.last.rotation * self.base.rotation.transpose())),
        };
        if self.given == Given::Twist {
            away = Twist::default();
        }
        let derived = usize::from(self.given == Given::Pose);
        let feed = 1.0 / FEED_TIME[derived].max(FEED_STEPS[derived] * step);
        let mut target = next.last.twist().plus(step, next.rate).plus(feed, away);
        let now = Twist { linear: self.base.velocity, angular: self.base.angular_velocity };
        if next.told[0] {
            target.linear += next.jerk.linear * (0.5 * step * step);
        }
        if next.told[1] {
            target.angular += next.jerk.angular * (0.5 * step * step);
            // of the rotation vector Φ since the start: Φ_t = ω − Φ × ω/2 + …, and at the start Φ_ttt = ω_tt − ω × ω_t/2
            let turned = (now.angular + target.angular) * (0.5 * step);
            target.angular -= turned.cross(&target.angular) * 0.5;
            next.jerk.angular -= next.last.angular_velocity.cross(&next.rate.angular) * 0.5;
        }
        let mean = target.plus(-1.0, now).map(|change| change / step);
        let acceleration = mean.plus(-0.5 * step, next.jerk);
        next.last_step = step;
        next.samples = self.samples.saturating_add(1);
        let mut segment =
            Segment { start: self.base, acceleration, next, distance: away.linear.norm(), angle: away.angular.norm() };
        segment.next.base = segment.at(step);
        segment
    }

    /// Takes what the host says of how the sample goes on in place of what the samples `before` tell.
    fn listen(&mut self, before: &Self, sample: &Sample, onward: &Onward, step: f64) {
        let linear = Told::of(self.given, sample.velocity, onward.velocity, onward.position);
        let angular = Told::of(self.given, sample.angular_velocity, onward.angular_velocity, onward.rotation);
        let (last, last_step) = (&before.last, before.last_step);
        let rates =
            |told: &Told, velocity, rate, part: usize| told.rates(step, last_step, velocity, rate, before.told[part]);
        if let Some(told) = &linear {
            (self.last.position, self.last.velocity) = (sample.position, told.velocity);
            (self.rate.linear, self.jerk.linear) = rates(told, last.velocity, before.rate.linear, 0);
        }
        if let Some(told) = &angular {
            (self.last.rotation, self.last.angular_velocity) = (sample.rotation, told.velocity);
            (self.rate.angular, self.jerk.angular) = rates(told, last.angular_velocity, before.rate.angular, 1);
        }
        self.told = [linear, angular].map(|told| told.is_some_and(|told| told.rate.is_some()));
    }

    /// Fading-memory fit of a parabola to the poses (the g-h-k filter with equal roots θ): position, twist and its
    /// rate.
    fn track(&mut self, sample: &Sample) {
        let step = self.last_step;
        if self.samples == 0 {
            return;
        }
        // at first the memory is no longer than the samples there are: two give a line, three a parabola
        let theta = (-step / TRACK_TIME.max(TRACK_STEPS * step)).exp().min(1.0 - 2.0 / f64::from(self.samples.max(2)));
        let (g, h, k) = match self.samples {
            1 => (1.0, 1.0, 0.0),
            _ => (1.0 - theta.powi(3), 1.5 * (1.0 - theta).powi(2) * (1.0 + theta), 0.5 * (1.0 - theta).powi(3)),
        };
        let predicted = self.last.twist().map(|v| v * step).plus(0.5 * step * step, self.rate);
        let rotation = so3::exp(&predicted.angular) * self.last.rotation;
        let position = self.last.position + predicted.linear;
        let miss =
            Twist { linear: sample.position - position, angular: so3::log(&(sample.rotation * rotation.transpose())) };
        let twist = self.last.twist().plus(step, self.rate).plus(h / step, miss);
        self.rate = self.rate.plus(2.0 * k / (step * step), miss);
        self.last = Sample {
            position: position + miss.linear * g,
            rotation: so3::exp(&(miss.angular * g)) * rotation,
            velocity: twist.linear,
            angular_velocity: twist.angular,
        };
    }
}

impl Segment {
    /// The end at the start of the step.
    pub fn start(&self) -> &Support {
        &self.start
    }

    /// The way since the start of the step, its rate and that of its rate.
    fn coordinates(&self, time: f64) -> [Twist; 3] {
        let Support { velocity, angular_velocity, .. } = self.start;
        let now = Twist { linear: velocity, angular: angular_velocity };
        let (start, slope, square) = (self.acceleration, self.next.jerk, time * time);
        [
            now.map(|v| v * time).plus(0.5 * square, start).plus(square * time / 6.0, slope),
            now.plus(time, start).plus(0.5 * square, slope),
            start.plus(time, slope),
        ]
    }

    /// The end `time` s after the start of the step.
    pub fn at(&self, time: f64) -> Support {
        let Support { position, rotation, .. } = self.start;
        let [moved, twist, acceleration] = self.coordinates(time);
        Support {
            position: position + moved.linear,
            rotation: so3::orthonormalised(&(so3::exp(&moved.angular) * rotation)),
            velocity: twist.linear,
            // the left Jacobian is the right one of −Φ
            angular_velocity: so3::right_jacobian(&-moved.angular) * twist.angular,
            acceleration: acceleration.linear,
            ..self.start
        }
    }

    /// How fast its acceleration and its angular velocity change then.
    pub fn rates(&self, time: f64) -> (Vec3, Vec3) {
        let [moved, twist, acceleration] = self.coordinates(time).map(|twist| twist.angular);
        let map = so3::Tangent::new(&-moved);
        (self.next.jerk.linear, map.jacobian() * acceleration - map.by_log(&twist) * twist)
    }

    /// The path at the end of the step.
    pub fn into_path(self) -> Path {
        self.next
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::f64::consts::TAU;

    fn sample(position: f64, velocity: f64) -> Sample {
        Sample {
            position: Vec3::x() * position,
            rotation: so3::exp(&(Vec3::z() * position)),
            velocity: Vec3::x() * velocity,
            angular_velocity: Vec3::z() * velocity,
        }
    }

    /// Accelerations at the ends of the steps, and the distance of path and motion there, over `periods` of a sine.
    fn sine(given: Given, per_period: usize, periods: usize) -> Vec<(f64, f64, f64)> {
        let (w, h) = (TAU, 1.0 / per_period as f64);
        // starts smoothly: the amplitude fades in over one period
        let x = |t: f64| {
            let fade = if t < 1.0 { t * t * t * (10.0 - 15.0 * t + 6.0 * t * t) } else { 1.0 };
            fade * (w * t).sin()
        };
        let v = |t: f64| (x(t + 1e-6) - x(t - 1e-6)) / 2e-6;
        let a = |t: f64| (x(t + 1e-4) - 2.0 * x(t) + x(t - 1e-4)) / 1e-8;
        let mut path = Path::new(given, sample(0.0, 0.0));
        (0..periods * per_period)
            .map(|i| {
                let t = i as f64 * h;
                path = path.segment(&sample(x(t), v(t)), &Onward::default(), h).into_path();
                (path.base.acceleration.x, a(t + h), path.base.position.x - x(t + h))
            })
            .collect()
    }

    #[test]
    fn the_rates_are_derivatives() {
        let twist = Twist { linear: Vec3::new(1.0, -2.0, 0.5), angular: Vec3::new(0.3, 1.0, -0.4) };
        let mut path = Path::new(Given::Twist, sample(0.1, 0.7));
        path.base.angular_velocity = Vec3::new(0.2, -0.5, 0.9);
        let mut segment = path.segment(&sample(0.2, 1.1), &Onward::default(), 0.3);
        (segment.acceleration, segment.next.jerk) = (twist, twist.map(|x| x.yzx()));
        let (time, step) = (0.2, 1e-5);
        let change =
            |of: fn(&Support) -> Vec3| (of(&segment.at(time + step)) - of(&segment.at(time - step))) / (2.0 * step);
        let (jerk, angular) = segment.rates(time);
        // the second order of the differences, and their rounding
        assert!((change(|base| base.acceleration) - jerk).norm() < 1e-8);
        assert!((change(|base| base.angular_velocity) - angular).norm() < 1e-8);
    }

    #[test]
    fn a_sampled_sine_is_followed_at_first_order_or_better_in_every_mode() {
        for given in [Given::PoseAndTwist, Given::Pose, Given::Twist] {
            let error = |n| {
                let steps = sine(given, n, 4);
                steps[n..].iter().map(|(path, exact, _)| (path - exact).abs()).fold(0.0, f64::max) / (TAU * TAU)
            };
            let (coarse, fine, finest) = (error(20), error(40), error(80));

            assert!(fine < 0.65 * coarse && finest < 0.65 * fine, "{given:?}: {coarse} {fine} {finest}");
            // H a/2 per step at most: half a step late, and the extrapolation's own error
            assert!(coarse < 1.2, "{given:?}: {coarse}");
        }
    }
}
