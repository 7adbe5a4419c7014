//! Groups and bindings of everything that is filled from outside, the same for all stages.

use std::collections::BTreeMap;

use super::Parsed;
use super::builtin;
use super::declare::{Block, Item, Qualifiers, Variable};
use super::source::{Place, Sources};
use crate::names::{self, Group};

/// Bindings by name.
#[derive(Debug, Default)]
pub struct Bindings {
    /// Group and binding of each name.
    pub of: BTreeMap<String, (u32, u32)>,
    /// Where each name is declared first.
    pub places: BTreeMap<String, Place>,
}

/// Something to be bound.
struct Wanted {
    name: String,
    group: Group,
    set: Option<u32>,
    binding: Option<u32>,
    place: Place,
}

/// The sampler of a combined type; comparing ones are not shared.
pub fn sampler_name(texture: &str, combined: &builtin::Combined) -> String {
    if combined.sampler == "samplerShadow" {
        format!("{texture}_sampler")
    } else {
        names::sampler_of(texture)
    }
}

/// The name of a block's variable: its instance, else the block's own. `Frame` and its like are `frame`.
pub fn block_name(block: &Block) -> String {
    let name = &*block.instance.as_ref().unwrap_or(&block.name).text;
    let lower = name.to_ascii_lowercase();
    let is_known = names::GROUPS.iter().any(|group| group.block() == lower);
    if is_known { lower } else { name.to_owned() }
}

/// The block that holds a uniform value, unless the value is a block by itself: a struct `material` is one.
pub fn holder(variable: &Variable) -> Option<Group> {
    let name = &*variable.name.text;
    let is_block =
        !builtin::is_value_type(&variable.ty.text) && names::GROUPS.iter().any(|group| group.block() == name);
    (!is_block).then(|| names::group_of_member(name))
}

/// Gives everything its group and binding: those of `layout(set=…, binding=…)` first, then the lowest that
/// are free, in order of appearance.
pub fn assign(sources: &mut Sources<'_, '_>, stages: &[Parsed]) -> Bindings {
    let mut wanted: Vec<Wanted> = Vec::new();
    for stage in stages {
        for item in &stage.items {
            match item {
                Item::Variable(variable) if variable.qualifiers.is("uniform") => {
                    variable_wants(variable, &mut wanted);
                }
                Item::Block(block) if block.qualifiers.is("uniform") || block.qualifiers.is("buffer") => {
                    let name = block_name(block);
                    let group = names::group_of_resource(&name);
                    wanted.push(Wanted::new(name, group, &block.qualifiers, block.name.place));
                }
                _ => {}
            }
        }
    }
    let mut bindings = Bindings::default();
    let mut taken: BTreeMap<(u32, u32), String> = BTreeMap::new();
    wanted.sort_by_key(|wanted| wanted.rank());
    for Wanted { name, group, set, binding, place } in wanted {
        if bindings.of.contains_key(&name) {
            continue;
        }
        let group = set.unwrap_or(group.number());
        let fixed = binding.map(|binding| (group, binding));
        if let Some(other) = fixed.filter(|_| set.is_some()).and_then(|at| taken.get(&at)) {
            let message = format!("`{name}` has the set and binding of `{other}`");
            let mut fault = sources.error(place, message);
            fault
                .notes
                .insert(0, format!("`{other}` is declared at {}", sources.describe(bindings.places[other])));
            sources.diagnostics.push(fault);
            continue;
        }
        // Without a set, binding numbers are OpenGL's: each kind of resource counts from 0 there.
        let fixed = fixed.filter(|at| !taken.contains_key(at));
        let free = (0..=u32::MAX).find(|binding| !taken.contains_key(&(group, *binding))).unwrap_or(0);
        let at = fixed.unwrap_or((group, free));
        taken.insert(at, name.clone());
        bindings.places.insert(name.clone(), place);
        bindings.of.insert(name, at);
    }
    bindings
}

impl Wanted {
    fn new(name: String, group: Group, qualifiers: &Qualifiers, place: Place) -> Wanted {
        let (set, binding) = (qualifiers.integer("set"), qualifiers.integer("binding"));
        Wanted { name, group, set, binding, place }
    }

    /// Fixed ones first, then those with a preference.
    fn rank(&self) -> u8 {
        match (self.set, self.binding) {
            (Some(_), Some(_)) => 0,
            (None, Some(_)) => 1,
            (_, None) => 2,
        }
    }
}

fn variable_wants(variable: &Variable, wanted: &mut Vec<Wanted>) {
    let (name, place) = (variable.name.text.to_string(), variable.place());
    if let Some(combined) = builtin::combined(&variable.ty.text) {
        let group = names::group_of_resource(&name);
        let sampler = sampler_name(&name, &combined);
        wanted.push(Wanted::new(name, group, &variable.qualifiers, place));
        let group = match names::group_of_resource(&sampler) {
            Group::Params => group,
            known => known,
        };
        // Its number is nobody's choice, but a texture's set is its sampler's too.
        let set = variable.qualifiers.integer("set");
        wanted.push(Wanted { name: sampler, group, set, binding: None, place });
    } else if builtin::is_opaque(&variable.ty.text) {
        let group = names::group_of_resource(&name);
        wanted.push(Wanted::new(name, group, &variable.qualifiers, place));
    } else if let Some(group) = holder(variable) {
        wanted.push(Wanted { name: group.block().to_owned(), group, set: None, binding: None, place });
    } else {
        let group = names::group_of_resource(&name);
        wanted.push(Wanted::new(name, group, &variable.qualifiers, place));
    }
}

/// Checks that a uniform which several stages declare is the same in all of them.
pub fn check_equal(sources: &mut Sources<'_, '_>, stages: &[Parsed]) {
    let mut first: BTreeMap<&str, (String, Place)> = BTreeMap::new();
    for stage in stages {
        for item in &stage.items {
            let Item::Variable(variable) = item else { continue };
            if !variable.qualifiers.is("uniform") {
                continue;
            }
            let array = variable.array.iter().map(|token| &*token.text);
            let ty: String = std::iter::once(&*variable.ty.text).chain(array).collect();
            let (other, place) = first.entry(&variable.name.text).or_insert((ty.clone(), variable.place()));
            if *other != ty {
                let name = &variable.name.text;
                let message = format!("`{name}` is `{ty}` here, and `{other}` in another stage");
                let mut fault = sources.error(variable.place(), message);
                fault.notes.insert(0, format!("the other is declared at {}", sources.describe(*place)));
                sources.diagnostics.push(fault);
            }
        }
    }
}

/// Where the stages declare the block, variable or struct `name`.
pub fn places_of(stages: &[Parsed], name: &str) -> Vec<Place> {
    let items = stages.iter().flat_map(|stage| &stage.items);
    let places = items.filter_map(|item| match item {
        Item::Block(block) if block_name(block) == name || block.name.is(name) => Some(block.name.place),
        Item::Variable(variable) if variable.name.is(name) => Some(variable.place()),
        Item::Struct(structure) if structure.name.is(name) => Some(structure.name.place),
        _ => None,
    });
    places.collect()
}
