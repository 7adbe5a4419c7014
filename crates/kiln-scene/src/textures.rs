//! Textures of a file, decoded on first use.

use std::collections::BTreeMap;

use crate::accessor::{Blob, Data, fetch_uri};
use crate::images::{self, ChannelRange, Picture};
use crate::schema::{self, TextureInfo};
use crate::uri::References;
use crate::{Image8, Sampler, SceneError, Wrap, limits};

/// A texture that could be read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) struct Found {
    /// Index into [`TextureTable::pictures`].
    pub picture: usize,
    pub sampler: schema::Sampler,
}

/// Decodes what is asked for, once.
pub(crate) struct TextureTable<'a, 'b> {
    references: References<'a>,
    data: &'a Data<'b>,
    /// By the file's texture index; generated ones follow after the file's.
    textures: BTreeMap<usize, Option<Found>>,
    /// By the file's image index.
    images: BTreeMap<usize, Option<usize>>,
    /// By the file's URIs: what several images name is decoded and packed once.
    files: BTreeMap<&'a str, usize>,
    pub pictures: Vec<Picture>,
    pub warnings: Vec<SceneError>,
    texels_left: usize,
}

impl<'a, 'b> TextureTable<'a, 'b> {
    pub fn new(references: References<'a>, data: &'a Data<'b>) -> Self {
        TextureTable {
            references,
            data,
            textures: BTreeMap::new(),
            images: BTreeMap::new(),
            files: BTreeMap::new(),
            pictures: Vec::new(),
            warnings: Vec::new(),
            texels_left: limits::TEXEL_COUNT_MAX,
        }
    }

    /// Decodes the texture if it was not yet; `false`, with a warning, if it cannot be drawn.
    pub fn require(&mut self, info: &TextureInfo, user: &str) -> bool {
        if let Some(found) = self.textures.get(&info.index) {
            return found.is_some();
        }
        let found = self.read(info.index, user);
        let result = found.map_err(|error| {
            self.warnings.push(error.with_help("the neutral texture is drawn in its place"));
        });
        self.textures.insert(info.index, result.ok());
        self.get(info).is_some()
    }

    /// A texture that [`require`](Self::require) found, or a generated one.
    pub fn get(&self, info: &TextureInfo) -> Option<Found> {
        self.textures.get(&info.index).copied().flatten()
    }

    /// Range of each channel; neutral where there is no texture.
    pub fn range(&self, info: &TextureInfo) -> ChannelRange {
        let neutral = ChannelRange { min: [u8::MAX; 4], max: [u8::MAX; 4] };
        self.get(info).map_or(neutral, |found| self.pictures[found.picture].range)
    }

    /// Adds a picture that was computed, sampled like `like`, and returns its texture index.
    ///
    /// # Errors
    /// A sentence, if it cannot be encoded.
    pub fn generate(&mut self, like: Found, picture: Image8) -> Result<usize, String> {
        let texels = picture.rgba.len() / 4;
        self.texels_left = self.texels_left.checked_sub(texels).ok_or("too many texels")?;
        self.pictures.push(images::from_texels(picture)?);
        let after_file = self.data.root.textures.len();
        let index = self.textures.last_key_value().map_or(after_file, |(last, _)| after_file.max(last + 1));
        self.textures.insert(index, Some(Found { picture: self.pictures.len() - 1, sampler: like.sampler }));
        Ok(index)
    }

    fn read(&mut self, index: usize, user: &str) -> Result<Found, SceneError> {
        let count = self.data.root.textures.len();
        let texture = self.data.root.textures.get(index).ok_or_else(|| {
            SceneError::new(user, format!("texture {index} does not exist, the file has {count}"))
        })?;
        let place = format!("/textures/{index}");
        let sampler = match texture.sampler {
            None => schema::Sampler::default(),
            Some(at) => *self.data.root.samplers.get(at).ok_or_else(|| {
                SceneError::new(format!("{place}/sampler"), format!("sampler {at} does not exist"))
            })?,
        };
        let picture = self.best_picture(texture, &place)?;
        Ok(Found { picture, sampler })
    }

