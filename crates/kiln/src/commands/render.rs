//! `kiln render`: builds a project and draws it, without a daemon or a window.

use std::path::{Path, PathBuf};
use std::process::ExitCode;
use std::sync::atomic::AtomicBool;
use std::time::Instant;

use anyhow::{Context as _, ensure};
use kiln_diagnostic::{Diagnostic, has_errors};
use kiln_gpu::Gpu;
use kiln_image::sheet::{Shot, shot_sheet};
use kiln_link::Revision;
use kiln_preview::{
    AnimationTime, ApplyReport, Assignment, Channel, DiffuseSource, FaultCounts, HeadlessViewer, Look,
    LookSheet, PassTime, PixelProbe, Selection,
};
use kiln_project::Wishes;
use kiln_shader::Widget;
use serde::Serialize;

use crate::args::{Diffuse, RenderArgs};
use crate::commands::bake::{progress_bar, show_progress};
use crate::out::say;
use crate::{INPUT_IS_WRONG, place, report};

/// Of pictures, where nothing says another.
const SIZE: [u32; 2] = [1280, 720];
/// Stands for every scene or environment of the project.
const ALL: &str = "all";

pub(crate) fn run(args: &RenderArgs) -> anyhow::Result<ExitCode> {
    let sheet = args.look.as_deref().map(read_sheet).transpose()?;
    let revision = build(args)?;
    let gpu = Gpu::headless().context("opening a graphics device")?;
    let size = args.size.or(sheet.as_ref().map(|sheet| sheet.size)).unwrap_or(SIZE);
    let mut session = Session::new(args, HeadlessViewer::new(gpu, size), &revision)?;
    if let Some(sheet) = sheet {
        session.draw_look(&revision, sheet.look)?;
        return session.finish(&revision);
    }
    for scene in chosen(&args.scene, &session.offered.scenes, "scene")? {
        for env in chosen(&args.env, &session.offered.envs, "environment")? {
            let variant = args.material_variant.clone();
            let diffuse = match args.diffuse {
                Diffuse::Map => DiffuseSource::Map,
                Diffuse::Harmonics => DiffuseSource::Harmonics,
            };
            let selection = Selection { scene: scene.clone(), env, variant, diffuse };
            session.draw_selection(&revision, selection)?;
        }
    }
    session.finish(&revision)
}

fn read_sheet(path: &Path) -> anyhow::Result<LookSheet> {
    let text = std::fs::read_to_string(path).map_err(|error| error.to_string());
    let sheet = text.and_then(|text| LookSheet::read(&text));
    sheet.map_err(|reason| place::WrongInput(format!("{} cannot be drawn: {reason}", path.display())).into())
}

fn build(args: &RenderArgs) -> anyhow::Result<Revision> {
    let engine = place::open_engine(&args.build.dir)?;
    let _hold = engine.store().hold();
    let bar = progress_bar();
    let progress = show_progress(&bar);
    let cancel = AtomicBool::new(false);
    let options = place::run_options(&args.build, true, &cancel, &progress);
    let inspect = !args.inspect.channel.is_empty() || args.inspect.mark_faults.is_some();
    let wishes = Wishes { inspect, ..Wishes::default() };
    let built = kiln_project::build_with(&engine, None, wishes, &options);
    bar.finish_and_clear();
    let built = built.context("building")?.context("the build was cancelled")?;
    engine.save_memory().context("remembering the build")?;
    kiln_daemon::to_revision(&engine, built).context("reading what was built")
}

/// What was asked for by name, each checked; the project's own choice where nothing was.
fn chosen(asked: &[String], offered: &[String], what: &str) -> anyhow::Result<Vec<Option<String>>> {
    if asked.is_empty() {
        return Ok(vec![None]);
    }
    if asked.iter().any(|name| name == ALL) {
        return Ok(offered.iter().cloned().map(Some).collect());
    }
    let check = |name: &String| {
        if offered.contains(name) {
            return Ok(Some(name.clone()));
        }
        let known = offered.join(", ");
        Err(place::WrongInput(format!("the project has no {what} `{name}`\n  help: it has {known}")).into())
    };
    asked.iter().map(check).collect()
}

