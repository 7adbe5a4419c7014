//! What a build did, as lines for people and as JSON for machines.

use kiln_build::TargetState;
use kiln_diagnostic::{Diagnostic, Severity};
use kiln_link::{RevisionTable, Work};

/// A length of time that fits its size.
pub(crate) fn duration(ms: f64) -> String {
    match ms {
        ms if ms < 9.95 => format!("{ms:.1} ms"),
        ms if ms < 999.5 => format!("{ms:.0} ms"),
        ms => format!("{:.2} s", ms / 1e3),
    }
}

/// A number of bytes that fits its size.
pub(crate) fn size(bytes: u64) -> String {
    let units = ["B", "KiB", "MiB", "GiB"];
    let mut scaled = bytes as f64;
    let mut unit = 0;
    while scaled >= 1024.0 && unit + 1 < units.len() {
        scaled /= 1024.0;
        unit += 1;
    }
    if unit == 0 { format!("{bytes} B") } else { format!("{scaled:.1} {}", units[unit]) }
}

/// `1 action`, `2 actions`.
pub(crate) fn count(number: usize, noun: &str) -> String {
    format!("{number} {noun}{}", if number == 1 { "" } else { "s" })
}

/// All diagnostics, errors last, so that they stand just above the prompt; notes only if `with_notes`.
pub(crate) fn print_diagnostics(diagnostics: &[Diagnostic], with_notes: bool) {
    let mut sorted: Vec<&Diagnostic> =
        diagnostics.iter().filter(|diagnostic| with_notes || diagnostic.severity > Severity::Note).collect();
    sorted.sort_by_key(|diagnostic| diagnostic.severity);
    for diagnostic in sorted {
        eprintln!("{diagnostic}\n");
    }
}

/// One line a kind of work: what ran how often, how long, and why.
pub(crate) fn work_lines(work: &Work) -> Vec<String> {
    let mut groups: Vec<(String, usize, f64, String)> = Vec::new();
    for action in &work.ran {
        let label = group_label(&action.name);
        match groups.iter_mut().find(|(known, ..)| *known == label) {
            Some((_, times, ms, _)) => {
                *times += 1;
                *ms += action.wall_ms;
            }
            None => groups.push((label, 1, action.wall_ms, action.reason.clone())),
        }
    }
    let line = |(label, times, ms, reason): (String, usize, f64, String)| {
        let times = if times == 1 { String::new() } else { format!(" ×{times}") };
        format!("{:<44} {:>9}   {reason}", format!("{label}{times}"), duration(ms))
    };
    groups.into_iter().map(line).collect()
}

/// Levels of a map are one line together.
pub(crate) fn group_label(name: &str) -> String {
    match name.split_once(" mip ") {
        Some((map, _)) => map.to_owned(),
        None => name.to_owned(),
    }
}

/// A published revision in one line.
pub(crate) fn revision_line(table: &RevisionTable) -> String {
    let stale = table.targets.values().filter(|target| target.state == TargetState::Stale).count();
    let stale = if stale == 0 { String::new() } else { format!(", {} stale", count(stale, "target")) };
    let coming = match table.building.len() {
        0 => String::new(),
        coming => format!(", {} to come", count(coming, "target")),
    };
    let Work { ran, reused, plan_ms, run_ms, .. } = &table.work;
    format!(
        "revision {}: {} ran, {reused} reused{stale}{coming}; planned in {}, ran in {}",
        table.number,
        count(ran.len(), "action"),
        duration(*plan_ms),
        duration(*run_ms)
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn durations_and_sizes_fit_their_magnitude() {
        let durations = [0.04, 9.94, 12.6, 999.4, 12_345.0].map(duration);
        assert_eq!(durations, ["0.0 ms", "9.9 ms", "13 ms", "999 ms", "12.35 s"]);
        assert_eq!([0, 1023, 1024, 5 << 20].map(size), ["0 B", "1023 B", "1.0 KiB", "5.0 MiB"]);
    }

    #[test]
    fn levels_of_a_map_are_one_line() {
        let action = |name: &str| kiln_link::ActionTime {
            name: name.to_owned(),
            wall_ms: 2.0,
            reason: "first build".to_owned(),
        };
        let ran = vec![action("prefilter env/a/specular mip 1"), action("prefilter env/a/specular mip 2")];
        let lines = work_lines(&Work { ran, ..Work::default() });
        assert_eq!(lines.len(), 1);
        assert!(lines[0].contains("×2") && lines[0].contains("4.0 ms"), "{lines:?}");
    }
}
