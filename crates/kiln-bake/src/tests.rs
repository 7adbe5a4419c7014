//! The recipes against closed forms, symmetries and brute force.

mod cancelled_step_ends_soon;
mod encodings;
mod environments;
mod recipes;
mod transform;
