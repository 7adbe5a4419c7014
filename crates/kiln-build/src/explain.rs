//! Why an action ran.

use std::collections::BTreeMap;

use crate::ActionRecord;

/// What differs between an action as it was last built and as it is now, in words;
/// `None` stands for "never built under this name".
pub fn explain(before: Option<&ActionRecord>, now: &ActionRecord) -> String {
    let Some(before) = before else { return "first build".to_owned() };
    let (old, new) = (deciding_fields(before), deciding_fields(now));
    let changed = new.iter().filter(|(name, value)| old.get(*name) != Some(value));
    let removed = old.keys().filter(|name| !new.contains_key(*name));
    let mut reasons: Vec<String> =
        changed.map(|(name, value)| describe(name, old.get(name).map(String::as_str), value)).collect();
    reasons.extend(removed.map(|name| format!("{name} is gone")));
    match reasons.len() {
        0 => "its result is no longer in the store".to_owned(),
        _ => reasons.join(", "),
    }
}

fn deciding_fields(record: &ActionRecord) -> BTreeMap<String, String> {
    let mut fields = BTreeMap::new();
    record.list_deciding_fields(&mut |name, value| {
        fields.insert(name.to_owned(), value.to_owned());
    });
    fields
}

fn describe(name: &str, old: Option<&str>, new: &str) -> String {
    match (name.strip_prefix("input "), old) {
        (Some(input), None) => format!("{input} is new"),
        (Some(input), Some("missing")) => format!("{input} appeared"),
        (Some(input), Some(_)) if new == "missing" => format!("{input} disappeared"),
        (Some(input), Some(_)) => format!("{input} changed"),
        (None, None) => format!("{name} = {new} is new"),
        (None, Some(old)) => format!("{name} changed from {old} to {new}"),
    }
}
