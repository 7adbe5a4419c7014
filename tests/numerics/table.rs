//! `docs/numerics.md` says what is tested, and no more.

use std::collections::BTreeSet;
use std::path::PathBuf;

use crate::record::{Record, is_updating, read};
use crate::support::repository;

/// A row of the table.
#[derive(Debug)]
struct Row {
    case: String,
    test: String,
    worst: String,
}

/// What must have a row: the words that some row's case holds.
const MUST: [&str; 47] = [
    "65504",
    "5.8e37",
    "denormals",
    "NaN, ±Inf and negative",
    "all-black",
    "single-texel",
    "10⁷ on black",
    "1-texel-high",
    "no power of two",
    "roughness 0, 1e-4, 1 and outside",
    "α² underflow",
    "n·h → 1",
    "n·v = 0 and n·l = 0",
    "V = +Z",
    "Charlie at roughness → 0",
    "anisotropic D",
    "Schlick",
    "one mip",
    "index 0 and last",
    "2³²−1",
    "LOD → ∞",
    "count 0 and 1",
    "basis at ±Z",
    "reflection at grazing",
    "poles",
    "wrap column",
    "edges and corners",
    "degenerate triangles",
    "zero-length normals",
    "mirrored UVs",
    "negative scale",
    "non-finite vertices",
    "constant map",
    "Legendre underflow",
    "above Nyquist",
    "ringing next to",
    "horizon kink",
    "Charlie's spectrum",
    "switch of method",
    "180°",
    "long sums",
    "f16 subnormals",
    "RGB9E5",
    "BC6H",
    "tone mapping of 0, Inf, NaN",
    "permutation explosion",
    "chi-square with",
];

fn rows(table: &str) -> Vec<Row> {
    let cells = |line: &str| -> Option<Row> {
        let cells: Vec<&str> = line.strip_prefix('|')?.strip_suffix('|')?.split('|').map(str::trim).collect();
        let [case, _, _, test, worst] = cells[..] else { return None };
        let test = test.strip_prefix('`')?.strip_suffix('`')?;
        Some(Row { case: case.to_owned(), test: test.to_owned(), worst: worst.to_owned() })
    };
    table.lines().filter_map(cells).collect()
}

/// What the record has of a test, as the table says it.
fn worst_of(record: &Record, test: &str) -> String {
    let entries = record.iter().filter(|((known, _), _)| known == test);
    entries.map(|((_, place), error)| format!("{place} {error:.1e}")).collect::<Vec<_>>().join(", ")
}

/// Names of the tests in the files of cases.
fn tests_here() -> BTreeSet<String> {
    let sources = [
        include_str!("elsewhere.rs"),
        include_str!("encodings.rs"),
        include_str!("geometry.rs"),
        include_str!("inputs.rs"),
        include_str!("lobes.rs"),
        include_str!("physics.rs"),
        include_str!("physics_wgsl.rs"),
        include_str!("sampling.rs"),
        include_str!("transforms.rs"),
    ];
    let tests = sources.iter().flat_map(|text| text.split("#[test]\nfn ").skip(1));
    tests.map(|rest| rest.split('(').next().unwrap_or_default().to_owned()).collect()
}

/// Tests of other crates that a row may name, with their files.
const ELSEWHERE: [(&str, &str); 1] =
    [("revision_is_delivered_only_when_whole", "crates/kiln-link/src/tests/mod.rs")];

/// Everything in which table, tests and record disagree.
fn disagreements(table: &str, tests: &BTreeSet<String>, record: &Record) -> Vec<String> {
    let rows = rows(table);
    let mut wrong = Vec::new();
    for Row { case, test, worst } in &rows {
        let is_elsewhere = ELSEWHERE.iter().any(|(name, _)| name == test);
        if !tests.contains(test) && !is_elsewhere {
            wrong.push(format!("`{case}` names `{test}`, which is no test"));
        }
        let known = worst_of(record, test);
        if *worst != known {
            wrong.push(format!("`{case}` says `{worst}`, the record `{known}`"));
        }
    }
    let without = tests.iter().filter(|test| !rows.iter().any(|row| row.test == **test));
    wrong.extend(without.map(|test| format!("the test `{test}` has no row")));
    let missing = MUST.iter().filter(|must| !rows.iter().any(|row| row.case.contains(**must)));
    wrong.extend(missing.map(|must| format!("no row is about `{must}`")));
    let orphans = record.keys().filter(|(test, _)| !tests.contains(test));
    wrong.extend(orphans.map(|(test, _)| format!("the record has `{test}`, which is no test")));
    wrong
}

fn path() -> PathBuf {
    repository().join("docs/numerics.md")
}

/// Writes the record's errors into the table.
pub fn update(record: &Record) {
    let table = std::fs::read_to_string(path()).unwrap();
    std::fs::write(path(), updated(&table, record)).unwrap();
}

/// The table with the record's errors in its last column.
fn updated(table: &str, record: &Record) -> String {
    let line = |line: &str| match rows(line).first() {
        Some(row) => {
            let start = line.trim_end_matches('|').rfind('|').unwrap_or(0);
            let worst = worst_of(record, &row.test);
            let space = if worst.is_empty() { "" } else { " " };
            format!("{}| {worst}{space}|", &line[..start])
        }
        None => line.to_owned(),
    };
    table.lines().map(|text| line(text) + "\n").collect()
}

#[test]
fn table_tests_and_record_agree() {
    if is_updating() {
        return;
    }
    let table = std::fs::read_to_string(path()).unwrap();
    let wrong = disagreements(&table, &tests_here(), &read());
    assert!(wrong.is_empty(), "{}", wrong.join("\n"));
    for (test, file) in ELSEWHERE {
        let text = std::fs::read_to_string(repository().join(file)).unwrap();
        assert!(text.contains(&format!("fn {test}()")), "{file} has no {test}");
    }
    // The checks themselves.
    let mut fewer = tests_here();
    fewer.pop_first();
    assert!(!disagreements(&table, &fewer, &read()).is_empty(), "a row without a test");
    let mut more = tests_here();
    more.insert("another_one".to_owned());
    assert_eq!(disagreements(&table, &more, &read()), ["the test `another_one` has no row"]);
    let other = table.replace("long sums", "sums");
    assert_eq!(disagreements(&other, &tests_here(), &read()), ["no row is about `long sums`"]);
}
