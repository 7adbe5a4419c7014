//! Primitive modes as triangle lists (glTF 2.0, section 3.7.2.1).

/// What a primitive mode becomes.
#[derive(Clone, Debug, PartialEq, Eq)]
pub(crate) enum Topology {
    /// Three indices a triangle.
    Triangles(Vec<u32>),
    /// Points and lines.
    NotDrawn(&'static str),
    /// No mode of the specification.
    Unknown,
}

/// Turns indices in the given mode into a triangle list; a rest that makes no triangle is dropped.
pub(crate) fn triangulate(mode: u32, indices: Vec<u32>) -> Topology {
    match mode {
        0 => Topology::NotDrawn("points"),
        1..=3 => Topology::NotDrawn("lines"),
        4 => Topology::Triangles(whole_triangles(indices)),
        5 => Topology::Triangles(strip(&indices)),
        6 => Topology::Triangles(fan(&indices)),
        _ => Topology::Unknown,
    }
}

fn whole_triangles(mut indices: Vec<u32>) -> Vec<u32> {
    indices.truncate(indices.len() / 3 * 3);
    indices
}

/// Triangle i is {i, i + 1 + i % 2, i + 2 − i % 2}, so that all wind alike.
fn strip(indices: &[u32]) -> Vec<u32> {
    let triangles = indices.windows(3).enumerate();
    triangles.flat_map(|(i, t)| if i % 2 == 0 { [t[0], t[1], t[2]] } else { [t[0], t[2], t[1]] }).collect()
}

/// Triangle i is {i + 1, i + 2, 0}.
fn fan(indices: &[u32]) -> Vec<u32> {
    let rim = indices.get(1..).unwrap_or_default();
    rim.windows(2).flat_map(|edge| [edge[0], edge[1], indices[0]]).collect()
}
