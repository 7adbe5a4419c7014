//! Buffers, buffer views, accessors and images: what they say about bytes.

use super::{Findings, Used};
use crate::accessor::{Data, element_bytes};
use crate::json::Json;
use crate::uri;

/// An accessor's claims, as far as they are well-formed.
#[derive(Clone, Copy, Debug)]
pub(super) struct Claims<'a> {
    pub json: &'a Json<'a>,
    pub kind: &'a str,
    pub component_type: u32,
    pub count: usize,
    pub view: Option<usize>,
    pub offset: usize,
    pub normalized: bool,
}

impl<'a> Claims<'a> {
    pub fn of(root: &'a Json<'a>, index: usize) -> Option<Self> {
        let json = root.table("accessors").get(index)?;
        Some(Claims {
            json,
            kind: json.get("type")?.text()?,
            component_type: json.index_at("componentType")? as u32,
            count: json.index_at("count")?,
            view: json.index_at("bufferView"),
            offset: json.index_at("byteOffset").unwrap_or(0),
            normalized: json.get("normalized") == Some(&Json::Bool(true)),
        })
    }

    pub fn component_bytes(&self) -> usize {
        match self.component_type {
            5120 | 5121 => 1,
            5122 | 5123 => 2,
            _ => 4,
        }
    }

    /// Why the elements do not fit the buffer view, if so; looks at numbers alone, as the bytes may be missing.
    fn misfit(&self, root: &Json<'_>) -> Option<String> {
        let length = root.table("bufferViews").get(self.view?)?.index_at("byteLength")?;
        let size = element_bytes(self.kind, self.component_bytes());
        let stride = self.stride(root).unwrap_or(size);
        if stride < size {
            return Some(format!("byteStride {stride} is less than the {size} bytes of an element"));
        }
        let needed = self.count.saturating_sub(1).saturating_mul(stride).saturating_add(size + self.offset);
        (needed > length).then(|| format!("its elements end at {needed}, the buffer view at {length}"))
    }

    /// Bytes from the start of the buffer.
    pub fn total_offset(&self, root: &Json<'_>) -> usize {
        let view = self.view.and_then(|view| root.table("bufferViews").get(view));
        self.offset + view.and_then(|view| view.index_at("byteOffset")).unwrap_or(0)
    }

    pub fn stride(&self, root: &Json<'_>) -> Option<usize> {
        root.table("bufferViews").get(self.view?)?.index_at("byteStride")
    }

    /// Such as `VEC3 5126 normalized`.
    pub fn format(&self) -> String {
        format!("{} {}{}", self.kind, self.component_type, if self.normalized { " normalized" } else { "" })
    }
}

pub(super) fn check(root: &Json<'_>, data: &Data<'_>, used: &Used<'_>, findings: &mut Findings) {
    for (at, buffer) in root.table("buffers").iter().enumerate() {
        check_buffer(at, buffer, data, findings);
    }
    for (at, view) in root.table("bufferViews").iter().enumerate() {
        check_view(at, view, data, findings);
    }
    for (at, _) in root.table("accessors").iter().enumerate() {
        check_accessor(root, at, data, findings);
    }
    check_images(root, used, findings);
}

fn check_buffer(at: usize, buffer: &Json<'_>, data: &Data<'_>, findings: &mut Findings) {
    let uri = buffer.get("uri").and_then(Json::text);
    // Compression extensions have buffers that exist in name only.
    if uri.is_none() && buffer.get("extensions").is_none() && !data.has_bytes(at) {
        findings.push(format!("/buffers/{at}"), "it has no URI and the file no binary chunk for it");
    }
    let place = format!("/buffers/{at}/uri");
    if uri.is_some_and(|uri| !uri::is_well_formed(uri)) {
        findings.push(place.clone(), "it is no well-formed URI");
    }
    let media = uri.and_then(|uri| uri.strip_prefix("data:")).and_then(|uri| uri.split([';', ',']).next());
    if let Some(media) = media
        && !["application/octet-stream", "application/gltf-buffer"].contains(&media)
    {
        let reason = format!("`{media}` is no media type of a buffer; its bytes were taken as they are");
        findings.push(place, reason);
    }
}

fn check_view(at: usize, view: &Json<'_>, data: &Data<'_>, findings: &mut Findings) {
    let place = format!("/bufferViews/{at}");
    let extent = data.check_view(at);
    extent.into_iter().for_each(|error| findings.add(error));
    let Some(stride) = view.index_at("byteStride") else { return };
    if view.index_at("byteLength").is_some_and(|length| stride > length) {
        findings.push(format!("{place}/byteStride"), "it is larger than the buffer view");
    }
    if view.index_at("target").is_some_and(|target| target == 34963) {
        findings.push(format!("{place}/byteStride"), "only vertices have a stride; `target` says indices");
    }
}

