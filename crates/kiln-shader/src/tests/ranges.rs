//! What the lint knows of an expression holds: naga evaluates it at points, and all results are in its range.

use naga::{Expression, Literal};

use crate::lint::returned_range;

/// Expressions of `x` and `y`, which can be evaluated at all points of [`INTERVALS`].
const EXPRESSIONS: &[&str] = &[
    "x + y",
    "x - y",
    "x * y",
    "x / (y * y + 0.5)",
    "x / (2.0 + abs(y))",
    "1.0 / (x - 9.0)",
    "1.0 / (9.0 - x)",
    "x % 1.5",
    "x % -0.7",
    "(x + y) % 0.3",
    "-x * x",
    "x * x - y * y",
    "x * y * x",
    "x * y * x * y",
    "abs(x) - abs(y)",
    "min(x, y)",
    "max(x, y)",
    "clamp(x, -0.5, 0.75)",
    "clamp(x, y, y + 1.0)",
    "saturate(x) * saturate(y)",
    "sign(x)",
    "floor(x) + ceil(y)",
    "round(x) - trunc(y)",
    "fract(x)",
    "sin(x) + cos(y)",
    "tanh(x)",
    "cosh(x)",
    "acos(clamp(x, -1.0, 1.0))",
    "asin(clamp(x, -1.0, 1.0))",
    "atan(x) + atan2(x, y + 9.0)",
    "exp(x) - exp2(y)",
    "log(abs(x) + 0.25)",
    "log2(x * x + 0.1)",
    "sqrt(abs(x)) - sqrt(abs(y))",
    "inverseSqrt(x * x + 0.01)",
    "pow(abs(x) + 0.1, y)",
    "pow(abs(x), 2.5)",
    "radians(x) + degrees(y)",
    "step(x, y)",
    "fma(x, y, x)",
    "dot(vec2f(x, y), vec2f(y, 2.0))",
    "dot(vec3f(x), vec3f(y, 1.0, -1.0))",
    "dot(vec2f(x, y), vec2f(x, y))",
    "length(vec3f(x, y, 1.0))",
    "distance(vec2f(x, y), vec2f(y, x))",
    "normalize(vec2f(x, 9.0)).y",
    "cross(vec3f(x, y, 1.0), vec3f(y, 1.0, x)).z",
    "(vec2f(x, y) * 2.0 - vec2f(1.0, x)).y",
    "vec4f(x, y, 1.0, -1.0).wzyx.z",
    "f32(i32(x)) + f32(u32(y))",
    "f32(i32(x * 3.0) / 2) - f32(i32(y) % 2)",
    "x - x + y",
    "1.0 - x * x",
    "(x + 1.0) * (x - 1.0)",
];

/// Functions that naga does not evaluate, with the same in others.
const EQUIVALENTS: &[(&str, &str)] = &[
    ("mix(x, y, 0.25)", "x * 0.75 + y * 0.25"),
    ("mix(x, 3.0, y)", "x * (1.0 - y) + 3.0 * y"),
    (
        "smoothstep(-1.0, 2.0, x)",
        "saturate((x + 1.0) / 3.0) * saturate((x + 1.0) / 3.0) * (3.0 - 2.0 * saturate((x + 1.0) / 3.0))",
    ),
    ("select(x, y, x > y)", "min(x, y)"),
];

const INTERVALS: [(f32, f32); 8] = [
    (0.0, 1.0),
    (-1.0, 1.0),
    (-3.0, -0.5),
    (0.25, 4.0),
    (-2.0, 0.0),
    (1.0, 1.0),
    (-0.001, 3.5),
    (1e-20, 2e-20),
];

/// Value of a constant expression, which naga's front end evaluates.
fn evaluated(expression: &str, x: f32, y: f32) -> f64 {
    let text = format!("const x: f32 = {x:?}; const y: f32 = {y:?}; const result: f32 = {expression};");
    let module =
        naga::front::wgsl::parse_str(&text).unwrap_or_else(|error| panic!("{}", error.emit_to_string(&text)));
    let (_, constant) = module.constants.iter().last().unwrap();
    match module.global_expressions[constant.init] {
        Expression::Literal(Literal::F32(value)) => value.into(),
        ref other => panic!("{expression} is {other:?}"),
    }
}

/// Range of the same with `x` and `y` anywhere in two intervals.
fn range(expression: &str, x: (f32, f32), y: (f32, f32)) -> (f64, f64) {
    let text = format!(
        "@fragment fn fs(@location(0) a: f32, @location(1) b: f32) -> @location(0) f32 {{
            let x = clamp(a, {:?}, {:?}); let y = clamp(b, {:?}, {:?}); return {expression};
        }}",
        x.0, x.1, y.0, y.1
    );
    returned_range(&text).unwrap()
}

fn points((lo, hi): (f32, f32)) -> [f32; 5] {
    [0.0, 0.25, 0.5, 0.9, 1.0].map(|t| if t == 1.0 { hi } else { lo + (hi - lo) * t })
}

/// Where a value is outside of a range.
fn outside(
    expression: &str,
    evaluable: &str,
    x: (f32, f32),
    y: (f32, f32),
    (lo, hi): (f64, f64),
) -> Option<String> {
    for a in points(x) {
        for b in points(y) {
            let value = evaluated(evaluable, a, b);
            // Other roundings than f32's own, of sines and powers.
            let slack = 1e-6 * value.abs();
            if !(lo - slack <= value && value <= hi + slack) {
                return Some(format!("{expression} at {a}, {b} is {value}, not in {lo} … {hi}"));
            }
        }
    }
    None
}

#[test]
fn ranges_hold_what_naga_evaluates() {
    let same = EXPRESSIONS.iter().map(|expression| (*expression, *expression));
    for (expression, evaluable) in same.chain(EQUIVALENTS.iter().copied()) {
        for x in INTERVALS {
            for y in [INTERVALS[1], INTERVALS[3], x] {
                let found = outside(expression, evaluable, x, y, range(expression, x, y));
                assert_eq!(found, None);
            }
        }
    }
}

#[test]
fn outside_finds_a_range_that_is_too_narrow() {
    let (x, y) = ((-1.0, 1.0), (0.0, 1.0));
    assert_eq!(outside("x * y", "x * y", x, y, range("x * y", x, y)), None);
    assert!(outside("x * y", "x * y", x, y, (-0.9, 1.0)).is_some());
    assert!(outside("x * y", "x * y", x, y, (f64::NAN, 1.0)).is_some());
}

#[test]
fn ranges_are_as_narrow_as_they_should_be() {
    let unit = (0.0, 1.0);
    let cases = [
        ("x * x", (-2.0, 1.0), (0.0, 4.0)),
        ("1.0 - x * x", unit, (0.0, 1.0)),
        ("x + 1.0", unit, (1.0, 2.0)),
        ("1.0 / (x + 1.0)", unit, (0.5, 1.0)),
        ("dot(vec2f(x, y), vec2f(x, y))", unit, (0.0, 2.0)),
        ("max(x, 0.25)", (-1.0, 1.0), (0.25, 1.0)),
        ("abs(x)", (-3.0, 2.0), (0.0, 3.0)),
    ];
    for (expression, x, expected) in cases {
        let (lo, hi) = range(expression, x, unit);
        assert!(
            (lo - expected.0).abs() <= 1e-5 && (hi - expected.1).abs() <= 1e-5,
            "{expression}: {lo} … {hi}"
        );
    }
}
