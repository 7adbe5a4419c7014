//! Which shaders a command is about, their variants, and compiling them.

use std::collections::{BTreeMap, BTreeSet};
use std::panic::resume_unwind;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex, PoisonError};

use anyhow::Context as _;
use kiln_diagnostic::Diagnostic;
use kiln_project::{PROJECT_FILE, Project, variant_name};
use kiln_shader::{Outcome, Program};
use kiln_worker::{Died, Sources};

use crate::args::SubjectArgs;
use crate::place::{self, WrongInput};

/// Longest file that is read: the compiler refuses what is longer than 1 MiB, and says so.
const FILE_BYTES_MAX: u64 = 2 << 20;

/// A shader with all it may need.
pub(super) struct Subject {
    /// What people call it: its name in a project, or its first file.
    pub(super) name: String,
    /// The folder that paths are relative to.
    pub(super) base: PathBuf,
    pub(super) program: Program,
    /// Features that its conditions name.
    pub(super) features: BTreeSet<String>,
    /// Feature sets to compile.
    pub(super) asked: BTreeSet<BTreeSet<String>>,
    sources: Sources,
}

/// A variant that is compiled: all asked sets that cannot differ.
pub(super) struct Variant {
    /// The asked sets, by name.
    pub(super) names: Vec<String>,
    pub(super) outcome: Outcome,
}

/// The shaders that a command line names. What is wrong with the projects among them comes too.
pub(super) fn subjects(args: &SubjectArgs) -> anyhow::Result<(Vec<Subject>, Vec<Diagnostic>)> {
    let (mut subjects, mut diagnostics) = (Vec::new(), Vec::new());
    let variant = |name: &String| kiln_project::parse_variant(name).map_err(WrongInput);
    let variants: BTreeSet<_> = args.variants.iter().map(variant).collect::<Result<_, _>>()?;
    let mut programs: BTreeMap<(PathBuf, String), Vec<PathBuf>> = BTreeMap::new();
    for path in &args.files {
        if path.is_dir() {
            of_project(path, &variants, &mut subjects, &mut diagnostics)?;
            continue;
        }
        let file = path.canonicalize().ok().filter(|file| file.is_file());
        let file =
            file.ok_or_else(|| WrongInput(format!("{} is no file that can be read", path.display())))?;
        if !is_shader(&file) {
            let message = format!(
                "{} is no shader: their names end in .wgsl .vert .frag .comp or .glsl",
                path.display()
            );
            return Err(WrongInput(message).into());
        }
        programs.entry(program_of(&file)).or_default().push(file);
    }
    for (_, files) in programs {
        subjects.push(of_files(files, args, &variants)?);
    }
    // A module that another of these imports is checked where it is used, under that one's features.
    let imported: BTreeSet<PathBuf> = subjects.iter().flat_map(Subject::imported).collect();
    subjects.retain(|subject| !imported.contains(&subject.base.join(subject.program.subject())));
    Ok((subjects, diagnostics))
}

/// Ends of the names of shader files.
const EXTENSIONS: [&str; 8] = ["wgsl", "vert", "frag", "comp", "glsl", "geom", "tesc", "tese"];

/// Whether a file's name is that of a shader.
pub(crate) fn is_shader(file: &Path) -> bool {
    let extension = file.extension().unwrap_or_default().to_string_lossy().to_ascii_lowercase();
    EXTENSIONS.contains(&&*extension)
}

/// Stages of one GLSL program differ in what follows the first dot; a WGSL file is a program of its own.
fn program_of(file: &Path) -> (PathBuf, String) {
    let folder = file.parent().map(Path::to_owned).unwrap_or_default();
    let name = file.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let is_wgsl = name.ends_with(".wgsl");
    let stem = if is_wgsl { name } else { name.split('.').next().unwrap_or_default().to_owned() };
    (folder, stem)
}

fn of_files(
    mut files: Vec<PathBuf>,
    args: &SubjectArgs,
    variants: &BTreeSet<BTreeSet<String>>,
) -> anyhow::Result<Subject> {
    // The vertex stage first, as it runs.
    files.sort_by_key(|file| !file.to_string_lossy().contains(".vert"));
    files.dedup();
    let base = base_of(&files[0])?;
    let relative = |path: &Path| -> anyhow::Result<String> {
        let missing = |error| WrongInput(format!("{} cannot be read: {error}", path.display()));
        let path = path.canonicalize().map_err(missing)?;
        let inside = path.strip_prefix(&base).ok().map(|path| path.to_string_lossy().replace('\\', "/"));
        inside.ok_or_else(|| {
            let message = format!(
                "{} lies outside {}, where this shader's files are looked for",
                path.display(),
                base.display()
            );
            WrongInput(format!("{message}\n  help: run kiln in a folder above both")).into()
        })
    };
    let all = |paths: &[PathBuf]| -> anyhow::Result<Vec<String>> {
        paths.iter().map(|path| relative(path)).collect()
    };
    let define = |text: &String| kiln_project::parse_define(text).map_err(WrongInput);
    let program = Program {
        roots: all(&files)?,
        defines: args.defines.iter().map(define).collect::<Result<_, _>>()?,
        include_dirs: all(&args.include_dirs)?,
        prelude: all(&args.prelude)?,
    };
    Ok(Subject::new(program.subject().to_owned(), base, program, variants.clone()))
}

