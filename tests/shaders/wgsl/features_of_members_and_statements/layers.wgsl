@if(coat) fn coat(under: vec4f, factor: f32) -> vec4f { return mix(under, vec4f(1.0), factor); }
@if(sheen) fn sheen(under: vec4f, factor: f32) -> vec4f { return under + factor; }
