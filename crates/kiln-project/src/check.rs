//! What would change in a folder of baked files: the question of CI.

use serde_json::Value;

use crate::{MANIFEST_FILE, Manifest, ManifestTarget};

/// Differences named of one target; the rest is counted.
const DETAILS_MAX: usize = 6;

/// A target that a bake would make, change or remove.
#[derive(Clone, Debug, PartialEq, Eq, serde::Serialize)]
pub struct Difference {
    /// Its name.
    pub target: String,
    /// What would happen to it.
    pub kind: DifferenceKind,
    /// What of it is different: `facts.size: 256 → 128`.
    pub details: Vec<String>,
}

/// What would happen to a target.
#[derive(Clone, Copy, Debug, PartialEq, Eq, serde::Serialize)]
#[serde(rename_all = "lowercase")]
pub enum DifferenceKind {
    /// The manifest does not have it.
    Added,
    /// Nothing makes it any more.
    Removed,
    /// It would be another one.
    Changed,
}

/// What a manifest says otherwise than the present sources, by target.
pub fn differences(committed: &Manifest, present: &Manifest) -> Vec<Difference> {
    let mut names: Vec<&String> = committed.targets.keys().chain(present.targets.keys()).collect();
    names.sort();
    names.dedup();
    let difference = |name: &String| {
        let (kind, details) = match (committed.targets.get(name), present.targets.get(name)) {
            (None, _) => (DifferenceKind::Added, Vec::new()),
            (Some(_), None) => (DifferenceKind::Removed, Vec::new()),
            (Some(old), Some(new)) if old == new => return None,
            (Some(old), Some(new)) => (DifferenceKind::Changed, details(old, new)),
        };
        Some(Difference { target: name.clone(), kind, details })
    };
    let mut differences: Vec<Difference> = names.into_iter().filter_map(difference).collect();
    if committed.writer != present.writer && !committed.targets.is_empty() {
        let details = vec![format!("writer: {} → {}", committed.writer, present.writer)];
        differences.push(Difference {
            target: MANIFEST_FILE.to_owned(),
            kind: DifferenceKind::Changed,
            details,
        });
    }
    differences
}

fn details(old: &ManifestTarget, new: &ManifestTarget) -> Vec<String> {
    let mut details = Vec::new();
    let as_json = |target: &ManifestTarget| serde_json::to_value(target).unwrap_or_default();
    compare("", &as_json(old), &as_json(new), &mut details);
    // The target's digest follows from the rest and says nothing.
    details.retain(|detail| !detail.starts_with("sha256: "));
    // What was asked for comes before what was found out.
    details.sort_by_key(|detail| {
        ["facts.details", "facts.measured"].iter().any(|found| detail.starts_with(found))
    });
    let surplus = details.len().saturating_sub(DETAILS_MAX);
    details.truncate(DETAILS_MAX);
    if surplus > 0 {
        details.push(format!("and {surplus} more"));
    }
    details
}

fn compare(path: &str, old: &Value, new: &Value, details: &mut Vec<String>) {
    let below = |key: &str| if path.is_empty() { key.to_owned() } else { format!("{path}.{key}") };
    match (old, new) {
        (old, new) if old == new => {}
        (Value::Object(old), Value::Object(new)) => {
            for (key, value) in old {
                compare(&below(key), value, new.get(key).unwrap_or(&Value::Null), details);
            }
            for (key, value) in new.iter().filter(|(key, _)| !old.contains_key(*key)) {
                compare(&below(key), &Value::Null, value, details);
            }
        }
        (Value::Array(old), Value::Array(new)) if old.len() == new.len() => {
            for (index, (old, new)) in old.iter().zip(new).enumerate() {
                compare(&format!("{path}[{index}]"), old, new, details);
            }
        }
        (old, new) => details.push(format!("{path}: {} → {}", short(old), short(new))),
    }
}

fn short(value: &Value) -> String {
    let text = match value {
        Value::Null => return "nothing".to_owned(),
        Value::String(text) => text.clone(),
        other => other.to_string(),
    };
    let is_digest = text.len() == 64 && text.bytes().all(|byte| byte.is_ascii_hexdigit());
    let length_max = if is_digest { 8 } else { 40 };
    match text.char_indices().nth(length_max) {
        Some((end, _)) if is_digest => text[..end].to_owned(),
        Some((end, _)) => format!("{}…", &text[..end]),
        None => text,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn difference_names_the_place_and_both_values() {
        let mut details = Vec::new();
        let old = serde_json::json!({"a": {"size": 256, "same": 1}, "list": [1, 2], "gone": true});
        let new = serde_json::json!({"a": {"size": 128, "same": 1}, "list": [1, 3], "new": "x"});
        compare("", &old, &new, &mut details);
        let expected = ["a.size: 256 → 128", "gone: true → nothing", "list[1]: 2 → 3", "new: nothing → x"];
        assert_eq!(details, expected);
        details.clear();
        compare("", &old, &old, &mut details);
        assert!(details.is_empty());
    }
}
