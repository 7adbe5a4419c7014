//! The recipes against closed forms, symmetries and brute force.

mod environments;
mod recipes;
mod transform;
