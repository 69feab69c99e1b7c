//! A rod in strain modes: inextensible, unshearable, with rotary inertia; explicit steps in time.
//!
//! Curvature is a polynomial along the rod (or along each of a few elements), so rotations, velocities and the
//! accelerations are integrals of it: no constraint, an ordinary differential equation, spectral accuracy. The scenes
//! are those of the work-precision charts; [`scenes`] defines them for every code.
//!
//! [`rule`] integrates along the rod, [`dense`] has the linear algebra, [`planar`] and [`spatial`] the equations of
//! motion, [`time`] the steps, [`record`] the results and their errors.

pub mod scenes;
pub mod rule;
pub mod dense;
pub mod time;
pub mod planar;
pub mod spatial;
pub mod record;
