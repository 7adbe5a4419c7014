//! What CI holds on to: the errors and the counted work of an earlier report.

use crate::report::{Environment, Report};

/// Errors may grow by this factor: probes and rounding are the same, so only a change of the code moves them.
const ERROR_FACTOR: f64 = 1.05;
/// Counted work may grow by this factor.
const WORK_FACTOR: f64 = 1.05;

/// Something that got worse, with the artefact that it is of.
#[derive(Clone, Debug, PartialEq)]
pub struct Regression {
    /// As targets are called: `env/NAME/specular`.
    pub artefact: String,
    /// What is wrong, with both values.
    pub reason: String,
}

/// The target that a lobe's chain is.
fn artefact(environment: &Environment, lobe: crate::LobeKind) -> String {
    let map = match lobe {
        crate::LobeKind::Ggx => "specular",
        crate::LobeKind::Lambert => "irradiance",
        crate::LobeKind::Charlie => "sheen",
    };
    format!("env/{}/{map}", environment.name)
}

/// NaN is above every limit.
fn is_above(error: f64, limit: f64) -> bool {
    error > limit || error.is_nan()
}

/// Chains whose level with the largest RMS error is above `error_max`.
pub fn over_limit(report: &Report, error_max: f64) -> Vec<Regression> {
    let mut found = Vec::new();
    for environment in &report.environments {
        for chain in &environment.choice.chains {
            if is_above(chain.worst_rms, error_max) {
                let reason =
                    format!("its error {:.2e} is above --max-error {error_max:.2e}", chain.worst_rms);
                found.push(Regression { artefact: artefact(environment, chain.lobe), reason });
            }
        }
    }
    found
}

/// Chains that are worse than in `baseline`, or need more work, or are gone.
pub fn regressions(report: &Report, baseline: &Report) -> Vec<Regression> {
    let mut found = Vec::new();
    for old in &baseline.environments {
        let new = report.environments.iter().find(|new| new.name == old.name);
        for before in &old.choice.chains {
            let artefact = artefact(old, before.lobe);
            let after = new.and_then(|new| new.choice.chains.iter().find(|chain| chain.lobe == before.lobe));
            let Some(after) = after else {
                let reason = "the baseline has it, this report does not".to_owned();
                found.push(Regression { artefact, reason });
                continue;
            };
            if is_above(after.worst_rms, before.worst_rms * ERROR_FACTOR) {
                let reason =
                    format!("its error grew from {:.3e} to {:.3e}", before.worst_rms, after.worst_rms);
                found.push(Regression { artefact: artefact.clone(), reason });
            }
            let (work, limit) = (after.work.flops, before.work.flops as f64 * WORK_FACTOR);
            if work as f64 > limit {
                let reason = format!("its counted work grew from {} to {work} operations", before.work.flops);
                found.push(Regression { artefact, reason });
            }
        }
    }
    found
}

#[cfg(test)]
mod tests {
    use super::{over_limit, regressions};
    use crate::report::{Choice, ChosenChain, Environment, Report, SCHEMA};
    use crate::{ErrorNorms, Estimator, LobeKind, Work};

    fn report(worst_rms: f64, flops: u64) -> Report {
        let chain = ChosenChain {
            lobe: LobeKind::Ggx,
            error: ErrorNorms::default(),
            worst_rms,
            work: Work { flops, ..Work::default() },
            seconds: 0.0,
        };
        let choice = Choice {
            estimator: Estimator::Convolution,
            error: 1e-3,
            format: "rgba16f".to_owned(),
            chains: vec![chain],
            bytes: 0,
            reasons: Vec::new(),
        };
        let environment = Environment {
            name: "sky".to_owned(),
            width: 2,
            height: 1,
            peak: 1.0,
            mean: [1.0; 3],
            face_size: 4,
            law: "linear".to_owned(),
            lobes: Vec::new(),
            tables: Vec::new(),
            ladder: None,
            choice,
        };
        Report { schema: SCHEMA, environments: vec![environment] }
    }

    #[test]
    fn worse_errors_more_work_and_missing_chains_are_named() {
        let old = report(1e-3, 1000);
        assert!(regressions(&report(1.04e-3, 1040), &old).is_empty());
        let worse = regressions(&report(2e-3, 2000), &old);
        assert_eq!(worse.len(), 2);
        assert!(worse.iter().all(|one| one.artefact == "env/sky/specular"), "{worse:?}");
        assert_eq!(regressions(&Report { schema: SCHEMA, environments: Vec::new() }, &old).len(), 1);
        assert_eq!(regressions(&report(f64::NAN, 1000), &old).len(), 1, "NaN is no improvement");
        assert_eq!((over_limit(&old, 2e-3).len(), over_limit(&old, 5e-4).len()), (0, 1));
    }
}
