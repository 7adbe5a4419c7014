import lib::light::{lambert, Light as PointLight};
import lib::{colour, light::falloff};

@group(0) @binding(0) var<uniform> light: PointLight;

struct Varying {
    @builtin(position) position: vec4f,
    @location(0) normal: vec3f,
}

@vertex
fn vs_main(@location(0) position: vec3f, @location(1) normal: vec3f) -> Varying {
    return Varying(vec4f(position, 1.0), normal);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4f {
    let received = lambert(light, in.normal) * falloff(light.distance);
    return vec4f(colour::encoded(light.color * received) + lib::colour::GREY, 1.0);
}