    /// The WebP image where there is one, else or if it is damaged the one that every reader knows.
    fn best_picture(&mut self, texture: &schema::Texture, place: &str) -> Result<usize, SceneError> {
        match (texture.extensions.webp, texture.source) {
            (Some(webp), None) => self.picture(webp.source, place),
            (Some(webp), Some(source)) => self.picture(webp.source, place).or_else(|error| {
                let picture = self.picture(source, place)?;
                self.warnings.push(error.with_help("the texture's other image is drawn in its place"));
                Ok(picture)
            }),
            (None, Some(source)) => self.picture(source, place),
            (None, None) => {
                let formats: Vec<&str> = texture.extensions.others.keys().map(String::as_str).collect();
                let reason = match formats.as_slice() {
                    [] => "it has no image".to_owned(),
                    formats => format!("only {} has its image, which is not supported", formats.join(", ")),
                };
                Err(SceneError::new(place, reason))
            }
        }
    }

    fn picture(&mut self, image: usize, user: &str) -> Result<usize, SceneError> {
        if let Some(known) = self.images.get(&image) {
            return known.ok_or_else(|| SceneError::new(user, format!("image {image} could not be read")));
        }
        let data: &'a Data<'b> = self.data;
        let uri = data.root.images.get(image).and_then(|image| image.uri.as_deref());
        if let Some(&known) = uri.and_then(|uri| self.files.get(uri)) {
            self.images.insert(image, Some(known));
            return Ok(known);
        }
        self.images.insert(image, None);
        let picture = self.decode(image, user)?;
        self.texels_left -= picture.decoded.rgba.len() / 4;
        self.pictures.push(picture);
        self.images.insert(image, Some(self.pictures.len() - 1));
        self.files.extend(uri.map(|uri| (uri, self.pictures.len() - 1)));
        Ok(self.pictures.len() - 1)
    }

    fn decode(&mut self, index: usize, user: &str) -> Result<Picture, SceneError> {
        let count = self.data.root.images.len();
        let image = self.data.root.images.get(index).ok_or_else(|| {
            SceneError::new(user, format!("image {index} does not exist, the file has {count}"))
        })?;
        let place = format!("/images/{index}");
        let blob;
        let bytes: &[u8] = match (&image.uri, image.buffer_view) {
            (Some(uri), _) => {
                blob = fetch_uri(&mut self.references, &format!("{place}/uri"), uri)?;
                match &blob {
                    Blob::Owned(bytes) => bytes,
                    Blob::Shared(bytes) => bytes,
                    Blob::Chunk(bytes) => bytes,
                    Blob::Absent => &[],
                }
            }
            (None, Some(view)) => self.data.span(&place, view, 0)?.0,
            (None, None) => return Err(SceneError::new(place, "it has neither a URI nor a buffer view")),
        };
        images::decode(bytes, self.texels_left)
            .map_err(|reason| SceneError::new(place, format!("the image cannot be read: {reason}")))
    }
}

/// Sampler codes of OpenGL; absent ones mean trilinear and repeated.
pub(crate) fn sampler(source: schema::Sampler) -> Sampler {
    let wrap = |code: Option<u32>| match code {
        Some(33071) => Wrap::ClampToEdge,
        Some(33648) => Wrap::MirroredRepeat,
        _ => Wrap::Repeat,
    };
    let (min_linear, mip_linear) = match source.min_filter {
        Some(9728) => (false, None),
        Some(9729) => (true, None),
        Some(9984) => (false, Some(false)),
        Some(9985) => (true, Some(false)),
        Some(9986) => (false, Some(true)),
        _ => (true, Some(true)),
    };
    Sampler {
        wrap_u: wrap(source.wrap_s),
        wrap_v: wrap(source.wrap_t),
        mag_linear: source.mag_filter != Some(9728),
        min_linear,
        mip_linear,
    }
}
