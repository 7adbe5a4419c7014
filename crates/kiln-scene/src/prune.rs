//! Which effects a material's values call for; what nothing calls for is taken out of it.
//!
//! Names decide nothing: a clear coat of factor 0, a black emissive texture or a flat normal map is no effect.
//! Values that an animation changes count with all they become: each question is put to the end that can say yes.

use crate::animate::Ranges;
use crate::images::ChannelRange;
use crate::materials::parse_alpha_mode;
use crate::schema::{Material, NormalTexture, OcclusionTexture, TextureInfo};
use crate::{AlphaMode, ColorSpace, Effect, EffectSet, LightReads, MaterialProperty};

/// Looks up the range of each channel of a texture.
pub(crate) type Look<'a> = &'a dyn Fn(&TextureInfo) -> ChannelRange;

/// A material without what it does not need, and what it calls for.
#[derive(Clone, Debug)]
pub(crate) struct Pruned {
    pub material: Material,
    pub effects: EffectSet,
    pub reads: LightReads,
    /// Least alpha of the base colour's factor.
    alpha_min: f32,
    /// Largest alpha that is cut.
    cutoff_max: f32,
}

impl Pruned {
    /// Whether setting `property` changes anything in what is left.
    pub fn responds_to(&self, property: MaterialProperty) -> bool {
        use MaterialProperty as M;
        match property {
            M::EmissiveFactor | M::EmissiveStrength if !self.effects.contains(&Effect::Emission) => false,
            M::MetallicFactor | M::RoughnessFactor => !self.effects.contains(&Effect::Unlit),
            M::AlphaCutoff => self.effects.contains(&Effect::AlphaMask),
            property => property.values(&mut self.material.clone()).is_some(),
        }
    }
}

/// A material with every animated number at its smallest and at its largest.
struct Extremes {
    low: Material,
    high: Material,
}

impl Extremes {
    /// The rest pose counts too.
    fn new(material: &Material, ranges: &Ranges) -> Self {
        let (mut low, mut high) = (material.clone(), material.clone());
        for (property, range) in ranges {
            let ends = property.values(&mut low).into_iter().zip(property.values(&mut high));
            for ((low, high), range) in ends.flat_map(|(low, high)| low.iter_mut().zip(high)).zip(range) {
                *low = low.min(range[0]);
                *high = high.max(range[1]);
            }
        }
        clamp(&mut low);
        clamp(&mut high);
        Extremes { low, high }
    }

    fn any(&self, test: impl Fn(&Material) -> bool) -> bool {
        test(&self.low) || test(&self.high)
    }
}

/// Decides all effects but those that depend on vertex colours: see [`settle`].
pub(crate) fn prune(mut material: Material, ranges: &Ranges, look: Look<'_>) -> Pruned {
    let mut effects = EffectSet::new();
    clamp(&mut material);
    let extremes = Extremes::new(&material, ranges);
    let Extremes { low, high } = &extremes;
    let alpha_min = low.pbr_metallic_roughness.base_color_factor[3];
    let cutoff_max = high.alpha_cutoff.unwrap_or(0.5);
    if material.extensions.unlit.is_some() {
        effects.insert(Effect::Unlit);
        let reads = LightReads::default();
        return Pruned { material: unlit(material), effects, reads, alpha_min, cutoff_max };
    }
    let mut keep = |effect, called_for: bool| {
        if called_for {
            effects.insert(effect);
        }
        called_for
    };
    if !keep(Effect::Emission, emits(high, look)) {
        material.emissive_factor = [0.0; 3];
        material.emissive_texture = None;
        material.extensions.emissive_strength = None;
    }
    if !keep(
        Effect::NormalMap,
        extremes.any(|it| it.normal_texture.as_ref().is_some_and(|it| bends(it, look))),
    ) {
        material.normal_texture = None;
    }
    if !keep(Effect::Occlusion, high.occlusion_texture.as_ref().is_some_and(|it| occludes(it, look))) {
        material.occlusion_texture = None;
    }
    if !keep(Effect::Clearcoat, has_clearcoat(high, look)) {
        material.extensions.clearcoat = None;
    }
    if let Some(clearcoat) = &mut material.extensions.clearcoat
        && !extremes.any(|it| has_bent_clearcoat(it, look))
    {
        clearcoat.clearcoat_normal_texture = None;
    }
    if !keep(Effect::Sheen, has_sheen(high, look)) {
        material.extensions.sheen = None;
    }
    let metal = is_metal(low, look);
    let transmits = !metal && transmits(high, look);
    if !keep(Effect::Transmission, transmits) {
        material.extensions.transmission = None;
    }
    let scatters = !metal && scatters(high, look);
    if !keep(Effect::DiffuseTransmission, scatters) {
        material.extensions.diffuse_transmission = None;
    }
    // What lets no light in has no inside, and walls without an inside bend no light.
    let has_inside = (transmits || scatters) && is_thick(high, look);
    if !keep(Effect::Volume, has_inside) {
        material.extensions.volume = None;
    }
    if !keep(Effect::Dispersion, transmits && has_inside && disperses(high)) {
        material.extensions.dispersion = None;
    }
    if !keep(Effect::Anisotropy, is_brushed(high, look)) {
        material.extensions.anisotropy = None;
    }
    if !keep(Effect::Iridescence, has_film(high, look)) {
        material.extensions.iridescence = None;
    }
    // A metal reflects its base colour, so the dielectric layer's strength and colour do not show.
    if !keep(Effect::Specular, !metal && extremes.any(|it| has_specular(it, look))) {
        material.extensions.specular = None;
        material.extensions.ior = None;
    }
    let reads = reads(&material, &extremes, look);
    Pruned { material, effects, reads, alpha_min, cutoff_max }
}

