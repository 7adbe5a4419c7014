//! Typed, bounds-checked reading of accessors (glTF 2.0, section 3.6).

use std::collections::BTreeMap;
use std::sync::Arc;

use crate::schema::{Accessor, Root, Sparse};
use crate::uri::References;
use crate::{SceneError, limits, uri};

/// Bytes of a buffer, from wherever they came.
#[derive(Clone, Debug)]
pub(crate) enum Blob<'a> {
    Chunk(&'a [u8]),
    Owned(Vec<u8>),
    Shared(Arc<[u8]>),
    /// No URI and no binary chunk: an error only if something reads it.
    Absent,
}

impl Blob<'_> {
    fn bytes(&self) -> Option<&[u8]> {
        match self {
            Blob::Chunk(bytes) => Some(bytes),
            Blob::Owned(bytes) => Some(bytes),
            Blob::Shared(bytes) => Some(bytes),
            Blob::Absent => None,
        }
    }
}

/// Fetches every buffer, and a file that several name once; all that fail are reported, not the first alone.
pub(crate) fn fetch_buffers<'a>(
    references: &mut References<'_>,
    root: &Root,
    bin: Option<&'a [u8]>,
) -> Result<Vec<Blob<'a>>, Vec<SceneError>> {
    let (mut blobs, mut errors) = (Vec::new(), Vec::new());
    let mut files: BTreeMap<&str, Arc<[u8]>> = BTreeMap::new();
    for (index, buffer) in root.buffers.iter().enumerate() {
        let pointer = format!("/buffers/{index}");
        let blob = match (&buffer.uri, bin) {
            (Some(uri), _) => match files.get(uri.as_str()) {
                Some(known) => Ok(Blob::Shared(known.clone())),
                None => fetch_uri(references, &format!("{pointer}/uri"), uri),
            },
            (None, Some(bin)) if index == 0 => Ok(Blob::Chunk(bin)),
            (None, _) => Ok(Blob::Absent),
        };
        if let (Some(uri), Ok(Blob::Shared(bytes))) = (&buffer.uri, &blob) {
            files.insert(uri, bytes.clone());
        }
        match blob.and_then(|blob| check_length(blob, buffer.byte_length, &pointer)) {
            Ok(blob) => blobs.push(blob),
            Err(error) => errors.push(error),
        }
    }
    if errors.is_empty() { Ok(blobs) } else { Err(errors) }
}

fn check_length<'a>(blob: Blob<'a>, wanted: u64, pointer: &str) -> Result<Blob<'a>, SceneError> {
    match blob.bytes() {
        Some(bytes) if (bytes.len() as u64) < wanted => {
            let actual = bytes.len();
            Err(SceneError::new(pointer, format!("byteLength is {wanted}, the data has {actual} bytes")))
        }
        _ => Ok(blob),
    }
}

/// Bytes behind a `data:` or file URI.
pub(crate) fn fetch_uri<'a>(
    references: &mut References<'_>,
    pointer: &str,
    uri: &str,
) -> Result<Blob<'a>, SceneError> {
    if uri.starts_with("data:") {
        let bytes = uri::data_payload(uri);
        return bytes.map(Blob::Owned).ok_or_else(|| SceneError::new(pointer, "the data URI is malformed"));
    }
    let (path, _) = uri::resolve(references.file, references.allowed_folders, pointer, uri)?;
    (references.read)(&path).map(Blob::Shared).ok_or_else(|| {
        SceneError::new(pointer, format!("`{}` was not found", uri::shorten(uri)))
            .with_help(format!("put the file at {path} or correct the URI"))
    })
}

/// The file's tables and the bytes behind them.
#[derive(Debug)]
pub(crate) struct Data<'a> {
    pub root: &'a Root,
    pub buffers: Vec<Blob<'a>>,
}

/// How one element lies in memory.
struct Layout<'a> {
    /// `None`: all zeros.
    bytes: Option<&'a [u8]>,
    stride: usize,
    count: usize,
    components: usize,
    component: Component,
}

#[derive(Clone, Copy, Debug, PartialEq)]
enum Component {
    I8,
    U8,
    I16,
    U16,
    U32,
    F32,
}

impl Component {
    fn from_gl(code: u32) -> Option<Self> {
        Some(match code {
            5120 => Component::I8,
            5121 => Component::U8,
            5122 => Component::I16,
            5123 => Component::U16,
            5125 => Component::U32,
            5126 => Component::F32,
            _ => return None,
        })
    }

    fn bytes(self) -> usize {
        match self {
            Component::I8 | Component::U8 => 1,
            Component::I16 | Component::U16 => 2,
            Component::U32 | Component::F32 => 4,
        }
    }

