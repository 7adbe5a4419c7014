//! What is wrong with an environment, a baked map or a frame: values in, findings out.
//!
//! Start at [`check_environment`] for what lights a scene, at [`check_chain`] for what was baked of it, at
//! [`check_harmonics`] and [`check_furnace`] for the rest. Each gives a [`Subject`]: facts, [`Finding`]s, what could not be
//! checked and why, and pictures if asked. [`html`] makes a page of them, [`Allowance`]s excuse what their author knows of.
//!
//! Conventions: a finding is named by its [`Check`]; places are those of the texels as decoded; shares are of flux, weighted by
//! solid angle, unless a message says another. Nothing is repaired here: what a bake would mend is found before it does.
//!
//! Not here: files, the command line and shaders' compiler (`kiln`), texel checks and repair (`kiln-image`).

mod allow;
mod artefact;
mod environment;
mod furnace;
mod html;
mod picture;
mod seams;
mod weights;

use kiln_diagnostic::Severity;
use serde::Serialize;

pub use allow::{Allowance, allow};
pub use artefact::{ChainKind, ChainSubject, LevelFacts, check_chain, check_harmonics, mean_radiance};
pub use environment::{SUN_SHARE_OF_TEXELS, check_environment};
pub use furnace::{FURNACE_TOLERANCE, check_furnace};
pub use html::html;
pub use picture::Picture;
pub use seams::{Lookup, Seam, cube_edges, pole_spread, wrap_column};

/// What is checked. Its name stands in reports, in `[check] allow` and on the command line.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Check {
    /// The file is read.
    Unreadable,
    /// No value is NaN or infinite.
    NonFinite,
    /// No light is negative.
    Negative,
    /// There is light.
    Black,
    /// Binary16 reaches.
    AboveF16,
    /// Binary16 keeps the dark texels too.
    F16Loss,
    /// A shared exponent keeps all texels.
    Rgb9e5Loss,
    /// A small part of the texels does not hold most of the light.
    SunFlux,
    /// A panorama closes.
    WrapColumn,
    /// A panorama's first and last row is one point.
    Poles,
    /// A cube's faces meet.
    CubeEdges,
    /// Each level has the energy of its source.
    MipEnergy,
    /// No level has more contrast than the one before.
    MipContrast,
    /// No level goes beyond what it was made of.
    Overshoot,
    /// Texels say what they should within what was asked for.
    EncodingError,
    /// Harmonics give no negative light.
    ShNegative,
    /// A shader compiles.
    ShaderCompile,
    /// A shader holds nothing doubtful.
    ShaderLint,
    /// A white room shows nothing.
    Furnace,
    /// Every allowance excuses something.
    UnusedAllowance,
}

impl Check {
    /// All of them.
    pub const ALL: [Check; 20] = [
        Check::Unreadable,
        Check::NonFinite,
        Check::Negative,
        Check::Black,
        Check::AboveF16,
        Check::F16Loss,
        Check::Rgb9e5Loss,
        Check::SunFlux,
        Check::WrapColumn,
        Check::Poles,
        Check::CubeEdges,
        Check::MipEnergy,
        Check::MipContrast,
        Check::Overshoot,
        Check::EncodingError,
        Check::ShNegative,
        Check::ShaderCompile,
        Check::ShaderLint,
        Check::Furnace,
        Check::UnusedAllowance,
    ];