/// Decides vertex colour and alpha once the geometry is known. `alpha_min` is the smallest vertex alpha.
pub(crate) fn settle(pruned: &mut Pruned, colored: bool, alpha_min: f32, look: Look<'_>) {
    if colored {
        pruned.effects.insert(Effect::VertexColor);
    }
    let base = &pruned.material.pbr_metallic_roughness;
    let texture_min = base.base_color_texture.as_ref().map_or(1.0, |info| unit(look(info).min[3]));
    let alpha = pruned.alpha_min * texture_min * alpha_min;
    match parse_alpha_mode(&pruned.material) {
        Some(AlphaMode::Mask { .. }) if alpha < pruned.cutoff_max => {
            pruned.effects.insert(Effect::AlphaMask);
        }
        Some(AlphaMode::Blend) if alpha < 1.0 => {
            pruned.effects.insert(Effect::AlphaBlend);
        }
        _ => {
            pruned.material.alpha_mode = None;
            pruned.material.alpha_cutoff = None;
        }
    }
}

/// Calls `keep` for every texture of the material and removes those that it refuses.
pub(crate) fn retain_textures(
    material: &mut Material,
    keep: &mut dyn FnMut(&mut TextureInfo, ColorSpace) -> bool,
) {
    use ColorSpace::{Linear, Srgb};
    let base = &mut material.pbr_metallic_roughness;
    retain(&mut base.base_color_texture, Srgb, keep);
    retain(&mut base.metallic_roughness_texture, Linear, keep);
    retain(&mut material.normal_texture, Linear, keep);
    retain(&mut material.occlusion_texture, Linear, keep);
    retain(&mut material.emissive_texture, Srgb, keep);
    if let Some(clearcoat) = &mut material.extensions.clearcoat {
        retain(&mut clearcoat.clearcoat_texture, Linear, keep);
        retain(&mut clearcoat.clearcoat_roughness_texture, Linear, keep);
        retain(&mut clearcoat.clearcoat_normal_texture, Linear, keep);
    }
    if let Some(sheen) = &mut material.extensions.sheen {
        retain(&mut sheen.sheen_color_texture, Srgb, keep);
        retain(&mut sheen.sheen_roughness_texture, Linear, keep);
    }
    if let Some(specular) = &mut material.extensions.specular {
        retain(&mut specular.specular_texture, Linear, keep);
        retain(&mut specular.specular_color_texture, Srgb, keep);
    }
    if let Some(transmission) = &mut material.extensions.transmission {
        retain(&mut transmission.transmission_texture, Linear, keep);
    }
    if let Some(anisotropy) = &mut material.extensions.anisotropy {
        retain(&mut anisotropy.anisotropy_texture, Linear, keep);
    }
    if let Some(film) = &mut material.extensions.iridescence {
        retain(&mut film.iridescence_texture, Linear, keep);
        retain(&mut film.iridescence_thickness_texture, Linear, keep);
    }
    if let Some(volume) = &mut material.extensions.volume {
        retain(&mut volume.thickness_texture, Linear, keep);
    }
    if let Some(diffuse) = &mut material.extensions.diffuse_transmission {
        retain(&mut diffuse.diffuse_transmission_texture, Linear, keep);
        retain(&mut diffuse.diffuse_transmission_color_texture, Srgb, keep);
    }
}