    /// Normalised integers as glTF 2.0 section 3.11 dequantises them.
    fn float(self, at: &[u8], normalized: bool) -> f32 {
        let (value, scale) = match self {
            Component::F32 => return f32::from_le_bytes(first(at)),
            Component::U32 => return u32::from_le_bytes(first(at)) as f32,
            Component::I8 => (f32::from(i8::from_le_bytes(first(at))), 127.0),
            Component::U8 => (f32::from(at[0]), 255.0),
            Component::I16 => (f32::from(i16::from_le_bytes(first(at))), 32767.0),
            Component::U16 => (f32::from(u16::from_le_bytes(first(at))), 65535.0),
        };
        if normalized { (value / scale).max(-1.0) } else { value }
    }

    fn unsigned(self, at: &[u8]) -> Option<u32> {
        match self {
            Component::U8 => Some(u32::from(at[0])),
            Component::U16 => Some(u32::from(u16::from_le_bytes(first(at)))),
            Component::U32 => Some(u32::from_le_bytes(first(at))),
            _ => None,
        }
    }
}

/// The first `N` bytes; callers slice whole elements, so they exist.
fn first<const N: usize>(at: &[u8]) -> [u8; N] {
    let mut bytes = [0; N];
    bytes.copy_from_slice(&at[..N]);
    bytes
}

impl<'a> Data<'a> {
    /// Number of elements of an accessor.
    pub fn count(&self, index: usize, user: &str) -> Result<u64, SceneError> {
        Ok(self.accessor(index, user)?.count)
    }

    /// Whether an accessor that exists holds floats.
    pub fn is_float(&self, index: usize) -> bool {
        self.component(index) == Some(Component::F32)
    }

    /// Whether an accessor that exists holds bytes as they are.
    pub fn is_byte(&self, index: usize) -> bool {
        self.component(index) == Some(Component::U8) && !self.root.accessors[index].normalized
    }

    /// Whether an accessor that exists holds integers that stand for [0, 1] or [−1, 1].
    pub fn is_normalized(&self, index: usize) -> bool {
        use Component::{I8, I16, U8, U16};
        let component = self.component(index);
        self.root.accessors[index].normalized && matches!(component, Some(I8 | U8 | I16 | U16))
    }

    fn component(&self, index: usize) -> Option<Component> {
        Component::from_gl(self.root.accessors[index].component_type)
    }

    /// Number of vertices of an attribute.
    pub fn bounded_count(&self, index: usize, user: &str) -> Result<usize, SceneError> {
        self.count_within(index, user, limits::VERTEX_COUNT_MAX)
    }

    /// Whether there is anything behind the buffer.
    pub fn has_bytes(&self, buffer: usize) -> bool {
        self.buffers.get(buffer).is_some_and(|blob| blob.bytes().is_some())
    }

    /// What keeps an accessor from being read, whether or not something reads it.
    pub fn check_accessor(&self, index: usize) -> Option<SceneError> {
        const KINDS: [&str; 7] = ["SCALAR", "VEC2", "VEC3", "VEC4", "MAT2", "MAT3", "MAT4"];
        let accessor = self.root.accessors.get(index)?;
        let layout = match self.layout(index, accessor, &KINDS, u32::MAX as usize) {
            Ok(layout) => layout,
            Err(error) => return Some(error),
        };
        self.sparse(index, accessor.sparse.as_ref()?, &layout).err()
    }

    /// What keeps a buffer view from being read.
    pub fn check_view(&self, index: usize) -> Option<SceneError> {
        let buffer = self.buffers.get(self.root.buffer_views.get(index)?.buffer);
        // One without data is a fault of the buffer, or of whoever reads it.
        if buffer.is_some_and(|blob| blob.bytes().is_none()) {
            return None;
        }
        self.span("", index, 0).err()
    }

    /// Hands each element to `sink` as floats, those that a sparse accessor replaces once more; missing
    /// components keep the value of `fill`, so that a `VEC3` colour gets alpha 1.
    pub fn each_float<const N: usize>(
        &self,
        index: usize,
        user: &str,
        kinds: &[&str],
        fill: [f32; N],
        sink: impl FnMut(usize, [f32; N]),
    ) -> Result<(), SceneError> {
        let accessor = self.accessor(index, user)?;
        let layout = self.layout(index, accessor, kinds, limits::VERTEX_COUNT_MAX)?;
        let (component, normalized) = (layout.component, accessor.normalized);
        // Most are floats already; a loop of their own costs a quarter of the time.
        if component == Component::F32 {
            self.each(index, &layout, fill, |at| f32::from_le_bytes(first(at)), sink)
        } else {
            self.each(index, &layout, fill, |at| component.float(at, normalized), sink)
        }
    }

