//! `[env.NAME]` of kiln.toml as data.

use kiln_bake::{RoughnessLaw, TexelFormat};
use kiln_image::{FACE_NAMES, Layout, TexelPolicy};

use crate::config::normalised;
use crate::profile::{self, PROFILE_NAMES};
use crate::reader::Section;

/// An environment and the quality it is baked with.
#[derive(Clone, Debug, PartialEq)]
pub struct EnvConfig {
    /// A panorama, cube or octahedral map; or the six faces +X −X +Y −Y +Z −Z.
    pub sources: Vec<String>,
    /// How the source is laid out; `None` looks at it.
    pub layout: Option<Layout>,
    /// Edge of the specular chain's first level, in texels; a power of two.
    pub size: usize,
    /// Levels of the specular and sheen chains; `None` ends them at faces of 4 texels.
    pub levels: Option<usize>,
    /// Roughness of the levels.
    pub law: RoughnessLaw,
    /// Edge of the skybox; `None` follows the source.
    pub skybox_size: Option<usize>,
    /// Edge of the irradiance cube.
    pub irradiance_size: usize,
    /// Whether there is a whole Charlie chain, whatever scenes call for.
    pub has_sheen: bool,
    /// Whether the irradiance and the whole GGX chain are baked, whatever scenes call for.
    pub bakes_all: bool,
    /// Perceptual roughness up to which somebody wants to blur the background.
    pub background_blur: f64,
    /// Highest degree of the harmonics.
    pub sh_order: usize,
    /// Whether the irradiance's harmonics are windowed until they are nowhere negative.
    pub is_sh_windowed: bool,
    /// Error asked for, relative RMS, encoding included. Where a time is asked for, the one that was chosen for it.
    pub error: f64,
    /// What a bake of all that is read of it may take, in milliseconds; `None` asks for an error.
    pub time_ms: Option<f64>,
    /// Whether `size` is nobody's wish.
    pub is_size_open: bool,
    /// Texel format.
    pub format: TexelFormat,
    /// What happens to values that a format cannot hold.
    pub range: Range,
    /// What happens to NaN, infinite and negative texels.
    pub texels: TexelPolicy,
    /// Radiance above it is cut, by the user's wish.
    pub radiance_max: Option<f64>,
    /// Whether the dominant small light becomes a light of its own.
    pub is_sun_extracted: bool,
}

/// What happens to values above 65504 when texels are no 32-bit floats.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Range {
    /// All texels are divided by a power of two, which is recorded.
    Scale,
    /// Such a map is stored as 32-bit floats.
    F32,
}

impl EnvConfig {
    /// What a section says that names its source alone.
    pub fn new(sources: Vec<String>) -> EnvConfig {
        EnvConfig {
            sources,
            layout: None,
            size: 256,
            levels: None,
            law: RoughnessLaw::Linear,
            skybox_size: None,
            irradiance_size: 64,
            has_sheen: false,
            bakes_all: false,
            background_blur: 0.0,
            sh_order: 2,
            is_sh_windowed: false,
            error: 1e-3,
            time_ms: None,
            is_size_open: true,
            format: TexelFormat::Rgba16Float,
            range: Range::Scale,
            texels: TexelPolicy::Repair,
            radiance_max: None,
            is_sun_extracted: false,
        }
    }

    /// Levels of the specular chain.
    pub fn level_count(&self) -> usize {
        if let RoughnessLaw::Custom(list) = &self.law {
            return list.len();
        }
        let smallest = SMALLEST_SPECULAR_FACE.min(self.size);
        self.levels.unwrap_or((self.size / smallest).ilog2() as usize + 1)
    }

    /// Perceptual roughness of a level.
    pub fn roughness(&self, level: usize) -> f64 {
        self.law.roughness(level, self.level_count())
    }

    /// Edge of a level of the specular chain.
    pub fn face_size(&self, level: usize) -> usize {
        (self.size >> level).max(1)
    }
}

/// Levels of a specular chain end at this face size unless somebody wants more: smaller ones cannot carry a rough lobe's
/// gradient through bilinear lookups.
const SMALLEST_SPECULAR_FACE: usize = 4;

/// The names by which kiln.toml and facts know texel formats.
pub const FORMATS: [(&str, TexelFormat); 5] = [
    ("rgba16f", TexelFormat::Rgba16Float),
    ("rgba32f", TexelFormat::Rgba32Float),
    ("rgb9e5", TexelFormat::Rgb9e5Ufloat),
    ("r11g11b10f", TexelFormat::R11g11b10Ufloat),
    ("bc6h", TexelFormat::Bc6hUfloat),
];

/// A format's name.
pub fn format_name(format: TexelFormat) -> &'static str {
    FORMATS.iter().find(|(_, known)| *known == format).map_or("", |(name, _)| name)
}

