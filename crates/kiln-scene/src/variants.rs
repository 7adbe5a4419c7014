//! `KHR_materials_variants`: which materials a primitive may have besides its own.

use std::collections::BTreeSet;

use crate::SceneError;
use crate::schema::{Primitive, Root, VariantMapping};

/// Names of the file's variants.
pub(crate) fn names(root: &Root) -> Vec<String> {
    let variants = root.extensions.variants.iter().flat_map(|it| &it.variants);
    variants.map(|variant| variant.name.clone()).collect()
}

/// A primitive's materials in variants.
///
/// # Errors
/// A variant that does not exist or that has two materials.
pub(crate) fn mappings<'a>(
    primitive: &'a Primitive,
    count: usize,
    pointer: &str,
) -> Result<&'a [VariantMapping], SceneError> {
    let Some(variants) = &primitive.extensions.variants else { return Ok(&[]) };
    let mut seen = BTreeSet::new();
    for (at, mapping) in variants.mappings.iter().enumerate() {
        for (which, &variant) in mapping.variants.iter().enumerate() {
            let place = || place(pointer, at) + &format!("/variants/{which}");
            if variant >= count {
                let reason = format!("variant {variant} does not exist, the file has {count}");
                return Err(SceneError::new(place(), reason));
            }
            if !seen.insert(variant) {
                return Err(SceneError::new(
                    place(),
                    format!("variant {variant} already has a material here"),
                ));
            }
        }
    }
    Ok(&variants.mappings)
}

/// JSON pointer of a mapping.
pub(crate) fn place(primitive: &str, mapping: usize) -> String {
    format!("{primitive}/extensions/KHR_materials_variants/mappings/{mapping}")
}