/// The folder whose files a shader may import: its project, else where the user stands, else its own.
fn base_of(file: &Path) -> anyhow::Result<PathBuf> {
    let folder = file.parent().unwrap_or(Path::new("/"));
    if let Some(project) = folder.ancestors().find(|folder| folder.join(PROJECT_FILE).is_file()) {
        return Ok(project.to_owned());
    }
    let here = std::env::current_dir().and_then(|here| here.canonicalize()).context("finding this folder")?;
    Ok(if folder.starts_with(&here) { here } else { folder.to_owned() })
}

/// The shaders of a project, each for what its scenes and its table ask for.
fn of_project(
    dir: &Path,
    variants: &BTreeSet<BTreeSet<String>>,
    subjects: &mut Vec<Subject>,
    diagnostics: &mut Vec<Diagnostic>,
) -> anyhow::Result<()> {
    let engine = place::open_engine(dir)?;
    let plan = kiln_project::plan(&engine, None).context("planning")?;
    diagnostics.extend(plan.diagnostics.iter().cloned());
    let Project { shaders, .. } = &plan.project;
    for (name, config) in shaders {
        let prefix = format!("shader/{name}/");
        let names = plan.targets.iter().filter_map(|target| target.name.strip_prefix(&prefix));
        let planned: BTreeSet<_> = names.filter_map(|name| kiln_project::parse_variant(name).ok()).collect();
        let asked = if variants.is_empty() { planned } else { variants.clone() };
        subjects.push(Subject::new(name.clone(), engine.folder().to_owned(), config.program.clone(), asked));
    }
    Ok(())
}

impl Subject {
    fn new(name: String, base: PathBuf, program: Program, asked: BTreeSet<BTreeSet<String>>) -> Subject {
        let mut sources = Sources::default();
        let mut read = |path: &str| {
            let text = read_text(&base.join(path));
            sources.0.insert(path.to_owned(), text.clone());
            text
        };
        let features = kiln_shader::scan(&program, &mut read).features;
        let asked = if asked.is_empty() { usual_variants(&features) } else { asked };
        Subject { name, base, program, features, asked, sources }
    }

    /// The files it is made of besides its roots.
    fn imported(&self) -> impl Iterator<Item = PathBuf> {
        let present = self.sources.0.iter().filter(|(_, text)| text.is_some());
        let others = present.filter(|(path, _)| !self.program.roots.contains(path));
        others.map(|(path, _)| self.base.join(path))
    }

    /// Compiles every variant once.
    pub(super) fn compile(&self) -> anyhow::Result<Vec<Variant>> {
        self.compile_by(kiln_worker::compile)
    }

    /// Compiles every variant once, with warnings of what is doubtful.
    pub(super) fn lint(&self) -> anyhow::Result<Vec<Variant>> {
        self.compile_by(kiln_worker::lint)
    }

    fn compile_by(
        &self,
        compile: fn(&Program, &BTreeSet<String>, Sources) -> Result<Outcome, Died>,
    ) -> anyhow::Result<Vec<Variant>> {
        let mut variants: BTreeMap<BTreeSet<String>, Vec<String>> = BTreeMap::new();
        for asked in &self.asked {
            // Features that no condition names make no difference.
            let effective = asked.intersection(&self.features).cloned().collect();
            variants.entry(effective).or_default().push(variant_name(asked));
        }
        let one = |(features, names): (BTreeSet<String>, Vec<String>)| {
            let outcome = match compile(&self.program, &features, self.sources.clone()) {
                Ok(outcome) => outcome,
                Err(Died::NoWorker(reason)) => anyhow::bail!("no shader compiler: {reason}"),
                Err(died) => {
                    let diagnostics = vec![died.diagnostic(self.program.subject())];
                    Outcome { diagnostics, ..Outcome::default() }
                }
            };
            Ok(Variant { names, outcome })
        };
        in_parallel(variants.into_iter().collect(), one)
    }

