//! SPIR-V for Vulkan.

use naga::ShaderStage;
use naga::back::spv::{Options, WriterFlags, write_vec};

use super::{BindingMap, EmitError, Emitted, Input, WGSL_BOUNDS, entry_points, has_stage, in_sets};

pub fn write(input: &Input<'_>) -> Result<Emitted, EmitError> {
    let options = Options {
        lang_version: (1, 3),
        // Names serve tools that reflect. No ADJUST_COORDINATE_SPACE: a viewport of negative height costs
        // nothing, and turns derivatives and `@builtin(position)` the right way as well.
        flags: WriterFlags::DEBUG | WriterFlags::CLAMP_FRAG_DEPTH,
        fake_missing_bindings: true,
        bounds_check_policies: WGSL_BOUNDS,
        // A loop without an end is the author's fault in WGSL too.
        force_loop_bounding: false,
        ..Options::default()
    };
    let words = write_vec(input.module, input.info, &options, None)
        .map_err(|error| EmitError::Internal(format!("SPIR-V: {error}")))?;
    let bindings = BindingMap {
        entry_points: entry_points(input.module, |_, name| Ok(name.to_owned()))?,
        resources: in_sets(&input.resources),
        buffer_sizes: None,
    };
    let mut notes = Vec::new();
    if has_stage(input.module, ShaderStage::Vertex) {
        notes.push("clip space has y up: draw with a viewport of negative height".to_owned());
    }
    let bytes = words.into_iter().flat_map(u32::to_le_bytes).collect();
    Ok(Emitted { file_suffix: ".spv".to_owned(), bytes, notes, bindings })
}
