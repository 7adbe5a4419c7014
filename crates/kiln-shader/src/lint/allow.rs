//! Comments by which an author allows a finding: `// kiln: allow(domain) the caller has checked it`.

use kiln_diagnostic::Diagnostic;

use super::Rule;
use crate::link::Graph;

const MARK: &str = "// kiln: allow(";

/// Allowances of all modules.
#[derive(Debug, Default)]
pub struct Allowances {
    /// Module, line from 1, rule.
    found: Vec<(usize, u32, Rule)>,
}

impl Allowances {
    /// Reads those of a graph; what is wrong with them is added to `diagnostics`.
    pub fn read(graph: &Graph, diagnostics: &mut Vec<Diagnostic>) -> Allowances {
        let mut allowances = Allowances::default();
        for (index, module) in graph.modules.iter().enumerate() {
            let mut start = 0;
            for (line, text) in (1..).zip(module.text.split_inclusive('\n')) {
                if let Some(at) = text.find(MARK) {
                    match parse(&text[at + MARK.len()..]) {
                        Ok(rule) => allowances.found.push((index, line, rule)),
                        Err((message, help)) => {
                            let range = start + at..start + text.trim_end().len();
                            let warning = Diagnostic::warning(message).at(&module.path, &module.text, range);
                            diagnostics.push(warning.with_help(help));
                        }
                    }
                }
                start += text.len();
            }
        }
        allowances
    }

    /// Whether `rule` may be broken on `line` of module `module`.
    pub fn allow(&self, module: usize, line: u32, rule: Rule) -> bool {
        let is_near = |at: u32| at == line || at + 1 == line;
        self.found.iter().any(|(of, at, allowed)| *of == module && is_near(*at) && *allowed == rule)
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
