//! Materials that something draws, pruned; their textures numbered.

use std::collections::BTreeMap;

use crate::animate::Ranges;
use crate::geometry::Needs;
use crate::images::Picture;
use crate::materials::{flatten, parse_alpha_mode, transform_rows, uv_set};
use crate::prune::{Pruned, prune, retain_textures, settle};
use crate::schema::{self, TextureInfo};
use crate::textures::{Found, TextureTable, sampler};
use crate::{
    AlphaMode, ColorSpace, Effect, LightReads, Material, MaterialProperty, Scene, SceneError,
    SpecularGlossinessAs, Texture, TextureRef, extensions, specular_glossiness,
};

pub(crate) struct MaterialTable<'a, 'b> {
    root: &'a schema::Root,
    textures: TextureTable<'a, 'b>,
    /// What animations do, by the file's material index.
    ranges: BTreeMap<usize, Ranges>,
    specular_glossiness: SpecularGlossinessAs,
    /// Slot by the file's material index; the default material comes last.
    slots_by_index: BTreeMap<usize, usize>,
    slots: Vec<Slot>,
}

struct Slot {
    name: String,
    pruned: Pruned,
    needs: Needs,
    notes: Vec<String>,
}

/// Everything about materials and textures, renumbered to what is used.
#[derive(Debug, Default)]
pub(crate) struct Settled {
    pub materials: Vec<schema::Material>,
    pub flat: Vec<Material>,
    pub reads: Vec<LightReads>,
    pub textures: Vec<schema::Texture>,
    pub samplers: Vec<schema::Sampler>,
    /// MIME type and bytes of each used image.
    pub pictures: Vec<(&'static str, Vec<u8>)>,
    pub notes: Vec<String>,
    pub warnings: Vec<SceneError>,
    /// The scene's material by the file's, and what it still has of the properties that are animated.
    pub moving: BTreeMap<usize, (usize, Vec<MaterialProperty>)>,
}

impl<'a, 'b> MaterialTable<'a, 'b> {
    pub fn new(
        root: &'a schema::Root,
        textures: TextureTable<'a, 'b>,
        ranges: BTreeMap<usize, Ranges>,
        specular_glossiness: SpecularGlossinessAs,
    ) -> Self {
        let (slots_by_index, slots) = (BTreeMap::new(), Vec::new());
        MaterialTable { root, textures, ranges, specular_glossiness, slots_by_index, slots }
    }

    /// Number of a material in this table; read and pruned on first use. `None` is glTF's default material.
    ///
    /// # Errors
    /// A material that does not exist or has an unknown alpha mode.
    pub fn slot(&mut self, index: Option<usize>, user: &str) -> Result<usize, SceneError> {
        let key = index.unwrap_or(usize::MAX);
        if let Some(&slot) = self.slots_by_index.get(&key) {
            return Ok(slot);
        }
        let slot = match index {
            None => self.prepare(schema::Material::default(), "default".into(), Ranges::new(), user),
            Some(index) => {
                let count = self.root.materials.len();
                let source = self.root.materials.get(index).ok_or_else(|| {
                    SceneError::new(
                        format!("{user}/material"),
                        format!("material {index} does not exist, the file has {count}"),
                    )
                })?;
                let place = format!("/materials/{index}");
                if parse_alpha_mode(source).is_none() {
                    return Err(SceneError::new(place + "/alphaMode", "it is none of OPAQUE, MASK, BLEND"));
                }
                let name = source.name.clone().unwrap_or_else(|| format!("material {index}"));
                let ranges = self.ranges.get(&index).cloned().unwrap_or_default();
                self.prepare(source.clone(), name, ranges, &place)
            }
        };
        self.slots.push(slot);
        self.slots_by_index.insert(key, self.slots.len() - 1);
        Ok(self.slots.len() - 1)
    }

    /// Whether a slot's material is blended, and its draws are sorted one by one, for vertices with colours or without.
    pub fn blends(&self, slot: usize, has_colors: bool) -> bool {
        let pruned = &self.slots[slot].pruned;
        if parse_alpha_mode(&pruned.material) != Some(AlphaMode::Blend) {
            return false;
        }
        let mut settled = pruned.clone();
        settle(&mut settled, false, 1.0, &|info| self.textures.range(info));
        has_colors || settled.effects.contains(&Effect::AlphaBlend)
    }

