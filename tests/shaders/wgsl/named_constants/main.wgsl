// Names of constants stay names: what is computed with them is not constant.
struct P { a: f32 }
@group(3) @binding(0) var<uniform> params: P;
fn f(x: i32) -> i32 { switch x { case 1: { return 2; } default: { return 3; } } }
fn pick(v: array<f32, 4>, i: u32) -> f32 { let w = v; return w[i]; }
@fragment fn fs_main(@location(0) x: f32) -> @location(0) vec4f {
  let arr = array<f32, 4>(1.0, 2.0, 3.0, x);
  let carr = array(1.0, 2.0, 3.0, 4.0);
  let z = array<f32, 4>();
  let p = &params;
  let b = true;
  let m = mat2x2f();
  let q = vec4f();
  var acc = 0.0;
  for (var i = 0u; i < 4u; i += 1u) { acc += arr[i] * carr[i] + z[i] + pick(carr, i); }
  if b { acc += (*p).a; }
  let bits = bitcast<u32>(1.5);
  let n = -1;
  return vec4f(acc, m[0].x, q.x, f32(f(n)) + f32(bits >> 3u)) + select(q, vec4f(1.0), b);
}
