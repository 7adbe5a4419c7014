//! Comments by which an author allows a finding: `// kiln: allow(domain) the caller has checked it`.

use kiln_diagnostic::{Diagnostic, Severity};

use super::Rule;

const MARK: &str = "// kiln: allow(";

/// Allowances of all files.
#[derive(Debug, Default)]
pub struct Allowances {
    /// File, line from 1, rule.
    found: Vec<(String, u32, Rule)>,
}

impl Allowances {
    /// Reads those of files, each with its path and text; what is wrong with them is added to `diagnostics`.
    pub fn read<'a>(
        files: impl Iterator<Item = (&'a str, &'a str)>,
        diagnostics: &mut Vec<Diagnostic>,
    ) -> Allowances {
        let mut allowances = Allowances::default();
        for (path, whole) in files {
            let mut start = 0;
            for (line, text) in (1..).zip(whole.split_inclusive('\n')) {
                if let Some(at) = text.find(MARK) {
                    match parse(&text[at + MARK.len()..]) {
                        Ok(rule) => allowances.found.push((path.to_owned(), line, rule)),
                        Err((message, help)) => {
                            let range = start + at..start + text.trim_end().len();
                            let warning = Diagnostic::warning(message).at(path, whole, range);
                            diagnostics.push(warning.with_help(help));
                        }
                    }
                }
                start += text.len();
            }
        }
        allowances
    }

    /// Makes a warning of a finding that stands at its author's place, unless the author allows it there.
    pub fn warn(&self, mut finding: Diagnostic, rule: Rule, help: &str) -> Option<Diagnostic> {
        let line = finding.span.as_ref().map_or(0, |span| span.line);
        let is_here = |(file, at, allowed): &(String, u32, Rule)| {
            finding.file.as_ref() == Some(file) && (*at == line || at + 1 == line) && *allowed == rule
        };
        if self.found.iter().any(is_here) {
            return None;
        }
        finding.severity = Severity::Warning;
        finding.help = Some(format!("{help}; or say `// kiln: allow({}) why`", rule.name()));
        Some(finding)
    }
}

/// What stands behind the mark: `domain) why`.
fn parse(text: &str) -> Result<Rule, (String, String)> {
    let (name, reason) = text.split_once(')').unwrap_or((text, ""));
    let names: Vec<&str> = Rule::ALL.iter().map(|rule| rule.name()).collect();
    let rule = Rule::ALL.into_iter().find(|rule| rule.name() == name.trim());
    let rule = rule.ok_or_else(|| {
        (format!("there is no lint `{}`", name.trim()), format!("there are: {}", names.join(", ")))
    })?;
    if reason.trim().is_empty() {
        let help = format!("say why behind it: `// kiln: allow({}) …`", rule.name());
        return Err(("an allowance gives no reason, so it allows nothing".to_owned(), help));
    }
    Ok(rule)
}
