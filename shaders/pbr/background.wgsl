// The environment behind the scene: sharp, or blurred through the specular chain.

import lib::environment::{skybox_radiance, specular_radiance};
import lib::colour::within_f16;
import lib::frame::frame;
import lib::fullscreen::fullscreen_position;

struct Varying {
    @builtin(position) position: vec4f,
    @location(0) direction: vec3f,
}

@vertex
fn vs_main(@builtin(vertex_index) vertex_index: u32) -> Varying {
    // Depth 1 is the far plane: drawn after the scene with `less-equal`, only what is still open is shaded.
    let position = vec4f(fullscreen_position(vertex_index), 1.0, 1.0);
    let far = frame.world_from_clip * position;
    // far.xyz / far.w - camera, times far.w > 0: no division, so an infinite far plane (w = 0) works too.
    // It is linear over the triangle, so interpolation is exact.
    return Varying(position, far.xyz - far.w * frame.camera_position);
}

@fragment
fn fs_main(in: Varying) -> @location(0) vec4f {
    // Asked of the direction too: see the tonemap about branches that hang on uniforms alone.
    let spread = frame.background_blur * in.direction;
    if dot(spread, spread) > 0.0 {
        return vec4f(within_f16(specular_radiance(in.direction, min(frame.background_blur, 1.0))), 1.0);
    }
    return vec4f(within_f16(skybox_radiance(in.direction)), 1.0);
}
