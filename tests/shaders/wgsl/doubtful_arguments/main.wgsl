@group(0) @binding(0) var<uniform> input: vec4f;

@fragment
fn fs_main(@location(0) normal: vec3f) -> @location(0) vec4f {
    let n = normalize(normal);
    let guarded = sqrt(max(input.x, 0.0)) / max(input.y, 1e-3);
    // kiln: allow(domain) the program that fills it keeps it above 0
    let allowed = log(input.z);
    let squared = pow(input.w, 2.0);
    return vec4f(n * guarded * allowed, squared + acos(dot(n, input.xyz)));
}
