//! Why an action has another result than before.

use std::collections::BTreeMap;
use std::fmt;

use serde::{Deserialize, Serialize};

use crate::{ActionRecord, Digest};

/// Why an action ran, or was found in the store under another key than before.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub enum Reason {
    /// It was never built under this name.
    FirstBuild,
    /// Something that decides its result is different.
    Changed(Vec<Change>),
    /// Everything is as it was, but what it made is no longer in the store.
    Lost,
}

/// One thing that decides an action's result, before and after.
#[derive(Clone, Debug, PartialEq, Eq, Serialize, Deserialize)]
pub struct Change {
    /// As `input environments/sky.hdr`, `parameter size` or `recipe version`.
    pub field: String,
    /// Its value before; `None` if the action did not have it.
    pub old: Option<String>,
    /// Its value now; `None` if the action no longer has it.
    pub new: Option<String>,
}

/// How the value of a missing input is written.
const MISSING: &str = "missing";

impl Reason {
    /// What differs between an action as it was last built (`None`: never) and as it is now.
    pub fn between(before: Option<&ActionRecord>, now: &ActionRecord) -> Reason {
        let Some(before) = before else { return Reason::FirstBuild };
        let (old, new) = (deciding_fields(before), deciding_fields(now));
        let of = |fields: &BTreeMap<String, String>, name: &str| fields.get(name).cloned();
        let changed = new.keys().filter(|name| old.get(*name) != new.get(*name));
        let gone = old.keys().filter(|name| !new.contains_key(*name));
        let change = |name: &String| Change { field: name.clone(), old: of(&old, name), new: of(&new, name) };
        let changes: Vec<Change> = changed.chain(gone).map(change).collect();
        if changes.is_empty() { Reason::Lost } else { Reason::Changed(changes) }
    }
}

impl Change {
    /// The input it is about, if it is about one.
    pub fn input(&self) -> Option<&str> {
        self.field.strip_prefix("input ")
    }

    /// With both values, digests shortened: `environments/sky.hdr: 1f0c9a3e → 77b2d014`.
    pub fn with_values(&self) -> String {
        let short = |value: &Option<String>| match value {
            None => "nothing".to_owned(),
            Some(value) => value.parse::<Digest>().map_or_else(|_| value.clone(), |digest| digest.short()),
        };
        let what = self.input().unwrap_or(&self.field);
        format!("{what}: {} → {}", short(&self.old), short(&self.new))
    }
}

impl fmt::Display for Change {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match (self.input(), self.old.as_deref(), self.new.as_deref()) {
            (Some(input), Some(MISSING), Some(_)) => write!(f, "{input} appeared"),
            (Some(input), Some(_), Some(MISSING)) => write!(f, "{input} disappeared"),
            (Some(input), Some(_), Some(_)) => write!(f, "{input} changed"),
            (Some(input), None, Some(MISSING)) => write!(f, "it looks for {input} too, which is missing"),
            (Some(input), None, _) => write!(f, "{input} is read too"),
            (None, None, Some(new)) => write!(f, "{} = {new} is new", self.field),
            (None, Some(old), Some(new)) => write!(f, "{} changed from {old} to {new}", self.field),
            (Some(input), Some(MISSING), None) => write!(f, "it looks for {input} no more"),
            (Some(input), _, None) => write!(f, "{input} is read no more"),
            (None, _, None) => write!(f, "{} is gone", self.field),
        }
    }
}

impl fmt::Display for Reason {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Reason::FirstBuild => f.write_str("first build"),
            Reason::Lost => f.write_str("its result is no longer in the store"),
            Reason::Changed(changes) => {
                let changes: Vec<String> = changes.iter().map(Change::to_string).collect();
                f.write_str(&changes.join(", "))
            }
        }
    }
}

fn deciding_fields(record: &ActionRecord) -> BTreeMap<String, String> {
    let mut fields = BTreeMap::new();
    record.list_deciding_fields(&mut |field| {
        fields.insert(field.shown, field.value);
    });
    fields
}
