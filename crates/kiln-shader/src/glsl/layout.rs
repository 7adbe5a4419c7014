//! Where the members of a block lie: `layout(offset = …)` and `layout(align = …)` move them in naga's module, and
//! the canonical text says it by the sizes of those before.

use std::ops::Range;

use naga::proc::{Alignment, Layouter};
use naga::{AddressSpace, Handle, Module, StructMember, Type, TypeInner};

use crate::explain::Finding;

/// A member that says where it lies.
#[derive(Clone, Debug)]
pub struct Moved {
    /// Its block.
    pub block: String,
    /// Its name.
    pub member: String,
    /// Its first byte.
    pub offset: Option<u32>,
    /// What its first byte is a multiple of.
    pub align: Option<u32>,
}

/// Moves members of the blocks in `module`, that naga made of `text`.
pub fn apply(module: &mut Module, text: &str, moved: &[Moved]) -> Vec<Finding> {
    if moved.is_empty() {
        return Vec::new();
    }
    let mut layouter = Layouter::default();
    if layouter.update(module.to_ctx()).is_err() {
        // Validation says what is wrong with such a type.
        return Vec::new();
    }
    let mut findings = Vec::new();
    for (handle, block, is_uniform) in blocks(module) {
        let Type { name, inner: TypeInner::Struct { mut members, .. } } = module.types[handle].clone() else {
            continue;
        };
        let own: Vec<&Moved> = moved.iter().filter(|moved| moved.block == block).collect();
        if own.is_empty() {
            continue;
        }
        let alignment = |member: &StructMember| {
            let is_wide =
                matches!(module.types[member.ty].inner, TypeInner::Array { .. } | TypeInner::Struct { .. });
            let natural = layouter[member.ty].alignment;
            if is_uniform && is_wide { natural.max(Alignment::MIN_UNIFORM) } else { natural }
        };
        let before = members.clone();
        let (mut cursor, mut widest) = (0, if is_uniform { Alignment::MIN_UNIFORM } else { Alignment::ONE });
        let alignments: Vec<Alignment> = members.iter().map(alignment).collect();
        for (index, (member, natural)) in members.iter_mut().zip(alignments).enumerate() {
            let said = own.iter().find(|moved| member.name.as_ref() == Some(&moved.member));
            match place(said.copied(), natural, cursor, index == 0) {
                Ok(offset) => member.offset = offset,
                Err(message) => {
                    let name = member.name.as_deref().unwrap_or_default();
                    let labels = range_of(text, &block, name).map(|range| (range, String::new()));
                    let message = format!("`{name}` {message}");
                    findings.push(Finding {
                        message,
                        notes: Vec::new(),
                        labels: labels.into_iter().collect(),
                    });
                }
            }
            cursor = member.offset.saturating_add(layouter[member.ty].size);
            widest = widest.max(natural);
        }
        let span = widest.round_up(cursor);
        // A type cannot be replaced by itself.
        if members != before {
            module.types.replace(handle, Type { name, inner: TypeInner::Struct { members, span } });
        }
    }
    findings
}

/// The first byte of a member that may stand from `free` on.
fn place(said: Option<&Moved>, natural: Alignment, free: u32, is_first: bool) -> Result<u32, String> {
    let (offset, align) = said.map_or((None, None), |said| (said.offset, said.align));
    let align = align.map(|align| {
        Alignment::new(align).ok_or_else(|| format!("has the alignment {align}, no power of 2"))
    });
    let align = align.transpose()?.map_or(natural, |align| align.max(natural));
    if let Some(offset) = offset {
        if !natural.is_aligned(offset) {
            return Err(format!("is at {offset}, which is no multiple of {natural}"));
        }
        if offset < free {
            return Err(format!("is at {offset}, but the member before it ends at {free}"));
        }
    }
    let at = align.round_up(offset.unwrap_or(free));
    if is_first && at > 0 {
        return Err(format!("is at {at}, but the first member of a block is at 0: put a member before it"));
    }
    Ok(at)
}

/// Types of blocks, with their names, and whether they are uniforms.
fn blocks(module: &Module) -> Vec<(Handle<Type>, String, bool)> {
    let blocks = module.global_variables.iter().filter_map(|(_, variable)| {
        let is_uniform = match variable.space {
            AddressSpace::Uniform => true,
            AddressSpace::Storage { .. } => false,
            _ => return None,
        };
        Some((variable.ty, module.types[variable.ty].name.clone()?, is_uniform))
    });
    blocks.collect()
}

/// Where the text of a stage declares a block's member.
fn range_of(text: &str, block: &str, member: &str) -> Option<Range<usize>> {
    let start = text.find(&format!(" {block} {{"))?;
    let at = start + text[start..].find(&format!(" {member} "))? + 1;
    Some(at..at + member.len())
}