/// A picture and how it came about.
#[derive(Debug, Serialize)]
struct Drawn {
    file: PathBuf,
    scene: Option<String>,
    env: Option<String>,
    /// Choice of the varied parameter.
    choice: Option<String>,
    frame: usize,
    /// Without reading it back.
    draw_ms: f64,
    /// What is shown in place of the picture.
    channel: Option<Channel>,
    /// Of each pass on the device; empty where it has no clocks.
    pass_ms: Vec<PassTime>,
    /// What `--probe` asked for.
    probe: Option<PixelProbe>,
    /// What `--mark-faults` counted.
    faults: Option<FaultCounts>,
}

/// Everything about one run.
#[derive(Debug, Serialize)]
struct Facts<'a> {
    adapter: String,
    pictures: &'a [Drawn],
    sheet: Option<&'a Path>,
    notes: Vec<String>,
    diagnostics: &'a [Diagnostic],
}

struct Session<'a> {
    args: &'a RenderArgs,
    viewer: HeadlessViewer,
    offered: ApplyReport,
    drawn: Vec<Drawn>,
    shots: Vec<Shot>,
    notes: Vec<String>,
    diagnostics: Vec<Diagnostic>,
}

impl<'a> Session<'a> {
    fn new(args: &'a RenderArgs, mut viewer: HeadlessViewer, revision: &Revision) -> anyhow::Result<Self> {
        std::fs::create_dir_all(&args.out)
            .with_context(|| format!("making the folder {}", args.out.display()))?;
        viewer.view.exposure_ev = args.exposure;
        (viewer.view.background, viewer.view.ground) = (args.background, args.ground);
        viewer.view.fault_limit = args.inspect.mark_faults;
        if args.single_sample {
            viewer.draw_single_samples();
        }
        let offered = viewer.apply(revision);
        let diagnostics = revision.table.diagnostics.clone();
        Ok(Session { args, viewer, offered, drawn: vec![], shots: vec![], notes: vec![], diagnostics })
    }

    fn draw_selection(&mut self, revision: &Revision, selection: Selection) -> anyhow::Result<()> {
        let mut applied = self.viewer.select(selection);
        if !self.args.param.is_empty() {
            applied = self.viewer.assign(&self.args.param).map_err(|it| place::WrongInput(it.to_string()))?;
        }
        if applied.shown.scene.is_none() {
            let number = revision.table.number;
            let reason = format!("the project has no scene that can be shown (revision {number})");
            return Err(place::WrongInput(reason).into());
        }
        self.notes.extend(
            applied.notes.iter().filter(|note| !self.notes.contains(note)).cloned().collect::<Vec<_>>(),
        );
        self.diagnostics.extend(applied.diagnostics.iter().cloned());
        if self.args.ground.catches_shadow && !applied.has_sun {
            let env = applied.shown.env.as_deref().unwrap_or_default();
            let note = format!("the ground shows no shadow: env/{env} has no sun that is a light of its own");
            if !self.notes.contains(&note) {
                self.notes.push(note);
            }
        }
        if let Some(name) = self.args.material_variant.as_ref().filter(|_| applied.shown.variant.is_none()) {
            return Err(unknown("material variant", name, &applied.variants));
        }
        self.viewer.view.scene_camera = match &self.args.camera {
            Some(name) => {
                place_of(name, &applied.cameras).ok_or_else(|| unknown("camera", name, &applied.cameras))?
            }
            None => 0,
        };
        self.viewer.view.animation = match &self.args.animation {
            Some(asked) => Some(AnimationTime { index: animation(asked, &applied)?, time_s: self.args.time }),
            None => None,
        };
        if self.args.inspect.channel.is_empty() {
            return self.draw_choices(&applied);
        }
        for &channel in &self.args.inspect.channel {
            if let Some(reason) = applied.inspection.refusal(channel) {
                return Err(
                    place::WrongInput(format!("channel `{channel}` cannot be shown: {reason}")).into()
                );
            }
            self.viewer.view.channel = Some(channel);
            self.draw_choices(&applied)?;
        }
        Ok(())
    }

    fn draw_choices(&mut self, applied: &ApplyReport) -> anyhow::Result<()> {
        match &self.args.vary {
            None => self.draw_frames(applied, None),
            Some(name) => {
                for choice in choices(name, applied)? {
                    let text = format!("{name}={choice}");
                    let assignment: Assignment = text.parse().map_err(place::WrongInput)?;
                    self.viewer.assign(&[assignment]).map_err(|it| place::WrongInput(it.to_string()))?;
                    self.draw_frames(applied, Some(&choice))?;
                }
                Ok(())
            }
        }
    }