    /// Elements as floats, see [`each_float`](Self::each_float).
    pub fn floats<const N: usize>(
        &self,
        index: usize,
        user: &str,
        kinds: &[&str],
        fill: [f32; N],
    ) -> Result<Vec<[f32; N]>, SceneError> {
        let count = self.count_within(index, user, limits::VERTEX_COUNT_MAX)?;
        let mut elements = vec![fill; count];
        self.each_float(index, user, kinds, fill, |at, element| elements[at] = element)?;
        Ok(elements)
    }

    /// Elements as unsigned integers.
    pub fn unsigned<const N: usize>(
        &self,
        index: usize,
        user: &str,
        kinds: &[&str],
    ) -> Result<Vec<[u32; N]>, SceneError> {
        let count = self.count_within(index, user, limits::INDEX_COUNT_MAX)?;
        let layout = self.layout(index, &self.root.accessors[index], kinds, limits::INDEX_COUNT_MAX)?;
        let component = layout.component;
        if component.unsigned(&[0; 4]).is_none() {
            return Err(SceneError::new(pointer(index), "componentType must be an unsigned integer"));
        }
        let mut elements = vec![[0; N]; count];
        let sink = |at: usize, element| elements[at] = element;
        if component == Component::U32 {
            self.each(index, &layout, [0; N], |at| u32::from_le_bytes(first(at)), sink)?;
        } else {
            self.each(index, &layout, [0; N], |at| component.unsigned(at).unwrap_or(0), sink)?;
        }
        Ok(elements)
    }

    /// Number of elements, refused before anything is allocated for them.
    fn count_within(&self, index: usize, user: &str, limit: usize) -> Result<usize, SceneError> {
        let count = self.accessor(index, user)?.count;
        let bounded = usize::try_from(count).ok().filter(|&count| count <= limit);
        let reason = || format!("{count} exceeds the limit of {limit}");
        bounded.ok_or_else(|| SceneError::new(pointer(index) + "/count", reason()))
    }

    fn each<T: Copy + Default, const N: usize>(
        &self,
        index: usize,
        layout: &Layout<'_>,
        fill: [T; N],
        read: impl Fn(&[u8]) -> T,
        mut sink: impl FnMut(usize, [T; N]),
    ) -> Result<(), SceneError> {
        let width = layout.component.bytes();
        let used = layout.components.min(N);
        let element = |bytes: &[u8]| {
            let mut element = fill;
            for (value, at) in element[..used].iter_mut().zip(bytes.chunks_exact(width)) {
                *value = read(at);
            }
            element
        };
        match layout.bytes {
            Some(bytes) => {
                for (at, start) in (0..layout.count).zip((0..).step_by(layout.stride)) {
                    sink(at, element(&bytes[start..]));
                }
            }
            None => {
                let mut zero = fill;
                zero[..used].fill(T::default());
                (0..layout.count).for_each(|at| sink(at, zero));
            }
        }
        if let Some(sparse) = &self.root.accessors[index].sparse {
            for (at, bytes) in self.sparse(index, sparse, layout)? {
                sink(at, element(bytes));
            }
        }
        Ok(())
    }

    /// Which elements a sparse accessor replaces, and by which bytes.
    fn sparse(
        &self,
        index: usize,
        sparse: &Sparse,
        layout: &Layout<'_>,
    ) -> Result<Vec<(usize, &[u8])>, SceneError> {
        let place = |what: &str| format!("{}/sparse{what}", pointer(index));
        if sparse.count > layout.count as u64 {
            let (actual, limit) = (sparse.count, layout.count);
            return Err(SceneError::new(place("/count"), format!("{actual} exceeds the accessor's {limit}")));
        }
        let count = sparse.count as usize;
        let component =
            Component::from_gl(sparse.indices.component_type).filter(|c| c.unsigned(&[0; 4]).is_some());
        let component =
            component.ok_or_else(|| SceneError::new(place("/indices/componentType"), "must be unsigned"))?;
        let (width, size) = (component.bytes(), layout.component.bytes() * layout.components);
        let indices =
            self.span(&place("/indices"), sparse.indices.buffer_view, sparse.indices.byte_offset)?.0;
        let values = self.span(&place("/values"), sparse.values.buffer_view, sparse.values.byte_offset)?.0;
        if indices.len() < count * width || values.len() < count * size {
            return Err(SceneError::new(
                place(""),
                format!("its buffer views are too short for {count} elements"),
            ));
        }
        let pairs = indices.chunks_exact(width).zip(values.chunks_exact(size)).take(count);
        pairs
            .map(|(at, bytes)| match component.unsigned(at) {
                Some(at) if (at as usize) < layout.count => Ok((at as usize, bytes)),
                at => Err(SceneError::new(
                    place("/indices"),
                    format!("index {} is outside the accessor's {} elements", at.unwrap_or(0), layout.count),
                )),
            })
            .collect()
    }