    /// What is asked for without being known.
    pub(super) fn unknown_features(&self) -> Vec<Diagnostic> {
        let unknown: BTreeSet<&String> =
            self.asked.iter().flatten().filter(|feature| !self.features.contains(*feature)).collect();
        let known = self.features.iter().cloned().collect::<Vec<_>>().join(", ");
        let message = |feature: &String| {
            let help = if known.is_empty() {
                "it has no conditions".to_owned()
            } else {
                format!("known are: {known}")
            };
            Diagnostic::note(format!("no condition of `{}` names the feature `{feature}`", self.name))
                .with_help(help)
        };
        unknown.into_iter().map(message).collect()
    }
}

impl Variant {
    /// Whether it compiles, or is sound and has no entry point.
    pub(super) fn is_good(&self) -> bool {
        self.outcome.is_library || self.outcome.compiled.is_some()
    }
}

/// Runs of neighbours that a thread takes at a time, for each thread: enough that all end at about the same time.
const RUNS_PER_THREAD: usize = 8;

/// Does `work` on all items, in as many threads as there are CPUs: each has a worker process of its own. Neighbours go to
/// the same one, since they are alike and it remembers. The results come in the order of the items.
fn in_parallel<T: Send, R: Send>(
    items: Vec<T>,
    work: impl Fn(T) -> anyhow::Result<R> + Sync,
) -> anyhow::Result<Vec<R>> {
    let threads = std::thread::available_parallelism().map_or(1, usize::from).min(items.len());
    let run_length = (items.len() / (threads.max(1) * RUNS_PER_THREAD)).max(1);
    let items = Mutex::new(items.into_iter().enumerate());
    let next_run = || -> Option<Vec<(usize, T)>> {
        let mut items = items.lock().unwrap_or_else(PoisonError::into_inner);
        Some(items.by_ref().take(run_length).collect()).filter(|run: &Vec<_>| !run.is_empty())
    };
    let take_all = || {
        let runs = std::iter::from_fn(next_run).flatten();
        runs.map(|(at, item)| (at, work(item))).collect::<Vec<_>>()
    };
    let mut results: Vec<(usize, anyhow::Result<R>)> = std::thread::scope(|scope| {
        let threads: Vec<_> = (0..threads).map(|_| scope.spawn(take_all)).collect();
        threads
            .into_iter()
            .flat_map(|thread| thread.join().unwrap_or_else(|panic| resume_unwind(panic)))
            .collect()
    });
    results.sort_by_key(|(at, _)| *at);
    results.into_iter().map(|(_, result)| result).collect()
}

/// The plain one, each feature alone, all together: what conditions go wrong in most.
fn usual_variants(features: &BTreeSet<String>) -> BTreeSet<BTreeSet<String>> {
    let single = features.iter().map(|feature| BTreeSet::from([feature.clone()]));
    single.chain([BTreeSet::new(), features.clone()]).collect()
}

/// A file's text; wrong bytes show in the diagnostic that follows.
fn read_text(path: &Path) -> Option<Arc<str>> {
    let length = std::fs::metadata(path).ok().filter(std::fs::Metadata::is_file)?.len();
    if length > FILE_BYTES_MAX {
        // Long enough to be refused by the compiler, with the file's name.
        return Some(" ".repeat(FILE_BYTES_MAX as usize).into());
    }
    Some(String::from_utf8_lossy(&std::fs::read(path).ok()?).into())
}

/// The diagnostics of all variants, each once, with the variants that have it where others have not.
pub(super) fn merged(variants: &[Variant]) -> Vec<Diagnostic> {
    let mut found: Vec<(Diagnostic, Vec<&str>)> = Vec::new();
    for variant in variants {
        for diagnostic in &variant.outcome.diagnostics {
            let names = variant.names.iter().map(String::as_str);
            match found.iter_mut().find(|(known, _)| known == diagnostic) {
                Some((_, in_variants)) => in_variants.extend(names),
                None => found.push((diagnostic.clone(), names.collect())),
            }
        }
    }
    let all: usize = variants.iter().map(|variant| variant.names.len()).sum();
    let with_variants = |(diagnostic, names): (Diagnostic, Vec<&str>)| match names.len() {
        count if count == all => diagnostic,
        count => {
            let shown = names.iter().take(4).copied().collect::<Vec<_>>().join(", ");
            let more = if count > 4 { " …" } else { "" };
            diagnostic.with_note(format!("in {count} of {all} variants: {shown}{more}"))
        }
    };
    found.into_iter().map(with_variants).collect()
}