fn check_accessor(root: &Json<'_>, at: usize, data: &Data<'_>, findings: &mut Findings) {
    let place = format!("/accessors/{at}");
    let Some(claims) = Claims::of(root, at) else { return };
    match claims.misfit(root) {
        Some(reason) => findings.push(place.clone(), reason),
        None => data.check_accessor(at).into_iter().for_each(|error| findings.add(error)),
    }
    let size = claims.component_bytes();
    if claims.view.is_some() {
        let unaligned = [("/byteOffset", claims.offset), ("", claims.total_offset(root))];
        for (field, offset) in unaligned.into_iter().filter(|(_, offset)| !offset.is_multiple_of(size)) {
            let reason =
                format!("offset {offset} is no multiple of a component's {size} bytes; read as it is");
            findings.push(place.clone() + field, reason);
        }
        if claims.kind.starts_with("MAT") && !claims.offset.is_multiple_of(4) {
            findings.push(format!("{place}/byteOffset"), "a matrix must start at a multiple of 4 bytes");
        }
    }
    if claims.normalized && matches!(claims.component_type, 5125 | 5126) {
        findings.push(format!("{place}/normalized"), "only 8 and 16 bits can be normalized; it was ignored");
    }
    let Some(sparse) = claims.json.get("sparse") else { return };
    for part in ["indices", "values"] {
        let view = sparse.get(part).and_then(|part| part.index_at("bufferView"));
        let view = view.and_then(|view| root.table("bufferViews").get(view));
        if view.is_some_and(|view| view.get("byteStride").is_some()) {
            let place = format!("{place}/sparse/{part}/bufferView");
            findings.push(place, "sparse data has no stride; it was read without gaps");
        }
    }
}

/// The MIME types that images say they have, and whether a texture can show them.
fn check_images(root: &Json<'_>, used: &Used<'_>, findings: &mut Findings) {
    let enabled = |mime: &str| mime != "image/webp" || used.contains("EXT_texture_webp");
    let images = root.table("images");
    for (at, image) in images.iter().enumerate() {
        if image.get("uri").and_then(Json::text).is_some_and(|uri| !uri::is_well_formed(uri)) {
            findings.push(format!("/images/{at}/uri"), "it is no well-formed URI");
        }
        let declared = image.get("mimeType").and_then(Json::text);
        let media = image.get("uri").and_then(Json::text).and_then(media_type);
        if let Some(mime) = declared.or(media).filter(|mime| !enabled(mime)) {
            findings.push(format!("/images/{at}"), format!("`{mime}` needs an extension that is not used"));
        }
        if let (Some(declared), Some(media)) = (declared, media)
            && declared != media
        {
            let reason = format!("it is `{media}`, but `mimeType` says `{declared}`; the bytes decide");
            findings.push(format!("/images/{at}/uri"), reason);
        }
    }
    let mime_of = |index: usize| {
        let image = images.get(index)?;
        image
            .get("uri")
            .and_then(Json::text)
            .and_then(media_type)
            .or(image.get("mimeType").and_then(Json::text))
    };
    for (at, texture) in root.table("textures").iter().enumerate() {
        let webp = texture.get("extensions").and_then(|it| it.get("EXT_texture_webp"));
        for (slot, texture, allowed) in [
            ("", Some(texture), &["image/png", "image/jpeg"][..]),
            ("/extensions/EXT_texture_webp", webp, &["image/webp"][..]),
        ] {
            let mime = texture.and_then(|texture| texture.index_at("source")).and_then(mime_of);
            if let Some(mime) = mime.filter(|mime| !allowed.contains(mime)) {
                let reason = format!("its image is `{mime}`, but must be {}", allowed.join(" or "));
                findings.push(format!("/textures/{at}{slot}/source"), reason);
            }
        }
    }
}

/// What a data URI or a file's name says about an image.
fn media_type(uri: &str) -> Option<&str> {
    if let Some(rest) = uri.strip_prefix("data:") {
        return rest.split([';', ',']).next().filter(|media| !media.is_empty());
    }
    match uri.rsplit_once('.')?.1 {
        "png" => Some("image/png"),
        "jpg" | "jpeg" => Some("image/jpeg"),
        "webp" => Some("image/webp"),
        _ => None,
    }
}
