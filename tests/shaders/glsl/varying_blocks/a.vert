#version 410
in vec3 position;
in vec4 tangent;
out VS_OUT { vec3 at; mat3 frame; flat int id; } vs_out;
out gl_PerVertex { vec4 gl_Position; float gl_PointSize; };
out float fade[2];
invariant gl_Position;
void main() {
    vs_out.at = position;
    vs_out.frame = mat3(tangent.xyz, position, vec3(1.0));
    vs_out.id = gl_VertexIndex;
    fade[0] = 1.0;
    fade[1] = 2.0;
    gl_Position = vec4(position, 1.0);
}