    /// As reports and kiln.toml spell it.
    pub fn name(self) -> &'static str {
        match self {
            Check::Unreadable => "unreadable",
            Check::NonFinite => "non-finite",
            Check::Negative => "negative",
            Check::Black => "black",
            Check::AboveF16 => "above-f16",
            Check::F16Loss => "f16-loss",
            Check::Rgb9e5Loss => "rgb9e5-loss",
            Check::SunFlux => "sun-flux",
            Check::WrapColumn => "wrap-column",
            Check::Poles => "poles",
            Check::CubeEdges => "cube-edges",
            Check::MipEnergy => "mip-energy",
            Check::MipContrast => "mip-contrast",
            Check::Overshoot => "overshoot",
            Check::EncodingError => "encoding-error",
            Check::ShNegative => "sh-negative",
            Check::ShaderCompile => "shader-compile",
            Check::ShaderLint => "shader-lint",
            Check::Furnace => "furnace",
            Check::UnusedAllowance => "unused-allowance",
        }
    }

    /// The check of that name.
    pub fn from_name(name: &str) -> Option<Check> {
        Check::ALL.into_iter().find(|check| check.name() == name)
    }

    /// What it makes sure of, for whoever sees its name for the first time.
    pub fn about(self) -> &'static str {
        match self {
            Check::Unreadable => "the file can be read",
            Check::NonFinite => "no value is NaN or infinite, before any repair",
            Check::Negative => "no value is below zero, but as a colour outside Rec. 709",
            Check::Black => "some texel holds light",
            Check::AboveF16 => "no value is above 65504, the largest binary16 number",
            Check::F16Loss => "binary16 keeps the luminance of all texels within 1 %, scaled as a bake would",
            Check::Rgb9e5Loss => {
                "RGB9E5 keeps the luminance of all texels within 1 %, scaled as a bake would"
            }
            Check::SunFlux => "the brightest 0.01 % of texels hold less than a tenth of the light",
            Check::WrapColumn => "the last column continues in the first",
            Check::Poles => "the first and last row, each of which is one point, hold one value",
            Check::CubeEdges => "faces continue each other across their edges",
            Check::MipEnergy => "each level has the mean radiance of what it was made of",
            Check::MipContrast => "no level of a chain has more contrast than the one before",
            Check::Overshoot => "no value goes beyond the brightest and darkest of what it was made of",
            Check::EncodingError => "rounding to texels costs less than was asked for",
            Check::ShNegative => "harmonics give no negative light in any direction",
            Check::ShaderCompile => "the shader compiles in every variant",
            Check::ShaderLint => {
                "no argument leaves a function's domain, no derivative stands in divergent control flow"
            }
            Check::Furnace => "white surfaces in uniform white light cannot be seen",
            Check::UnusedAllowance => "each allowance of kiln.toml excuses something",
        }
    }
}

impl Serialize for Check {
    fn serialize<S: serde::Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// One thing that is wrong, or worth knowing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Finding {
    /// What was checked.
    pub check: Check,
    /// How much it matters.
    pub severity: Severity,
    /// What was found, with its numbers.
    pub message: String,
    /// Where: texels, levels, lines; the worst first.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub places: Vec<String>,
    /// What to do about it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub help: Option<String>,
    /// The reason for which kiln.toml allows it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub allowed: Option<String>,
}

impl Finding {
    /// A finding without a place.
    pub fn new(check: Check, severity: Severity, message: impl Into<String>) -> Finding {
        Finding { check, severity, message: message.into(), places: Vec::new(), help: None, allowed: None }
    }

    /// Says where.
    #[must_use]
    pub fn at(mut self, place: impl Into<String>) -> Finding {
        self.places.push(place.into());
        self
    }

    /// Says what to do.
    #[must_use]
    pub fn with_help(mut self, help: impl Into<String>) -> Finding {
        self.help = Some(help.into());
        self
    }

    /// Whether it counts against the subject: at least `least`, and not allowed.
    pub fn counts(&self, least: Severity) -> bool {
        self.severity >= least && self.allowed.is_none()
    }
}

/// What was not checked.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Unchecked {
    /// The check, or what of it.
    pub what: String,
    /// Why not.
    pub reason: String,
}

/// A number worth knowing.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Fact {
    /// What it is.
    pub name: String,
    /// Its value with its unit.
    pub value: String,
}

/// One thing that was checked.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct Subject {
    /// A target's name or a file's path.
    pub name: String,
    /// `environment`, `chain`, `harmonics`, `shader` or `furnace`.
    pub kind: String,
    /// What it is like.
    pub facts: Vec<Fact>,
    /// What is wrong with it, in the order of the checks.
    pub findings: Vec<Finding>,
    /// What could not be said.
    pub unchecked: Vec<Unchecked>,
    /// Where it is wrong.
    #[serde(skip)]
    pub pictures: Vec<Picture>,
    /// How long it took.
    pub ms: f64,
}

impl Subject {
    /// Nothing known yet.
    pub fn new(name: impl Into<String>, kind: &str) -> Subject {
        Subject { name: name.into(), kind: kind.to_owned(), ..Subject::default() }
    }

    /// Adds a fact.
    pub fn fact(&mut self, name: &str, value: impl Into<String>) {
        self.facts.push(Fact { name: name.to_owned(), value: value.into() });
    }

    /// Says what was not checked.
    pub fn skip(&mut self, what: &str, reason: impl Into<String>) {
        self.unchecked.push(Unchecked { what: what.to_owned(), reason: reason.into() });
    }

    /// Whether something counts against it.
    pub fn is_bad(&self, least: Severity) -> bool {
        self.findings.iter().any(|finding| finding.counts(least))
    }
}
