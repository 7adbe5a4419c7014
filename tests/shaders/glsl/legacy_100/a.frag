#extension GL_OES_standard_derivatives : enable
#ifdef GL_ES
precision mediump float;
#endif
varying vec2 v_uv;
varying vec3 v_direction;
uniform sampler2D picture;
uniform samplerCube env_skybox;
uniform sampler2DShadow shadow_map;
void main() {
    vec4 a = texture2D(picture, v_uv, -1.0);
    vec4 b = textureCube(env_skybox, v_direction);
    vec4 c = texture2DLod(picture, v_uv, 2.0) + textureCubeLod(env_skybox, v_direction, 1.0);
    float lit = shadow2D(shadow_map, vec3(v_uv, 0.5)).r;
    gl_FragColor = (a + b + c) * lit * fwidth(v_uv.x);
}
