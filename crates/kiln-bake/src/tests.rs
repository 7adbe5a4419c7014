//! The recipes against closed forms, symmetries and brute force.

mod cancelled_step_ends_soon;
mod cubes;
mod dering;
mod determinism;
mod encodings;
mod environments;
mod laws;
mod measure;
mod model;
mod recipes;
mod sun;
mod tables;
mod transform;
