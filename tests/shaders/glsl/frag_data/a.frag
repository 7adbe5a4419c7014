#version 120
uniform sampler2D picture;
varying vec2 v_uv;
void main() {
    gl_FragData[0] = texture2D(picture, v_uv);
    gl_FragData[2] = vec4(1.0);
}