fn retain<T: AsMut<TextureInfo>>(
    slot: &mut Option<T>,
    space: ColorSpace,
    keep: &mut dyn FnMut(&mut TextureInfo, ColorSpace) -> bool,
) {
    if slot.as_mut().is_some_and(|texture| !keep(texture.as_mut(), space)) {
        *slot = None;
    }
}

impl AsMut<TextureInfo> for TextureInfo {
    fn as_mut(&mut self) -> &mut TextureInfo {
        self
    }
}

impl AsMut<TextureInfo> for NormalTexture {
    fn as_mut(&mut self) -> &mut TextureInfo {
        &mut self.info
    }
}

impl AsMut<TextureInfo> for OcclusionTexture {
    fn as_mut(&mut self) -> &mut TextureInfo {
        &mut self.info
    }
}

/// Base colour and alpha alone.
fn unlit(material: Material) -> Material {
    let base = material.pbr_metallic_roughness;
    let mut bare = Material {
        name: material.name,
        alpha_mode: material.alpha_mode,
        alpha_cutoff: material.alpha_cutoff,
        double_sided: material.double_sided,
        ..Material::default()
    };
    bare.pbr_metallic_roughness.base_color_factor = base.base_color_factor;
    bare.pbr_metallic_roughness.base_color_texture = base.base_color_texture;
    bare.extensions.unlit = material.extensions.unlit;
    bare
}

/// Brings factors into the ranges of the schema; values outside have no physical meaning.
pub(crate) fn clamp(material: &mut Material) {
    let unit = |value: &mut f32| *value = value.clamp(0.0, 1.0);
    let base = &mut material.pbr_metallic_roughness;
    base.base_color_factor.iter_mut().for_each(unit);
    unit(&mut base.metallic_factor);
    unit(&mut base.roughness_factor);
    material.emissive_factor.iter_mut().for_each(|value| *value = value.max(0.0));
    if let Some(occlusion) = &mut material.occlusion_texture {
        unit(&mut occlusion.strength);
    }
    if let Some(clearcoat) = &mut material.extensions.clearcoat {
        unit(&mut clearcoat.clearcoat_factor);
        unit(&mut clearcoat.clearcoat_roughness_factor);
    }
    if let Some(sheen) = &mut material.extensions.sheen {
        sheen.sheen_color_factor.iter_mut().for_each(unit);
        unit(&mut sheen.sheen_roughness_factor);
    }
    if let Some(specular) = &mut material.extensions.specular {
        unit(&mut specular.specular_factor);
        specular.specular_color_factor.iter_mut().for_each(|value| *value = value.max(0.0));
    }
    if let Some(transmission) = &mut material.extensions.transmission {
        unit(&mut transmission.transmission_factor);
    }
    let positive = |value: &mut f32| *value = value.max(0.0);
    if let Some(anisotropy) = &mut material.extensions.anisotropy {
        unit(&mut anisotropy.anisotropy_strength);
    }
    if let Some(film) = &mut material.extensions.iridescence {
        unit(&mut film.iridescence_factor);
        film.iridescence_ior = film.iridescence_ior.max(1.0);
        positive(&mut film.iridescence_thickness_minimum);
        positive(&mut film.iridescence_thickness_maximum);
    }
    if let Some(volume) = &mut material.extensions.volume {
        positive(&mut volume.thickness_factor);
        volume.attenuation_color.iter_mut().for_each(unit);
        volume.attenuation_distance = volume.attenuation_distance.filter(|it| *it > 0.0);
    }
    if let Some(dispersion) = &mut material.extensions.dispersion {
        positive(&mut dispersion.dispersion);
    }
    if let Some(diffuse) = &mut material.extensions.diffuse_transmission {
        unit(&mut diffuse.diffuse_transmission_factor);
        diffuse.diffuse_transmission_color_factor.iter_mut().for_each(positive);
    }
    if let Some(ior) = &mut material.extensions.ior {
        // 0 is the extension's own way to say a Fresnel term of 1.
        ior.ior = if ior.ior == 0.0 { 0.0 } else { ior.ior.max(1.0) };
    }
}

