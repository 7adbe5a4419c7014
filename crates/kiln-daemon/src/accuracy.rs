//! Errors that clients ask for while they are there, and who still waits for the revision that has theirs.

use std::collections::BTreeMap;

use kiln_diagnostic::Diagnostic;
use kiln_link::Answer;

/// A request that is answered by the next revision made for it.
#[derive(Debug, PartialEq)]
struct Open {
    client: u64,
    id: u64,
    env: String,
    error: Option<f64>,
}

/// What each client asks for. Bounded: a client has one error for an environment of the project, and one open request for it.
#[derive(Debug, Default)]
pub(crate) struct Accuracy {
    asked: BTreeMap<(u64, String), f64>,
    open: Vec<Open>,
}

impl Accuracy {
    /// A client asks for an error, or for none any more. What it asked before for this environment is answered: it will not be.
    pub(crate) fn ask(&mut self, client: u64, id: u64, env: &str, error: Option<f64>) -> Vec<(u64, Answer)> {
        let is_older = |open: &mut Open| open.client == client && open.env == env;
        let older: Vec<Open> = self.open.extract_if(.., is_older).collect();
        match error {
            Some(error) => _ = self.asked.insert((client, env.to_owned()), error),
            None => _ = self.asked.remove(&(client, env.to_owned())),
        }
        self.open.push(Open { client, id, env: env.to_owned(), error });
        let superseded = |open: Open| {
            let note = Diagnostic::note("another error was asked for before this one was baked");
            (open.client, Answer { id: open.id, diagnostics: vec![note], ..Answer::default() })
        };
        older.into_iter().map(superseded).collect()
    }

    /// A client is gone, and what it asked for with it.
    pub(crate) fn forget(&mut self, client: u64) {
        self.asked.retain(|(asker, _), _| *asker != client);
        self.open.retain(|open| open.client != client);
    }

    /// Each environment's error: the most exact that any client asks for.
    pub(crate) fn errors(&self) -> BTreeMap<String, f64> {
        let mut errors = BTreeMap::new();
        for ((_, env), error) in &self.asked {
            errors
                .entry(env.clone())
                .and_modify(|known: &mut f64| *known = error.min(*known))
                .or_insert(*error);
        }
        errors
    }

    /// The answers to what a build for `errors` fulfilled.
    pub(crate) fn fulfil(&mut self, errors: &BTreeMap<String, f64>, revision: u64) -> Vec<(u64, Answer)> {
        let now = self.errors();
        let is_done = |open: &mut Open| now.get(&open.env) == errors.get(&open.env);
        let done: Vec<Open> = self.open.extract_if(.., is_done).collect();
        let answer = |open: Open| {
            let error = errors
                .get(&open.env)
                .map_or("the error of kiln.toml".to_owned(), |error| format!("an error of {error}"));
            let mut answer = Answer {
                id: open.id,
                message: format!("revision {revision} has {} at {error}", open.env),
                targets: vec![format!("env/{}", open.env)],
                revision: Some(revision),
                ..Answer::default()
            };
            if open.error.is_some() && open.error.as_ref() != errors.get(&open.env) {
                answer.diagnostics.push(Diagnostic::note("another client asks for a more exact one"));
            }
            (open.client, answer)
        };
        done.into_iter().map(answer).collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn errors(pairs: &[(&str, f64)]) -> BTreeMap<String, f64> {
        pairs.iter().map(|(env, error)| ((*env).to_owned(), *error)).collect()
    }

    #[test]
    fn most_exact_error_counts_until_its_client_goes() {
        let mut accuracy = Accuracy::default();
        accuracy.ask(1, 1, "sky", Some(1e-2));
        accuracy.ask(2, 1, "sky", Some(1e-4));
        accuracy.ask(2, 2, "dusk", Some(0.5));
        assert_eq!(accuracy.errors(), errors(&[("sky", 1e-4), ("dusk", 0.5)]));
        accuracy.forget(2);
        assert_eq!(accuracy.errors(), errors(&[("sky", 1e-2)]));
        accuracy.ask(1, 2, "sky", None);
        assert_eq!(accuracy.errors(), errors(&[]));
    }

    #[test]
    fn request_is_answered_once_by_the_build_that_has_it_or_by_its_successor() {
        let mut accuracy = Accuracy::default();
        assert!(accuracy.ask(1, 1, "sky", Some(1e-2)).is_empty());
        let superseded = accuracy.ask(1, 2, "sky", Some(1e-3));
        assert_eq!((superseded[0].1.id, superseded[0].1.revision), (1, None));
        assert!(accuracy.fulfil(&errors(&[("sky", 1e-2)]), 6).is_empty(), "a build for the older one");
        let done = accuracy.fulfil(&errors(&[("sky", 1e-3)]), 7);
        assert_eq!((done[0].1.id, done[0].1.revision, done[0].1.is_done()), (2, Some(7), true));
        assert_eq!(done[0].1.targets, ["env/sky"]);
        assert!(accuracy.fulfil(&errors(&[("sky", 1e-3)]), 8).is_empty());
    }

    #[test]
    fn who_asks_for_less_than_another_is_told_so() {
        let mut accuracy = Accuracy::default();
        accuracy.ask(1, 1, "sky", Some(1e-4));
        accuracy.ask(2, 1, "sky", Some(1e-1));
        let done = accuracy.fulfil(&accuracy.errors(), 3);
        let notes: Vec<usize> = done.iter().map(|(_, answer)| answer.diagnostics.len()).collect();
        assert_eq!(notes, [0, 1]);
    }
}
