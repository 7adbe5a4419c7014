//! `kiln graph`: sources, actions and targets as a picture.

use std::process::ExitCode;

use anyhow::Context as _;

use crate::args::{GraphArgs, GraphFormat};
use crate::commands::why::suggestion;
use crate::out::say;
use crate::picture::Picture;
use crate::{INPUT_IS_WRONG, place};

pub(crate) fn run(args: &GraphArgs) -> anyhow::Result<ExitCode> {
    let engine = place::open_engine(&args.dir)?;
    let _hold = engine.store().hold();
    let plan = kiln_project::plan(&engine, None).context("planning")?;
    let forecasts = engine.forecast(&plan.graph);
    let wanted = match &args.target {
        None => plan.graph.iter().map(|(id, _)| id).collect(),
        Some(target) => match plan.actions_of(target) {
            Some(first) => plan.graph.with_upstream(&first),
            None => {
                eprintln!("error: there is no target `{target}`{}", suggestion(target, &plan));
                return Ok(ExitCode::from(INPUT_IS_WRONG));
            }
        },
    };
    let picture = Picture::new(&plan, &forecasts, &wanted, args.target.as_deref());
    let by_extension =
        args.out.as_ref().and_then(|path| path.extension()).is_some_and(|extension| extension == "svg");
    let format = args.format.unwrap_or(if by_extension { GraphFormat::Svg } else { GraphFormat::Dot });
    let text = match format {
        GraphFormat::Dot => picture.to_dot(),
        GraphFormat::Svg => picture.to_svg(),
    };
    match &args.out {
        Some(path) => kiln_build::write_atomically(&kiln_build::Disk, path, text.as_bytes())
            .context("writing the picture")?,
        None => say!("{}", text.trim_end()),
    }
    Ok(ExitCode::SUCCESS)
}
