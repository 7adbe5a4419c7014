//! Whole daemons whose clients ask for another error than kiln.toml says.

use std::fs;
use std::path::Path;
use std::sync::Arc;

use kiln_build::Digest;
use kiln_link::{Answer, Ask, Client, ClientEvent, Quality, Revision, ask};

use super::LIMIT;
use super::live::Running;

/// A panorama with something in it: a bright spot on a slope.
fn source(folder: &Path) {
    let texel = |index: usize| {
        let (x, y) = (index % 64, index / 64);
        if (x, y) == (20, 10) { [128, 128, 128, 140] } else { [x as u8 + 40, y as u8 + 60, 90, 128] }
    };
    let mut bytes = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 32 +X 64\n".to_vec();
    bytes.extend((0..64 * 32).flat_map(texel));
    fs::write(folder.join("project/sky.hdr"), bytes).unwrap();
}

struct Looker(Client);

impl Looker {
    fn new(daemon: &Running, name: &str) -> Looker {
        Looker(Client::connect(daemon.socket.clone(), name))
    }

    fn revision(&self, is_wanted: impl Fn(&Revision) -> bool) -> Arc<Revision> {
        loop {
            if let ClientEvent::Revision(revision) = self.0.events().recv_timeout(LIMIT).expect("a revision")
                && is_wanted(&revision)
            {
                return revision;
            }
        }
    }

    fn ask(&self, error: Option<f64>) -> u64 {
        self.0.request(Ask::BakeAtError { env: "sky".to_owned(), error }).unwrap()
    }

    fn answer(&self, id: u64) -> Answer {
        loop {
            if let ClientEvent::Answer(answer) = self.0.events().recv_timeout(LIMIT).expect("an answer")
                && answer.id == id
            {
                return answer;
            }
        }
    }
}

fn specular(revision: &Revision) -> Vec<Digest> {
    revision.table.targets["env/sky/specular"].parts.iter().map(|part| part.digest).collect()
}

#[test]
fn client_bakes_at_its_own_error_until_it_goes_and_no_source_is_touched() {
    let daemon = Running::start(None, source);
    let toml = fs::read(daemon.path("project/kiln.toml")).unwrap();
    let onlooker = Looker::new(&daemon, "looks on");
    let plain = specular(&onlooker.revision(|_| true));
    let slider = Looker::new(&daemon, "slider");
    slider.revision(|_| true);
    let coarse = slider.answer(slider.ask(Some(0.5)));
    assert!(coarse.is_done(), "{coarse:?}");
    assert_eq!(coarse.targets, ["env/sky"]);
    let number = coarse.revision.expect("it names the revision");
    let seen = onlooker.revision(|revision| revision.table.number >= number);
    assert_ne!(specular(&seen), plain, "half of everything may be wrong, and nothing is different");
    drop(slider);
    onlooker.revision(|revision| revision.table.number > number && specular(revision) == plain);
    assert_eq!(fs::read(daemon.path("project/kiln.toml")).unwrap(), toml);
    assert!(!daemon.path("project/baked").exists());
}

#[test]
fn most_exact_of_two_clients_is_heeded_and_the_other_hears_of_it() {
    let daemon = Running::start(None, source);
    let slider = Looker::new(&daemon, "slider");
    let plain = specular(&slider.revision(|_| true));
    let exact = Looker::new(&daemon, "exact");
    exact.revision(|_| true);
    exact.answer(exact.ask(Some(1e-3)));
    let alone = slider.answer(slider.ask(None));
    assert!(alone.is_done(), "{alone:?}");
    let again = slider.answer(slider.ask(Some(0.4)));
    assert!(again.is_done() && !again.diagnostics.is_empty(), "{again:?}");
    let number = again.revision.unwrap();
    drop(exact);
    let left = slider.revision(|revision| revision.table.number > number);
    assert_ne!(specular(&left), plain, "the one that stays has its own error now");
}

#[test]
fn many_errors_one_after_the_other_end_with_the_last_and_each_is_answered() {
    let daemon = Running::start(None, source);
    let slider = Looker::new(&daemon, "slider");
    let plain = specular(&slider.revision(|_| true));
    let ids: Vec<u64> = (1..=10).map(|step| slider.ask(Some(0.05 * f64::from(step)))).collect();
    let answers: Vec<Answer> = ids.iter().map(|id| slider.answer(*id)).collect();
    assert!(answers.iter().all(Answer::is_done));
    assert!(answers.last().is_some_and(|last| last.revision.is_some()), "{answers:?}");
    let back = slider.answer(slider.ask(None));
    assert!(back.message.contains("the error of kiln.toml"), "{back:?}");
    let last = Looker::new(&daemon, "later").revision(|_| true);
    assert_eq!(specular(&last), plain);
}

#[test]
fn error_for_nothing_that_is_there_or_without_following_is_refused() {
    let daemon = Running::start(None, source);
    let slider = Looker::new(&daemon, "slider");
    slider.revision(|_| true);
    let unknown = slider.0.request(Ask::BakeAtError { env: "dusk".to_owned(), error: Some(0.1) }).unwrap();
    let refused = slider.answer(unknown);
    assert!(refused.diagnostics[0].message.contains("no environment `dusk`"), "{refused:?}");
    assert!(slider.0.request(Ask::BakeAtError { env: "sky".to_owned(), error: Some(2.0) }).is_err());
    let passing =
        ask(&daemon.socket, Ask::BakeAtError { env: "sky".to_owned(), error: Some(0.1) }, LIMIT).unwrap();
    assert!(!passing.is_done() && passing.diagnostics[0].message.contains("follows"), "{passing:?}");
}

#[test]
fn quality_that_a_client_needs_is_known_to_the_daemon() {
    let daemon = Running::start(None, source);
    let first = Looker::new(&daemon, "first");
    first.0.want_at(vec![("env/sky".to_owned(), Quality::Draft), ("lut".to_owned(), Quality::Final)]);
    daemon.wait_until(|status| {
        status.clients.iter().any(|client| client.qualities.get("env/sky") == Some(&Quality::Draft))
    });
}
