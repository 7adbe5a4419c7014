import first::{one, two};
import second::three;

@fragment
fn fs_main() -> @location(0) vec4f {
    return vec4f(one(), two(), three(), 1.0);
}
