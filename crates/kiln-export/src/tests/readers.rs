//! Readers that share nothing with the writers: crate `ktx2`, crate `zstd`, and texels by their formulas.

use kiln_sphere::cube_face_st;

/// A cube's levels as a GPU holds them.
pub(super) struct GpuCube {
    pub(super) sizes: Vec<usize>,
    levels: Vec<Vec<[f64; 3]>>,
}

impl GpuCube {
    /// The texel that `textureLod` takes with nearest filtering, by Vulkan's rules for cubes.
    pub(super) fn fetch(&self, direction: [f64; 3], level: f64) -> [f64; 3] {
        let level = level.round() as usize;
        let size = self.sizes[level];
        let (face, st) = cube_face_st(direction);
        let [x, y] = st.map(|st| (((st + 1.0) * 0.5 * size as f64) as usize).min(size - 1));
        self.levels[level][(face * size + y) * size + x]
    }

    pub(super) fn last_level(&self) -> f64 {
        (self.levels.len() - 1) as f64
    }
}

fn half(bits: u16) -> f64 {
    let (exponent, mantissa) = (i32::from(bits >> 10 & 31), f64::from(bits & 1023));
    let value = if exponent == 0 { mantissa } else { mantissa + 1024.0 };
    value * libm::exp2(f64::from(exponent.max(1) - 25)) * if bits >> 15 == 1 { -1.0 } else { 1.0 }
}

fn texels(vk_format: u32, bytes: &[u8]) -> Vec<[f64; 3]> {
    let word = |chunk: &[u8]| u32::from_le_bytes([chunk[0], chunk[1], chunk[2], chunk[3]]);
    match vk_format {
        97 => {
            bytes.chunks(8).map(|t| [0, 2, 4].map(|i| half(u16::from_le_bytes([t[i], t[i + 1]])))).collect()
        }
        109 => {
            bytes.chunks(16).map(|t| [0, 4, 8].map(|i| f64::from(f32::from_bits(word(&t[i..]))))).collect()
        }
        122 => bytes
            .chunks(4)
            .map(|t| {
                let w = word(t);
                // An 11-bit float is a half without sign and without the last four bits; blue lacks one more.
                [w & 0x7ff, w >> 11 & 0x7ff, w >> 22 << 1].map(|bits| half((bits << 4) as u16))
            })
            .collect(),
        123 => bytes
            .chunks(4)
            .map(|t| {
                let w = word(t);
                let unit = libm::exp2(f64::from(w >> 27) - 24.0);
                [w, w >> 9, w >> 18].map(|bits| f64::from(bits & 511) * unit)
            })
            .collect(),
        other => panic!("VkFormat {other}"),
    }
}

/// A KTX2 cube, and its VkFormat.
pub(super) fn ktx2_cube(bytes: &[u8]) -> (GpuCube, u32) {
    let reader = ktx2::Reader::new(bytes).expect("the crate reads it");
    let header = reader.header();
    assert_eq!((header.face_count, header.pixel_width), (6, header.pixel_height));
    let vk_format = header.format.expect("a format").value();
    let mut cube = GpuCube { sizes: Vec::new(), levels: Vec::new() };
    for (index, level) in reader.levels().enumerate() {
        let size = (header.pixel_width as usize >> index).max(1);
        let data = match header.supercompression_scheme {
            None => level.data.to_vec(),
            Some(_) => zstd::bulk::decompress(level.data, 1 << 26).expect("Zstandard"),
        };
        cube.levels.push(texels(vk_format, &data));
        assert_eq!(cube.levels[index].len(), 6 * size * size);
        cube.sizes.push(size);
    }
    (cube, vk_format)
}

/// Filament's `Ktx1Bundle`: R11F_G11F_B10F cubes and their pairs.
pub(super) fn ktx1_cube(bytes: &[u8]) -> (GpuCube, Vec<(String, String)>) {
    let mut rest = bytes.strip_prefix(b"\xabKTX 11\xbb\r\n\x1a\n").expect("KTX 1");
    let mut next = || {
        let (word, tail) = rest.split_first_chunk::<4>().expect("a word");
        rest = tail;
        u32::from_le_bytes(*word)
    };
    let words: [u32; 13] = std::array::from_fn(|_| next());
    assert_eq!(
        words[..6],
        [0x0403_0201, 0x8c3a, 4, 0x1907, 0x8c3a, 0x1907],
        "what Filament's reader asks for"
    );
    assert_eq!(words[8..11], [0, 0, 6]);
    let (mut left, mut rest) = rest.split_at(words[12] as usize);
    let mut pairs = Vec::new();
    while let Some((length, tail)) = left.split_first_chunk::<4>() {
        let length = u32::from_le_bytes(*length) as usize;
        let text = std::str::from_utf8(&tail[..length]).expect("text");
        let (key, value) = text.split_once('\0').expect("key and value");
        pairs.push((key.to_owned(), value.trim_end_matches('\0').to_owned()));
        left = &tail[length.next_multiple_of(4)..];
    }
    let mut cube = GpuCube { sizes: Vec::new(), levels: Vec::new() };
    for level in 0..words[11] {
        let size = (words[6] >> level).max(1) as usize;
        let (face_bytes, tail) = rest.split_first_chunk::<4>().expect("a level");
        assert_eq!(u32::from_le_bytes(*face_bytes) as usize, size * size * 4);
        let (data, tail) = tail.split_at(6 * size * size * 4);
        cube.levels.push(texels(122, data));
        cube.sizes.push(size);
        rest = tail;
    }
    assert!(rest.is_empty());
    (cube, pairs)
}
