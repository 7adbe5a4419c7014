//! How much of the device a prepared revision holds.

use std::collections::{HashMap, HashSet};
use std::sync::Arc;

use crate::prepare::Prepared;
use crate::scene_gpu::GpuScene;

/// Maps and geometry by identity, with their bytes on the device. Pipelines, uniforms and textures of shaders' authors are
/// left out.
pub(crate) type Holdings = HashMap<usize, u64>;

/// What `prepared` draws with.
pub(crate) fn holdings(prepared: &Prepared) -> Holdings {
    let environment = &prepared.environment;
    let cubes = [&environment.skybox, &environment.irradiance, &environment.specular, &environment.sheen];
    let cubes = cubes.map(|cube| (Arc::as_ptr(cube) as usize, texture_bytes(cube.view.texture())));
    let tables = [&environment.lut_ggx, &environment.lut_charlie];
    let tables = tables.map(|table| (Arc::as_ptr(table) as usize, texture_bytes(table.view.texture())));
    let scene = prepared.scene.iter().map(|scene| (Arc::as_ptr(scene) as usize, scene_bytes(scene)));
    cubes.into_iter().chain(tables).chain(scene).collect()
}

/// Bytes of all in `pinned` that `live` does not hold.
pub(crate) fn own_bytes<'a>(pinned: impl Iterator<Item = &'a Holdings>, live: &Holdings) -> u64 {
    let all: Holdings = pinned.flatten().map(|(what, bytes)| (*what, *bytes)).collect();
    all.iter().filter(|(what, _)| !live.contains_key(*what)).map(|(_, bytes)| bytes).sum()
}

#[expect(clippy::mutable_key_type, reason = "a texture's hash is that of who it is, not of what it holds")]
fn scene_bytes(scene: &GpuScene) -> u64 {
    let textures: HashSet<&wgpu::Texture> = scene.textures().collect();
    let textures: u64 = textures.into_iter().map(texture_bytes).sum();
    textures + scene.buffers().map(wgpu::Buffer::size).sum::<u64>()
}

/// Bytes of all levels and layers.
pub(crate) fn texture_bytes(texture: &wgpu::Texture) -> u64 {
    let format = texture.format();
    let (block_width, block_height) = format.block_dimensions();
    let block_bytes = u64::from(format.block_copy_size(None).unwrap_or(4));
    let level = |level: u32| {
        let blocks = |side: u32, block: u32| u64::from((side >> level).max(1).div_ceil(block));
        blocks(texture.width(), block_width) * blocks(texture.height(), block_height) * block_bytes
    };
    let levels: u64 = (0..texture.mip_level_count()).map(level).sum();
    levels * u64::from(texture.depth_or_array_layers()) * u64::from(texture.sample_count())
}
