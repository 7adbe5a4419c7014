//! Revisions made by hand, with the real shaders.

use std::collections::{BTreeSet, HashMap};
use std::path::PathBuf;
use std::sync::{Arc, OnceLock};

use half::f16;
use kiln_build::Digest;
use kiln_gpu::{Gpu, GpuError};
use kiln_link::{Part, Revision, RevisionTable, Target, TargetState};
use kiln_scene::{EffectOverrides, EffectSet};
use serde_json::{Value, json};

/// Six radiances in KTX2 face order: +X red, −X cyan, +Y green, −Y magenta, +Z blue, −Z yellow.
pub const SIX_COLORS: [[f32; 3]; 6] =
    [[0.5, 0.0, 0.0], [0.0, 0.5, 0.5], [0.0, 0.5, 0.0], [0.5, 0.0, 0.5], [0.0, 0.0, 0.5], [0.5, 0.5, 0.0]];

/// A device, or `None` with a loud line; with `KILN_REQUIRE_GPU=1` a missing device fails.
#[expect(clippy::print_stderr, reason = "a skipped test says so")]
pub fn gpu() -> Option<Gpu> {
    // One device for all tests: opening one costs more than most of them.
    static GPU: OnceLock<Result<Gpu, GpuError>> = OnceLock::new();
    match GPU.get_or_init(Gpu::headless) {
        Ok(gpu) => Some(gpu.clone()),
        Err(error) if std::env::var_os("KILN_REQUIRE_GPU").is_some() => panic!("{error}"),
        Err(error) => {
            eprintln!("SKIPPED: {error}");
            None
        }
    }
}

/// Edge of [`Build::lut`]'s table.
pub const LUT_SIZE: usize = 32;

/// Scale and bias at a texel: column n·v, row perceptual roughness.
pub fn lut_texel(column: usize, row: usize) -> [f32; 2] {
    let [n_dot_v, roughness] = [column, row].map(|step| (step as f32 + 0.5) / LUT_SIZE as f32);
    let (x, y) = (1.0 - roughness, 0.0425 - 0.0275 * roughness);
    let a = (x * x).min((-9.28 * n_dot_v).exp2()) * x + y;
    let (scale, bias) = (1.04 - 0.572 * roughness - 1.04 * a, 0.022 * roughness - 0.04 + 1.04 * a);
    [scale.clamp(0.0, 1.0), bias.clamp(0.0, 1.0)]
}

/// A revision that grows target by target.
#[derive(Clone, Default)]
pub struct Build {
    pub table: RevisionTable,
    blobs: HashMap<Digest, Arc<[u8]>>,
}

impl Build {
    /// An empty revision 1.
    pub fn new() -> Self {
        Build { table: RevisionTable { number: 1, ..Default::default() }, ..Default::default() }
    }

    /// Shaders, table, one environment `sky` of six colours, one scene `ball`.
    pub fn ball(material: Value) -> Self {
        let mut build = Build::new();
        build.shaders(&[&[]]).lut().env("sky", SIX_COLORS).scene("ball", "sky", sphere_glb(material));
        build
    }

    pub fn target(&mut self, name: &str, kind: &str, meta: Value, parts: &[(&str, Vec<u8>)]) -> &mut Self {
        let parts = parts.iter().map(|(part, bytes)| {
            let digest = Digest::of(bytes);
            self.blobs.insert(digest, bytes.as_slice().into());
            Part { name: (*part).to_owned(), digest, bytes: bytes.len() as u64 }
        });
        let target =
            Target { kind: kind.to_owned(), state: TargetState::Fresh, meta, parts: parts.collect() };
        self.table.targets.insert(name.to_owned(), target);
        self
    }

    /// The project's own shaders, `pbr` with each of the feature sets.
    pub fn shaders(&mut self, feature_sets: &[&[&str]]) -> &mut Self {
        for features in feature_sets {
            self.shader("pbr", "material", "pbr/pbr.wgsl", features);
        }
        self.shader("background", "background", "pbr/background.wgsl", &[]);
        self.shader("tonemap", "tonemap", "pbr/tonemap.wgsl", &[])
    }

    pub fn shader(&mut self, name: &str, role: &str, root: &str, features: &[&str]) -> &mut Self {
        let folder = PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../../shaders");
        self.shader_from(name, role, root, features, &mut |path| {
            std::fs::read_to_string(folder.join(path)).ok().map(Arc::from)
        })
    }

