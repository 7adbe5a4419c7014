enable f16;
@fragment
fn fs_main(@location(0) x: f32) -> @location(0) vec4f {
    let half = f16(x);
    return vec4f(f32(half));
}
