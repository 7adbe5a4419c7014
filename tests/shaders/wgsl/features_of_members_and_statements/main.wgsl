@if(coat) import layers::coat;
@if(sheen) import layers::sheen;

struct Material {
    color: vec4f,
    @if(coat) coat_factor: f32,
    @if(sheen) sheen_factor: f32,
}

@group(1) @binding(0) var<uniform> material: Material;

@fragment
fn fs_main() -> @location(0) vec4f {
    var color = material.color;
    @if(coat) color = coat(color, material.coat_factor);
    @if(sheen) color = sheen(color, material.sheen_factor);
    return color;
}