    /// `pbr` with each of the feature sets as the variants that show channels.
    pub fn inspect_shaders(&mut self, feature_sets: &[&[&str]]) -> &mut Self {
        for features in feature_sets {
            let variant = if features.is_empty() { "base".to_owned() } else { features.join("+") };
            let mut compiled = Build::new();
            compiled.shader("pbr", "material", "pbr/pbr.wgsl", &[features, &["inspect"][..]].concat());
            let (_, mut target) = compiled.table.targets.pop_first().expect("it was compiled");
            target.meta["features"] = json!(features);
            self.blobs.extend(compiled.blobs);
            self.table.targets.insert(format!("inspect/pbr/{variant}"), target);
        }
        self.target("inspect/shaders", "inspect", json!({ "shaders": ["pbr"] }), &[])
    }

    /// Compiles one module that imports nothing.
    pub fn shader_text(&mut self, name: &str, role: &str, text: &str) -> &mut Self {
        self.shader_from(name, role, "test.wgsl", &[], &mut |path| {
            (path == "test.wgsl").then(|| Arc::from(text))
        })
    }

    fn shader_from(
        &mut self,
        name: &str,
        role: &str,
        root: &str,
        features: &[&str],
        read: &mut dyn FnMut(&str) -> Option<Arc<str>>,
    ) -> &mut Self {
        let set: BTreeSet<String> = features.iter().map(|feature| (*feature).to_owned()).collect();
        let outcome = kiln_shader::compile(&kiln_shader::Program::of(root), &set, read);
        let compiled = outcome.compiled.unwrap_or_else(|| panic!("{root}: {:?}", outcome.diagnostics));
        let variant = if features.is_empty() { "base".to_owned() } else { features.join("+") };
        let reflection = serde_json::to_vec(&compiled.reflection).expect("a reflection is plain data");
        let parts = [("wgsl", compiled.wgsl.into_bytes()), ("reflection", reflection)];
        let meta = json!({ "shader": name, "role": role, "features": features });
        self.target(&format!("shader/{name}/{variant}"), "shader", meta, &parts)
    }

    /// An environment whose faces have one radiance each: all three maps are that cube.
    pub fn env(&mut self, name: &str, faces: [[f32; 3]; 6]) -> &mut Self {
        for map in ["skybox", "irradiance", "specular"] {
            self.cube(&format!("env/{name}/{map}"), 4, 3, 0, faces);
        }
        self
    }

    pub fn cube(
        &mut self,
        name: &str,
        size: u32,
        levels: u32,
        scale_log2: i32,
        faces: [[f32; 3]; 6],
    ) -> &mut Self {
        let level = |level: u32| {
            let texels = (size >> level).pow(2) as usize;
            let texel =
                |[r, g, b]: [f32; 3]| [r, g, b, 1.0].map(f16::from_f32).map(f16::to_le_bytes).concat();
            (format!("mip{level}"), faces.iter().flat_map(|face| texel(*face).repeat(texels)).collect())
        };
        let parts: Vec<(String, Vec<u8>)> = (0..levels).map(level).collect();
        let parts: Vec<(&str, Vec<u8>)> =
            parts.iter().map(|(name, bytes)| (name.as_str(), bytes.clone())).collect();
        let meta = json!({ "size": size, "levels": levels, "format": "rgba16f", "scale_log2": scale_log2 });
        self.target(name, "cube", meta, &parts)
    }

    /// A cube of one level with a radiance for each texel, faces in KTX2 order and rows from the top.
    pub fn cube_of(&mut self, name: &str, size: u32, texels: &[[f32; 3]]) -> &mut Self {
        let texel =
            |[r, g, b]: &[f32; 3]| [*r, *g, *b, 1.0].map(f16::from_f32).map(f16::to_le_bytes).concat();
        let bytes = texels.iter().flat_map(texel).collect();
        let meta = json!({ "size": size, "levels": 1, "format": "rgba16f", "scale_log2": 0 });
        self.target(name, "cube", meta, &[("mip0", bytes)])
    }

    /// Lazarov's fit of the split-sum table: smooth, plausible, and not constant.
    pub fn lut(&mut self) -> &mut Self {
        let texel =
            |index: usize| lut_texel(index % LUT_SIZE, index / LUT_SIZE).map(f32::to_le_bytes).concat();
        let texels: Vec<u8> = (0..LUT_SIZE * LUT_SIZE).flat_map(texel).collect();
        self.target("lut/ggx", "lut", json!({ "size": LUT_SIZE, "format": "rg32f" }), &[("texels", texels)])
    }

