//! KTX 1 files, read back by a reader written from the specification alone.

use crate::ktx1::{Cube, Format, write_cube};

struct Read {
    gl_type: u32,
    type_size: u32,
    gl_format: u32,
    internal_format: u32,
    size: u32,
    faces: u32,
    pairs: Vec<(String, String)>,
    /// Faces of each level, without row padding being removed.
    levels: Vec<Vec<Vec<u8>>>,
}

/// Follows KTX 1's pseudo code; `None` for anything that does not fit to the byte.
fn read(bytes: &[u8]) -> Option<Read> {
    let mut rest = bytes.strip_prefix(b"\xabKTX 11\xbb\r\n\x1a\n")?;
    let mut words = [0; 13];
    for word in &mut words {
        let (head, tail) = rest.split_first_chunk()?;
        (*word, rest) = (u32::from_le_bytes(*head), tail);
    }
    let [
        endianness,
        gl_type,
        type_size,
        gl_format,
        internal_format,
        base,
        width,
        height,
        depth,
        layers,
        faces,
        level_count,
        pair_bytes,
    ] = words;
    if endianness != 0x0403_0201 || base != gl_format || width != height || depth != 0 || layers != 0 {
        return None;
    }
    let (mut pairs_left, mut rest) = rest.split_at_checked(pair_bytes as usize)?;
    let mut pairs = Vec::new();
    while let Some((length, tail)) = pairs_left.split_first_chunk() {
        let length = u32::from_le_bytes(*length) as usize;
        let text = std::str::from_utf8(tail.get(..length)?).ok()?;
        let (key, value) = text.split_once('\0')?;
        pairs.push((key.to_owned(), value.strip_suffix('\0')?.to_owned()));
        pairs_left = tail.get(length.next_multiple_of(4)..)?;
    }
    let mut levels = Vec::new();
    for _ in 0..level_count {
        let (size, tail) = rest.split_first_chunk()?;
        let size = u32::from_le_bytes(*size) as usize;
        let (data, tail) = tail.split_at_checked(size * faces as usize)?;
        if !size.is_multiple_of(4) {
            return None;
        }
        levels.push(data.chunks(size).map(<[u8]>::to_vec).collect());
        rest = tail;
    }
    rest.is_empty().then_some(Read {
        gl_type,
        type_size,
        gl_format,
        internal_format,
        size: width,
        faces,
        pairs,
        levels,
    })
}

fn level_data(format: Format, size: usize, count: usize) -> Vec<Vec<u8>> {
    let bytes = |level| format.texels().level_bytes(size, size, 6, level).expect("small");
    (0..count)
        .map(|level| (0..bytes(level)).map(|index| (index * 7 + level) as u8 & 0x3f).collect())
        .collect()
}

fn file(format: Format, size: usize, levels: &[Vec<u8>]) -> Vec<u8> {
    let levels = levels.iter().map(Vec::as_slice).collect();
    write_cube(&Cube {
        format,
        face_size: size,
        levels,
        key_values: vec![("sh".to_owned(), "1 2 3\n".to_owned())],
    })
}

#[test]
fn every_format_comes_back_with_its_numbers() {
    let numbers = [
        (Format::R11fG11fB10f, [0x8c3b, 4, 0x1907, 0x8c3a]),
        (Format::R11fG11fB10fFilament, [0x8c3a, 4, 0x1907, 0x8c3a]),
        (Format::Rgb16f, [0x140b, 2, 0x1907, 0x881b]),
        (Format::Rgba16f, [0x140b, 2, 0x1908, 0x881a]),
        (Format::Rgba32f, [0x1406, 4, 0x1908, 0x8814]),
    ];
    for (format, numbers) in numbers {
        let levels = level_data(format, 8, 3);
        let back = read(&file(format, 8, &levels)).expect("our own file");
        assert_eq!([back.gl_type, back.type_size, back.gl_format, back.internal_format], numbers);
        assert_eq!((back.size, back.faces), (8, 6));
        assert_eq!(back.pairs, [("sh".to_owned(), "1 2 3\n".to_owned())]);
        for (back, level) in back.levels.iter().zip(&levels) {
            assert_eq!(back.len(), 6);
            // Rows of these sizes need no padding, whatever the format: 8, 4 and 2 texels.
            assert_eq!(&back.concat(), level);
        }
    }
}

#[test]
fn rows_of_three_halves_are_padded_to_four_bytes() {
    let levels = level_data(Format::Rgb16f, 5, 1);
    let back = read(&file(Format::Rgb16f, 5, &levels)).expect("our own file");
    for (face, row) in (0..6).flat_map(|face| (0..5).map(move |row| (face, row))) {
        let wanted = &levels[0][(face * 5 + row) * 30..][..30];
        assert_eq!(&back.levels[0][face][row * 32..][..32], [wanted, &[0, 0]].concat());
    }
}

#[test]
fn the_reader_of_these_tests_notices_a_missing_or_a_surplus_byte() {
    let bytes = file(Format::Rgba16f, 2, &level_data(Format::Rgba16f, 2, 2));
    assert!(read(&bytes).is_some() && read(&bytes[..bytes.len() - 1]).is_none());
    assert!(read(&[bytes.as_slice(), &[0]].concat()).is_none());
}
