//! What the host may set, and what it is told where it sets something else, or something fails.

use crate::stepper::Diverged;
use std::fmt;

/// What a variable may be set to, beyond being finite.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Allowed {
    /// Every finite value.
    Finite,
    /// Above zero.
    Positive,
    /// Zero and above.
    NonNegative,
    /// Both ends included.
    Between(f64, f64),
    /// A whole number, both ends included.
    Choice(i32, i32),
    /// What the words say.
    Such(&'static str),
}

impl Allowed {
    /// Whether `value` may be set. NaN and infinities never may.
    pub fn contains(self, value: f64) -> bool {
        value.is_finite()
            && match self {
                Self::Finite | Self::Such(_) => true,
                Self::Positive => value > 0.0,
                Self::NonNegative => value >= 0.0,
                Self::Between(low, high) => (low..=high).contains(&value),
                Self::Choice(low, high) => (f64::from(low)..=f64::from(high)).contains(&value),
            }
    }

    /// The attribute `min`; that of a positive variable is the bound it must not reach, as FMI knows only closed
    /// ranges.
    pub fn min(self) -> Option<f64> {
        match self {
            Self::Finite | Self::Such(_) => None,
            Self::Positive | Self::NonNegative => Some(0.0),
            Self::Between(low, _) => Some(low),
            Self::Choice(low, _) => Some(low.into()),
        }
    }

    /// The attribute `max`.
    pub fn max(self) -> Option<f64> {
        match self {
            Self::Finite | Self::Such(_) | Self::Positive | Self::NonNegative => None,
            Self::Between(_, high) => Some(high),
            Self::Choice(_, high) => Some(high.into()),
        }
    }
}

impl fmt::Display for Allowed {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Finite => write!(f, "finite"),
            Self::Positive => write!(f, "finite and > 0"),
            Self::NonNegative => write!(f, "finite and >= 0"),
            Self::Between(low, high) => write!(f, "from {low} to {high}"),
            Self::Such(words) => write!(f, "{words}"),
            Self::Choice(low, high) => write!(f, "a whole number from {low} to {high}"),
        }
    }
}

/// Why the unit refused; names are those of the unit's variables.
#[derive(Clone, Debug, PartialEq)]
pub enum Error {
    /// A parameter or input has a value that is not allowed.
    NotAllowed {
        /// Name of the variable.
        name: &'static str,
        /// Its value.
        value: f64,
        /// What is allowed.
        allowed: Allowed,
    },
    /// The rod has no static equilibrium that can be reached from its rest shape.
    NoEquilibrium(Diverged),
    /// The static equilibrium it would start from is unstable.
    UnstableEquilibrium {
        /// The lowest ω², 1/s².
        omega_squared: f64,
    },
    /// No equilibrium with the tip where it is to be driven from can be reached.
    NotHeld(Diverged),
    /// The only equilibria between the two ends that were found are unstable.
    HeldUnstably {
        /// The lowest ω², 1/s².
        omega_squared: f64,
    },
    /// The ends are to be further apart than a rod reaches that does not stretch, or nearly so.
    OutOfReach {
        /// Between the ends, m.
        distance: f64,
        /// Of the rod, m.
        length: f64,
    },
    /// The equations of motion at the start are singular.
    NoStart(Diverged),
    /// There is no step that the outputs could be differentiated in.
    NoStep,
    /// The outputs have no derivatives by time before the first step.
    NoStepYet,
    /// No equilibrium follows the last one: a rod that buckles or snaps is not at rest in between.
    NoEquilibriumNearby {
        /// Time since the start of the communication step, s.
        time: f64,
        /// How the way to the next one ended.
        cause: Diverged,
    },
    /// An internal step diverged however small it was made.
    Diverged {
        /// Time since the start of the communication step, s.
        time: f64,
        /// The smallest internal step tried, s.
        step: f64,
        /// How it ended.
        cause: Diverged,
    },
}

impl fmt::Display for Error {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NotAllowed { name, value, allowed } => write!(f, "{name} = {value} is not allowed: {allowed}"),
            Self::NoEquilibrium(cause) => {
                write!(f, "start_in_equilibrium: no static equilibrium can be reached from the rest shape ({cause})")
            }
            Self::UnstableEquilibrium { omega_squared } => write!(
                f,
                "start_in_equilibrium: the static equilibrium is unstable (lowest squared frequency {omega_squared:.3e} 1/s2)"
            ),
            Self::NotHeld(cause) => {
                write!(
                    f,
                    "tip.mode = 1: no static equilibrium between the ends can be reached from the rest shape ({cause})"
                )
            }
            Self::HeldUnstably { omega_squared } => write!(
                f,
                "tip.mode = 1: the static equilibria between the ends that were found are unstable (lowest squared frequency \
                 {omega_squared:.3e} 1/s2)"
            ),
            Self::OutOfReach { distance, length } => write!(
                f,
                "the driven tip is {distance:.6} m from the base, too far for a rod with length = {length} m that does not \
                 stretch: bring tip.driven_position nearer to base.position, or set extensible = true"
            ),
            Self::NoStart(cause) => write!(f, "the equations of motion at the start have no solution ({cause})"),
            Self::NoStep => write!(
                f,
                "there is no step to differentiate in: a state was set, or a step has failed, since the last one"
            ),
            Self::NoStepYet => write!(f, "there was no step yet, over which outputs could have changed"),
            Self::NoEquilibriumNearby { time, cause } => write!(
                f,
                "quasi_static: no static equilibrium follows the one at {time:.6} s after the communication point, as \
                 when a rod buckles or snaps ({cause})"
            ),
            Self::Diverged { time, step, cause } => {
                write!(
                    f,
                    "the internal step of {step:.1e} s at {time:.6} s after the communication point failed: {cause}"
                )
            }
        }
    }
}

impl std::error::Error for Error {}

/// Something the host should know although the step succeeded; each kind is given once in a run.
#[derive(Clone, Debug, PartialEq)]
pub enum Warning {
    /// Pose and twist of the base, or of a driven tip, do not belong to one motion.
    PoseAndTwistDisagree {
        /// Which end.
        end: &'static str,
        /// Names of the two variables.
        names: [&'static str; 2],
        /// How far apart they have run.
        distance: f64,
        /// m or rad.
        unit: &'static str,
    },
}

impl fmt::Display for Warning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::PoseAndTwistDisagree { end, names: [pose, twist], distance, unit } => write!(
                f,
                "{pose} and the motion that {twist} describes are {distance:.3e} {unit} apart; the {end} follows {twist} and \
                 is led back slowly ({end}.motion = 1 takes the pose alone, 2 the twist alone)"
            ),
        }
    }
}
