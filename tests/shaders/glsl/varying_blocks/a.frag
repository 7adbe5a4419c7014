#version 410
in VS_OUT { vec3 at; mat3 frame; flat int id; } fs_in;
noperspective in float fade[2];
layout(location = 1) out vec4 second;
layout(location = 0) out vec4 first;
void main() {
    first = vec4(fs_in.frame * fs_in.at, float(fs_in.id));
    second = vec4(fade[1], gl_FragCoord.xyz);
    gl_FragDepth = gl_FrontFacing ? 0.25 : 0.5;
}
