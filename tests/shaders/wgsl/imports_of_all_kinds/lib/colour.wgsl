const GREY = vec3f(0.01);

fn encoded(linear: vec3f) -> vec3f {
    return sqrt(max(linear, vec3f()));
}
