//! Compares a file with the tables of [`super::table`].

use super::table::{EXTENSIONS, Kind, Number, Property, ROOT};
use super::{Findings, Used};
use crate::json::Json;

/// Most properties of one object. Looking one up takes as many steps, so this bounds the time of all checks.
const PROPERTY_COUNT_MAX: usize = 64;

/// Walks the whole file; `false` if it is too strange for more checks.
pub(super) fn check(json: &Json<'_>, used: &Used<'_>, findings: &mut Findings) -> bool {
    let required: Vec<&str> = json.table("extensionsRequired").iter().filter_map(Json::text).collect();
    for (at, name) in required.iter().enumerate().filter(|(_, name)| !used.contains(*name)) {
        let reason = format!("{name} is required, but `extensionsUsed` does not list it");
        findings.push(format!("/extensionsRequired/{at}"), reason);
    }
    let quantization = "KHR_mesh_quantization";
    if used.contains(quantization) && !required.contains(&quantization) {
        findings.push("/extensionsUsed", format!("{quantization} cannot be optional; it was applied"));
    }
    let mut walker = Walker { root: json, used, findings, place: String::new(), is_strange: false };
    walker.value(json, &ROOT);
    !walker.is_strange
}

struct Walker<'a, 'b> {
    root: &'a Json<'b>,
    used: &'a Used<'a>,
    findings: &'a mut Findings,
    place: String,
    is_strange: bool,
}

impl Walker<'_, '_> {
    fn say(&mut self, reason: impl Into<String>) {
        self.findings.push(self.place.clone(), reason);
    }

    /// Does something one step further down.
    fn at(&mut self, step: &str, then: impl FnOnce(&mut Self)) {
        let length = self.place.len();
        self.place.push('/');
        self.place.push_str(&step.replace('~', "~0").replace('/', "~1"));
        then(self);
        self.place.truncate(length);
    }

    fn value(&mut self, value: &Json<'_>, kind: &'static Kind) {
        match (kind, value) {
            (Kind::Any, _) | (Kind::Bool, Json::Bool(_)) | (Kind::Text, Json::Text(_)) => {}
            (Kind::OneOf(texts), Json::Text(text)) if !texts.contains(&&**text) => {
                self.say(format!("`{text}` is none of {}", texts.join(", ")));
            }
            (Kind::OneOf(_), Json::Text(_)) => {}
            (Kind::Codes(codes), Json::Number(code)) if !codes.iter().any(|it| f64::from(*it) == *code) => {
                self.say(format!("{code} is none of {codes:?}"));
            }
            (Kind::Codes(_), Json::Number(_)) => {}
            (Kind::Number(bounds), Json::Number(number)) => self.number(*number, bounds),
            (Kind::Index(table), Json::Number(_)) => self.index(value, table),
            (Kind::List(kind, least), Json::List(list)) => self.list(list, kind, *least),
            (Kind::Map(kind), Json::Object(members)) => {
                if members.is_empty() {
                    self.say("it must not be empty");
                }
                self.repeated(value);
                members.iter().for_each(|(name, value)| self.at(name, |it| it.value(value, kind)));
            }
            (Kind::Object(home, properties), Json::Object(_)) => self.object(value, home, properties),
            _ => self.say(format!("it must be {}", kind.words())),
        }
    }

    fn number(&mut self, number: f64, bounds: &Number) {
        if !bounds.holds(number) {
            self.say(format!("{number} is out of range: {bounds}"));
        }
    }

    /// An extension of the whole file.
    fn extension(&self, name: &str) -> Option<&Json<'_>> {
        self.root.get("extensions").and_then(|it| it.get(name))
    }

    fn index(&mut self, value: &Json<'_>, table: &str) {
        let table_json = match table {
            "lights" => self.extension("KHR_lights_punctual"),
            "variants" => self.extension("KHR_materials_variants"),
            _ => Some(self.root),
        };
        let count = table_json.map_or(0, |it| it.table(table).len());
        match value.index() {
            Some(index) if index < count => {}
            Some(index) => self.say(format!("{index} does not exist, `{table}` has {count}")),
            None => self.say("an index must be a whole number from 0 on"),
        }
    }

    fn list(&mut self, list: &[Json<'_>], kind: &'static Kind, least: usize) {
        if list.len() < least {
            let few = format!("{} entries, it must have at least {least}", list.len());
            self.say(if list.is_empty() { "it must not be empty".to_owned() } else { few });
        }
        for (at, value) in list.iter().enumerate() {
            self.at(&at.to_string(), |it| it.value(value, kind));
        }
        if matches!(kind, Kind::Index(_)) {
            let mut sorted: Vec<usize> = list.iter().filter_map(Json::index).collect();
            sorted.sort_unstable();
            if let Some(pair) = sorted.windows(2).find(|pair| pair[0] == pair[1]) {
                self.say(format!("{} is listed twice", pair[0]));
            }
        }
    }

    fn object(&mut self, value: &Json<'_>, home: &str, properties: &'static [Property]) {
        self.repeated(value);
        for property in properties {
            match value.get(property.name) {
                Some(found) => {
                    self.at(property.name, |it| it.value(found, property.kind));
                    let missing = property.needs.filter(|other| value.get(other).is_none());
                    if let Some(other) = missing {
                        self.at(property.name, |it| it.say(format!("it means nothing without `{other}`")));
                    }
                    let rival = property.excludes.iter().find(|other| value.get(other).is_some());
                    if let Some(other) = rival {
                        self.say(format!("it has both `{}` and `{other}`", property.name));
                    }
                }
                None if property.required => self.say(format!("`{}` is missing", property.name)),
                None => {}
            }
        }
        if value.get("name").is_some_and(|name| name.text().is_none()) {
            self.at("name", |it| it.say("it must be a text"));
        }
        if let Some(extensions) = value.get("extensions") {
            self.at("extensions", |it| it.extensions(extensions, home));
        }
    }

    fn extensions(&mut self, extensions: &Json<'_>, home: &str) {
        for (name, value) in extensions.members() {
            self.at(name, |it| {
                if !it.used.contains(&**name) {
                    it.say("`extensionsUsed` does not list this extension");
                }
                let mut known = EXTENSIONS.iter().filter(|known| known.name == *name).peekable();
                if known.peek().is_none() {
                    return;
                }
                match known.find(|known| known.home == home) {
                    Some(known) => it.value(value, known.kind),
                    None => it.say("this extension has no meaning here and was ignored"),
                }
            });
        }
    }

    /// Keys that occur twice; readers differ in which one they take.
    fn repeated(&mut self, object: &Json<'_>) {
        let count = object.members().len();
        if count > PROPERTY_COUNT_MAX {
            self.is_strange = true;
            self.say(format!(
                "{count} properties exceed the limit of {PROPERTY_COUNT_MAX} for further checks"
            ));
        }
        let mut names: Vec<&str> = object.members().iter().map(|(name, _)| &**name).collect();
        names.sort_unstable();
        let twice: Vec<String> =
            names.windows(2).filter(|pair| pair[0] == pair[1]).map(|pair| pair[0].to_owned()).collect();
        for name in twice {
            self.at(&name, |it| it.say("this key occurs twice; the last one counts"));
        }
    }
}
