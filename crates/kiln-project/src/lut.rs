//! Actions of `[lut.NAME]`: tables of what BRDFs reflect of uniform light.

use std::sync::Arc;

use kiln_bake::{Masking, SheenVisibility, Table, TableAxes};
use kiln_build::{Action, little_memory};
use serde_json::{Value, json};

use crate::environment::{cancel, command, ended, success};
use crate::lut_config::{LutConfig, table_name};
use crate::plan::{PartSpec, Planner, rank};

/// The table that renderers of environments read; `[lut.ggx]` replaces it.
pub(crate) const DEFAULT: LutConfig =
    LutConfig { table: Table::GgxScaleBias(Masking::SmithCorrelated), size: 128, axes: TableAxes::Uniform };

/// The table that sheen is drawn with; `[lut.charlie]` replaces it.
pub(crate) const CHARLIE: LutConfig = LutConfig {
    table: Table::SheenAlbedo(SheenVisibility::Unclamped),
    size: 128,
    axes: TableAxes::Uniform,
};

/// Roughness from which on a table's stated error counts: what lookups are off by below it depends on no size.
const ERROR_ROUGHNESS_MIN: f64 = 0.089;

/// What the analytic fits that some shaders use in a table's place are off by, as a dielectric's reflectance.
fn fits(masking: Masking) -> Value {
    let error = |fit: fn(f64, f64) -> [f64; 2]| {
        let error = kiln_bake::fit_error(masking, FIT_CELLS, fit).dielectric;
        json!({"rms": error.rms, "largest": error.worst})
    };
    json!({"karis_mobile": error(kiln_bake::fit_karis_mobile), "lazarov": error(kiln_bake::fit_lazarov)})
}

/// Cells along a side of the grid on which the fits are compared.
const FIT_CELLS: usize = 32;

/// Adds a table; its errors are integrated too if they are to be stated, which takes longer than the table.
pub(crate) fn plan_lut(planner: &mut Planner, name: &str, config: &LutConfig, states_errors: bool) {
    let config = *config;
    let axes = match config.axes {
        TableAxes::Uniform => "x = n.v, y = perceptual roughness",
        TableAxes::Graded => "x = cbrt(n.v), y = sqrt(perceptual roughness)",
    };
    let mut params = json!({"kind": table_name(config.table), "size": config.size, "axes": axes});
    if states_errors {
        params["states"] = json!("errors");
    }
    let action = planner.graph.add(Action {
        name: format!("integrate lut/{name}"),
        command: command("brdf table", 2, params, &["texels"]),
        inputs: Vec::new(),
        rank: rank::SCENE,
        memory: little_memory(),
        perform: Arc::new(move |inputs| {
            let LutConfig { table, size, axes } = config;
            let values = kiln_bake::table(table, axes, size, cancel(inputs)).map_err(ended)?;
            let mut meta = json!({});
            if states_errors && size > 1 {
                let from = ERROR_ROUGHNESS_MIN;
                let error = kiln_bake::table_error(table, axes, size, &values, from, cancel(inputs));
                let error = error.map_err(ended)?;
                meta["detail"] = json!({
                    "lookup_error": {"from_roughness": from, "rms": error.rms, "largest": error.worst},
                });
                if let Table::GgxScaleBias(masking) = table {
                    meta["detail"]["fits"] = fits(masking);
                }
            }
            // A lone channel is stored with a second one of zeros.
            let pairs = values
                .chunks_exact(table.channels())
                .flat_map(|texel| [texel[0], texel.get(1).copied().unwrap_or(0.0)].map(f32::to_le_bytes));
            Ok(success("texels", pairs.flatten().collect(), meta))
        }),
    });
    let width = config.table.width(config.size);
    let meta = json!({
        "size": config.size,
        "width": width,
        "format": "rg32f",
        "kind": table_name(config.table),
        "axes": axes,
    });
    planner.target(format!("lut/{name}"), "lut", meta, vec![PartSpec::one(action, "texels")]);
}
