// What is the same for the whole frame. See docs/shader-interface.md, group 0.

struct Frame {
    clip_from_world: mat4x4f,
    world_from_clip: mat4x4f,
    environment_from_world: mat4x4f,
    camera_position: vec3f,
    exposure: f32,
    environment_intensity: f32,
    specular_level_max: f32,
    skybox_scale: f32,
    irradiance_scale: f32,
    specular_scale: f32,
    background_blur: f32,
}

// A light of the scene's own. KHR_lights_punctual.
struct PunctualLight {
    // Homogeneous, in the world: a place with w = 1, or with w = 0 the direction towards what is infinitely far.
    position: vec4f,
    // Colour times intensity, in candela; in lux where w = 0. A lux on white Lambert gives radiance 1/π.
    intensity: vec3f,
    // 0 for light that reaches any distance.
    inverse_range_squared: f32,
    // Where it shines, unit length.
    direction: vec3f,
    // 1 / (cos(inner) - cos(outer)) of a spot's cone; 1 without a cone.
    cone_scale: f32,
    // 1 - cos(outer); 3 without a cone, which no angle reaches.
    outer_versine: f32,
}

// A shader may have room for another number of lights: the strongest go first.
const LIGHT_COUNT_MAX: u32 = 64u;

struct Lights {
    count: u32,
    items: array<PunctualLight, LIGHT_COUNT_MAX>,
}

// The environment's sun where it was extracted: a light from infinitely far.
struct Sun {
    // World to the shadow map: x and y from its upper left corner, z the depth it compares.
    shadow_from_world: mat4x4f,
    // Towards it, in the world, unit length.
    direction: vec3f,
    // Half of the angle that it is wide, in radians.
    angular_radius: f32,
    // Of a surface that faces it, in the environment's radiance times steradian, times intensity.
    irradiance: vec3f,
    // Edge of the shadow map's texels in the world.
    shadow_texel: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var env_skybox: texture_cube<f32>;
@group(0) @binding(2) var env_irradiance: texture_cube<f32>;
@group(0) @binding(3) var env_specular: texture_cube<f32>;
@group(0) @binding(4) var lut_ggx: texture_2d<f32>;
@group(0) @binding(5) var env_sampler: sampler;
@group(0) @binding(6) var lut_sampler: sampler;
@group(0) @binding(7) var hdr_color: texture_2d<f32>;
@group(0) @binding(8) var env_sheen: texture_cube<f32>;
@group(0) @binding(9) var lut_charlie: texture_2d<f32>;
@group(0) @binding(10) var<uniform> lights: Lights;
@group(0) @binding(11) var scene_color: texture_2d<f32>;
@group(0) @binding(12) var<uniform> sun: Sun;
@group(0) @binding(13) var sun_shadow: texture_depth_2d;
@group(0) @binding(14) var sun_shadow_sampler: sampler_comparison;
