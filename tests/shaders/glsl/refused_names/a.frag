#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
uniform sampler2DRect rect;
uniform double wide;
uniform samplerBuffer many;
float16_t half_;
f16vec2 halves;
dvec3 d;
uint64_t big;
void main() {
    colour = textureGather(rect, x.xy) + vec4(1.0lf);
    colour += interpolateAtCentroid(x).xyzz + float(subgroupAdd(1.0)) + gl_ModelViewProjectionMatrix * gl_Vertex;
    int e; colour += frexp(x.x, e);
    colour.x = gl_FragCord.x + gl_PointCoord.x;
    atomicAdd(e, 1);
    textureQueryLod(rect, x.xy);
}