    /// The table that `kiln bake` makes.
    pub fn exact_lut(&mut self) -> &mut Self {
        const SIZE: usize = 64;
        let table = kiln_bake::dfg_table(SIZE, kiln_bake::Cancel::NEVER).expect("nobody cancels");
        let texels = table.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        self.target("lut/ggx", "lut", json!({ "size": SIZE, "format": "rg32f" }), &[("texels", texels)])
    }

    pub fn scene(&mut self, name: &str, env: &str, glb: Vec<u8>) -> &mut Self {
        let meta = json!({ "env": env, "shader": "pbr", "notes": [] });
        self.target(&format!("scene/{name}"), "scene", meta, &[("glb", glb)])
    }

    /// The shader variants that a scene's draws call for, in all its material variants.
    pub fn shaders_of(&mut self, glb: &[u8]) -> &mut Self {
        self.variants_of(glb, |effects| effects)
    }

    /// The same in the light of a sun.
    pub fn sunlit_shaders_of(&mut self, glb: &[u8]) -> &mut Self {
        self.variants_of(glb, |effects| EffectOverrides::default().under_sun(&effects))
    }

    /// The sun of an environment, with what was extracted of it.
    pub fn sun(&mut self, env: &str, direction: [f64; 3], irradiance: [f64; 3], diameter: f64) -> &mut Self {
        let light = json!({ "direction": direction, "irradiance": irradiance, "angular_diameter": diameter });
        let json = json!({ "light": light }).to_string().into_bytes();
        self.target(&format!("env/{env}/sun"), "light", json!({}), &[("json", json)])
    }

    fn variants_of(&mut self, glb: &[u8], lit: fn(EffectSet) -> EffectSet) -> &mut Self {
        let scene = kiln_scene::load(glb).expect("what was packed loads");
        let variants = std::iter::once(None).chain((0..scene.variants.len()).map(Some));
        for variant in variants {
            for draw in scene.draws.iter().chain(&scene.hidden) {
                let effects = lit(scene.effects(draw, scene.material_of(draw, variant)));
                let mut features: Vec<&str> = effects.iter().map(|effect| effect.name()).collect();
                features.sort_unstable();
                self.shaders(&[&features]);
            }
        }
        self
    }

    /// Forgets contents that the table no longer names.
    pub fn forget_unused(&mut self) {
        let parts = self.table.targets.values().flat_map(|target| &target.parts);
        let used: BTreeSet<Digest> = parts.map(|part| part.digest).collect();
        self.blobs.retain(|digest, _| used.contains(digest));
    }

    pub fn revision(&self) -> Revision {
        Revision::new(self.table.clone(), self.blobs.clone()).expect("every part has its blob")
    }
}

/// A unit sphere at the origin with one material, as a GLB that went through `kiln_scene::pack`.
pub fn sphere_glb(material: Value) -> Vec<u8> {
    Sphere { material, ..Sphere::default() }.glb()
}

/// A unit sphere at the origin, its tangents eastwards, without texture coordinates.
#[derive(Default)]
pub struct Sphere {
    pub material: Value,
    /// Texture 0, 1 … of one texel each.
    pub texels: Vec<[u8; 4]>,
    /// Of its node; none is 1.
    pub scale: Option<[f32; 3]>,
    /// More spheres: material, middle, radius.
    pub others: Vec<(Value, [f32; 3], f32)>,
    /// Lights of `KHR_lights_punctual`, each with where its node stands.
    pub lights: Vec<(Value, Value)>,
}

