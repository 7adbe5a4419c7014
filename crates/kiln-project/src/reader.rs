//! Reads tables of kiln.toml key by key, so that every complaint has a place and a way out.

use std::ops::Range;

use kiln_diagnostic::Diagnostic;
use toml::Spanned;
use toml::de::{DeString, DeTable, DeValue};

use crate::PROJECT_FILE;

/// The text of kiln.toml and what was found wrong with it.
pub(crate) struct Document<'a> {
    pub(crate) text: &'a str,
    pub(crate) diagnostics: Vec<Diagnostic>,
}

impl Document<'_> {
    pub(crate) fn error(&self, message: impl Into<String>, place: Range<usize>) -> Diagnostic {
        Diagnostic::error(message).at(PROJECT_FILE, self.text, place)
    }
}

/// One table, as `[env.sky]`.
pub(crate) struct Section<'a, 'd> {
    document: &'d mut Document<'a>,
    name: String,
    header: Range<usize>,
    table: &'d DeTable<'a>,
    known: Vec<&'static str>,
    /// Required keys that are absent, each with an example value.
    missing: Vec<(&'static str, &'static str)>,
    failed: bool,
}

impl<'a, 'd> Section<'a, 'd> {
    pub(crate) fn new(
        document: &'d mut Document<'a>,
        name: String,
        header: Range<usize>,
        table: &'d DeTable<'a>,
    ) -> Self {
        Section { document, name, header, table, known: Vec::new(), missing: Vec::new(), failed: false }
    }

    fn find(&mut self, key: &'static str) -> Option<&'d Spanned<DeValue<'a>>> {
        self.known.push(key);
        self.table.iter().find(|(name, _)| name.get_ref() == key).map(|(_, value)| value)
    }

    /// Where the value of `key` stands, for later complaints; the section's header if it is absent.
    pub(crate) fn place(&self, key: &str) -> Range<usize> {
        let entry = self.table.iter().find(|(name, _)| name.get_ref() == key);
        entry.map_or(self.header.clone(), |(_, value)| value.span())
    }

    pub(crate) fn fail(&mut self, message: String, place: Range<usize>, help: Option<String>) {
        let mut diagnostic = self.document.error(message, place);
        diagnostic.help = help;
        self.document.diagnostics.push(diagnostic);
        self.failed = true;
    }

    /// Says what does nothing as it stands; the section is used.
    pub(crate) fn warn(&mut self, message: String, place: Range<usize>, help: &str) {
        let warning = Diagnostic::warning(message).at(PROJECT_FILE, self.document.text, place);
        self.document.diagnostics.push(warning.with_help(help));
    }

    fn wrong_type(&mut self, key: &str, wanted: &str, value: &Spanned<DeValue>) {
        let message =
            format!("`{key}` in [{}] must be {wanted}, not {}", self.name, value.get_ref().type_str());
        self.fail(message, value.span(), None);
    }

    pub(crate) fn text(&mut self, key: &'static str) -> Option<String> {
        let value = self.find(key)?;
        match value.get_ref().as_str() {
            Some(text) => Some(text.to_owned()),
            None => {
                self.wrong_type(key, "a string", value);
                None
            }
        }
    }

    /// A text, or an array of texts.
    pub(crate) fn texts(&mut self, key: &'static str) -> Option<Vec<String>> {
        let value = self.find(key)?;
        let texts: Option<Vec<String>> = match value.get_ref() {
            DeValue::String(text) => Some(vec![text.to_string()]),
            DeValue::Array(values) => {
                values.iter().map(|value| value.get_ref().as_str().map(str::to_owned)).collect()
            }
            _ => None,
        };
        if texts.is_none() {
            self.wrong_type(key, "a string or an array of strings", value);
        }
        texts
    }

    /// Whether the value of `key` is an array.
    pub(crate) fn is_array(&self, key: &str) -> bool {
        let entry = self.table.iter().find(|(name, _)| name.get_ref() == key);
        entry.is_some_and(|(_, value)| matches!(value.get_ref(), DeValue::Array(_)))
    }

