// One triangle that covers the viewport: no diagonal seam, no vertex buffer.

// Clip-space x and y of vertex 0, 1 or 2: (-1, -1), (3, -1), (-1, 3).
fn fullscreen_position(vertex_index: u32) -> vec2f {
    let x = select(-1.0, 3.0, vertex_index == 1u);
    let y = select(-1.0, 3.0, vertex_index == 2u);
    return vec2f(x, y);
}