    /// What a slot's material reads from vertices.
    pub fn needs(&self, slot: usize) -> Needs {
        self.slots[slot].needs
    }

    fn prepare(&mut self, mut material: schema::Material, name: String, ranges: Ranges, place: &str) -> Slot {
        let mut notes = extensions::material_notes(&name, &material, self.specular_glossiness);
        let textures = &mut self.textures;
        let mut keep = |info: &mut TextureInfo, _: ColorSpace| {
            let set = uv_set(info);
            if set > 1 {
                notes.push(format!("material `{name}`: a texture wants TEXCOORD_{set} and is not drawn"));
            }
            set <= 1 && textures.require(info, place)
        };
        if let Some(source) = &mut material.extensions.specular_glossiness {
            for slot in [&mut source.diffuse_texture, &mut source.specular_glossiness_texture] {
                if slot.as_mut().is_some_and(|info| !keep(info, ColorSpace::Srgb)) {
                    *slot = None;
                }
            }
        }
        retain_textures(&mut material, &mut keep);
        let converted =
            specular_glossiness::convert(&mut material, self.specular_glossiness, &mut self.textures);
        if let Err(reason) = converted {
            notes.push(format!(
                "material `{name}`: specular-glossiness textures were not converted: {reason}"
            ));
        }
        material.name = Some(name.clone());
        let pruned = prune(material, &ranges, &|info| self.textures.range(info));
        Slot { name, needs: needs(&pruned), pruned, notes }
    }

