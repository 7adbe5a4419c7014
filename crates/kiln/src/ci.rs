//! Results in the forms that CI hosts show: JUnit reports and annotations.

use std::fmt::Write as _;

use kiln_diagnostic::{Diagnostic, Severity};

use crate::args::CiHost;

/// One test case of a JUnit report.
pub(crate) struct TestCase {
    /// A target's kind.
    pub(crate) class: String,
    /// A target's name.
    pub(crate) name: String,
    pub(crate) seconds: f64,
    /// What is wrong with it; `None` if it is well.
    pub(crate) failure: Option<String>,
}

/// A JUnit report of one suite.
pub(crate) fn junit(suite: &str, cases: &[TestCase]) -> String {
    let failures = cases.iter().filter(|case| case.failure.is_some()).count();
    let seconds: f64 = cases.iter().map(|case| case.seconds).sum();
    let mut xml = String::from("<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n");
    let counts = format!("tests=\"{}\" failures=\"{failures}\" time=\"{seconds:.3}\"", cases.len());
    let suite = escape(suite);
    // Writing to a string cannot fail.
    let _ = writeln!(xml, "<testsuites {counts}>\n  <testsuite name=\"{suite}\" {counts}>");
    for case in cases {
        let (class, name) = (escape(&case.class), escape(&case.name));
        let _ =
            write!(xml, "    <testcase classname=\"{class}\" name=\"{name}\" time=\"{:.3}\"", case.seconds);
        let _ = match &case.failure {
            None => writeln!(xml, "/>"),
            Some(text) => {
                let first = escape(text.lines().next().unwrap_or_default());
                writeln!(
                    xml,
                    ">\n      <failure message=\"{first}\">{}</failure>\n    </testcase>",
                    escape(text)
                )
            }
        };
    }
    xml + "  </testsuite>\n</testsuites>\n"
}

/// Text for XML 1.0, which has no way to write most control characters.
fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        match character {
            '&' => escaped.push_str("&amp;"),
            '<' => escaped.push_str("&lt;"),
            '>' => escaped.push_str("&gt;"),
            '"' => escaped.push_str("&quot;"),
            '\n' | '\t' => escaped.push(character),
            '\u{fffe}' | '\u{ffff}' => escaped.push('\u{fffd}'),
            character if character.is_control() => escaped.push('\u{fffd}'),
            character => escaped.push(character),
        }
    }
    escaped
}

/// A diagnostic as a line that a CI host understands. `below` is the project's folder relative to the repository.
pub(crate) fn annotation(host: CiHost, below: &str, diagnostic: &Diagnostic) -> String {
    let mut message = diagnostic.message.clone();
    for line in diagnostic.notes.iter().chain(&diagnostic.help) {
        let _ = write!(message, "\n{line}");
    }
    let file = diagnostic
        .file
        .as_ref()
        .map(|file| if below.is_empty() { file.clone() } else { format!("{below}/{file}") });
    let (line, column) = diagnostic.span.as_ref().map_or((1, 1), |span| (span.line, span.column));
    match host {
        CiHost::Github => {
            let level = match diagnostic.severity {
                Severity::Error => "error",
                Severity::Warning => "warning",
                Severity::Note => "notice",
            };
            let place = file.map(|file| format!(" file={},line={line},col={column}", percent(&file, ":,")));
            format!("::{level}{}::{}", place.unwrap_or_default(), percent(&message, ""))
        }
        CiHost::Azure => {
            let level = if diagnostic.severity == Severity::Error { "error" } else { "warning" };
            let place = file.map(|file| {
                format!(";sourcepath={};linenumber={line};columnnumber={column}", percent(&file, ";]"))
            });
            let place = place.unwrap_or_default();
            format!("##vso[task.logissue type={level}{place}]{}", percent(&message, ""))
        }
    }
}

/// Both hosts end a message at its line's end, and write such characters as `%0A`.
fn percent(text: &str, also: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for character in text.chars() {
        if character == '%' || character.is_ascii_control() || also.contains(character) {
            let _ = write!(escaped, "%{:02X}", u32::from(character));
        } else {
            escaped.push(character);
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn diagnostic() -> Diagnostic {
        let text = "let a = 1;\nlet b = half;\n";
        Diagnostic::error("no definition: `half`\n100 %")
            .at("lib/a,b.wgsl", text, 19..23)
            .with_help("write 0.5")
    }

    #[test]
    fn github_annotation_names_file_line_and_column_and_stays_one_line() {
        let line = annotation(CiHost::Github, "look", &diagnostic());
        let expected =
            "::error file=look/lib/a%2Cb.wgsl,line=2,col=9::no definition: `half`%0A100 %25%0Awrite 0.5";
        assert_eq!(line, expected);
        let plain = annotation(CiHost::Github, "", &Diagnostic::note("hello"));
        assert_eq!(plain, "::notice::hello");
    }

    #[test]
    fn azure_annotation_names_file_line_and_column() {
        let line = annotation(CiHost::Azure, "", &diagnostic());
        assert!(line.starts_with(
            "##vso[task.logissue type=error;sourcepath=lib/a,b.wgsl;linenumber=2;columnnumber=9]no"
        ));
    }

    #[test]
    fn junit_report_is_read_by_another_reader() {
        let case = |name: &str, failure: Option<&str>| TestCase {
            class: "cube".to_owned(),
            name: name.to_owned(),
            seconds: 0.25,
            failure: failure.map(str::to_owned),
        };
        let hostile = "a < b && \"c\" \u{1b}[1m\u{0}\nsecond line";
        let report = junit("kiln & co", &[case("env/sky", None), case("env/\"x\"", Some(hostile))]);
        let document = roxmltree::Document::parse(&report).unwrap();
        let cases: Vec<_> = document.descendants().filter(|node| node.has_tag_name("testcase")).collect();
        assert_eq!(cases.len(), 2);
        assert_eq!(cases[1].attribute("name"), Some("env/\"x\""));
        let failure = cases[1].first_element_child().unwrap();
        assert_eq!(failure.text().unwrap(), hostile.replace(['\u{1b}', '\u{0}'], "\u{fffd}"));
        let suite = document.descendants().find(|node| node.has_tag_name("testsuite")).unwrap();
        assert_eq!((suite.attribute("tests"), suite.attribute("failures")), (Some("2"), Some("1")));
    }
}
