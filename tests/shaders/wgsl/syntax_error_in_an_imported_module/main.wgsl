import package::lib::broken::f;
@fragment fn fs_main() -> @location(0) vec4f { return vec4f(f()); }
