struct Light { direction: vec3f, distance: f32, color: vec3f }

fn lambert(light: Light, normal: vec3f) -> f32 {
    return max(dot(light.direction, normal), 0.0);
}

fn falloff(distance: f32) -> f32 {
    return 1.0 / max(distance * distance, GREY);
}

const GREY = 1e-4;
