//! GLSL nobody should write: limits give errors, mutations neither panic nor hang.
