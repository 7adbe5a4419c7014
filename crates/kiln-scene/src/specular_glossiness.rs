//! Conversion of `KHR_materials_pbrSpecularGlossiness` to metallic-roughness, with `KHR_materials_specular` or without.
//!
//! With it, reflectance and roughness are what the old model says, to the last bit of their texels: an index of refraction
//! of 0 stands for a reflectance of 1, which the specular colour scales (conversion note of `KHR_materials_specular`). What
//! lies below the reflection stays different: the old model takes 1 − max s of the light, from wherever it is seen, the
//! new one what the Fresnel term leaves, which is the same head-on and less at grazing views.
//!
//! Without it both models agree where a colour c with metalness m gives the same diffuse and specular reflectance:
//! d = c (1 − 0.04)(1 − m) / (1 − max s) and s = 0.04 (1 − m) + c m, on brightness. Eliminating c leaves a
//! quadratic in m, the one of Khronos' conversion example in the extension's repository folder.

use serde::{Deserialize, Serialize};

use crate::Image8;
use crate::schema::{Ior, Material, MetallicRoughness, Specular, SpecularGlossiness, TextureInfo};
use crate::textures::TextureTable;

/// Reflectance of a dielectric at normal incidence for an index of refraction of 1.5.
const DIELECTRIC: f32 = 0.04;
/// Below it a quotient is noise.
const SMALL: f32 = 1e-6;

/// How materials of `KHR_materials_pbrSpecularGlossiness` are drawn.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum SpecularGlossinessAs {
    /// As metal and dielectric, which calls for no effect; colours of dielectrics' reflections are lost.
    #[default]
    MetallicRoughness,
    /// As dielectrics whose reflectance at normal incidence is the old model's specular colour
    /// (`KHR_materials_specular`), exactly.
    Specular,
}

/// Replaces the material's base layer; textures are converted texel by texel where the result varies.
///
/// # Errors
/// A sentence, if a converted texture cannot be made; the factors are converted then.
pub(crate) fn convert(
    material: &mut Material,
    to: SpecularGlossinessAs,
    table: &mut TextureTable<'_, '_>,
) -> Result<(), String> {
    let Some(source) = material.extensions.specular_glossiness.take() else { return Ok(()) };
    match to {
        SpecularGlossinessAs::MetallicRoughness => to_metallic_roughness(material, &source, table),
        SpecularGlossinessAs::Specular => to_specular(material, source, table),
    }
}

fn to_specular(
    material: &mut Material,
    source: SpecularGlossiness,
    table: &mut TextureTable<'_, '_>,
) -> Result<(), String> {
    material.pbr_metallic_roughness = MetallicRoughness {
        base_color_factor: source.diffuse_factor,
        base_color_texture: source.diffuse_texture,
        metallic_factor: 0.0,
        roughness_factor: 1.0 - source.glossiness_factor,
        metallic_roughness_texture: None,
    };
    material.extensions.ior = Some(Ior { ior: 0.0 });
    let specular = Specular { specular_color_factor: source.specular_factor, ..Specular::default() };
    let specular = material.extensions.specular.insert(specular);
    let Some(info) = source.specular_glossiness_texture else { return Ok(()) };
    let Some(like) = table.get(&info) else { return Ok(()) };
    let (color, roughness) = split(&table.pictures[like.picture].decoded, source.glossiness_factor);
    let color = table.generate(like, color)?;
    let roughness = table.generate(like, roughness)?;
    specular.specular_color_texture = Some(TextureInfo { index: color, ..info.clone() });
    let base = &mut material.pbr_metallic_roughness;
    base.metallic_roughness_texture = Some(TextureInfo { index: roughness, ..info });
    base.roughness_factor = 1.0;
    Ok(())
}

/// The specular colours as they are (sRGB), and a metallic-roughness image without metal.
fn split(specular_glossiness: &Image8, glossiness_factor: f32) -> (Image8, Image8) {
    let (texels, _) = specular_glossiness.rgba.as_chunks::<4>();
    let color = texels.iter().flat_map(|&[red, green, blue, _]| [red, green, blue, u8::MAX]).collect();
    let roughness = |glossiness: u8| code(1.0 - glossiness_factor * f32::from(glossiness) / 255.0);
    let rough = texels.iter().flat_map(|texel| [u8::MAX, roughness(texel[3]), 0, u8::MAX]).collect();
    let image = |rgba| Image8 { rgba, ..*specular_glossiness };
    (image(color), image(rough))
}

fn to_metallic_roughness(
    material: &mut Material,
    source: &SpecularGlossiness,
    table: &mut TextureTable<'_, '_>,
) -> Result<(), String> {
    let solved = solve(
        [source.diffuse_factor[0], source.diffuse_factor[1], source.diffuse_factor[2]],
        source.specular_factor,
    );
    let [red, green, blue] = solved.base_color;
    material.pbr_metallic_roughness = MetallicRoughness {
        base_color_factor: [red, green, blue, source.diffuse_factor[3]],
        base_color_texture: source.diffuse_texture.clone(),
        metallic_factor: solved.metallic,
        roughness_factor: 1.0 - source.glossiness_factor,
        metallic_roughness_texture: None,
    };
    let varies = source.specular_glossiness_texture.is_some()
        || (source.diffuse_texture.is_some() && brightness(source.specular_factor) > DIELECTRIC);
    if varies { convert_texels(material, source, table) } else { Ok(()) }
}