    /// Drops what no primitive of the scene uses, decides the last effects, numbers the rest and gives the
    /// scene its textures, images and material indices. `is_lit` if the scene has lights of its own.
    pub fn settle(mut self, scene: &mut Scene, is_lit: bool) -> Settled {
        let mut settled = Settled::default();
        let mut final_index = BTreeMap::new();
        let mut numbering = Numbering::default();
        let each: Vec<Colors> = scene.primitives.iter().map(colors).collect();
        let variants = scene.variant_materials.iter().map(|it| (it.primitive, it.material));
        let users: Vec<(usize, usize)> =
            scene.primitives.iter().map(|it| it.material).enumerate().chain(variants).collect();
        for (&index, &slot) in &self.slots_by_index {
            let used =
                users.iter().filter(|(_, material)| *material == slot).map(|&(primitive, _)| each[primitive]);
            let Some(colors) = used.reduce(Colors::and) else { continue };
            let Slot { name, pruned, notes, .. } = &mut self.slots[slot];
            settle(pruned, colors.any, colors.alpha_min, &|info| self.textures.range(info));
            if is_lit && !pruned.effects.contains(&Effect::Unlit) {
                pruned.effects.insert(Effect::PunctualLights);
            }
            settled.notes.append(notes);
            let mut material = pruned.material.clone();
            retain_textures(&mut material, &mut |info, _| {
                let found = self.textures.get(info);
                found.map(|found| info.index = numbering.texture(found)).is_some()
            });
            let mut place = |info: &TextureInfo, space| TextureRef {
                texture: numbering.view(info.index, space),
                ..texture_ref(info)
            };
            settled.flat.push(flatten(&material, name.clone(), pruned.effects.clone(), &mut place));
            settled.materials.push(material);
            settled.reads.push(pruned.reads);
            final_index.insert(slot, settled.flat.len() - 1);
            let mut moving: Vec<MaterialProperty> =
                self.ranges.get(&index).into_iter().flatten().map(|(property, _)| *property).collect();
            moving.retain(|property| pruned.responds_to(*property));
            if !moving.is_empty() {
                let source = settled.materials[settled.flat.len() - 1].clone();
                scene.sources.materials.insert(settled.flat.len() - 1, source);
            }
            settled.moving.insert(index, (settled.flat.len() - 1, moving));
        }
        for primitive in &mut scene.primitives {
            primitive.material = final_index[&primitive.material];
        }
        for variant in &mut scene.variant_materials {
            variant.material = final_index[&variant.material];
        }
        settled.warnings = std::mem::take(&mut self.textures.warnings);
        numbering.write(&mut self.textures.pictures, scene, &mut settled);
        settled
    }
}

/// UV set and placement, without a texture.
pub(crate) fn texture_ref(info: &TextureInfo) -> TextureRef {
    let transform = transform_rows(info.extensions.transform.as_ref());
    TextureRef { texture: 0, uv_set: uv_set(info), transform }
}

fn needs(pruned: &Pruned) -> Needs {
    let mut uv = [false; 2];
    let mut material = pruned.material.clone();
    retain_textures(&mut material, &mut |info, _| {
        uv[uv_set(info) as usize] = true;
        true
    });
    Needs { normals: material.extensions.unlit.is_none(), tangents: tangent_space(&material), uv }
}

/// Where the tangents of a mesh without any come from: the placement of the first texture that is read through them. A
/// brush without a texture runs along the first UV set (`KHR_materials_anisotropy`).
fn tangent_space(material: &schema::Material) -> Option<TextureRef> {
    let ext = &material.extensions;
    let coat = ext.clearcoat.as_ref().and_then(|coat| coat.clearcoat_normal_texture.as_ref());
    let normal = material.normal_texture.as_ref().or(coat).map(|texture| texture_ref(&texture.info));
    let brush = ext.anisotropy.as_ref().map(|brush| match &brush.anisotropy_texture {
        Some(info) => texture_ref(info),
        None => texture_ref(&TextureInfo::default()),
    });
    normal.or(brush)
}

/// What the vertex colours of some primitives are like.
#[derive(Clone, Copy, Debug)]
struct Colors {
    /// Any that is not white.
    any: bool,
    alpha_min: f32,
}

impl Colors {
    fn and(self, other: Colors) -> Colors {
        Colors { any: self.any || other.any, alpha_min: self.alpha_min.min(other.alpha_min) }
    }
}

fn colors(primitive: &crate::Primitive) -> Colors {
    let each = primitive.vertices.iter().map(|vertex| vertex.color);
    let each = each.map(|color| Colors { any: color != [1.0; 4], alpha_min: color[3] });
    each.reduce(Colors::and).unwrap_or(Colors { any: false, alpha_min: 1.0 })
}

/// Numbers in the order of first use, so that they do not depend on what the file had besides.
#[derive(Default)]
struct Numbering {
    textures: Vec<Found>,
    views: Vec<(usize, ColorSpace)>,
}

impl Numbering {
    fn texture(&mut self, found: Found) -> usize {
        position_or_push(&mut self.textures, found)
    }

    fn view(&mut self, texture: usize, space: ColorSpace) -> usize {
        position_or_push(&mut self.views, (texture, space))
    }

    fn write(self, pictures: &mut [Picture], scene: &mut Scene, settled: &mut Settled) {
        let mut used = Vec::new();
        let images: Vec<usize> =
            self.textures.iter().map(|found| position_or_push(&mut used, found.picture)).collect();
        for (found, &image) in self.textures.iter().zip(&images) {
            let plain = found.sampler == schema::Sampler::default();
            let sampler = (!plain).then(|| position_or_push(&mut settled.samplers, found.sampler));
            settled.textures.push(schema::Texture {
                sampler,
                source: Some(image),
                ..schema::Texture::default()
            });
        }
        scene.sources.textures.clone_from(&self.views);
        for (texture, color_space) in self.views {
            let sampler = sampler(self.textures[texture].sampler);
            scene.textures.push(Texture { image: images[texture], color_space, sampler });
        }
        for picture in used {
            let picture = &mut pictures[picture];
            scene.images.push(std::mem::take(&mut picture.decoded));
            settled.pictures.push((picture.mime_type, std::mem::take(&mut picture.encoded)));
        }
    }
}

fn position_or_push<T: PartialEq>(list: &mut Vec<T>, value: T) -> usize {
    list.iter().position(|known| *known == value).unwrap_or_else(|| {
        list.push(value);
        list.len() - 1
    })
}
