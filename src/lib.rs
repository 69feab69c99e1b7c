//! One elastic rod as an FMI 2.0 co-simulation unit.
#![deny(unsafe_code)]

pub mod so3;
pub mod mesh;
pub mod rod;
pub mod sweep;
pub mod alpha;
pub mod pose;
pub mod energy;
pub mod stepper;
pub mod modes;
pub mod path;
pub mod unit;

pub mod fmi2;
pub mod package;
