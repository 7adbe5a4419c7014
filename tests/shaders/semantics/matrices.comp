#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `m[2].zxy - m[at]` => `m[2].zyx - m[at]`
vec4 row(mat4 m, int i) { return vec4(m[0][i], m[1][i], m[2][i], m[3][i]); }
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    vec4 a = vec4(floats[base], floats[base + 1], floats[base + 2], floats[base + 3]);
    vec4 b = vec4(floats[base + 4], floats[base + 5], floats[base + 6], floats[base + 7]);
    mat4 big = mat4(a, b, a * b, a - b);
    mat3 m = mat3(big);
    mat2 turn = mat2(b);
    mat2x3 wide = mat2x3(a.xyz, b.yzw);
    int at = abs(ints[base]) % 3;
    floats[base] = dot(big * a, b) + dot(a * big, b);
    floats[base + 1] = determinant(m + mat3(3.0));
    floats[base + 2] = dot(turn * a.xy, b.zw) + (turn * turn)[1][0];
    floats[base + 3] = dot(transpose(wide) * a.xyz, vec2(1.0, 2.0)) + dot(wide * a.xy, vec3(1.0));
    m[at].zx = m[1].xz;
    m[at].y += 1.0;
    m[2].yx *= 2.0;
    m[0] = m[2].zxy - m[at];
    floats[base + 4] = m[0].x + 2.0 * m[0].y + 3.0 * m[0].z;
    floats[base + 5] = m[1].x + 2.0 * m[1].y + 3.0 * m[1].z;
    floats[base + 6] = m[2].x + 2.0 * m[2].y + 3.0 * m[2].z;
    mat3 other = matrixCompMult(m, outerProduct(a.xyz, b.xyz));
    other *= 0.5; other += m; other /= 4.0; other -= 1.0;
    floats[base + 7] = other[0][1] + other[1][2] - other[2][0];
    m *= other;
    floats[base + 8] = m[0][1] + m[1][2] - m[2][0];
    floats[base + 9] = dot(row(big, at), vec4(1.0, 2.0, 3.0, 4.0));
    floats[base + 10] = (m == other ? 1.0 : 2.0) + (m == m ? 10.0 : 20.0) + (big != mat4(a, b, a * b, a - b) ? 100.0 : 200.0);
    mat2 inverted = inverse(mat2(2.0, 1.0, a.x, 9.0 + abs(b.y)));
    floats[base + 11] = inverted[0].y + inverted[1].x;
    vec3 v = b.xyz; v *= m;
    floats[base + 12] = v.x + v.y * 2.0 + v.z * 4.0;
}