fn unit(code: u8) -> f32 {
    f32::from(code) / 255.0
}

/// Largest product of factor and texture over the red, green and blue channels.
fn color_max(factor: [f32; 3], texture: Option<&TextureInfo>, look: Look<'_>) -> f32 {
    let max = texture.map_or([u8::MAX; 4], |info| look(info).max);
    (0..3).map(|channel| factor[channel] * unit(max[channel])).fold(0.0, f32::max)
}

fn channel_max(texture: Option<&TextureInfo>, channel: usize, look: Look<'_>) -> f32 {
    texture.map_or(1.0, |info| unit(look(info).max[channel]))
}

fn emits(material: &Material, look: Look<'_>) -> bool {
    let strength = material.extensions.emissive_strength.as_ref().map_or(1.0, |it| it.emissive_strength);
    strength > 0.0 && color_max(material.emissive_factor, material.emissive_texture.as_ref(), look) > 0.0
}

/// 8-bit codes 127 and 128 both stand for 0: neither is exact.
fn bends(texture: &NormalTexture, look: Look<'_>) -> bool {
    let ChannelRange { min, max } = look(&texture.info);
    let flat = min[0] >= 127 && max[0] <= 128 && min[1] >= 127 && max[1] <= 128 && min[2] >= 254;
    texture.scale != 0.0 && !flat
}

fn occludes(texture: &OcclusionTexture, look: Look<'_>) -> bool {
    texture.strength > 0.0 && look(&texture.info).min[0] < u8::MAX
}

fn has_clearcoat(material: &Material, look: Look<'_>) -> bool {
    let clearcoat = material.extensions.clearcoat.as_ref();
    clearcoat
        .is_some_and(|it| it.clearcoat_factor * channel_max(it.clearcoat_texture.as_ref(), 0, look) > 0.0)
}

fn has_bent_clearcoat(material: &Material, look: Look<'_>) -> bool {
    let clearcoat = material.extensions.clearcoat.as_ref();
    clearcoat.and_then(|it| it.clearcoat_normal_texture.as_ref()).is_some_and(|it| bends(it, look))
}

fn has_sheen(material: &Material, look: Look<'_>) -> bool {
    let sheen = material.extensions.sheen.as_ref();
    sheen.is_some_and(|it| color_max(it.sheen_color_factor, it.sheen_color_texture.as_ref(), look) > 0.0)
}

fn transmits(material: &Material, look: Look<'_>) -> bool {
    let transmission = material.extensions.transmission.as_ref();
    transmission.is_some_and(|it| {
        it.transmission_factor * channel_max(it.transmission_texture.as_ref(), 0, look) > 0.0
    })
}

/// The texture's alpha is the share that scatters through.
fn scatters(material: &Material, look: Look<'_>) -> bool {
    let diffuse = material.extensions.diffuse_transmission.as_ref();
    diffuse.is_some_and(|it| {
        it.diffuse_transmission_factor * channel_max(it.diffuse_transmission_texture.as_ref(), 3, look) > 0.0
    })
}

fn is_thick(material: &Material, look: Look<'_>) -> bool {
    let volume = material.extensions.volume.as_ref();
    volume.is_some_and(|it| it.thickness_factor * channel_max(it.thickness_texture.as_ref(), 1, look) > 0.0)
}

/// The spread of indices is in proportion to what they are above 1.
fn disperses(material: &Material) -> bool {
    let ior = material.extensions.ior.as_ref().map_or(1.5, |it| it.ior);
    ior > 1.0 && material.extensions.dispersion.is_some_and(|it| it.dispersion > 0.0)
}