impl Sphere {
    /// As a GLB that went through `kiln_scene::pack`.
    pub fn glb(&self) -> Vec<u8> {
        const RINGS: u32 = 96;
        const SEGMENTS: u32 = 192;
        let (mut positions, mut tangents): (Vec<f32>, Vec<f32>) = (Vec::new(), Vec::new());
        for ring in 0..=RINGS {
            let theta = std::f32::consts::PI * ring as f32 / RINGS as f32;
            for segment in 0..=SEGMENTS {
                let phi = std::f32::consts::TAU * segment as f32 / SEGMENTS as f32;
                positions.extend([theta.sin() * phi.sin(), theta.cos(), theta.sin() * phi.cos()]);
                tangents.extend([phi.cos(), 0.0, -phi.sin(), 1.0]);
            }
        }
        let mut indices: Vec<u32> = Vec::new();
        for ring in 0..RINGS {
            for segment in 0..SEGMENTS {
                let a = ring * (SEGMENTS + 1) + segment;
                let b = a + SEGMENTS + 1;
                indices.extend([a, b, a + 1, a + 1, b, b + 1]);
            }
        }
        let images: Vec<Vec<u8>> = self.texels.iter().map(|texel| png(*texel)).collect();
        let columns = [
            bytemuck::cast_slice(&positions).to_vec(),
            bytemuck::cast_slice(&indices).to_vec(),
            bytemuck::cast_slice(&tangents).to_vec(),
        ];
        let (mut binary, mut views) = (Vec::new(), Vec::new());
        for bytes in columns.iter().chain(&images) {
            views.push(json!({ "buffer": 0, "byteOffset": binary.len(), "byteLength": bytes.len() }));
            binary.extend_from_slice(bytes);
            binary.resize(binary.len().next_multiple_of(4), 0);
        }
        let count = positions.len() / 3;
        let texture = |at| json!({ "source": at });
        let image = |at| json!({ "bufferView": columns.len() + at, "mimeType": "image/png" });
        let mesh = |material: usize| {
            let attributes = json!({ "POSITION": 0, "NORMAL": 0, "TANGENT": 2 });
            json!({ "primitives": [{ "attributes": attributes, "indices": 1, "material": material }] })
        };
        let mut nodes = vec![json!({ "mesh": 0, "scale": self.scale.unwrap_or([1.0; 3]) })];
        for (at, (_, middle, radius)) in self.others.iter().enumerate() {
            nodes.push(json!({ "mesh": at + 1, "translation": middle, "scale": [radius, radius, radius] }));
        }
        let materials: Vec<&Value> =
            [&self.material].into_iter().chain(self.others.iter().map(|(material, ..)| material)).collect();
        for (at, (_, node)) in self.lights.iter().enumerate() {
            let mut node = node.clone();
            node["extensions"] = json!({ "KHR_lights_punctual": { "light": at } });
            nodes.push(node);
        }
        let mut document = json!({
            "asset": { "version": "2.0" }, "scene": 0,
            "scenes": [{ "nodes": (0..nodes.len()).collect::<Vec<_>>() }],
            "nodes": nodes,
            "meshes": (0..materials.len()).map(mesh).collect::<Vec<_>>(),
            "materials": materials,
            "textures": (0..images.len()).map(texture).collect::<Vec<_>>(),
            "images": (0..images.len()).map(image).collect::<Vec<_>>(),
            "buffers": [{ "byteLength": binary.len() }],
            "bufferViews": views,
            "accessors": [
                { "bufferView": 0, "componentType": 5126, "count": count, "type": "VEC3",
                  "min": [-1.0, -1.0, -1.0], "max": [1.0, 1.0, 1.0] },
                { "bufferView": 1, "componentType": 5125, "count": indices.len(), "type": "SCALAR" },
                { "bufferView": 2, "componentType": 5126, "count": count, "type": "VEC4" },
            ],
        });
        if !self.lights.is_empty() {
            let lights: Vec<&Value> = self.lights.iter().map(|(light, _)| light).collect();
            document["extensions"] = json!({ "KHR_lights_punctual": { "lights": lights } });
        }
        let packed = kiln_scene::pack("sphere.glb", &glb(&document, &binary), &mut |_| None);
        packed.glb.unwrap_or_else(|| panic!("{:?}", packed.diagnostics)).to_vec()
    }
}

fn png(texel: [u8; 4]) -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let image = image::RgbaImage::from_pixel(1, 1, image::Rgba(texel));
    image.write_to(&mut bytes, image::ImageFormat::Png).expect("one texel can be encoded");
    bytes.into_inner()
}

/// glTF 2.0, section 4: header, JSON chunk, binary chunk.
pub fn glb(document: &Value, binary: &[u8]) -> Vec<u8> {
    let mut json = document.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |value: usize| (value as u32).to_le_bytes();
    let total = 12 + 8 + json.len() + 8 + binary.len();
    let header = [*b"glTF", word(2), word(total), word(json.len()), *b"JSON"].concat();
    [header, json, [word(binary.len()), *b"BIN\0"].concat(), binary.to_vec()].concat()
}