    /// What a parameter sheet says; what it names and the project lacks is an error, not another picture.
    fn draw_look(&mut self, revision: &Revision, look: Look) -> anyhow::Result<()> {
        let Look { selection, view } = look;
        self.viewer.view = view;
        let mut applied = self.viewer.select(selection.clone());
        if !self.args.param.is_empty() {
            applied = self.viewer.assign(&self.args.param).map_err(|it| place::WrongInput(it.to_string()))?;
        }
        for (what, asked, shown) in [
            ("scene", &selection.scene, &applied.shown.scene),
            ("environment", &selection.env, &applied.shown.env),
            ("material variant", &selection.variant, &applied.shown.variant),
        ] {
            if let Some(name) = asked.as_ref().filter(|_| asked != shown) {
                let reason = format!("the sheet names the {what} `{name}`, which the project does not have");
                return Err(place::WrongInput(reason).into());
            }
        }
        ensure!(applied.shown.scene.is_some(), "revision {} has no scene to show", revision.table.number);
        self.notes.extend(applied.notes.iter().cloned());
        self.diagnostics.extend(applied.diagnostics.iter().cloned());
        self.draw_frames(&applied, None)
    }

    fn draw_frames(&mut self, applied: &ApplyReport, choice: Option<&str>) -> anyhow::Result<()> {
        let before = self.viewer.view.clone();
        for frame in 1..=self.args.frames {
            self.draw_frame(applied, choice, frame)?;
            self.viewer.view.environment_rotation_rad += self.args.turn.to_radians();
            if let Some(time) = &mut self.viewer.view.animation {
                // From the first frame on, so that no rounding adds up.
                let first_s = before.animation.map_or(0.0, |first| first.time_s);
                time.time_s = first_s + frame as f64 / self.args.fps;
            }
        }
        self.viewer.view = before;
        Ok(())
    }

    fn draw_frame(
        &mut self,
        applied: &ApplyReport,
        choice: Option<&str>,
        frame: usize,
    ) -> anyhow::Result<()> {
        let start = Instant::now();
        self.viewer.draw().context("drawing a frame")?;
        let draw_ms = start.elapsed().as_secs_f64() * 1e3;
        let pass_ms = self.viewer.take_pass_times().unwrap_or_default();
        let faults = match self.args.inspect.mark_faults {
            Some(_) => self.viewer.count_faults().context("counting faults")?,
            None => None,
        };
        let probe = match self.args.inspect.probe {
            Some(pixel) => Some(self.probe(pixel)?),
            None => None,
        };
        let picture = self.viewer.picture().context("reading a frame")?;
        let channel = self.viewer.view.channel;
        let shown = &applied.shown;
        let words = [shown.scene.as_deref(), shown.env.as_deref(), choice, channel.map(Channel::name)];
        let title = words.into_iter().flatten().collect::<Vec<_>>();
        let number = if self.args.frames > 1 { format!("_{frame:04}") } else { String::new() };
        let stem = format!("{}{number}", title.join("-").replace(['/', '\\'], "-"));
        let file = self.args.out.join(format!("{stem}.png"));
        picture.save(&file).with_context(|| format!("writing {}", file.display()))?;
        if self.args.exr {
            let radiance = self.viewer.radiance().context("reading a frame")?;
            let bytes = kiln_image::exr_write::encode_image(&radiance, kiln_image::Cancel::NEVER)?;
            kiln_build::write_atomically(&kiln_build::Disk, &file.with_extension("exr"), &bytes)
                .context("writing the radiance")?;
        }
        if self.args.sheet.is_some() {
            let rgb = picture.pixels().flat_map(|pixel| [pixel[0], pixel[1], pixel[2]]).collect();
            let [width, height] = [picture.width(), picture.height()].map(|pixels| pixels as usize);
            self.shots.push(Shot { title: title.join(", ") + &number, width, height, rgb });
        }
        let (scene, env) = (shown.scene.clone(), shown.env.clone());
        let choice = choice.map(str::to_owned);
        self.drawn.push(Drawn { file, scene, env, choice, frame, draw_ms, channel, pass_ms, probe, faults });
        Ok(())
    }

