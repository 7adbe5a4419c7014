#version 450
layout(location = 0) out vec4 colour;
layout(location = 0) in vec2 uv;
uniform sampler2D maps[2];
uniform sampler2D map;
uniform texture2D separate[2];
uniform int at;
vec4 one(sampler2D map) { return texture(map, uv); }
vec4 all(sampler2D map[]) { return texture(map[0], uv); }
void main() {
    colour = texture(maps[2], uv) + texture(maps[-1], uv) + texture(maps, uv) + maps[0] + texture(map[0], uv);
    colour += one(maps[at]) + textureOffset(maps[at], uv, ivec2(at));
}
