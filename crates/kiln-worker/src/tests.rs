//! Children that misbehave. What sound ones do is tested with the real program (`tests/e2e/shaders.rs`).

use std::collections::BTreeSet;
use std::time::Duration;

use crate::{Died, Limits, Sources, Task, Workers};

const SHORT: Limits = Limits { cpu: Duration::from_millis(200), wall: Duration::from_secs(60) };

fn task() -> Task {
    let program = kiln_shader::Program::of("a.wgsl");
    Task::Compile { program, features: BTreeSet::new(), sources: Sources::default(), lints: false }
}

#[cfg(unix)]
fn died(script: &str, limits: Limits) -> Died {
    let workers = Workers::new("sh".into(), &["-c", script], limits);
    let died = workers.run(&task()).expect_err("that is no worker");
    assert!(workers.idle_ids().is_empty(), "a child that died is not used again");
    died
}

#[cfg(unix)]
#[test]
fn child_that_works_for_ever_is_ended_by_its_cpu_time() {
    assert_eq!(died("while :; do :; done", SHORT), Died::TooSlow(SHORT.cpu));
}

#[cfg(unix)]
#[test]
fn child_that_waits_for_ever_is_ended_by_the_clock() {
    let limits = Limits { wall: Duration::from_millis(200), ..SHORT };
    assert_eq!(died("sleep 1000", limits), Died::Stuck(limits.wall));
}

#[cfg(unix)]
#[test]
fn child_that_crashes_is_said_how() {
    assert_eq!(died("kill -SEGV $$", SHORT), Died::Crashed("ran out of stack".to_owned()));
    assert_eq!(
        died("kill -ABRT $$", SHORT),
        Died::Crashed("ran out of memory or stack and gave up".to_owned())
    );
    assert_eq!(died("kill -KILL $$", SHORT), Died::Killed);
    assert!(!Died::Killed.is_of_input() && Died::TooSlow(SHORT.cpu).is_of_input());
    let Died::Crashed(how) = died("exit 3", SHORT) else { panic!("it ended") };
    assert!(how.starts_with("ended early"), "{how}");
}

#[cfg(unix)]
#[test]
fn child_that_claims_a_message_without_end_is_not_believed() {
    let died = died("printf '\\377\\377\\377\\377'; sleep 1000", SHORT);
    assert!(matches!(&died, Died::NoWorker(why) if why.contains("4294967295 bytes")), "{died:?}");
}

#[test]
fn program_that_is_not_there_is_no_worker() {
    let workers = Workers::new("no-such-program".into(), &[], SHORT);
    assert!(matches!(workers.run(&task()), Err(Died::NoWorker(_))));
}

#[test]
fn deaths_name_the_shader_and_what_to_do() {
    let text = Died::TooSlow(Duration::from_secs(2)).diagnostic("a.wgsl").to_string();
    assert!(text.contains("ended after 2 s") && text.contains("a.wgsl") && text.contains("undo"), "{text}");
}
