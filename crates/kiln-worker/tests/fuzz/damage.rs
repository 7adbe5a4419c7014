//! Small damage to a text. The tests of `kiln-shader` do it too, in their own process.

use super::random::Random;

/// Some bytes replaced, added or left out, or the end cut off.
pub fn bytes(text: String, random: &mut Random) -> String {
    let mut bytes = text.into_bytes();
    for _ in 0..1 + random.below(8) {
        let at = random.below(bytes.len() + 1);
        match random.below(4) {
            0 => bytes.truncate(at),
            1 => bytes.insert(at, random.below(256) as u8),
            2 if at < bytes.len() => drop(bytes.remove(at)),
            _ => bytes.iter_mut().skip(at).take(1).for_each(|byte| *byte ^= 1 << random.below(8)),
        }
    }
    String::from_utf8_lossy(&bytes).into_owned()
}

/// Words, numbers and single characters.
pub fn token_ranges(text: &str) -> Vec<std::ops::Range<usize>> {
    let mut ranges: Vec<std::ops::Range<usize>> = Vec::new();
    let mut in_word = false;
    for (at, character) in text.char_indices() {
        let is_word = character.is_alphanumeric() || character == '_';
        let end = at + character.len_utf8();
        match ranges.last_mut() {
            Some(last) if is_word && in_word => last.end = end,
            _ if !character.is_whitespace() => ranges.push(at..end),
            _ => {}
        }
        in_word = is_word;
    }
    ranges
}

/// A token left out, doubled or replaced.
pub fn tokens(text: &str, random: &mut Random) -> String {
    let ranges = token_ranges(text);
    if ranges.is_empty() {
        return text.to_owned();
    }
    let (one, other) = (random.pick(&ranges).clone(), random.pick(&ranges).clone());
    let mut changed = text.to_owned();
    let with = match random.below(4) {
        0 => String::new(),
        1 => format!("{} {}", &text[one.clone()], &text[other]),
        2 => (*random.pick(&WORDS)).to_owned(),
        _ => text[other].to_owned(),
    };
    changed.replace_range(one, &with);
    changed
}

const WORDS: [&str; 30] = [
    "{",
    "}",
    "(",
    ")",
    "[",
    "]",
    ";",
    "#",
    "##",
    "\\\n",
    "//",
    "/*",
    "f32",
    "vec4f",
    "struct",
    "array",
    "var",
    "let",
    "const",
    "override",
    "loop",
    "switch",
    "return",
    "sampler2D",
    "uniform",
    "inout",
    "layout",
    "@if(a)",
    "import",
    "texture_2d",
];
