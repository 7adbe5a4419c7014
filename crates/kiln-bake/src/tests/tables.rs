//! Tables of BRDFs: their entries, and what lookups between them are off by.

use super::environments::check_within;
use crate::{Cancel, TABLE_SIZE, Table, TableAxes, dfg_table, table, table_error};
use kiln_brdf::{ErrorNorms, Masking, Precision, SheenVisibility, sheen_albedo};

const KINDS: [Table; 6] = [
    Table::GgxScaleBias(Masking::SmithCorrelated),
    Table::GgxScaleBias(Masking::SchlickIbl),
    Table::GgxMultiscatter(Masking::SmithCorrelated),
    Table::GgxAlbedoAverage(Masking::SmithCorrelated),
    Table::SheenAlbedo(SheenVisibility::Clamped),
    Table::SheenAlbedo(SheenVisibility::Unclamped),
];

fn made(kind: Table, axes: TableAxes, size: usize) -> Vec<f32> {
    table(kind, axes, size, Cancel::NEVER).expect("nobody cancels")
}

fn measured(kind: Table, axes: TableAxes, size: usize, values: &[f32], roughness_min: f64) -> ErrorNorms {
    table_error(kind, axes, size, values, roughness_min, Cancel::NEVER).expect("nobody cancels")
}

#[test]
fn every_table_has_its_size_and_its_axes() {
    for kind in KINDS {
        let values = made(kind, TableAxes::Uniform, 6);
        assert_eq!(values.len(), kind.width(6) * 6 * kind.channels(), "{kind:?}");
        assert!(values.iter().all(|value| value.is_finite() && *value >= 0.0), "{kind:?}");
    }
    let sheen = Table::SheenAlbedo(SheenVisibility::Unclamped);
    let exact = |at: [f64; 2]| sheen_albedo(SheenVisibility::Unclamped, at[0], at[1], Precision::Full);
    // Column 4, row 2 of 6.
    let uniform = made(sheen, TableAxes::Uniform, 6)[2 * 6 + 4];
    check_within("uniform", uniform.into(), exact([0.75, 2.5 / 6.0]), 1e-6);
    let graded = made(sheen, TableAxes::Graded, 6)[2 * 6 + 4];
    check_within("graded", graded.into(), exact([0.75 * 0.75 * 0.75, 2.5 / 6.0 * (2.5 / 6.0)]), 1e-6);
}

#[test]
fn pairs_are_the_uniform_scale_bias_table() {
    let values = made(Table::GgxScaleBias(Masking::SmithCorrelated), TableAxes::Uniform, 5);
    assert_eq!(dfg_table(5, Cancel::NEVER).expect("nobody cancels").as_flattened(), values);
}

#[test]
fn multiscatter_table_swaps_the_terms_and_adds_them() {
    let scale_bias = made(Table::GgxScaleBias(Masking::SmithCorrelated), TableAxes::Uniform, 4);
    let swapped = made(Table::GgxMultiscatter(Masking::SmithCorrelated), TableAxes::Uniform, 4);
    for (plain, swapped) in scale_bias.chunks_exact(2).zip(swapped.chunks_exact(2)) {
        assert_eq!(plain[1], swapped[0]);
        check_within("E", swapped[1].into(), f64::from(plain[0]) + f64::from(plain[1]), 1e-7);
    }
}

/// Renderers with half floats allow no smaller roughness (Filament, bevy).
const ROUGHNESS_MIN: f64 = 0.089;

fn error_of(kind: Table, axes: TableAxes, size: usize, roughness_min: f64) -> ErrorNorms {
    measured(kind, axes, size, &made(kind, axes, size), roughness_min)
}

#[test]
fn lookups_in_graded_tables_are_within_1e_4() {
    // Measured in full, the limits are 0.089 for GGX, 0 for its average, 0.12 for clamped and 0.25 for unclamped sheen;
    // only GGX is tested down to its own.
    for (kind, roughness_min) in [
        (Table::GgxScaleBias(Masking::SmithCorrelated), ROUGHNESS_MIN),
        (Table::GgxMultiscatter(Masking::SmithCorrelated), 0.7),
        (Table::GgxAlbedoAverage(Masking::SmithCorrelated), 0.0),
        (Table::SheenAlbedo(SheenVisibility::Clamped), 0.7),
        (Table::SheenAlbedo(SheenVisibility::Unclamped), 0.7),
    ] {
        let error = error_of(kind, TableAxes::Graded, TABLE_SIZE, roughness_min);
        assert!(error.worst <= 1e-4, "{kind:?} {error:?}");
    }
}

#[test]
fn lookups_in_uniform_tables_are_within_1e_4_on_average_only() {
    let kind = Table::GgxScaleBias(Masking::SmithCorrelated);
    let error = error_of(kind, TableAxes::Uniform, TABLE_SIZE, ROUGHNESS_MIN);
    assert!(error.rms <= 1e-4, "{error:?}");
    // Twice the size does not help in the corner n·v ~ α.
    let [coarse, fine] = [32, 64].map(|size| error_of(kind, TableAxes::Uniform, size, 0.0));
    assert!(coarse.worst > 1e-2 && fine.worst > 0.8 * coarse.worst, "{coarse:?} {fine:?}");
    assert!(coarse.worst_at[0] < 0.1 && coarse.worst_at[1] < 0.2, "{coarse:?}");
}

#[test]
fn one_wrong_entry_is_seen() {
    let kind = Table::GgxScaleBias(Masking::SmithCorrelated);
    let mut values = made(kind, TableAxes::Graded, 64);
    let right = measured(kind, TableAxes::Graded, 64, &values, 0.2);
    values[2 * (50 * 64 + 30) + 1] += 5e-3;
    let wrong = measured(kind, TableAxes::Graded, 64, &values, 0.2);
    assert!(right.worst <= 1e-3 && wrong.worst >= 2e-3, "{right:?} {wrong:?}");
}

#[test]
fn tables_of_one_row_or_none_are_legal() {
    for size in [0, 1] {
        for kind in KINDS {
            let values = made(kind, TableAxes::Uniform, size);
            let error = measured(kind, TableAxes::Uniform, size, &values, 0.0);
            assert_eq!((values.len(), error.worst), (size * kind.channels(), 0.0));
        }
    }
}

#[test]
fn equal_tables_for_any_number_of_threads() {
    let kind = Table::SheenAlbedo(SheenVisibility::Clamped);
    let one = made(kind, TableAxes::Graded, 16);
    for threads in [1, 2, 7] {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().expect("threads");
        let bits = |values: Vec<f32>| values.into_iter().map(f32::to_bits).collect::<Vec<_>>();
        assert_eq!(bits(pool.install(|| made(kind, TableAxes::Graded, 16))), bits(one.clone()), "{threads}");
    }
    assert!(made(kind, TableAxes::Uniform, 16) != one, "the axes matter");
}
