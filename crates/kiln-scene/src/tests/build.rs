//! Small files, made for a test.

use serde_json::{Value, json};

/// A .gltf with one buffer, embedded.
#[derive(Clone, Debug)]
pub(super) struct File {
    pub root: Value,
    bin: Vec<u8>,
}

impl File {
    /// Scene with one node and nothing on it.
    pub fn new() -> Self {
        let root = json!({
            "asset": {"version": "2.0"},
            "scenes": [{"nodes": [0]}], "nodes": [{"name": "thing"}],
            "meshes": [], "accessors": [], "bufferViews": [], "materials": [],
        });
        File { root, bin: Vec::new() }
    }

    /// One triangle in the plane z = 0, counter-clockwise seen from +z, with normals and coordinates.
    pub fn triangle() -> Self {
        let mut file = File::new();
        let position = file.floats(&[[0.0, 0.0, 0.0], [2.0, 0.0, 0.0], [0.0, 1.0, 0.0]]);
        let normal = file.floats(&[[0.0, 0.0, 1.0]; 3]);
        let uv = file.floats(&[[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]);
        file.root["meshes"] = json!([{"primitives": [
            {"attributes": {"POSITION": position, "NORMAL": normal, "TEXCOORD_0": uv}}
        ]}]);
        file.root["nodes"][0]["mesh"] = json!(0);
        file
    }

    /// A triangle with a material of these properties.
    pub fn with_material(material: Value) -> Self {
        let mut file = File::triangle();
        file.root["materials"] = json!([material]);
        file.primitive()["material"] = json!(0);
        file
    }

    pub fn primitive(&mut self) -> &mut Value {
        &mut self.root["meshes"][0]["primitives"][0]
    }

    /// Adds texture 0, 1 … of one texel.
    pub fn texture(mut self, texel: [u8; 4]) -> Self {
        let mut png = std::io::Cursor::new(Vec::new());
        let image = image::RgbaImage::from_pixel(1, 1, image::Rgba(texel));
        image.write_to(&mut png, image::ImageFormat::Png).unwrap();
        let view = self.view(&png.into_inner());
        for (table, entry) in [("images", json!({"bufferView": view})), ("textures", json!({}))] {
            let list = self.root.as_object_mut().unwrap().entry(table).or_insert(json!([]));
            list.as_array_mut().unwrap().push(entry);
        }
        let at = self.root["textures"].as_array().unwrap().len() - 1;
        self.root["textures"][at]["source"] = json!(at);
        self
    }

    pub fn floats<const N: usize>(&mut self, values: &[[f32; N]]) -> usize {
        let bytes: Vec<u8> = values.iter().flatten().flat_map(|value| value.to_le_bytes()).collect();
        let kind = if N == 16 { "MAT4".to_owned() } else { format!("VEC{N}") };
        self.accessor(&bytes, 5126, values.len(), &kind)
    }

    pub fn accessor(&mut self, bytes: &[u8], component_type: u32, count: usize, kind: &str) -> usize {
        let view = self.view(bytes);
        push(
            &mut self.root["accessors"],
            json!({"bufferView": view, "componentType": component_type, "count": count, "type": kind}),
        )
    }

    pub fn view(&mut self, bytes: &[u8]) -> usize {
        self.bin.resize(self.bin.len().next_multiple_of(4), 0);
        let offset = self.bin.len();
        self.bin.extend_from_slice(bytes);
        push(
            &mut self.root["bufferViews"],
            json!({"buffer": 0, "byteOffset": offset, "byteLength": bytes.len()}),
        )
    }

    /// The bytes of the file as it is so far.
    pub fn bytes_of(&self) -> Vec<u8> {
        self.clone().bytes()
    }

    /// The file's bytes, one JSON property a line.
    pub fn bytes(mut self) -> Vec<u8> {
        if !self.bin.is_empty() {
            let uri = format!("data:application/octet-stream;base64,{}", base64(&self.bin));
            self.root["buffers"] = json!([{"byteLength": self.bin.len(), "uri": uri}]);
        }
        serde_json::to_vec_pretty(&self.root).unwrap()
    }
}

fn push(list: &mut Value, entry: Value) -> usize {
    let list = list.as_array_mut().unwrap();
    list.push(entry);
    list.len() - 1
}

fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::new();
    for group in bytes.chunks(3) {
        let bits =
            group.iter().fold(0u32, |bits, &byte| bits << 8 | u32::from(byte)) << (8 * (3 - group.len()));
        for digit in 0..4 {
            let symbol = DIGITS[(bits >> (18 - 6 * digit) & 63) as usize];
            text.push(if digit > group.len() { '=' } else { char::from(symbol) });
        }
    }
    text
}
