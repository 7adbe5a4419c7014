#version 300 es
precision mediump float;
precision mediump sampler2D;
in mediump vec3 v_normal;
flat in int v_index;
layout(location = 0) out lowp vec4 colour;
uniform highp sampler2D my_map;
highp float shade(const in highp vec3 n) { return max(n.z, 0.0); }
void main() {
#ifdef GL_ES
    colour = vec4(shade(normalize(v_normal))) * texelFetch(my_map, ivec2(v_index, 0), 0);
#endif
}
