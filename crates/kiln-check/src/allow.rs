//! What an author knows of and lets pass, with the reason.

use kiln_diagnostic::Severity;

use crate::{Check, Finding, Subject};

/// A line of `[check] allow`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Allowance {
    /// The check whose findings pass.
    pub check: Check,
    /// The subjects: a name, or the beginning of names followed by `*`.
    pub target: String,
    /// Why.
    pub reason: String,
}

impl Allowance {
    /// Whether it is about a subject.
    pub fn covers(&self, subject: &str) -> bool {
        match self.target.strip_suffix('*') {
            Some(beginning) => subject.starts_with(beginning),
            None => subject == self.target,
        }
    }
}

/// Marks what is allowed. An allowance that excuses nothing is a warning of its own, as it may hide what comes next: on `file`,
/// where it stands.
pub fn allow(subjects: &mut Vec<Subject>, allowances: &[Allowance], file: &str) {
    let mut unused = Subject::new(file, "allowances");
    for allowance in allowances {
        let covered = subjects.iter_mut().filter(|subject| allowance.covers(&subject.name));
        let findings = covered.flat_map(|subject| &mut subject.findings);
        let mut count = 0;
        for finding in findings.filter(|finding| finding.check == allowance.check) {
            finding.allowed.get_or_insert_with(|| allowance.reason.clone());
            count += 1;
        }
        if count == 0 {
            let message = format!(
                "`{}` is allowed on `{}`, which has no such finding",
                allowance.check.name(),
                allowance.target
            );
            let finding = Finding::new(Check::UnusedAllowance, Severity::Warning, message);
            unused
                .findings
                .push(finding.with_help("take the line out of `[check] allow`, or correct its target"));
        }
    }
    if !unused.findings.is_empty() {
        subjects.push(unused);
    }
}
