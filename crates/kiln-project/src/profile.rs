//! Named qualities: config/profiles.toml as data.

use std::collections::BTreeMap;

use kiln_bake::TexelFormat;
use serde::Deserialize;

use crate::env_config::{EnvConfig, FORMATS};

const PROFILES: &str = include_str!("../../../config/profiles.toml");

/// The names that `profile` takes, from the coarsest.
pub const PROFILE_NAMES: [&str; 3] = ["draft", "preview", "final"];

#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
struct Profile {
    error: f64,
    size: usize,
    irradiance_size: usize,
    format: String,
}

/// Gives an environment the quality of this name.
pub(crate) fn apply(name: &str, env: &mut EnvConfig) {
    let profiles: BTreeMap<String, Profile> = toml::from_str(PROFILES).unwrap_or_default();
    let Some(profile) = profiles.get(name) else { return };
    (env.error, env.size, env.irradiance_size) = (profile.error, profile.size, profile.irradiance_size);
    if let Some(format) = format_of(&profile.format) {
        env.format = format;
    }
}

fn format_of(name: &str) -> Option<TexelFormat> {
    FORMATS.iter().find(|(known, _)| *known == name).map(|(_, format)| *format)
}

#[cfg(test)]
mod tests {
    use super::{PROFILE_NAMES, PROFILES, Profile, apply, format_of};
    use crate::env_config::EnvConfig;

    #[test]
    fn profiles_are_those_that_have_names_and_grow_finer() {
        let read: std::collections::BTreeMap<String, Profile> = toml::from_str(PROFILES).expect("it is TOML");
        assert_eq!(read.len(), PROFILE_NAMES.len());
        let of = |name: &str| {
            assert!(
                format_of(&read[name].format).is_some_and(|_| read[name].size.is_power_of_two()),
                "{name}"
            );
            let mut env = EnvConfig::new(vec!["a.hdr".to_owned()]);
            apply(name, &mut env);
            env
        };
        let [draft, preview, last] = PROFILE_NAMES.map(of);
        assert!(draft.error > preview.error && preview.error > last.error);
        assert!(draft.size < preview.size && preview.size < last.size);
        assert_eq!(preview, EnvConfig::new(vec!["a.hdr".to_owned()]), "`preview` is what nobody asked for");
        let mut other = draft.clone();
        apply("fnial", &mut other);
        assert_eq!(other, draft, "no profile is called so");
    }
}