fn is_brushed(material: &Material, look: Look<'_>) -> bool {
    let anisotropy = material.extensions.anisotropy.as_ref();
    anisotropy
        .is_some_and(|it| it.anisotropy_strength * channel_max(it.anisotropy_texture.as_ref(), 2, look) > 0.0)
}

/// A film without thickness is none.
fn has_film(material: &Material, look: Look<'_>) -> bool {
    material.extensions.iridescence.as_ref().is_some_and(|it| {
        let least = it.iridescence_thickness_texture.as_ref().map_or(1.0, |info| unit(look(info).min[1]));
        let thickness_max = if least < 1.0 {
            it.iridescence_thickness_minimum.max(it.iridescence_thickness_maximum)
        } else {
            it.iridescence_thickness_maximum
        };
        let factor = it.iridescence_factor * channel_max(it.iridescence_texture.as_ref(), 0, look);
        factor > 0.0 && thickness_max > 0.0
    })
}

fn is_metal(material: &Material, look: Look<'_>) -> bool {
    let base = &material.pbr_metallic_roughness;
    let texture = base.metallic_roughness_texture.as_ref();
    base.metallic_factor * texture.map_or(1.0, |info| unit(look(info).min[2])) >= 1.0
}

fn has_specular(material: &Material, look: Look<'_>) -> bool {
    let ior = material.extensions.ior.as_ref().is_some_and(|it| it.ior != 1.5);
    let specular = material.extensions.specular.as_ref().is_some_and(|it| {
        let dimmed = it.specular_texture.as_ref().is_some_and(|info| look(info).min[3] < u8::MAX);
        let color = it.specular_color_texture.as_ref();
        let tinted = color.is_some_and(|info| look(info).min[..3] != [u8::MAX; 3]);
        it.specular_factor != 1.0 || it.specular_color_factor != [1.0; 3] || dimmed || tinted
    });
    ior || specular
}

/// What a lit material that was pruned reads of its environment.
fn reads(pruned: &Material, Extremes { low, high }: &Extremes, look: Look<'_>) -> LightReads {
    let rough = |it: &Material| it.pbr_metallic_roughness.roughness_factor;
    let texture = pruned.pbr_metallic_roughness.metallic_roughness_texture.as_ref();
    let mut ggx = interval([rough(low), rough(high)], texture, 1, look);
    if pruned.extensions.transmission.is_some() {
        ggx[0] *= share_refracted(pruned, low, high);
    }
    if let Some(coat) = &pruned.extensions.clearcoat {
        let rough =
            |it: &Material| it.extensions.clearcoat.as_ref().map_or(0.0, |it| it.clearcoat_roughness_factor);
        let coat = interval([rough(low), rough(high)], coat.clearcoat_roughness_texture.as_ref(), 1, look);
        ggx = [ggx[0].min(coat[0]), ggx[1].max(coat[1])];
    }
    let charlie = pruned.extensions.sheen.as_ref().map(|sheen| {
        let rough = |it: &Material| it.extensions.sheen.as_ref().map_or(0.0, |it| it.sheen_roughness_factor);
        interval([rough(low), rough(high)], sheen.sheen_roughness_texture.as_ref(), 3, look)
    });
    LightReads { ggx: Some(ggx), charlie }
}

/// Least share of its roughness that a refracted lobe keeps, over the colours that dispersion parts: none in a medium like
/// air, all of it at index 1.5 and above (Khronos sample viewer, `applyIorToRoughness`; KHR_materials_dispersion).
fn share_refracted(pruned: &Material, low: &Material, high: &Material) -> f32 {
    let ior = low.extensions.ior.as_ref().map_or(1.5, |it| it.ior).max(1.0);
    let dispersion =
        pruned.extensions.dispersion.and(high.extensions.dispersion).map_or(0.0, |it| it.dispersion);
    let least = ior - (ior - 1.0) * 0.025 * dispersion;
    (2.0 * least - 2.0).clamp(0.0, 1.0)
}

/// Factors times what a channel of a texture holds.
fn interval(factor: [f32; 2], texture: Option<&TextureInfo>, channel: usize, look: Look<'_>) -> [f32; 2] {
    let (low, high) =
        texture.map_or((1.0, 1.0), |info| (unit(look(info).min[channel]), unit(look(info).max[channel])));
    [factor[0] * low, factor[1] * high]
}
