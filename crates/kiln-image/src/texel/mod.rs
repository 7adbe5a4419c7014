//! Packed texels: what a GPU samples, as pure functions from values to bytes and back.
//!
//! Each codec says what it cannot hold. Nothing here scales: divide bright maps by a power of two before.

pub mod bc6h;
pub mod r11g11b10;
pub mod rgb9e5;
