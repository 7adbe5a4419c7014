//! Damage, small and monstrous.

use crate::corpus::Input;
use crate::damage::{bytes, token_ranges, tokens};
use crate::random::Random;

/// One to three changes to one file of `input`, most often its root. `others` lends text.
pub fn mutate(input: &Input, others: &[Input], random: &mut Random) -> Input {
    let mut mutant = Input { is_valid: false, ..input.clone() };
    let paths: Vec<String> = mutant.files.keys().cloned().collect();
    let path = match mutant.program.roots.iter().find(|root| mutant.files.contains_key(*root)) {
        Some(root) if !random.one_in(4) => root.clone(),
        _ => random.pick(&paths).clone(),
    };
    let mut text = mutant.files[&path].clone();
    let is_wgsl = path.ends_with(".wgsl");
    for _ in 0..1 + random.below(3) {
        text = match random.below(9) {
            0 => bytes(text, random),
            1 | 2 => tokens(&text, random),
            3 => splice(&text, random.pick(others), random),
            4 => at_a_number(&text, &nested(random), random),
            5 => at_a_number(&text, &chain(random), random),
            6 => at_a_number(&text, NUMBERS[random.below(NUMBERS.len())], random),
            7 => text + &bomb(is_wgsl, random),
            _ => includes(text, is_wgsl, &mut mutant, random),
        };
    }
    mutant.files.insert(path, text);
    mutant
}

/// Lines of another shader.
fn splice(text: &str, other: &Input, random: &mut Random) -> String {
    let files: Vec<&String> = other.files.values().collect();
    let lent: Vec<&str> = random.pick(&files).lines().collect();
    let mut lines: Vec<&str> = text.lines().collect();
    let start = random.below(lent.len() + 1);
    let end = (start + 1 + random.below(20)).min(lent.len());
    let at = random.below(lines.len() + 1);
    let gone = (at + random.below(5)).min(lines.len());
    lines.splice(at..gone, lent[start.min(end)..end].iter().copied());
    lines.join("\n")
}

/// Replaces one of the text's numbers.
fn at_a_number(text: &str, with: &str, random: &mut Random) -> String {
    let mut ranges = token_ranges(text);
    ranges.retain(|range| text[range.clone()].starts_with(|first: char| first.is_ascii_digit()));
    if ranges.is_empty() {
        return format!("{text}\n{with}");
    }
    let mut changed = text.to_owned();
    changed.replace_range(random.pick(&ranges).clone(), with);
    changed
}

const NUMBERS: [&str; 14] = [
    "0",
    "-1",
    "1e38",
    "1e39",
    "1e-50",
    "4294967295u",
    "4294967296",
    "2147483647",
    "-2147483648",
    "65535",
    "1000000",
    "99999999999999999999",
    "0x7fffffff",
    "0x1p-1074",
];

fn length(random: &mut Random) -> usize {
    // Within the limits, at their edge and far beyond.
    *random.pick(&[10, 50, 95, 99, 100, 101, 190, 260, 400, 499, 501, 5_000, 50_000])
}

fn nested(random: &mut Random) -> String {
    let (open, close) = *random.pick(&[
        ("(", ")"),
        ("sin(", ")"),
        ("(1.0+", ")"),
        ("-(", ")"),
        ("vec2(", ",1.0).x"),
        ("[", "]"),
        ("{", "}"),
    ]);
    let count = length(random);
    format!("{}1.0{}", open.repeat(count), close.repeat(count))
}

fn chain(random: &mut Random) -> String {
    let link =
        *random.pick(&["1.0+", "1+", "-", "!", "~", "1.0*", "true&&", "1<<", "1.0/", "true?1.0:", "*&"]);
    format!("{}1", link.repeat(length(random)))
}

/// Declarations that ask for much, by themselves or by what each does to the one before.
fn bomb(is_wgsl: bool, random: &mut Random) -> String {
    let (kind, count) = (random.below(7), *random.pick(&[8, 20, 60, 300]));
    if is_wgsl { wgsl_bomb(kind, count) } else { glsl_bomb(kind, count) }
}

/// What `line` makes of each number and the one after it.
fn each(count: usize, line: impl Fn(usize, usize) -> String) -> String {
    (0..count).map(|index| line(index, index + 1)).collect()
}

