//! What the preview promises, on whatever adapter there is (lavapipe in CI).

mod corpus;
mod faults;
mod fixture;
mod frames;
mod panels;
mod pure;
mod wire;