    /// An array of numbers.
    pub(crate) fn numbers(&mut self, key: &'static str) -> Option<Vec<f64>> {
        let value = self.find(key)?;
        let number = |value: &Spanned<DeValue>| match value.get_ref() {
            DeValue::Float(float) => float.as_str().replace('_', "").parse().ok(),
            DeValue::Integer(integer) => integer.as_str().replace('_', "").parse().ok(),
            _ => None,
        };
        let numbers = match value.get_ref() {
            DeValue::Array(values) => values.iter().map(number).collect(),
            _ => None,
        };
        if numbers.is_none() {
            self.wrong_type(key, "an array of numbers", value);
        }
        numbers
    }

    pub(crate) fn boolean(&mut self, key: &'static str) -> Option<bool> {
        let value = self.find(key)?;
        match value.get_ref() {
            DeValue::Boolean(boolean) => Some(*boolean),
            _ => {
                self.wrong_type(key, "true or false", value);
                None
            }
        }
    }

    pub(crate) fn missing(&mut self, key: &'static str, example: &'static str) {
        self.missing.push((key, example));
    }

    pub(crate) fn required_text(&mut self, key: &'static str, example: &'static str) -> String {
        if !self.table.iter().any(|(name, _)| name.get_ref() == key) {
            self.missing.push((key, example));
        }
        self.text(key).unwrap_or_default()
    }

    /// An integer within `range`.
    pub(crate) fn integer(
        &mut self,
        key: &'static str,
        range: std::ops::RangeInclusive<usize>,
    ) -> Option<usize> {
        let value = self.find(key)?;
        let Some(integer) = value.get_ref().as_integer() else {
            self.wrong_type(key, "an integer", value);
            return None;
        };
        let digits = integer.as_str().replace('_', "");
        let number =
            usize::from_str_radix(&digits, integer.radix()).ok().filter(|number| range.contains(number));
        if number.is_none() {
            let message = format!(
                "`{key}` in [{}] must be from {} to {}, not {digits}",
                self.name,
                range.start(),
                range.end()
            );
            self.fail(message, value.span(), None);
        }
        number
    }

    /// A number (integer or float) within `range`.
    pub(crate) fn number(&mut self, key: &'static str, range: std::ops::RangeInclusive<f64>) -> Option<f64> {
        let value = self.find(key)?;
        let text = match value.get_ref() {
            DeValue::Float(float) => float.as_str(),
            DeValue::Integer(integer) => integer.as_str(),
            _ => {
                self.wrong_type(key, "a number", value);
                return None;
            }
        };
        let number = text.replace('_', "").parse::<f64>().ok().filter(|number| range.contains(number));
        if number.is_none() {
            let (low, high) = (range.start(), range.end());
            let message = format!("`{key}` in [{}] must be from {low:e} to {high:e}, not {text}", self.name);
            self.fail(message, value.span(), None);
        }
        number
    }

    /// A number of bytes: an integer, or a text as `64 MiB`.
    pub(crate) fn bytes(&mut self, key: &'static str) -> Option<u64> {
        if self.find(key)?.get_ref().as_str().is_none() {
            let bytes = self.integer(key, 0..=usize::MAX)?;
            return u64::try_from(bytes).ok();
        }
        let text = self.text(key)?;
        let bytes = parse_bytes(&text);
        if bytes.is_none() {
            let message = format!("`{key}` in [{}] is `{text}`, which is no size", self.name);
            self.fail(
                message,
                self.place(key),
                Some("write it as `64 MiB`, `1.5 GiB` or `200000`".to_owned()),
            );
        }
        bytes
    }

    /// One of a few words.
    pub(crate) fn choice<T: Copy>(&mut self, key: &'static str, choices: &[(&str, T)]) -> Option<T> {
        let place = self.place(key);
        let text = self.text(key)?;
        let chosen = choices.iter().find(|(word, _)| *word == text).map(|(_, choice)| *choice);
        if chosen.is_none() {
            let words: Vec<&str> = choices.iter().map(|(word, _)| *word).collect();
            let message =
                format!("`{key}` in [{}] is `{text}`, which is none of {}", self.name, words.join(", "));
            self.fail(message, place, suggest(&text, words.iter().copied()));
        }
        chosen
    }

