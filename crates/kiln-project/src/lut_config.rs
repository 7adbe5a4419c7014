//! `[lut.NAME]` of kiln.toml as data: tables of what BRDFs reflect of uniform light.

use kiln_bake::{Masking, SheenVisibility, TABLE_SIZE, Table, TableAxes};

use crate::reader::Section;

/// A table and its size.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LutConfig {
    /// What it holds.
    pub table: Table,
    /// Rows.
    pub size: usize,
    /// Where its texels stand.
    pub axes: TableAxes,
}

/// The names by which kiln.toml knows tables.
pub const TABLES: [(&str, Table); 10] = [
    ("ggx", Table::GgxScaleBias(Masking::SmithCorrelated)),
    ("ggx-separable", Table::GgxScaleBias(Masking::SmithSeparable)),
    ("ggx-schlick", Table::GgxScaleBias(Masking::SchlickIbl)),
    ("ggx-schlick-lights", Table::GgxScaleBias(Masking::SchlickLights)),
    ("ggx-multiscatter", Table::GgxMultiscatter(Masking::SmithCorrelated)),
    ("ggx-multiscatter-separable", Table::GgxMultiscatter(Masking::SmithSeparable)),
    ("ggx-average", Table::GgxAlbedoAverage(Masking::SmithCorrelated)),
    ("ggx-average-separable", Table::GgxAlbedoAverage(Masking::SmithSeparable)),
    ("charlie", Table::SheenAlbedo(SheenVisibility::Unclamped)),
    ("charlie-clamped", Table::SheenAlbedo(SheenVisibility::Clamped)),
];

/// A table's name.
pub fn table_name(table: Table) -> &'static str {
    TABLES.iter().find(|(_, known)| *known == table).map_or("", |(name, _)| name)
}

pub(crate) fn read_lut(section: &mut Section, _: &str) -> LutConfig {
    let has_kind = section.place("kind") != section.place("");
    let table = section.choice("kind", &TABLES);
    if !has_kind {
        section.missing("kind", "ggx-multiscatter");
    }
    LutConfig {
        table: table.unwrap_or(TABLES[0].1),
        size: section.integer("size", 1..=1024).unwrap_or(TABLE_SIZE),
        axes: section
            .choice("axes", &[("uniform", TableAxes::Uniform), ("graded", TableAxes::Graded)])
            .unwrap_or(TableAxes::Uniform),
    }
}
