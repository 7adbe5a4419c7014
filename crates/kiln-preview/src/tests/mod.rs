//! What the preview promises, on whatever adapter there is (lavapipe in CI).

mod behind;
mod corpus;
mod deform;
mod effects;
mod faults;
mod fixture;
mod frames;
mod harmonics;
mod inspect;
mod inspect_panels;
mod lights;
mod looks;
mod offscreen;
mod panels;
mod parameters;
mod pure;
mod requests;
mod sun;
mod swap;
mod themes;
mod tools;
mod transmission;
mod twin;
mod window;
mod wire;