    /// An array of tables, each read by `read` as a section of its own; those with an error are left out.
    pub(crate) fn tables<T>(
        &mut self,
        key: &'static str,
        mut read: impl FnMut(&mut Section<'a, '_>) -> Option<T>,
    ) -> Vec<T> {
        let Some(value) = self.find(key) else { return Vec::new() };
        let wanted = "an array of tables, as `[{ check = \"…\", … }]`";
        let DeValue::Array(values) = value.get_ref() else {
            self.wrong_type(key, wanted, value);
            return Vec::new();
        };
        let mut read_all = Vec::new();
        for value in values.iter() {
            let DeValue::Table(table) = value.get_ref() else {
                self.wrong_type(key, wanted, value);
                continue;
            };
            let name = format!("{}.{key}", self.name);
            let mut section = Section::new(&mut *self.document, name, value.span(), table);
            let one = read(&mut section);
            if section.finish() {
                read_all.extend(one);
            } else {
                self.failed = true;
            }
        }
        read_all
    }

    /// Complains about keys that nothing asked for and, unless one of those may be it misspelt, about required ones
    /// that are absent; returns whether the section may be used.
    pub(crate) fn finish(mut self) -> bool {
        let unknown = self.table.iter().map(|(key, _)| key);
        let unknown: Vec<&Spanned<DeString>> =
            unknown.filter(|key| !self.known.contains(&key.get_ref().as_ref())).collect();
        self.failed |= !self.missing.is_empty();
        if unknown.is_empty() {
            for (key, example) in std::mem::take(&mut self.missing) {
                let message = format!("[{}] has no `{key}`", self.name);
                self.fail(message, self.header.clone(), Some(format!("add `{key} = \"{example}\"`")));
            }
        }
        for key in unknown {
            let known = std::mem::take(&mut self.known);
            let help = suggest(key.get_ref(), known.iter().copied())
                .unwrap_or_else(|| format!("known keys are {}", known.join(", ")));
            self.known = known;
            self.fail(format!("unknown key `{}` in [{}]", key.get_ref(), self.name), key.span(), Some(help));
        }
        !self.failed
    }
}

/// "did you mean …", if something known is close enough to what was written.
pub fn suggest<'a>(written: &str, known: impl Iterator<Item = &'a str>) -> Option<String> {
    let scored = known.map(|word| (strsim::jaro_winkler(written, word), word));
    let best = scored.max_by(|a, b| a.0.total_cmp(&b.0).then(b.1.cmp(a.1)))?;
    (best.0 > 0.75).then(|| format!("did you mean `{}`?", best.1))
}

/// A number of bytes from a text as `200000`, `64 MiB`, `1.5GB`. `K`, `M` and `G` alone, and with `iB`, are powers of 1024;
/// with `B` they are powers of 1000.
pub fn parse_bytes(text: &str) -> Option<u64> {
    const UNITS: [(&str, f64); 14] = [
        ("", 1.0),
        ("B", 1.0),
        ("K", 1024.0),
        ("M", 1_048_576.0),
        ("G", 1_073_741_824.0),
        ("KiB", 1024.0),
        ("MiB", 1_048_576.0),
        ("GiB", 1_073_741_824.0),
        ("TiB", 1_099_511_627_776.0),
        ("kB", 1e3),
        ("KB", 1e3),
        ("MB", 1e6),
        ("GB", 1e9),
        ("TB", 1e12),
    ];
    let text = text.trim();
    let end =
        text.find(|character: char| !character.is_ascii_digit() && character != '.').unwrap_or(text.len());
    let (number, unit) = text.split_at(end);
    let scale = UNITS.iter().find(|(name, _)| *name == unit.trim())?.1;
    let bytes = number.parse::<f64>().ok()? * scale;
    // Up to 2^53 every whole number of bytes is exact.
    (0.0..9e15).contains(&bytes).then_some(bytes as u64)
}
