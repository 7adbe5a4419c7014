//! `kiln set`: values of parameters, written into the shaders that declare them.

use std::collections::BTreeMap;
use std::process::ExitCode;
use std::time::Duration;

use kiln_diagnostic::Diagnostic;
use kiln_link::{Answer, Ask, ParameterWrite};
use kiln_project::{ParameterValue, parse_parameter_value, write_parameters};

use super::add::{ask, say_answer};
use crate::args::SetArgs;
use crate::place;

const ANSWER_LIMIT: Duration = Duration::from_secs(60);

pub(crate) fn run(args: &SetArgs) -> anyhow::Result<ExitCode> {
    let engine = place::open_engine(&args.dir)?;
    let parse = |text: &String| parse_parameter_value(&engine, text);
    let values = match args.values.iter().map(parse).collect::<Result<Vec<ParameterValue>, Box<Diagnostic>>>()
    {
        Ok(values) => values,
        Err(fault) => return Ok(say_answer(&Answer::refused(0, *fault))),
    };
    let write = |value: &ParameterValue| ParameterWrite {
        shader: value.shader.clone(),
        name: value.name.clone(),
        value: value.value.clone(),
    };
    let parameters = values.iter().map(write).collect();
    let answer = match ask(&args.dir, Ask::WriteParameters { parameters }, ANSWER_LIMIT)? {
        Some(answer) => answer,
        None => match write_parameters(&engine, &values, &BTreeMap::new()) {
            Ok(written) => Answer { message: kiln_project::describe_written(&written), ..Answer::default() },
            Err(fault) => Answer::refused(0, *fault),
        },
    };
    Ok(say_answer(&answer))
}
