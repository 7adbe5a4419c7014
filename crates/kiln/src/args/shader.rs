//! `kiln shader …`.

use std::path::PathBuf;

use clap::{Args, Subcommand};
use kiln_shader::Language;

#[derive(Debug, Subcommand)]
pub(crate) enum ShaderCommand {
    /// Compile shaders for all their variants and say what is wrong, at the author's line
    Check(CheckArgs),
    /// Say which features a shader knows, and which of its variants are one and the same
    Variants(VariantsArgs),
    /// Print what a shader offers and asks for: entry points, bindings, inputs, parameters
    Reflect(ReflectArgs),
    /// Write shaders as WGSL, SPIR-V, GLSL, HLSL or MSL, with where each resource is bound
    Emit(EmitArgs),
}

/// Which shaders, and how they are to be read.
#[derive(Debug, Args)]
pub(crate) struct SubjectArgs {
    /// Shader files (.wgsl .vert .frag .comp .glsl), or folders of projects; GLSL files that differ in their extension
    /// alone are one program
    #[arg(required = true, value_name = "FILE|DIR")]
    pub(crate) files: Vec<PathBuf>,
    /// A variant, as `sheen+clearcoat` or `base`; again for another [default: what a project's scenes ask for; else
    /// `base`, each feature alone and all together]
    #[arg(short, long = "variant", value_name = "FEATURES")]
    pub(crate) variants: Vec<String>,
    /// GLSL: a macro, as `#define NAME VALUE` before the first line
    #[arg(short = 'D', long = "define", value_name = "NAME[=VALUE]")]
    pub(crate) defines: Vec<String>,
    /// GLSL: a folder in which `#include` looks too
    #[arg(short = 'I', long = "include", value_name = "DIR")]
    pub(crate) include_dirs: Vec<PathBuf>,
    /// GLSL: a file whose text goes before the first line
    #[arg(long, value_name = "FILE")]
    pub(crate) prelude: Vec<PathBuf>,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  kiln shader check look                              all variants that the project's scenes ask for
  kiln shader check pbr.vert pbr.frag -D LIGHTS=4     one GLSL program of two stages
  kiln shader check *.wgsl --json                     diagnostics with byte ranges, for an editor

Exit codes: 0 all compile, 1 some do not, 2 the tool failed.")]
pub(crate) struct CheckArgs {
    #[command(flatten)]
    pub(crate) subjects: SubjectArgs,
    /// Warnings count as errors
    #[arg(long)]
    pub(crate) deny_warnings: bool,
    /// Leave out warnings of what is valid but doubtful: arguments at the edge of a function's domain, derivatives in
    /// control flow that is not uniform, what is slow for no reason
    #[arg(long)]
    pub(crate) no_lint: bool,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct VariantsArgs {
    #[command(flatten)]
    pub(crate) subjects: SubjectArgs,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
pub(crate) struct ReflectArgs {
    #[command(flatten)]
    pub(crate) subjects: SubjectArgs,
    /// Print JSON instead of text
    #[arg(long)]
    pub(crate) json: bool,
}

#[derive(Debug, Args)]
#[command(after_help = "\
Examples:
  kiln shader emit pbr.wgsl --to spirv,msl --out built      pbr.spv, pbr.metal, and what is bound where as .json
  kiln shader emit pbr.wgsl --to glsl-es -v sheen --out built
  kiln shader emit pbr.vert pbr.frag --to wgsl              to standard output")]
pub(crate) struct EmitArgs {
    #[command(flatten)]
    pub(crate) subjects: SubjectArgs,
    /// Languages: wgsl, spirv, glsl (4.50), glsl-es (3.00), hlsl (shader model 6.0), msl (2.4)
    #[arg(long, required = true, value_delimiter = ',', value_name = "LANGUAGE", value_parser = parse_language)]
    pub(crate) to: Vec<Language>,
    /// Folder of the files [default: standard output, for one text]
    #[arg(short, long, value_name = "DIR")]
    pub(crate) out: Option<PathBuf>,
    /// Write NAME.map.json too: the author's file, line and names for each function
    #[arg(long)]
    pub(crate) source_map: bool,
}

fn parse_language(text: &str) -> Result<Language, String> {
    let known = || Language::ALL.map(Language::name).join(", ");
    Language::parse(text).ok_or_else(|| format!("known are: {}", known()))
}
