//! The table of names is the document's.

use crate::names::{
    DRAW_MEMBERS, FRAME_MEMBERS, FRAME_RESOURCES, GROUPS, Group, MATERIAL_MEMBERS, MATERIAL_TEXTURES,
    group_of_member, group_of_resource, sampler_of,
};

const DOCUMENT: &str = include_str!("../../../../docs/shader-interface.md");

/// Names in backquotes of the section that begins with `title`.
fn documented(title: &str) -> Vec<&'static str> {
    let section = DOCUMENT.split("\n## ").find(|section| section.starts_with(title)).unwrap();
    let names = section.split('`').skip(1).step_by(2);
    let is_name = |name: &&str| {
        name.bytes().all(|byte| byte.is_ascii_lowercase() || byte == b'_' || byte.is_ascii_digit())
    };
    let types = ["f32", "vec2f", "vec3f", "vec4f", "mat4x4f"];
    names.filter(is_name).filter(|name| !types.contains(name) && !name.is_empty()).collect()
}

/// Names of `table` that are not in `section`, and the other way round.
fn difference(section: &[&str], table: &[&str]) -> Vec<String> {
    let missing = |from: &[&str], of: &[&str]| {
        let names = of.iter().filter(|name| !from.contains(name));
        names.map(|name| (*name).to_owned()).collect::<Vec<_>>()
    };
    [missing(section, table), missing(table, section)].concat()
}

#[test]
fn table_of_names_is_that_of_the_document() {
    let frame = [&["frame"], &FRAME_MEMBERS[..], &FRAME_RESOURCES[..]].concat();
    assert_eq!(difference(&documented("Group 0"), &frame), Vec::<String>::new());
    let material = [&["material"], &MATERIAL_MEMBERS[..], &MATERIAL_TEXTURES[..]].concat();
    assert_eq!(difference(&documented("Group 1"), &material), Vec::<String>::new());
    let draw = [&["draw"], &DRAW_MEMBERS[..]].concat();
    assert_eq!(difference(&documented("Group 2"), &draw), Vec::<String>::new());
    assert_eq!(
        difference(&documented("Group 2"), &["draw", "world_from_object"]),
        ["world_from_object_normal"]
    );
}

#[test]
fn names_have_the_groups_of_the_document() {
    assert_eq!(GROUPS.map(Group::number), [0, 1, 2, 3]);
    let members =
        ["time_s", "normal_uv_v", "ior", "world_from_object", "my_gain", "wood_uv_u"].map(group_of_member);
    assert_eq!(
        members,
        [Group::Frame, Group::Material, Group::Material, Group::Draw, Group::Params, Group::Params]
    );
    let resources =
        ["env_specular", "hdr_color", "sheen_color_texture", "wood_texture", "draw"].map(group_of_resource);
    assert_eq!(resources, [Group::Frame, Group::Frame, Group::Material, Group::Params, Group::Draw]);
    let samplers =
        ["env_skybox", "lut_ggx", "hdr_color", "scene_color", "normal_texture", "noise"].map(sampler_of);
    assert_eq!(
        samplers,
        ["env_sampler", "lut_sampler", "lut_sampler", "lut_sampler", "normal_sampler", "noise_sampler"]
    );
}
