//! The unit as an FMI 2.0 co-simulation slave.
//!
//! ```text
//! host =C=> abi -> instance -> {saved, variables} -> unit
//! description -> {model, variables}  host: the other side of the C boundary, for the commands, tests, benchmarks
//! ```

pub mod variables;

pub mod model;

pub mod description;

mod saved;

mod instance;

mod abi;

pub mod host;
