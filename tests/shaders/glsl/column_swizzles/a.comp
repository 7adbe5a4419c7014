#version 450
layout(local_size_x = 1) in;
layout(std430, binding = 0) buffer Data { mat3 stored; float data[]; };
struct Frame { mat4 basis; mat2x3 flat_[2]; };
int at;
void turn(inout mat3 m) { m[0].zx = m[0].xz; }
void main() {
    mat3 m = mat3(1.0);
    Frame frame;
    m[1].xz = vec2(3.0, 4.0);
    m[at++].yx *= 2.0;
    m[2].rgb -= m[1].xxx;
    frame.basis[at].wzyx = frame.basis[0];
    frame.flat_[1][at].xy += vec2(at > 1 ? 1.0 : 2.0, 3.0);
    stored[1].zy = vec2(1.0);
    m[at].y += 1.0; m[1].g++; --m[2].z; stored[0].x = m[0].y;
    turn(m);
    vec2 both = (m[0].xy = vec2(7.0));
    data[0] = m[1].x + both.y;
}
