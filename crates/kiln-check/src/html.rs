//! A report as one page: no script, no other file, light or dark as the reader has it.

use std::fmt::Write as _;

use kiln_diagnostic::Severity;

use crate::picture::Picture;
use crate::{Finding, Subject};

const STYLE: &str = "\
:root{color-scheme:light dark;--ink:#1b1d20;--paper:#fbfbfa;--rim:#d6d6d2;--error:#b3261e;--warning:#8a5a00;--note:#2f5d8a;--good:#25683a}
@media(prefers-color-scheme:dark){:root{--ink:#e4e4e1;--paper:#17181a;--rim:#3a3c40;--error:#ff8a80;--warning:#f0b45a;--note:#8fbcec;--good:#7fcf97}}
body{margin:2rem auto;max-width:68rem;padding:0 1rem;font:15px/1.5 system-ui,sans-serif;color:var(--ink);background:var(--paper)}
h1{font-size:1.5rem}h2{font-size:1.1rem;margin:2.5rem 0 .3rem;border-top:1px solid var(--rim);padding-top:1rem;overflow-wrap:anywhere}
table{border-collapse:collapse}td,th{padding:.15rem 1.2rem .15rem 0;text-align:left;vertical-align:top}th{font-weight:500;opacity:.75}
.finding{margin:.5rem 0;padding-left:.8rem;border-left:3px solid}.error{border-color:var(--error)}.warning{border-color:var(--warning)}.note{border-color:var(--note)}
.error b{color:var(--error)}.warning b{color:var(--warning)}.note b{color:var(--note)}.good{color:var(--good)}.allowed{opacity:.6}
.small{font-size:.88em;opacity:.85}figure{margin:1rem 0}img{max-width:100%;image-rendering:pixelated}
.swatch{display:inline-block;width:.8em;height:.8em;margin:0 .3em 0 1em;border:1px solid var(--rim)}";

/// The page of all subjects, titled `title`.
pub fn html(title: &str, subjects: &[Subject]) -> String {
    let mut page = format!(
        "<!doctype html>\n<html lang=\"en\"><head><meta charset=\"utf-8\"><meta name=\"viewport\" content=\"width=device-width\">\
         <title>{0}</title><style>{STYLE}</style></head><body><h1>{0}</h1>\n",
        escaped(title)
    );
    let count = |severity| {
        let findings = subjects.iter().flat_map(|subject| &subject.findings);
        findings.filter(|finding| finding.severity == severity && finding.allowed.is_none()).count()
    };
    let allowed =
        subjects.iter().flat_map(|subject| &subject.findings).filter(|it| it.allowed.is_some()).count();
    _ = writeln!(
        page,
        "<p>{} checked: {} errors, {} warnings, {} notes, {allowed} allowed.</p>",
        subjects.len(),
        count(Severity::Error),
        count(Severity::Warning),
        count(Severity::Note)
    );
    for subject in subjects {
        write_subject(&mut page, subject);
    }
    page.push_str("</body></html>\n");
    page
}

fn write_subject(page: &mut String, subject: &Subject) {
    _ = writeln!(
        page,
        "<h2>{} <span class=\"small\">{}</span></h2>",
        escaped(&subject.name),
        escaped(&subject.kind)
    );
    page.push_str("<table>");
    for fact in &subject.facts {
        _ = write!(page, "<tr><th>{}</th><td>{}</td></tr>", escaped(&fact.name), escaped(&fact.value));
    }
    page.push_str("</table>\n");
    if subject.findings.is_empty() {
        page.push_str("<p class=\"good\">nothing found</p>\n");
    }
    for finding in &subject.findings {
        write_finding(page, finding);
    }
    for unchecked in &subject.unchecked {
        _ = writeln!(
            page,
            "<p class=\"small\">not checked: {}: {}</p>",
            escaped(&unchecked.what),
            escaped(&unchecked.reason)
        );
    }
    for picture in &subject.pictures {
        write_picture(page, picture);
    }
}

fn write_finding(page: &mut String, finding: &Finding) {
    let class = if finding.allowed.is_some() { " allowed" } else { "" };
    _ = write!(
        page,
        "<div class=\"finding {0}{class}\"><b>{0}</b> {1} <span class=\"small\">{2}</span>",
        finding.severity,
        escaped(&finding.message),
        finding.check.name()
    );
    for place in &finding.places {
        _ = write!(page, "<br><span class=\"small\">{}</span>", escaped(place));
    }
    for (word, text) in [("help", &finding.help), ("allowed", &finding.allowed)] {
        if let Some(text) = text {
            _ = write!(page, "<br><span class=\"small\">{word}: {}</span>", escaped(text));
        }
    }
    page.push_str("</div>\n");
}

fn write_picture(page: &mut String, picture: &Picture) {
    _ = write!(
        page,
        "<figure><img width=\"{}\" height=\"{}\" alt=\"{}\" src=\"data:image/png;base64,{}\"><figcaption class=\"small\">{}: grey is sound",
        picture.width,
        picture.height,
        escaped(&picture.title),
        base64(&picture.png),
        escaped(&picture.title)
    );
    for (colour, text) in &picture.legend {
        let [r, g, b] = colour;
        _ = write!(
            page,
            "<span class=\"swatch\" style=\"background:rgb({r},{g},{b})\"></span>{}",
            escaped(text)
        );
    }
    page.push_str("</figcaption></figure>\n");
}

/// Text as HTML shows it: names of files and messages hold anything.
fn escaped(text: &str) -> String {
    text.replace('&', "&amp;").replace('<', "&lt;").replace('>', "&gt;").replace('"', "&quot;")
}

/// RFC 4648, section 4.
fn base64(bytes: &[u8]) -> String {
    const DIGITS: &[u8; 64] = b"ABCDEFGHIJKLMNOPQRSTUVWXYZabcdefghijklmnopqrstuvwxyz0123456789+/";
    let mut text = String::with_capacity(bytes.len().div_ceil(3) * 4);
    for chunk in bytes.chunks(3) {
        let byte = |index: usize| u32::from(chunk.get(index).copied().unwrap_or(0));
        let word = byte(0) << 16 | byte(1) << 8 | byte(2);
        for digit in 0..4 {
            let is_there = digit <= chunk.len();
            let index = (word >> (18 - 6 * digit) & 63) as usize;
            text.push(if is_there { char::from(DIGITS[index]) } else { '=' });
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::{base64, escaped};

    #[test]
    fn base64_has_the_vectors_of_its_standard() {
        let texts = ["", "f", "fo", "foo", "foob", "fooba", "foobar"].map(|text| base64(text.as_bytes()));
        assert_eq!(texts, ["", "Zg==", "Zm8=", "Zm9v", "Zm9vYg==", "Zm9vYmE=", "Zm9vYmFy"]);
        assert_eq!(base64(&[0xff, 0xef, 0xbe]), "/+++");
        assert_eq!(escaped("<a href=\"x\">&"), "&lt;a href=&quot;x&quot;&gt;&amp;");
    }
}
