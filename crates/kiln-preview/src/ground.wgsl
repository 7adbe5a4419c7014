// The floor: a square in the world with lines on it, or with the sun's shadow.

struct Ground {
    clip_from_world: mat4x4f,
    // As in `lib::frame`.
    shadow_from_world: mat4x4f,
    // Its middle, in the world.
    center: vec3f,
    // Half of its edge; what is drawn on it fades out towards that.
    radius: f32,
    // Towards the sun, and its irradiance on the floor over π.
    sun_direction: vec3f,
    shadow_texel: f32,
    sun_over_pi: vec3f,
    // From line to line.
    spacing: f32,
    // Undoes the scaling of the map, times intensity.
    irradiance_scale: f32,
    // Linear radiance of a line.
    line: f32,
}

@group(0) @binding(0) var<uniform> ground: Ground;
@group(0) @binding(1) var env_irradiance: texture_cube<f32>;
@group(0) @binding(2) var env_sampler: sampler;
@group(0) @binding(3) var sun_shadow: texture_depth_2d;
@group(0) @binding(4) var sun_shadow_sampler: sampler_comparison;

struct Varying {
    @builtin(position) clip_position: vec4f,
    // From the middle, along x and z.
    @location(0) place: vec2f,
}

@vertex
fn vs_main(@builtin(vertex_index) index: u32) -> Varying {
    // Two triangles, counter-clockwise seen from above.
    let corner = array(vec2f(-1.0, -1.0), vec2f(-1.0, 1.0), vec2f(1.0, -1.0), vec2f(1.0, -1.0), vec2f(-1.0, 1.0), vec2f(1.0, 1.0))[index];
    let place = ground.radius * corner;
    let world = ground.center + vec3f(place.x, 0.0, place.y);
    return Varying(ground.clip_from_world * vec4f(world, 1.0), place);
}

// 1 in the middle, 0 at the edge.
fn fading(place: vec2f) -> f32 {
    return 1.0 - smoothstep(0.2, 1.0, length(place) / ground.radius);
}

// Share of a pixel that lines of some thickness cover, at least a pixel wide; their mean where they are too close to be told apart
// (Golus 2023, "The Best Darn Grid Shader (Yet)").
fn lines(at: vec2f, width: vec2f, spacing: f32, thickness: f32) -> f32 {
    let coordinate = at / spacing;
    let pixel = width / spacing;
    let drawn = min(max(vec2f(thickness / spacing), pixel), vec2f(0.5));
    let away = abs(fract(coordinate - 0.5) - 0.5);
    let edge = 1.5 * pixel;
    var covered = 1.0 - smoothstep(0.5 * drawn - 0.5 * edge, 0.5 * drawn + edge, away);
    covered *= saturate(drawn / max(pixel, vec2f(1e-9)));
    covered = mix(covered, 2.0 * drawn, saturate(2.0 * pixel - 1.0));
    return mix(covered.x, 1.0, covered.y);
}

@fragment
fn fs_grid(in: Varying) -> @location(0) vec4f {
    let at = in.place + ground.center.xz;
    let width = fwidth(at);
    let minor = 0.3 * lines(at, width, ground.spacing, 0.01 * ground.spacing);
    let major = 0.55 * lines(at, width, 10.0 * ground.spacing, 0.02 * ground.spacing);
    return vec4f(vec3f(ground.line), max(minor, major) * fading(in.place));
}

// What a white floor keeps of its light, to be multiplied with what lies behind.
@fragment
fn fs_shadow(in: Varying) -> @location(0) vec4f {
    let world = ground.center + vec3f(in.place.x, 0.0, in.place.y);
    let sine = sqrt(saturate(1.0 - ground.sun_direction.y * ground.sun_direction.y));
    let lifted = world + vec3f(0.0, ground.shadow_texel * (2.8285 * sine + 0.5), 0.0);
    let map = (ground.shadow_from_world * vec4f(lifted, 1.0)).xyz;
    let texel = 1.0 / f32(textureDimensions(sun_shadow).x);
    var seen = 0.0;
    for (var index = 0u; index < 9u; index++) {
        let offset = vec2f(f32(index % 3u), f32(index / 3u)) - vec2f(1.0);
        seen += textureSampleCompareLevel(sun_shadow, sun_shadow_sampler, map.xy + offset * texel, saturate(map.z)) / 9.0;
    }
    let is_inside = all(map.xy >= vec2f(0.0)) && all(map.xy <= vec2f(1.0));
    let hidden = select(0.0, 1.0 - seen, is_inside) * fading(in.place);
    // The environment turns around +Y, so what it gives the floor stays.
    let sky = textureSampleLevel(env_irradiance, env_sampler, vec3f(0.0, 1.0, 0.0), 0.0).rgb * ground.irradiance_scale;
    let whole = max(sky + ground.sun_over_pi, vec3f(1e-9));
    return vec4f(1.0 - hidden * ground.sun_over_pi / whole, 1.0);
}
