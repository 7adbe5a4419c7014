#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec3 x;
float saturate(float v) { return clamp(v, 0.0, 1.0); }
float zero() { return 0; }
float minus() { return -1; }
uint one() { return 1; }
void main() {
    float whole;
    float part = modf(x.x, whole);
    mat3 m = outerProduct(x, x) + matrixCompMult(mat3(1.0), mat3(2.0));
    if (isnan(part) || isinf(whole) || any(isnan(x))) discard;
    colour = vec4(m * x, saturate(part) + zero() + minus() + float(one()) + inverse(m)[0].x);
}
