#version 450
layout(location = 0) in vec2 from_vertex;
layout(location = 0) out vec4 colour;
layout(set = 1, binding = 2) uniform sampler2D base_color_texture;
layout(set = 3, binding = 1, std140) uniform Tint { vec4 tint; float weights[4]; bool invert; } tint;
layout(set = 3, binding = 2, std430) readonly buffer Lights { vec4 lights[]; };
layout(constant_id = 3) const int COUNT = 2;
void main() {
    vec4 sum = texture(base_color_texture, from_vertex) * tint.tint * tint.weights[COUNT];
    for (int i = 0; i < COUNT; i++) sum += lights[i];
    colour = tint.invert ? 1.0 - sum : sum;
}
