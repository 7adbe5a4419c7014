//! Environments that are not what a preset asks for, and work that nobody wants any more.

use super::synthetic::environment;
use crate::{BakedEnvironment, Cancel, ExportError, FACE_SIZE_DEFAULT, Preset, package, package_as};
use kiln_bake::TexelFormat;
use kiln_image::{Cancelled, Cube};
use std::sync::atomic::AtomicI64;

fn refused(preset: Preset, change: impl FnOnce(&mut BakedEnvironment)) -> ExportError {
    let mut environment = environment(preset, 1.0);
    change(&mut environment);
    package(preset, &environment, Cancel::NEVER).expect_err("it is not what the preset asks for")
}

#[test]
fn missing_maps_are_named() {
    let missing = |preset: Preset, map| ExportError::Missing { preset: preset.name(), map };
    assert_eq!(refused(Preset::Bevy, |e| e.skybox.clear()), missing(Preset::Bevy, "skybox"));
    assert_eq!(
        refused(Preset::Filament, |e| e.specular.clear()),
        missing(Preset::Filament, "specular chain")
    );
    assert_eq!(refused(Preset::Khronos, |e| e.sheen = None), missing(Preset::Khronos, "sheen chain"));
    assert_eq!(refused(Preset::Bevy, |e| e.irradiance = None), missing(Preset::Bevy, "irradiance map"));
    assert_eq!(refused(Preset::Raw, |e| e.dfg = None), missing(Preset::Raw, "BRDF table"));
    let few = ExportError::Harmonics { needed: 9, actual: 4 };
    assert_eq!(refused(Preset::Three, |e| e.radiance_sh.truncate(4)), few);
    assert!(refused(Preset::Raw, |e| e.radiance_sh.push([0.0; 3])).to_string().contains("10 were given"));
    let table = ExportError::Table { size: 3, actual: 4 };
    assert_eq!(refused(Preset::Raw, |e| e.dfg.as_mut().expect("a table").size = 3), table);
}

#[test]
fn wrong_sizes_and_laws_are_refused_with_their_level() {
    let level = ExportError::Level { map: "specular chain", level: 1, expected: 32, actual: 16 };
    assert_eq!(refused(Preset::Bevy, |e| drop(e.specular.remove(1))), level);
    let short = ExportError::Level { map: "skybox", level: 0, expected: 64, actual: 0 };
    assert_eq!(refused(Preset::Three, |e| e.skybox[0].rgb.truncate(5)), short);
    let huge =
        refused(Preset::Bevy, |e| e.irradiance = Some(Cube { face_size: usize::MAX, rgb: Vec::new() }));
    assert!(matches!(huge, ExportError::Level { actual: 0, .. }), "{huge}");
    let another_law = refused(Preset::Filament, |e| e.specular = environment(Preset::Bevy, 1.0).specular);
    let expected = "level 1 of the specular chain has roughness 0.5, filament reads 0.29";
    assert!(another_law.to_string().starts_with(expected), "{another_law}");
    assert!(matches!(
        refused(Preset::Bevy, |e| e.specular[2].0 = f64::NAN),
        ExportError::Roughness { level: 2, .. }
    ));
}

#[test]
fn each_engine_takes_its_formats_and_refuses_others() {
    for preset in Preset::ALL {
        let environment = environment(preset, 1.0);
        for format in TexelFormat::ALL {
            let files = package_as(preset, &environment, Some(format), Cancel::NEVER);
            if !preset.formats().contains(&format) {
                let refused = files.expect_err("not a format of the engine").to_string();
                assert!(refused.starts_with(&format!("{preset} does not take ")), "{refused}");
                continue;
            }
            let files = files.expect("a format of the engine");
            for file in
                files.iter().filter(|file| file.path.ends_with(".ktx2") && file.path.starts_with("studio"))
            {
                let header = ktx2::Reader::new(&file.bytes).expect("the crate reads it").header();
                assert_eq!(
                    header.format.map(|f| f.value()),
                    Some(format.ktx2().vk_format()),
                    "{preset} {}",
                    file.path
                );
            }
        }
        let usual = preset.formats().first().copied();
        let files = package(preset, &environment, Cancel::NEVER).expect("complete");
        assert_eq!(package_as(preset, &environment, usual, Cancel::NEVER), Ok(files));
    }
}

#[test]
fn names_that_leave_the_folder_are_refused() {
    for name in ["", "../up", "a/b", "a\\b", ".hidden", "a b", "ü"] {
        let name = name.to_owned();
        assert_eq!(refused(Preset::Raw, |e| e.name.clone_from(&name)), ExportError::Name(name));
    }
    let mut fine = environment(Preset::Three, 1.0);
    fine.name = "Venice_1k-2.0".to_owned();
    assert!(package(Preset::Three, &fine, Cancel::NEVER).is_ok(), "the check itself");
}

#[test]
fn every_preset_ends_soon_after_it_is_cancelled_and_repeats_itself() {
    for preset in Preset::ALL {
        let environment = environment(preset, 1.0);
        let never = AtomicI64::new(i64::MAX);
        let files = package(preset, &environment, Cancel::countdown(&never)).expect("complete");
        assert_eq!(package(preset, &environment, Cancel::NEVER).expect("complete"), files);
        let checks = i64::MAX - never.into_inner();
        assert!(checks > 100, "{preset} looks {checks} times");
        for left in [0, 1, checks / 2, checks - 1] {
            let left = AtomicI64::new(left);
            let ended = package(preset, &environment, Cancel::countdown(&left));
            assert_eq!(ended, Err(ExportError::Cancelled(Cancelled)), "{preset}");
        }
    }
}

#[test]
fn one_level_is_legal_and_a_flat_chain_too() {
    for preset in Preset::ALL {
        for face_size in [1, 8, 16, FACE_SIZE_DEFAULT] {
            let wish = preset.wish(face_size);
            let levels: Vec<f64> =
                (0..wish.specular_levels).map(|l| wish.law.roughness(l, wish.specular_levels)).collect();
            assert!(
                levels.first().is_none_or(|&first| first == 0.0)
                    && levels.iter().all(|r| (0.0..=1.0).contains(r))
            );
            assert!(wish.specular_levels == 0 || face_size >> (wish.specular_levels - 1) >= 1);
        }
        let mut one = environment(preset, 1.0);
        one.specular.truncate(1);
        one.skybox.truncate(1);
        if let Some(sheen) = &mut one.sheen {
            sheen.truncate(1);
        }
        assert!(package(preset, &one, Cancel::NEVER).is_ok(), "{preset}");
    }
    assert_eq!(Preset::Filament.wish(256).specular_levels, 5);
    assert_eq!(Preset::Raw.wish(256).specular_levels, 9);
    assert_eq!("bevy".parse(), Ok(Preset::Bevy));
    assert!("unity".parse::<Preset>().is_err_and(|error| error.to_string().contains("filament")));
}
