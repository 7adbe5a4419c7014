attribute vec3 position;
attribute vec2 uv0;
uniform mat4 clip_from_world;
varying vec2 v_uv;
varying vec3 v_direction;
void main() {
    v_uv = uv0;
    v_direction = position;
    gl_Position = clip_from_world * vec4(position, 1.0);
}