pub(crate) fn read_env(section: &mut Section) -> EnvConfig {
    let mut config = EnvConfig::new(read_sources(section));
    let profiles = PROFILE_NAMES.map(|name| (name, name));
    let profile = section.choice("profile", &profiles);
    if let Some(name) = profile {
        profile::apply(name, &mut config);
    }
    let default = config.clone();
    let layouts = Layout::ALL.map(|layout| (layout.name(), Some(layout)));
    let layouts: Vec<(&str, Option<Layout>)> = std::iter::once(("auto", None)).chain(layouts).collect();
    config.layout = section.choice("layout", &layouts).unwrap_or(default.layout);
    let size = section.integer("size", 1..=4096);
    config.is_size_open = size.is_none() && profile.is_none();
    config.size = size.unwrap_or(default.size);
    config.skybox_size = section.integer("skybox_size", 1..=4096);
    config.irradiance_size = section.integer("irradiance_size", 1..=1024).unwrap_or(default.irradiance_size);
    config.has_sheen = section.boolean("sheen").unwrap_or(default.has_sheen);
    config.bakes_all =
        section.choice("bake", &[("needed", false), ("all", true)]).unwrap_or(default.bakes_all);
    config.background_blur = section.number("background_blur", 0.0..=1.0).unwrap_or(default.background_blur);
    config.sh_order = section.integer("sh_order", 0..=8).unwrap_or(default.sh_order);
    let windows = [("none", false), ("dering", true)];
    config.is_sh_windowed = section.choice("sh_window", &windows).unwrap_or(default.is_sh_windowed);
    let error = section.number("error", 1e-7..=1.0);
    config.error = error.unwrap_or(default.error);
    config.time_ms = section.number("time_ms", 1.0..=3.6e6);
    if config.time_ms.is_some() && (error.is_some() || profile.is_some()) {
        let other = if error.is_some() { "error" } else { "profile" };
        let message = format!("`time_ms` and `{other}` both say how good the maps are");
        section.fail(
            message,
            section.place("time_ms"),
            Some("take out one; with `time_ms` Kiln chooses the error, and says which".to_owned()),
        );
        config.time_ms = None;
    }
    config.format = section.choice("format", &FORMATS).unwrap_or(default.format);
    config.range =
        section.choice("range", &[("scale", Range::Scale), ("f32", Range::F32)]).unwrap_or(default.range);
    let policies =
        [("repair", TexelPolicy::Repair), ("error", TexelPolicy::Error), ("keep", TexelPolicy::Keep)];
    config.texels = section.choice("texels", &policies).unwrap_or(default.texels);
    config.radiance_max = section.number("max_radiance", 1e-30..=1e38);
    config.is_sun_extracted =
        section.choice("sun", &[("keep", false), ("extract", true)]).unwrap_or(default.is_sun_extracted);
    if config.is_sun_extracted && config.texels == TexelPolicy::Keep {
        let message = "`sun = \"extract\"` needs radiance: `texels` may not be \"keep\"".to_owned();
        section.fail(message, section.place("sun"), None);
    }
    if !config.size.is_power_of_two() {
        let message = format!("`size` is {}, which is no power of two", config.size);
        let help =
            format!("use {} or {}", config.size.next_power_of_two() / 2, config.size.next_power_of_two());
        section.fail(message, section.place("size"), Some(help));
    }
    read_law(section, &mut config);
    let most = config.size.ilog2() as usize + 1;
    if config.level_count() > most {
        let (place, wanted) = match config.law {
            RoughnessLaw::Custom(_) => ("law", "a list of"),
            _ => ("levels", "`levels` ="),
        };
        let message = format!(
            "{wanted} {} is more than a chain from {} texels has levels: {most}",
            config.level_count(),
            config.size
        );
        section.fail(message, section.place(place), None);
        config.law = RoughnessLaw::Linear;
        config.levels = None;
    }
    config
}

fn read_law(section: &mut Section, config: &mut EnvConfig) {
    config.levels = section.integer("levels", 1..=13);
    let place = section.place("law");
    if section.is_array("law") {
        let Some(list) = section.numbers("law") else { return };
        match RoughnessLaw::custom(list) {
            Ok(law) => config.law = law,
            Err(error) => section.fail(format!("`law`: {error}"), place.clone(), None),
        }
        if config.levels.is_some_and(|levels| levels != config.law_length()) {
            section.fail("`levels` and the list in `law` disagree".to_owned(), place, None);
        }
        return;
    }
    // Laws are no plain values, so they are chosen by their place.
    let laws = [RoughnessLaw::Linear, RoughnessLaw::Filament, RoughnessLaw::Eevee];
    if let Some(index) = section.choice("law", &[("linear", 0), ("filament", 1), ("eevee", 2)]) {
        config.law = laws[index].clone();
    }
}

impl EnvConfig {
    fn law_length(&self) -> usize {
        if let RoughnessLaw::Custom(list) = &self.law { list.len() } else { 0 }
    }
}

fn read_sources(section: &mut Section) -> Vec<String> {
    let place = section.place("source");
    let Some(sources) = section.texts("source") else {
        section.missing("source", "environments/sky.hdr");
        return vec![String::new()];
    };
    if sources.len() != 1 && sources.len() != FACE_NAMES.len() {
        let message = format!("`source` names {} files", sources.len());
        let help = format!("name one file, or six faces in the order {}", FACE_NAMES.join(" "));
        section.fail(message, place, Some(help));
    }
    sources.iter().map(|source| normalised(source)).collect()
}
