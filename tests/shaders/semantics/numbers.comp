#version 450
layout(local_size_x = 8) in;
layout(std430, set = 0, binding = 0) buffer Data { int ints[128]; float floats[128]; };
// Another program: `mod(x, -2.5)` => `mod(x, 2.5)`
void main() {
    int base = int(gl_GlobalInvocationID.x) * 16;
    int a = ints[base], b = abs(ints[base + 1]) + 1;
    float x = floats[base], y = floats[base + 1];
    uint u = uint(a), w = uint(b);
    ints[base] = a / b;
    ints[base + 1] = abs(a) % b;
    ints[base + 2] = int(u / w) ^ int(u % w);
    ints[base + 3] = (a >> 3) + int(u >> 3) + (a << 5) + (a & 0x55) - (a | 3) + (~a ^ b);
    ints[base + 4] = int(x * 10.0) + int(uint(abs(y) * 10.0)) + int(-1.9) + int(true);
    ints[base + 5] = sign(a) * 100 + min(a, b) + max(a, -b) + clamp(a, -5, 5) + abs(a);
    ints[base + 6] = a - -b + +a * -1;
    ints[base + 7] = int(floatBitsToUint(x) >> 20) + floatBitsToInt(y) / 65536;
    ints[base + 8] = bitCount(a) + findLSB(b) * 64 + findMSB(w) * 4096 + bitfieldExtract(a, 3, 7) + int(bitfieldExtract(u, 3, 7));
    ints[base + 9] = bitfieldInsert(a, b, 4, 6) ^ int(bitfieldReverse(w));
    floats[base] = mod(x, 3.0) + 10.0 * mod(x, -2.5) + mod(vec2(y, -y), vec2(1.5)).y;
    floats[base + 1] = fract(y) + floor(x) * 2.0 + ceil(y) * 3.0 + trunc(x) * 5.0 + sign(y) * 7.0;
    floats[base + 2] = mix(x, y, 0.25) + mix(x, y, a > 0) + dot(mix(vec2(x), vec2(y), bvec2(false, true)), vec2(1.0, 2.0));
    floats[base + 3] = step(0.0, x) + smoothstep(-2.0, 2.0, y) + clamp(x, -1.0, 1.0) + float(a) / float(b);
    float whole; float rest = modf(x, whole);
    floats[base + 4] = whole * 8.0 + rest;
    vec3 v = vec3(x, y, 1.0);
    floats[base + 5] = dot(reflect(v, vec3(0.0, 1.0, 0.0)), vec3(1.0)) + length(cross(v, v.zxy)) + distance(v, v.yzx);
    floats[base + 6] = float(isnan(x)) + 2.0 * float(isinf(y)) + float(any(lessThan(v, v.yzx))) + float(all(notEqual(v, v.yzx)));
    floats[base + 7] = pow(abs(x) + 0.5, 1.5) + exp2(y * 0.25) + sqrt(abs(y)) + inversesqrt(abs(x) + 1.0) + atan(y, x + 5.0);
    floats[base + 8] = faceforward(v, v.yzx, v.zxy).x + ldexp(x, 3) + uintBitsToFloat(floatBitsToUint(y));
    const int folded = -7 / 2 + 7 % 4 + (5 > 3 ? 2 : 1) + (1 << 4);
    ints[base + 10] = folded;
}
