//! `--log`: what happens inside, as lines on standard error, for whoever looks for a fault. What a person asked for is not among it.

use std::str::FromStr;

use tracing_subscriber::filter::{LevelFilter, Targets};
use tracing_subscriber::layer::SubscriberExt as _;
use tracing_subscriber::util::SubscriberInitExt as _;

use crate::place;

/// Says the same as `--log`, where that is not given.
const VARIABLE: &str = "KILN_LOG";

/// What events are about, and who knows of it.
const TARGETS: [&str; 4] = ["watch", "build", "wire", "request"];

/// What is let through, as `info` or `info,wire=debug`.
#[derive(Clone, Debug, PartialEq)]
pub(crate) struct LogFilter(Targets);

impl FromStr for LogFilter {
    type Err = String;

    fn from_str(text: &str) -> Result<LogFilter, String> {
        let level = |name: &str| {
            let known = LevelFilter::from_str(name)
                .ok()
                .filter(|_| !name.is_empty() && !name.starts_with(|first: char| first.is_ascii_digit()));
            known.ok_or_else(|| {
                format!("`{name}` is no level; there are off, error, warn, info, debug and trace")
            })
        };
        let mut filter = Targets::new();
        for directive in text.split(',').map(str::trim) {
            filter = match directive.split_once('=') {
                None => filter.with_default(level(directive)?),
                Some((target, name)) if TARGETS.contains(&target) => filter.with_target(target, level(name)?),
                Some((target, _)) => {
                    return Err(format!("nothing is said of `{target}`; there are {}", TARGETS.join(", ")));
                }
            };
        }
        Ok(LogFilter(filter))
    }
}

/// Begins to write what `asked`, else the environment, lets through. Whether anything is.
pub(crate) fn start(asked: Option<&LogFilter>) -> anyhow::Result<bool> {
    let variable = std::env::var(VARIABLE).ok().filter(|text| !text.is_empty());
    let wrong = |reason: String| place::WrongInput(format!("{VARIABLE}: {reason}"));
    let filter = match (asked, variable) {
        (Some(filter), _) => filter.clone(),
        (None, Some(text)) => text.parse().map_err(wrong)?,
        (None, None) => return Ok(false),
    };
    let lines = tracing_subscriber::fmt::layer().with_writer(std::io::stderr);
    tracing_subscriber::registry().with(lines).with(filter.0).try_init()?;
    Ok(true)
}

#[cfg(test)]
mod tests {
    use tracing::Level;

    use super::*;

    #[test]
    fn levels_hold_for_all_and_for_one_target() {
        let LogFilter(filter) = "info, wire=trace,build=off".parse().unwrap();
        assert!(filter.would_enable("watch", &Level::INFO) && !filter.would_enable("watch", &Level::DEBUG));
        assert!(filter.would_enable("wire", &Level::TRACE) && !filter.would_enable("build", &Level::ERROR));
        let LogFilter(one) = "wire=warn".parse().unwrap();
        assert!(one.would_enable("wire", &Level::WARN) && !one.would_enable("watch", &Level::ERROR));
    }

    #[test]
    fn unknown_levels_and_targets_are_named() {
        for (text, named) in
            [("loud", "`loud` is no level"), ("sea=info", "`sea`"), ("", "`` is no level"), ("3", "`3`")]
        {
            let error = text.parse::<LogFilter>().unwrap_err();
            assert!(error.contains(named), "{error}");
        }
    }
}
