//! A five by seven dot font for titles.

/// Columns from one character to the next.
pub(super) const ADVANCE: usize = 6;
/// Rows of a character.
pub(super) const HEIGHT: usize = 7;
const WIDTH: usize = 5;

/// What stands for a character without a glyph.
const BOX: [u8; HEIGHT] = [0o37, 0o21, 0o21, 0o21, 0o21, 0o21, 0o37];

/// The dots of a character as (column, row); small letters are drawn as capitals.
pub(super) fn dots(character: char) -> impl Iterator<Item = (usize, usize)> {
    let code = character.to_ascii_uppercase() as usize;
    let rows =
        code.checked_sub(usize::from(b' ')).and_then(|index| GLYPHS.get(index)).copied().unwrap_or(BOX);
    let is_set = move |column: usize, row: usize| rows[row] >> (WIDTH - 1 - column) & 1 == 1;
    (0..HEIGHT * WIDTH)
        .map(|index| (index % WIDTH, index / WIDTH))
        .filter(move |&(column, row)| is_set(column, row))
}

/// ASCII 32 to 95, rows from the top; in each the highest of five bits is the left dot.
#[rustfmt::skip]
const GLYPHS: [[u8; HEIGHT]; 64] = [
    [0o00, 0o00, 0o00, 0o00, 0o00, 0o00, 0o00], // space
    [0o04, 0o04, 0o04, 0o04, 0o04, 0o00, 0o04], // !
    [0o12, 0o12, 0o12, 0o00, 0o00, 0o00, 0o00], // "
    [0o12, 0o12, 0o37, 0o12, 0o37, 0o12, 0o12], // #
    [0o04, 0o17, 0o24, 0o16, 0o05, 0o36, 0o04], // $
    [0o31, 0o31, 0o02, 0o04, 0o10, 0o23, 0o23], // %
    [0o14, 0o22, 0o24, 0o10, 0o25, 0o22, 0o15], // &
    [0o04, 0o04, 0o10, 0o00, 0o00, 0o00, 0o00], // '
    [0o02, 0o04, 0o10, 0o10, 0o10, 0o04, 0o02], // (
    [0o10, 0o04, 0o02, 0o02, 0o02, 0o04, 0o10], // )
    [0o00, 0o04, 0o25, 0o16, 0o25, 0o04, 0o00], // *
    [0o00, 0o04, 0o04, 0o37, 0o04, 0o04, 0o00], // +
    [0o00, 0o00, 0o00, 0o00, 0o06, 0o04, 0o10], // ,
    [0o00, 0o00, 0o00, 0o37, 0o00, 0o00, 0o00], // -
    [0o00, 0o00, 0o00, 0o00, 0o00, 0o14, 0o14], // .
    [0o01, 0o01, 0o02, 0o04, 0o10, 0o20, 0o20], // /
    [0o16, 0o21, 0o23, 0o25, 0o31, 0o21, 0o16], // 0
    [0o04, 0o14, 0o04, 0o04, 0o04, 0o04, 0o16], // 1
    [0o16, 0o21, 0o01, 0o02, 0o04, 0o10, 0o37], // 2
    [0o37, 0o02, 0o04, 0o02, 0o01, 0o21, 0o16], // 3
    [0o02, 0o06, 0o12, 0o22, 0o37, 0o02, 0o02], // 4
    [0o37, 0o20, 0o36, 0o01, 0o01, 0o21, 0o16], // 5
    [0o06, 0o10, 0o20, 0o36, 0o21, 0o21, 0o16], // 6
    [0o37, 0o01, 0o02, 0o04, 0o10, 0o10, 0o10], // 7
    [0o16, 0o21, 0o21, 0o16, 0o21, 0o21, 0o16], // 8
    [0o16, 0o21, 0o21, 0o17, 0o01, 0o02, 0o14], // 9
    [0o00, 0o14, 0o14, 0o00, 0o14, 0o14, 0o00], // :
    [0o00, 0o14, 0o14, 0o00, 0o14, 0o04, 0o10], // ;
    [0o02, 0o04, 0o10, 0o20, 0o10, 0o04, 0o02], // <
    [0o00, 0o00, 0o37, 0o00, 0o37, 0o00, 0o00], // =
    [0o10, 0o04, 0o02, 0o01, 0o02, 0o04, 0o10], // >
    [0o16, 0o21, 0o01, 0o02, 0o04, 0o00, 0o04], // ?
    [0o16, 0o21, 0o27, 0o25, 0o27, 0o20, 0o16], // @
    [0o16, 0o21, 0o21, 0o37, 0o21, 0o21, 0o21], // A
    [0o36, 0o21, 0o21, 0o36, 0o21, 0o21, 0o36], // B
    [0o16, 0o21, 0o20, 0o20, 0o20, 0o21, 0o16], // C
    [0o34, 0o22, 0o21, 0o21, 0o21, 0o22, 0o34], // D
    [0o37, 0o20, 0o20, 0o36, 0o20, 0o20, 0o37], // E
    [0o37, 0o20, 0o20, 0o36, 0o20, 0o20, 0o20], // F
    [0o16, 0o21, 0o20, 0o27, 0o21, 0o21, 0o17], // G
    [0o21, 0o21, 0o21, 0o37, 0o21, 0o21, 0o21], // H
    [0o16, 0o04, 0o04, 0o04, 0o04, 0o04, 0o16], // I
    [0o07, 0o02, 0o02, 0o02, 0o02, 0o22, 0o14], // J
    [0o21, 0o22, 0o24, 0o30, 0o24, 0o22, 0o21], // K
    [0o20, 0o20, 0o20, 0o20, 0o20, 0o20, 0o37], // L
    [0o21, 0o33, 0o25, 0o25, 0o21, 0o21, 0o21], // M
    [0o21, 0o21, 0o31, 0o25, 0o23, 0o21, 0o21], // N
    [0o16, 0o21, 0o21, 0o21, 0o21, 0o21, 0o16], // O
    [0o36, 0o21, 0o21, 0o36, 0o20, 0o20, 0o20], // P
    [0o16, 0o21, 0o21, 0o21, 0o25, 0o22, 0o15], // Q
    [0o36, 0o21, 0o21, 0o36, 0o24, 0o22, 0o21], // R
    [0o17, 0o20, 0o20, 0o16, 0o01, 0o01, 0o36], // S
    [0o37, 0o04, 0o04, 0o04, 0o04, 0o04, 0o04], // T
    [0o21, 0o21, 0o21, 0o21, 0o21, 0o21, 0o16], // U
    [0o21, 0o21, 0o21, 0o21, 0o21, 0o12, 0o04], // V
    [0o21, 0o21, 0o21, 0o25, 0o25, 0o25, 0o12], // W
    [0o21, 0o21, 0o12, 0o04, 0o12, 0o21, 0o21], // X
    [0o21, 0o21, 0o12, 0o04, 0o04, 0o04, 0o04], // Y
    [0o37, 0o01, 0o02, 0o04, 0o10, 0o20, 0o37], // Z
    [0o16, 0o10, 0o10, 0o10, 0o10, 0o10, 0o16], // [
    [0o20, 0o20, 0o10, 0o04, 0o02, 0o01, 0o01], // backslash
    [0o16, 0o02, 0o02, 0o02, 0o02, 0o02, 0o16], // ]
    [0o04, 0o12, 0o21, 0o00, 0o00, 0o00, 0o00], // ^
    [0o00, 0o00, 0o00, 0o00, 0o00, 0o00, 0o37], // _
];