fn wgsl_bomb(kind: usize, count: usize) -> String {
    match kind {
        0 => "\nvar<private> huge: array<array<f32, 65535>, 65535>; @fragment fn fz() { huge[1][2] = 1.0; }".to_owned(),
        1 => "\nconst huge = array<f32, 10000000>(); @fragment fn fz() -> @location(0) vec4f { return vec4f(huge[3]); }".to_owned(),
        2 => {
            let aliases = each(count, |i, next| format!("alias B{next} = array<B{i}, 2>;"));
            format!("\nalias B0 = f32;{aliases} const bomb = B{count}();")
        }
        3 => {
            let structs = each(count, |i, next| format!("struct B{next} {{ a: B{i}, b: B{i} }}"));
            format!("\nstruct B0 {{ a: f32 }}{structs} var<private> bomb: B{count}; @fragment fn fz() {{ var b = bomb; bomb = b; }}")
        }
        4 => {
            let calls = each(count, |i, next| format!("fn b{next}() -> f32 {{ return b{i}() + b{i}(); }}"));
            format!("\nfn b0() -> f32 {{ return 1.0; }}{calls} @fragment fn fz() -> @location(0) vec4f {{ return vec4f(b{count}()); }}")
        }
        5 => "\nconst b0 = vec4f(1.0);".to_owned() + &each(count, |i, next| format!("const b{next} = b{i} + b{i} * b{i};")),
        _ => {
            let looped = |i, _| format!("for (var i{i} = 0; i{i} < 2147483647; i{i}++) {{ switch i{i} {{ default {{}} }} }}");
            format!("\n@compute @workgroup_size(1) fn fz() {{ {} }}", each(count, looped))
        }
    }
}

fn glsl_bomb(kind: usize, count: usize) -> String {
    match kind {
        0 => "\nfloat huge[2147483647];\n".to_owned(),
        1 => format!(
            "\n{}float bomb = B0;\n",
            each(count, |i, next| format!("#define B{i} B{next} B{next}\n"))
        ),
        2 => {
            let macros = each(count, |i, next| format!("#define B{i}(x) B{next}(x x) B{next}(x)\n"));
            format!("\n{macros}float bomb = B0(1.0);\n")
        }
        3 => {
            let structs = each(count, |i, next| format!("struct B{next} {{ B{i} a; B{i} b[9]; }};\n"));
            format!("\nstruct B0 {{ float a; }};\n{structs}uniform Bomb {{ B{count} bomb; }};\n")
        }
        4 => {
            let calls = each(count, |i, next| format!("float b{next}() {{ return b{i}() + b{i}(); }}\n"));
            format!("\nfloat b0() {{ return 1.0; }}\n{calls}")
        }
        5 => format!("\n#if 1\n{}", "#if 1\n#elif 1\n".repeat(count)),
        _ => format!(
            "\nvoid fz() {{ {} }}\n",
            each(count, |i, _| format!("for (int i{i} = 0; i{i} < 2147483647; i{i}++) ;"))
        ),
    }
}

/// Files that include each other: in a circle, doubling, or many.
fn includes(text: String, is_wgsl: bool, mutant: &mut Input, random: &mut Random) -> String {
    let count = *random.pick(&[2, 30, 70, 300]);
    let times = 1 + random.below(3);
    let is_circle = random.one_in(2);
    for index in 0..count {
        let next = if is_circle { (index + 1) % count } else { index + 1 };
        let (path, content) = if is_wgsl {
            let import = format!("import lib::fz{next}::f{next};\n").repeat(times);
            (
                format!("shaders/lib/fz{index}.wgsl"),
                format!("{import}fn f{index}() -> f32 {{ return f{next}(); }}\n"),
            )
        } else {
            (format!("fz{index}.glsl"), format!("#include \"fz{next}.glsl\"\n").repeat(times))
        };
        mutant.files.insert(path, content);
    }
    if is_wgsl {
        return format!(
            "import lib::fz0::f0;\n{text}\n@fragment fn fz() -> @location(0) vec4f {{ return vec4f(f0()); }}"
        );
    }
    let (first, rest) = text.split_once('\n').unwrap_or((&text, ""));
    format!("{first}\n#include \"fz0.glsl\"\n{rest}")
}
