//! One elastic rod (cable, hose, umbilical, catheter, spring, hair) as an FMI 2.0 co-simulation unit.
//!
//! The rod is the dynamic Cosserat rod of Sobottka, Lay and Weber (*Stable Integration of the Dynamic Cosserat
//! Equations with Application to Hair Modeling*, 2008): a two-point boundary value problem in space, integrated in time
//! by the generalized-α method and solved by Newton's method along the whole rod at once. "eq" and "section" in these
//! pages are that paper's.
//!
//! # Layers
//!
//! The modules stand in the order of reading, which is the order of dependence:
//!
//! ```text
//! host =C=> fmi2 -> sensitivity -> unit -> {path, integrator},  integrator -> {refine, lateral} -> {plane, stepper}
//!                       integrator, unit -> span -> modes -> stepper
//!                       stepper -> {runge_kutta, pose},  pose -> sweep,  plane -> {rosenbrock, pose}
//!      examples, tests -> rate -> formulation -> {energy, stepper}
//!                       pose, rate -> {alpha, boundary, rod, mesh, archive, so3},  unit -> rest -> mesh
//! ```
//!
//! The rod is formulated twice, on the same rods, meshes, ends, time schemes and rotations: by [`pose`], which
//! [`stepper`] solves and the unit moves, and by [`rate`], which is the paper's and solves itself. [`formulation`] is
//! what both offer to those who set one beside the other; [`stepper`] says for both what a step reports and why it
//! fails. The integrator and the unit know neither [`rate`] nor [`formulation`].
//!
//! A rod that stays in a plane has in [`plane`] a third way: an ordinary differential equation in its angles alone, on the
//! same rods, meshes and ends, which [`rosenbrock`] integrates; [`lateral`] tells whether it would stay there. The cells of
//! either model refine and coarsen as [`refine`] sees fit. [`integrator`] brings all this together.
//!
//! 1. A module uses only modules listed before it (kept by `tests/layers.rs`).
//! 2. Below `fmi2` nobody knows value references, C types, logging or files. Delete `fmi2`, `package` and the command
//!    line, and the rest compiles.
//! 3. `unsafe` stands only at the C boundary, in `fmi2::abi` and its counterpart `fmi2::host`. No panic, print, thread,
//!    clock or mutable static in the library.
//! 4. [`sweep`] and [`rate::Band`] know blocks and no rod, [`archive`], [`alpha`], [`runge_kutta`] and [`rosenbrock`] know
//!    numbers and no rod; only [`pose`], [`plane`] and [`rate`] know which unknowns a section has.
//! 5. [`pose::State`] and [`rate::State`] are plain data; everything a later step depends on is in them. Rebuilding the
//!    storage around them changes no bit of any result. Same inputs, same bits, also after [`archive`] has saved and
//!    loaded them.
//! 6. Stepping allocates nothing. A failed step leaves the state as it was and says why ([`stepper::Diverged`]); the retry
//!    with smaller steps lives in [`integrator`], never in Newton.
//!
//! # Notation
//!
//! SI units. The world frame is right-handed; body-frame components refer to R = [d₁ d₂ d₃], body to world, d₃ along
//! the rod. `_s` and `_t` are derivatives by arc length and time.
//!
//! | symbol | identifier | unit | meaning |
//! |---|---|---|---|
//! | r, R | `position`, `rotation` | m, – | centreline; orientation of the section |
//! | u, ω | `velocity`, `omega` | m/s, rad/s | of the section; ω in the body frame |
//! | κ, κ̂ | `kappa`, `kappa_rest` | 1/m | (RᵀR_s)^∨: bending 1, 2 and twist 3; of the unstressed rod |
//! | n, m | `force`, `moment` | N, N·m | what the part s⁺ exerts on the part s⁻; the reaction is (n, m) at s = 0 |
//! | K, C | `stiffness`, `compliance` | N·m², 1/N | diag(EI₁, EI₂, GJ); diag(1/GA, 1/GA, 1/EA) |
//! | ρA, ρI | `mass_per_length`, `inertia_per_length` | kg/m, kg·m | |
//! | α, β, γ | `alpha`, `beta`, `gamma` | – | the time scheme: α and β weigh the old end of a step, γ the new one |
//! | h, s | `length`, `stages` | m, – | of a cell: its length, its Gauss points |
#![deny(unsafe_code)]

pub mod so3;
pub mod archive;
pub mod mesh;
pub mod rest;
pub mod rod;
pub mod sweep;
pub mod alpha;
pub mod runge_kutta;
pub mod rosenbrock;
pub mod boundary;
pub mod pose;
pub mod energy;
pub mod plane;
pub mod lateral;
pub mod stepper;
pub mod refine;
pub mod formulation;
pub mod rate;
pub mod modes;
pub mod span;
pub mod integrator;
pub mod path;
pub mod unit;
pub mod sensitivity;

pub mod fmi2;
pub mod package;
