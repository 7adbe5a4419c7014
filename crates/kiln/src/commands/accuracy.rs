//! `kiln accuracy`: what accuracy costs in time, on one's own environments.

mod against;
mod inputs;

use std::path::Path;
use std::process::ExitCode;
use std::time::Instant;

use anyhow::Context as _;
use indicatif::{ProgressBar, ProgressStyle};
use kiln_accuracy::{
    Curve, Environment, Estimator, LobeKind, Pictures, Regression, Report, Request, SCHEMA, Stopwatch,
    examine, number, over_limit, page, regressions, tables,
};
use kiln_image::Cancel;

use crate::args::AccuracyArgs;
use crate::out::say;
use crate::place::WrongInput;
use crate::{INPUT_IS_WRONG, report};

/// Names of the files.
const JSON: &str = "accuracy.json";
const HTML: &str = "accuracy.html";

pub(crate) fn run(args: &AccuracyArgs) -> anyhow::Result<ExitCode> {
    let start = Instant::now();
    let estimators = estimators(&args.estimators)?;
    let lobes = lobes(&args.lobes)?;
    let baseline = args.baseline.as_deref().map(read_report).transpose()?;
    if args.max_error.is_some_and(|error| error.is_nan() || error <= 0.0) {
        return Err(wrong("--max-error is an error above 0, as 1e-3".to_owned()));
    }
    let inputs = inputs::inputs(args, &lobes)?;
    if let Some(map) = &args.against {
        return against::run(args, &inputs, map);
    }
    let bar = spinner();
    let watch = OneThread::new()?;
    let mut examined: Vec<(Environment, Pictures)> = Vec::new();
    for input in &inputs {
        let panorama = input.panorama()?;
        let request = Request {
            name: &input.name,
            panorama: &panorama,
            lobes: &input.lobes,
            estimators: &estimators,
            face_size: input.face_size,
            law: &input.law,
            error: input.error,
            format: input.format,
            probes: args.probes,
        };
        let tell = |step: &str| bar.set_message(format!("{}: {step}", input.name));
        examined.push(examine(&request, &watch, &tell, Cancel::NEVER).context("measuring")?);
    }
    bar.set_message("BRDF tables");
    if let Some((first, _)) = examined.first_mut() {
        first.tables = tables(Cancel::NEVER).context("measuring tables")?;
    }
    bar.finish_and_clear();
    let html = page(&examined);
    let environments = examined.into_iter().map(|(environment, _)| environment).collect();
    let report = Report { schema: SCHEMA, environments };
    let json = serde_json::to_string_pretty(&report).context("writing the report as JSON")?;
    std::fs::create_dir_all(&args.out).with_context(|| format!("making {}", args.out.display()))?;
    for (name, text) in [(JSON, &json), (HTML, &html)] {
        let path = args.out.join(name);
        kiln_build::write_atomically(&kiln_build::Disk, &path, text.as_bytes())
            .with_context(|| format!("writing {}", path.display()))?;
    }
    if args.json {
        say!("{json}");
    } else {
        report.environments.iter().for_each(print_environment);
        let seconds = start.elapsed().as_secs_f64();
        say!("wrote {} in {}", args.out.join(HTML).display(), report::duration(seconds * 1e3));
    }
    Ok(judge(args, &report, baseline.as_ref()))
}

/// What CI wants to know.
fn judge(args: &AccuracyArgs, report: &Report, baseline: Option<&Report>) -> ExitCode {
    let mut found: Vec<Regression> = args.max_error.map_or_else(Vec::new, |error| over_limit(report, error));
    found.extend(baseline.map_or_else(Vec::new, |baseline| regressions(report, baseline)));
    for Regression { artefact, reason } in &found {
        eprintln!("error: {artefact}: {reason}");
    }
    if found.is_empty() { ExitCode::SUCCESS } else { ExitCode::from(INPUT_IS_WRONG) }
}

fn wrong(message: String) -> anyhow::Error {
    WrongInput(message).into()
}

fn estimators(names: &[String]) -> anyhow::Result<Vec<Estimator>> {
    if names.is_empty() {
        return Ok(Estimator::ALL.to_vec());
    }
    let parsed =
        names.iter().map(|name| Estimator::parse(name.trim()).map_err(|error| wrong(error.to_string())));
    parsed.collect()
}

