import effects::glow;
@fragment fn fs_main() -> @location(0) vec4f { return glow(); }
