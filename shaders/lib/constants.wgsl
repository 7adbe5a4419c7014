// Numbers that several modules need.

const PI: f32 = 3.14159265358979;

// Least alpha = perceptual roughness² that distributions tell from a mirror: at the peak GGX is 1 / (π alpha²) = 3e15,
// which times a visibility of 5e13 is still an f32.
const ALPHA_MIN: f32 = 1e-8;
