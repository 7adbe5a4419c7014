//! What the preview promises, on whatever adapter there is (lavapipe in CI).

mod behind;
mod corpus;
mod deform;
mod effects;
mod faults;
mod fixture;
mod frames;
mod harmonics;
mod lights;
mod panels;
mod parameters;
mod pure;
mod requests;
mod sun;
mod swap;
mod transmission;
mod twin;
mod wire;