    fn probe(&mut self, pixel: [u32; 2]) -> anyhow::Result<PixelProbe> {
        let [width, height] = self.viewer.size();
        let outside = || {
            let [x, y] = pixel;
            place::WrongInput(format!(
                "the pixel {x},{y} is outside of the picture of {width}x{height} pixels"
            ))
        };
        let probe = self.viewer.probe(pixel).context("reading a pixel")?;
        Ok(probe.ok_or_else(outside)?)
    }

    fn finish(self, revision: &Revision) -> anyhow::Result<ExitCode> {
        let errors = self.viewer.gpu().take_errors();
        ensure!(errors.is_empty(), "the graphics device reported: {}", errors.join("; "));
        if let Some(path) = &self.args.sheet {
            // A row for each scene under each light.
            let rows = self.drawn.iter().map(|drawn| (&drawn.scene, &drawn.env));
            let rows = rows.collect::<std::collections::BTreeSet<_>>().len().max(1);
            let (width, height, rgb) = shot_sheet(&self.shots, (self.shots.len() / rows).clamp(1, 8));
            let png = kiln_image::png::encode_rgb8(width, height, &rgb);
            kiln_build::write_atomically(&kiln_build::Disk, path, &png).context("writing the sheet")?;
        }
        let facts = Facts {
            adapter: self.viewer.gpu().description(),
            pictures: &self.drawn,
            sheet: self.args.sheet.as_deref(),
            notes: self.notes,
            diagnostics: &self.diagnostics,
        };
        if self.args.build.json {
            say!("{}", serde_json::to_string_pretty(&facts)?);
        } else {
            report::print_diagnostics(facts.diagnostics, false);
            facts.notes.iter().for_each(|note| say!("note: {note}"));
            say!("{} on {}", report::revision_line(&revision.table), facts.adapter);
            for drawn in facts.pictures {
                say!("{}  ({})", drawn.file.display(), report::duration(drawn.draw_ms));
                if let Some(probe) = &drawn.probe {
                    say!("  {}", serde_json::to_string(probe)?);
                }
                if let Some(FaultCounts { nan, infinite, negative, over_range }) = drawn.faults {
                    say!(
                        "  pixels: {nan} NaN, {infinite} infinite, {negative} negative, {over_range} over range"
                    );
                }
            }
            if let Some(sheet) = facts.sheet {
                say!("{}", sheet.display());
            }
        }
        Ok(if has_errors(facts.diagnostics) { ExitCode::from(INPUT_IS_WRONG) } else { ExitCode::SUCCESS })
    }
}

fn place_of(name: &str, names: &[String]) -> Option<usize> {
    names.iter().position(|known| known == name)
}

/// The animation of that name, else of that number.
fn animation(asked: &str, applied: &ApplyReport) -> anyhow::Result<usize> {
    let names: Vec<String> = applied.animations.iter().map(|animation| animation.name.clone()).collect();
    let by_number = || asked.parse().ok().filter(|index: &usize| *index < names.len());
    place_of(asked, &names).or_else(by_number).ok_or_else(|| unknown("animation", asked, &names))
}

fn unknown(what: &str, name: &str, known: &[String]) -> anyhow::Error {
    let known = if known.is_empty() { "none".to_owned() } else { known.join(", ") };
    place::WrongInput(format!("the scene has no {what} `{name}`\n  help: it has {known}")).into()
}

/// The names that a parameter with a list offers.
fn choices(name: &str, applied: &ApplyReport) -> anyhow::Result<Vec<String>> {
    let is_it = |offered: &str, full: &str| offered == name || full == name;
    let found = applied.parameters.iter().find(|offered| is_it(&offered.name, &offered.full_name()));
    match found.map(|offered| &offered.widget) {
        Some(Widget::Choice { names }) => Ok(names.clone()),
        Some(_) => Err(place::WrongInput(format!(
            "`{name}` has no list of choices to vary\n  help: `--param {name}=VALUE` sets it"
        ))
        .into()),
        None => {
            let lists = applied.parameters.iter().filter(|it| matches!(it.widget, Widget::Choice { .. }));
            let known: Vec<String> = lists.map(|offered| offered.full_name()).collect();
            let help = if known.is_empty() { "none has a list".to_owned() } else { known.join(", ") };
            Err(place::WrongInput(format!("no shader in use offers `{name}`\n  help: to vary: {help}"))
                .into())
        }
    }
}