fn convert_texels(
    material: &mut Material,
    source: &SpecularGlossiness,
    table: &mut TextureTable<'_, '_>,
) -> Result<(), String> {
    let infos = [&source.diffuse_texture, &source.specular_glossiness_texture];
    let Some(info) = infos.into_iter().flatten().next().cloned() else { return Ok(()) };
    let Some(like) = table.get(&info) else { return Ok(()) };
    let layer =
        |info: &Option<TextureInfo>| info.as_ref().and_then(|info| table.get(info)).map(|it| it.picture);
    let [diffuse, specular] = infos.map(layer).map(|at| at.map(|at| &table.pictures[at].decoded));
    let (base_color, metallic_roughness) = converted(source, diffuse, specular);
    let base = &mut material.pbr_metallic_roughness;
    let base_color = table.generate(like, base_color)?;
    let metallic_roughness = table.generate(like, metallic_roughness)?;
    base.base_color_factor = [1.0; 4];
    base.metallic_factor = 1.0;
    base.roughness_factor = 1.0;
    base.base_color_texture = Some(TextureInfo { index: base_color, ..info.clone() });
    base.metallic_roughness_texture = Some(TextureInfo { index: metallic_roughness, ..info });
    Ok(())
}

/// Base colour (sRGB, alpha) and metallic-roughness images of the larger input's size.
fn converted(
    source: &SpecularGlossiness,
    diffuse: Option<&Image8>,
    specular: Option<&Image8>,
) -> (Image8, Image8) {
    let sizes = [diffuse, specular].into_iter().flatten().map(|image| (image.width, image.height));
    let (width, height) = sizes.max().unwrap_or((1, 1));
    let linear: Vec<f32> = (0..=u8::MAX).map(srgb_to_linear).collect();
    let texels = width as usize * height as usize;
    let (mut base, mut rough) = (Vec::with_capacity(4 * texels), Vec::with_capacity(4 * texels));
    for (y, x) in (0..height).flat_map(|y| (0..width).map(move |x| (y, x))) {
        let at =
            |image: Option<&Image8>| image.map_or([u8::MAX; 4], |image| nearest(image, x, y, width, height));
        let (d, s) = (at(diffuse), at(specular));
        let mix = |factor: f32, code: u8| factor * linear[usize::from(code)];
        let solved = solve(
            std::array::from_fn(|channel| mix(source.diffuse_factor[channel], d[channel])),
            std::array::from_fn(|channel| mix(source.specular_factor[channel], s[channel])),
        );
        let [red, green, blue] = solved.base_color.map(linear_to_srgb);
        let glossiness = source.glossiness_factor * f32::from(s[3]) / 255.0;
        base.extend([red, green, blue, code(source.diffuse_factor[3] * f32::from(d[3]) / 255.0)]);
        rough.extend([u8::MAX, code(1.0 - glossiness), code(solved.metallic), u8::MAX]);
    }
    (Image8 { width, height, rgba: base }, Image8 { width, height, rgba: rough })
}

fn nearest(image: &Image8, x: u32, y: u32, width: u32, height: u32) -> [u8; 4] {
    let scale = |at: u32, from: u32, to: u32| (u64::from(at) * u64::from(to) / u64::from(from)) as usize;
    let at = scale(y, height, image.height) * image.width as usize + scale(x, width, image.width);
    let (texels, _) = image.rgba.as_chunks::<4>();
    texels[at]
}

#[derive(Clone, Copy, Debug, PartialEq)]
struct Solved {
    base_color: [f32; 3],
    metallic: f32,
}

fn solve(diffuse: [f32; 3], specular: [f32; 3]) -> Solved {
    let transmitted = 1.0 - specular.into_iter().fold(0.0, f32::max).min(1.0);
    let metallic = solve_metallic(brightness(diffuse), brightness(specular), transmitted);
    let from_diffuse = transmitted / (1.0 - DIELECTRIC) / (1.0 - metallic).max(SMALL);
    let weight = metallic * metallic;
    let base_color = std::array::from_fn(|channel| {
        let of_specular = (specular[channel] - DIELECTRIC * (1.0 - metallic)) / metallic.max(SMALL);
        let mixed = (1.0 - weight) * diffuse[channel] * from_diffuse + weight * of_specular;
        mixed.clamp(0.0, 1.0)
    });
    Solved { base_color, metallic }
}

fn solve_metallic(diffuse: f32, specular: f32, transmitted: f32) -> f32 {
    if specular < DIELECTRIC {
        return 0.0;
    }
    let b = diffuse * transmitted / (1.0 - DIELECTRIC) + specular - 2.0 * DIELECTRIC;
    let c = DIELECTRIC - specular;
    let discriminant = (b * b - 4.0 * DIELECTRIC * c).max(0.0);
    ((discriminant.sqrt() - b) / (2.0 * DIELECTRIC)).clamp(0.0, 1.0)
}

/// Perceived brightness (HSP colour model).
fn brightness([red, green, blue]: [f32; 3]) -> f32 {
    (0.299 * red * red + 0.587 * green * green + 0.114 * blue * blue).sqrt()
}

fn code(value: f32) -> u8 {
    (value.clamp(0.0, 1.0) * 255.0 + 0.5) as u8
}

/// IEC 61966-2-1.
fn srgb_to_linear(code: u8) -> f32 {
    let value = f64::from(code) / 255.0;
    let linear = if value <= 0.04045 { value / 12.92 } else { libm::pow((value + 0.055) / 1.055, 2.4) };
    linear as f32
}

fn linear_to_srgb(linear: f32) -> u8 {
    let value = f64::from(linear);
    let encoded =
        if value <= 0.003_130_8 { value * 12.92 } else { 1.055 * libm::pow(value, 1.0 / 2.4) - 0.055 };
    code(encoded as f32)
}