fn lobes(names: &[String]) -> anyhow::Result<Vec<LobeKind>> {
    let lobe = |name: &String| {
        let known = LobeKind::ALL.into_iter().find(|lobe| lobe.name() == name.trim());
        known.ok_or_else(|| wrong(format!("no lobe is called `{name}`; there are: ggx, lambert, charlie")))
    };
    names.iter().map(lobe).collect()
}

fn read_report(path: &Path) -> anyhow::Result<Report> {
    let text = std::fs::read_to_string(path)
        .map_err(|error| wrong(format!("cannot read the baseline {}: {error}", path.display())))?;
    let report: Report = serde_json::from_str(&text).map_err(|error| {
        let help = "it must be an accuracy.json that this version of `kiln accuracy` wrote";
        wrong(format!("the baseline {} is no report: {error}\n  help: {help}", path.display()))
    })?;
    if report.schema != SCHEMA {
        let message =
            format!("the baseline has schema {}, this version reads {SCHEMA}: make it anew", report.schema);
        return Err(wrong(message));
    }
    Ok(report)
}

fn spinner() -> ProgressBar {
    let bar = ProgressBar::new_spinner();
    if let Ok(style) = ProgressStyle::with_template("{spinner} {elapsed:>4}  {wide_msg}") {
        bar.set_style(style);
    }
    bar
}

/// Measures work on one thread, so that seconds are those of one core.
struct OneThread(rayon::ThreadPool);

impl OneThread {
    fn new() -> anyhow::Result<OneThread> {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(1).build();
        Ok(OneThread(pool.context("starting the thread that is timed")?))
    }
}

impl Stopwatch for OneThread {
    fn seconds(&self, work: &mut (dyn FnMut() + Send)) -> f64 {
        self.0.install(|| {
            let start = thread_seconds();
            work();
            thread_seconds() - start
        })
    }
}

/// CPU time of this thread: what other programs take of the core is not in it.
#[cfg(unix)]
fn thread_seconds() -> f64 {
    let time = rustix::time::clock_gettime(rustix::time::ClockId::ThreadCPUTime);
    time.tv_sec as f64 + 1e-9 * time.tv_nsec as f64
}

/// Where there is no such clock, time on the wall since the first call.
#[cfg(not(unix))]
fn thread_seconds() -> f64 {
    static START: std::sync::OnceLock<Instant> = std::sync::OnceLock::new();
    START.get_or_init(Instant::now).elapsed().as_secs_f64()
}

fn print_environment(environment: &Environment) {
    let Environment { name, width, height, peak, face_size, law, choice, .. } = environment;
    say!("{name}: {width} × {height}, brightest {peak:.4}; chain from faces of {face_size}, roughness {law}");
    for lobe in &environment.lobes {
        say!(
            "  {:<18} {:>9} {:>9} {:>9} {:>9} {:>10} {:>10}",
            lobe.lobe.name(),
            "knob",
            "RMS",
            "95 %",
            "largest",
            "seconds",
            "operations"
        );
        for curve in &lobe.curves {
            print_curve(curve);
        }
    }
    if let Some(ladder) = &environment.ladder {
        say!("  the ladder of errors");
        for rung in &ladder.rungs {
            let mark = if rung.name == ladder.dominant { "<- largest" } else { "" };
            say!("    {:<16} {:>9.1e}  {} {mark}", rung.name, rung.rms, rung.what);
        }
    }
    say!("  Kiln bakes: {}, error {}, {}", choice.estimator.name(), number(choice.error), choice.format);
    for reason in &choice.reasons {
        say!("    {reason}");
    }
}

/// The usual setting of an estimator, of Kiln's own all.
fn print_curve(curve: &Curve) {
    for point in &curve.points {
        if curve.estimator == Estimator::Convolution || point.knob == nearest_usual(curve) {
            let error = point.error;
            say!(
                "    {:<16} {:>9} {:>9.1e} {:>9.1e} {:>9.1e} {:>10.3} {:>10.1e}",
                curve.estimator.name(),
                number(point.knob),
                error.rms,
                error.p95,
                error.max,
                point.seconds,
                point.work.flops as f64
            );
        }
    }
}

/// The measured knob that is nearest to the usual one.
fn nearest_usual(curve: &Curve) -> f64 {
    let usual = curve.estimator.usual_knob().ln();
    let knobs = curve.points.iter().map(|point| point.knob);
    knobs.min_by(|a, b| (a.ln() - usual).abs().total_cmp(&(b.ln() - usual).abs())).unwrap_or(0.0)
}
