//! Hard cases, by name: what breaks elsewhere stays stable here. `docs/numerics.md` is the table of them.
//!
//! Each test looks at values before anything sanitises them, compares with `f64` where there is an error to tell, and holds that
//! error to the one in `record.tsv`. `KILN_UPDATE_RECORD=1` writes what was seen into the record and the table.
//! `cargo xtask mutants` takes each guard away once and sees these tests fail.

mod elsewhere;
mod encodings;
mod geometry;
mod inputs;
mod lobes;
mod maps;
mod physics;
mod physics_wgsl;
mod record;
#[allow(dead_code, reason = "shared with the tests of the library, which use the rest")]
#[path = "../../crates/kiln-gpu/tests/library/reference.rs"]
mod reference;
mod sampling;
#[allow(dead_code, reason = "shared with the tests of the library, which use the rest")]
#[path = "../../crates/kiln-gpu/tests/library/support.rs"]
mod support;
mod table;
mod transforms;