    fn accessor(&self, index: usize, user: &str) -> Result<&'a Accessor, SceneError> {
        let count = self.root.accessors.len();
        let missing =
            || SceneError::new(user, format!("accessor {index} does not exist, the file has {count}"));
        self.root.accessors.get(index).ok_or_else(missing)
    }

    fn layout(
        &self,
        index: usize,
        accessor: &Accessor,
        kinds: &[&str],
        limit: usize,
    ) -> Result<Layout<'_>, SceneError> {
        let fault = |field: &str, reason: String| Err(SceneError::new(pointer(index) + field, reason));
        if accessor.count > limit as u64 {
            return fault("/count", format!("{} exceeds the limit of {limit}", accessor.count));
        }
        if !kinds.contains(&accessor.kind.as_str()) {
            return fault("/type", format!("`{}`, expected {}", accessor.kind, kinds.join(" or ")));
        }
        let Some(component) = Component::from_gl(accessor.component_type) else {
            return fault("/componentType", format!("{} is no component type", accessor.component_type));
        };
        let components = component_count(&accessor.kind);
        let (size, count) = (element_bytes(&accessor.kind, component.bytes()), accessor.count as usize);
        let Some(view) = accessor.buffer_view else {
            return Ok(Layout { bytes: None, stride: size, count, components, component });
        };
        let (bytes, stride) = self.span(&pointer(index), view, accessor.byte_offset)?;
        let stride = stride.unwrap_or(size);
        if stride < size {
            let reason = format!(
                "the byteStride {stride} of buffer view {view} is less than the {size} bytes of an element"
            );
            return fault("", reason);
        }
        let needed = count.checked_sub(1).map_or(0, |last| last * stride + size);
        if needed > bytes.len() {
            let left = bytes.len();
            return fault("", format!("{count} elements need {needed} bytes, its buffer view has {left}"));
        }
        Ok(Layout { bytes: Some(bytes), stride, count, components, component })
    }

    /// Bytes of a buffer view from `offset` on, and its stride.
    pub fn span(&self, user: &str, view: usize, offset: u64) -> Result<(&[u8], Option<usize>), SceneError> {
        let Some(buffer_view) = self.root.buffer_views.get(view) else {
            let count = self.root.buffer_views.len();
            return Err(SceneError::new(
                user,
                format!("buffer view {view} does not exist, the file has {count}"),
            ));
        };
        let place = format!("/bufferViews/{view}");
        let compressed = buffer_view.extensions.keys().find(|name| name.contains("meshopt"));
        let Some(blob) = self.buffers.get(buffer_view.buffer) else {
            return Err(SceneError::new(place, format!("buffer {} does not exist", buffer_view.buffer)));
        };
        let Some(bytes) = blob.bytes() else {
            let why = compressed.map_or("it has no URI and the file no binary chunk".to_owned(), |name| {
                format!("{name} is not supported and the file has no uncompressed copy")
            });
            return Err(SceneError::new(place, format!("buffer {} has no data: {why}", buffer_view.buffer)));
        };
        let end = buffer_view.byte_offset.checked_add(buffer_view.byte_length);
        if end.is_none_or(|end| end > bytes.len() as u64) {
            let (start, length, limit) = (buffer_view.byte_offset, buffer_view.byte_length, bytes.len());
            return Err(SceneError::new(
                place,
                format!("{length} bytes from {start} on do not fit the buffer's {limit}"),
            ));
        }
        let start = buffer_view.byte_offset as usize;
        let bytes = &bytes[start..start + buffer_view.byte_length as usize];
        let Some(rest) = usize::try_from(offset).ok().and_then(|offset| bytes.get(offset..)) else {
            return Err(SceneError::new(
                user,
                format!("byteOffset {offset} is outside the buffer view's {} bytes", bytes.len()),
            ));
        };
        let stride = buffer_view.byte_stride.map(|stride| usize::try_from(stride).unwrap_or(usize::MAX));
        // The specification's bound; a larger stride would overflow the arithmetic above.
        if stride.is_some_and(|stride| !(4..=252).contains(&stride)) {
            return Err(SceneError::new(place, "byteStride must be from 4 to 252"));
        }
        Ok((rest, stride))
    }
}

fn component_count(kind: &str) -> usize {
    match kind {
        "VEC2" => 2,
        "VEC3" => 3,
        "VEC4" | "MAT2" => 4,
        "MAT3" => 9,
        "MAT4" => 16,
        _ => 1,
    }
}

/// Columns of matrices begin at multiples of 4 bytes (glTF 2.0, section 3.6.2.4).
pub(crate) fn element_bytes(kind: &str, component_bytes: usize) -> usize {
    let rows = match kind {
        "MAT2" => 2,
        "MAT3" => 3,
        "MAT4" => 4,
        _ => return component_bytes * component_count(kind),
    };
    (rows * component_bytes).next_multiple_of(4) * rows
}

fn pointer(index: usize) -> String {
    format!("/accessors/{index}")
}
