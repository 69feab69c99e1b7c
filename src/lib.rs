//! One elastic rod as an FMI 2.0 co-simulation unit.
#![deny(unsafe_code)]

pub mod unit;

pub mod fmi2;
pub mod package;
