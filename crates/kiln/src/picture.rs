//! The build graph as DOT and SVG: sources on the left, targets on the right, colours by what a bake would do.

use std::collections::{BTreeMap, BTreeSet};
use std::fmt::Write as _;

use kiln_build::{ActionId, Forecast, Input};
use kiln_project::{PartSpec, Plan, Reason, Skipped};

use crate::commands::demand::{self, Pass};

/// Sizes of the SVG, in pixels.
const ROW: usize = 26;
const BOX: usize = 20;
const CHARACTER: usize = 7;
const COLUMN_GAP: usize = 90;
const MARGIN: usize = 16;

struct Node {
    label: String,
    /// What is shown of it besides under a pointer.
    title: String,
    kind: Kind,
    /// Nodes to the left.
    reads: BTreeSet<usize>,
    column: usize,
}

#[derive(Clone, Copy, PartialEq, Eq)]
enum Kind {
    Source { is_missing: bool },
    UpToDate,
    WouldRun,
    MayRun,
    Faulty,
    Target,
    Material,
    Effect,
    Pass,
    Skipped,
}

impl Kind {
    /// Fill and border.
    fn colours(self) -> (&'static str, &'static str) {
        match self {
            Kind::Source { is_missing: false } => ("#f4f1ea", "#8a8171"),
            Kind::Source { is_missing: true } => ("#fff", "#b9b4aa"),
            Kind::UpToDate => ("#e3f0e6", "#4d8a5b"),
            Kind::WouldRun => ("#ffd9a8", "#c2710c"),
            Kind::MayRun => ("#fff3d6", "#c2a00c"),
            Kind::Faulty => ("#fbd3cd", "#b42318"),
            Kind::Target => ("#dfe9f7", "#46699c"),
            Kind::Material => ("#f4f1ea", "#8a8171"),
            Kind::Effect => ("#fff3d6", "#c2a00c"),
            Kind::Pass => ("#ece4f6", "#74569c"),
            Kind::Skipped => ("#fff", "#b9b4aa"),
        }
    }

    fn meaning(self) -> &'static str {
        match self {
            Kind::Source { is_missing: false } => "source",
            Kind::Source { is_missing: true } => "looked for, absent",
            Kind::UpToDate => "up to date",
            Kind::WouldRun => "would run",
            Kind::MayRun => "may run",
            Kind::Faulty => "at fault",
            Kind::Target => "target",
            Kind::Material => "material",
            Kind::Effect => "effects",
            Kind::Pass => "work of every frame",
            Kind::Skipped => "skipped: nothing calls for it",
        }
    }
}

/// A laid-out graph.
pub(crate) struct Picture {
    nodes: Vec<Node>,
    /// Whether columns keep the order in which their nodes were added; else few lines cross.
    keeps_order: bool,
}

impl Picture {
    /// The picture of some actions, of what they read, and of the targets they make: of the one called `target`, or all.
    pub(crate) fn new(
        plan: &Plan,
        forecasts: &[Forecast],
        wanted: &[ActionId],
        target: Option<&str>,
    ) -> Picture {
        let mut picture = Picture { nodes: Vec::new(), keeps_order: false };
        let mut sources: BTreeMap<String, usize> = BTreeMap::new();
        let mut actions: BTreeMap<ActionId, usize> = BTreeMap::new();
        // Levels of a map are drawn as one.
        let mut groups: BTreeMap<String, usize> = BTreeMap::new();
        let mut sorted = wanted.to_vec();
        sorted.sort();
        for id in sorted {
            let action = plan.graph.action(id);
            let group = crate::report::group_label(&action.name);
            let kind = kind_of(&forecasts[id.index()]);
            let node = *groups.entry(group.clone()).or_insert_with(|| picture.add(group, kind));
            if kind != Kind::UpToDate && picture.nodes[node].kind == Kind::UpToDate {
                picture.nodes[node].kind = kind;
            }
            actions.insert(id, node);
            for input in &action.inputs {
                let read = match input {
                    Input::Output { action, .. } => actions.get(action).copied(),
                    Input::Source { path, digest } => {
                        let kind = Kind::Source { is_missing: digest.is_none() };
                        Some(*sources.entry(path.clone()).or_insert_with(|| picture.add(path.clone(), kind)))
                    }
                };
                picture.nodes[node].reads.extend(read);
            }
        }
        for spec in plan.targets.iter().filter(|spec| target.is_none_or(|target| spec.name == target)) {
            let made_by: BTreeSet<usize> = spec
                .parts
                .iter()
                .map(PartSpec::action)
                .filter_map(|action| actions.get(&action).copied())
                .collect();
            if !made_by.is_empty() {
                let node = picture.add(spec.name.clone(), Kind::Target);
                picture.nodes[node].reads = made_by;
            }
        }
        picture.assign_columns();
        picture
    }

    /// Materials, the effects that they call for, and the variants, passes, maps and levels that follow; what is left out
    /// stands below.
    pub(crate) fn of_demand(plan: &Plan, skipped: Vec<Skipped>) -> Picture {
        let mut picture = Picture { nodes: Vec::new(), keeps_order: true };
        let mut materials: BTreeMap<(String, String), usize> = BTreeMap::new();
        let mut variants: BTreeMap<String, usize> = BTreeMap::new();
        for scene in &plan.scenes {
            for material in &scene.materials {
                // One that is drawn with several kinds of geometry has several sets of effects.
                let from =
                    *materials.entry((scene.name.clone(), material.material.clone())).or_insert_with(|| {
                        picture.add(format!("scene/{}: {}", scene.name, material.material), Kind::Material)
                    });
                let name = material.variant_name();
                let effects = *variants.entry(format!("{} {name}", scene.shader)).or_insert_with(|| {
                    let label = if material.effects.is_empty() { "no effect" } else { &name };
                    let effects = picture.add(label.to_owned(), Kind::Effect);
                    let variant = picture.add(format!("shader/{}/{name}", scene.shader), Kind::Target);
                    picture.nodes[variant].reads.insert(effects);
                    effects
                });
                picture.nodes[effects].reads.insert(from);
            }
        }
        let (run, left_out): (Vec<Pass>, Vec<Pass>) =
            demand::passes(plan).into_iter().partition(Pass::is_run);
        for pass in run {
            let node = picture.add(pass.name.to_owned(), Kind::Pass);
            picture.nodes[node].title = pass.reason();
            picture.nodes[node].reads =
                pass.users.iter().filter_map(|user| materials.get(user).copied()).collect();
        }
        for (what, reasons) in demand::merged(kiln_project::made(plan)) {
            let made = picture.add(what, Kind::Target);
            picture.nodes[made].title = reasons.iter().map(Reason::to_string).collect::<Vec<_>>().join("\n");
            // Where a setting asks for a map whatever materials do, lines from all of them would say nothing.
            let readers = reasons.iter().map_while(|reason| match reason {
                Reason::Material { scene, material, .. } => {
                    materials.get(&(scene.clone(), material.clone())).copied()
                }
                Reason::Said(_) => None,
            });
            picture.nodes[made].reads = readers.collect();
        }
        picture.assign_columns();
        let last = picture.nodes.iter().map(|node| node.column).max().unwrap_or(0);
        let maps = demand::groups(skipped).into_iter().map(|group| {
            (format!("{}, saves {}", group.what, crate::report::size(group.bytes)), group.because)
        });
        let passes = left_out.iter().map(|pass| (pass.name.to_owned(), pass.reason()));
        for (label, title) in passes.chain(maps) {
            let skipped = picture.add(label, Kind::Skipped);
            picture.nodes[skipped].column = last;
            picture.nodes[skipped].title = title;
        }
        picture
    }

    fn add(&mut self, label: String, kind: Kind) -> usize {
        self.nodes.push(Node { label, title: String::new(), kind, reads: BTreeSet::new(), column: 0 });
        self.nodes.len() - 1
    }

    /// Every node stands right of what it reads; targets stand together.
    fn assign_columns(&mut self) {
        // A source may have been added after its first reader, so one pass is not enough.
        let mut is_changed = true;
        while is_changed {
            is_changed = false;
            for index in 0..self.nodes.len() {
                let left = self.nodes[index]
                    .reads
                    .iter()
                    .map(|&read| self.nodes[read].column + 1)
                    .max()
                    .unwrap_or(0);
                if left > self.nodes[index].column {
                    self.nodes[index].column = left;
                    is_changed = true;
                }
            }
        }
        let last = self.nodes.iter().map(|node| node.column).max().unwrap_or(0);
        let is_result = |node: &&mut Node| matches!(node.kind, Kind::Target | Kind::Pass);
        self.nodes.iter_mut().filter(is_result).for_each(|node| node.column = last);
    }

    pub(crate) fn to_dot(&self) -> String {
        let mut dot = String::from(
            "digraph kiln {\n  rankdir=LR;\n  node [shape=box, style=\"filled,rounded\", fontname=\"sans-serif\"];\n",
        );
        for (index, node) in self.nodes.iter().enumerate() {
            let (fill, border) = node.kind.colours();
            let label = node.label.replace('\\', "\\\\").replace('"', "\\\"");
            // Writing to a string cannot fail.
            let _ =
                writeln!(dot, "  n{index} [label=\"{label}\", fillcolor=\"{fill}\", color=\"{border}\"];");
            for read in &node.reads {
                let _ = writeln!(dot, "  n{read} -> n{index};");
            }
        }
        dot + "}\n"
    }

    pub(crate) fn to_svg(&self) -> String {
        let columns = self.rows();
        let width = |node: &Node| node.label.chars().count() * CHARACTER + 14;
        let mut left = MARGIN;
        let mut x = Vec::new();
        for column in &columns {
            x.push(left);
            left += column.iter().map(|&index| width(&self.nodes[index])).max().unwrap_or(0) + COLUMN_GAP;
        }
        let total_width = (left.saturating_sub(COLUMN_GAP) + MARGIN).max(640);
        let rows = columns.iter().map(Vec::len).max().unwrap_or(0);
        let top = MARGIN + ROW + 8;
        let height = top + rows * ROW + MARGIN;
        let mut y = vec![0; self.nodes.len()];
        for column in &columns {
            // Short columns stand in the middle.
            let offset = (rows - column.len()) * ROW / 2;
            for (row, &index) in column.iter().enumerate() {
                y[index] = top + offset + row * ROW;
            }
        }
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" width=\"{total_width}\" height=\"{height}\" \
             viewBox=\"0 0 {total_width} {height}\" font-family=\"ui-monospace, monospace\" font-size=\"11\">\n\
             <rect width=\"100%\" height=\"100%\" fill=\"#fff\"/>\n"
        );
        self.draw_legend(&mut svg);
        for (index, node) in self.nodes.iter().enumerate() {
            for &read in &node.reads {
                let (x0, y0) = (x[self.nodes[read].column] + width(&self.nodes[read]), y[read] + BOX / 2);
                let (x1, y1) = (x[node.column], y[index] + BOX / 2);
                let middle = usize::midpoint(x0, x1);
                let _ = writeln!(
                    svg,
                    "<path d=\"M{x0} {y0} C{middle} {y0} {middle} {y1} {x1} {y1}\" fill=\"none\" stroke=\"#b9b4aa\"/>"
                );
            }
        }
        for (index, node) in self.nodes.iter().enumerate() {
            let label = Label { text: &node.label, title: &node.title };
            draw_box(&mut svg, [x[node.column], y[index], width(node)], node.kind, label);
        }
        svg + "</svg>\n"
    }

    fn draw_legend(&self, svg: &mut String) {
        let kinds = [
            Kind::Source { is_missing: false },
            Kind::Source { is_missing: true },
            Kind::UpToDate,
            Kind::WouldRun,
            Kind::MayRun,
            Kind::Faulty,
            Kind::Material,
            Kind::Effect,
            Kind::Target,
            Kind::Pass,
            Kind::Skipped,
        ];
        let mut x = MARGIN;
        for kind in kinds.into_iter().filter(|kind| self.nodes.iter().any(|node| node.kind == *kind)) {
            let width = kind.meaning().len() * CHARACTER + 14;
            draw_box(svg, [x, MARGIN, width], kind, Label { text: kind.meaning(), title: "" });
            x += width + 8;
        }
    }

    /// The nodes of each column from top to bottom: as they were added, or near the middle of what they read.
    fn rows(&self) -> Vec<Vec<usize>> {
        let count = self.nodes.iter().map(|node| node.column + 1).max().unwrap_or(0);
        let mut columns: Vec<Vec<usize>> = vec![Vec::new(); count];
        for (index, node) in self.nodes.iter().enumerate() {
            columns[node.column].push(index);
        }
        if self.keeps_order {
            return columns;
        }
        let mut place = vec![0.0_f64; self.nodes.len()];
        let set_places = |column: &[usize], place: &mut Vec<f64>| {
            column
                .iter()
                .enumerate()
                .for_each(|(row, &index)| place[index] = row as f64 / column.len() as f64);
        };
        columns.iter().for_each(|column| set_places(column, &mut place));
        for column in columns.iter_mut().skip(1) {
            let middle = |index: usize| {
                let reads = &self.nodes[index].reads;
                reads.iter().map(|&read| place[read]).sum::<f64>() / reads.len().max(1) as f64
            };
            let mut keyed: Vec<(f64, usize)> = column.iter().map(|&index| (middle(index), index)).collect();
            keyed.sort_by(|a, b| a.0.total_cmp(&b.0).then(a.1.cmp(&b.1)));
            *column = keyed.into_iter().map(|(_, index)| index).collect();
            set_places(column, &mut place);
        }
        columns
    }
}

/// What stands in a box, and what a pointer over it shows.
struct Label<'a> {
    text: &'a str,
    title: &'a str,
}

fn draw_box(svg: &mut String, [x, y, width]: [usize; 3], kind: Kind, label: Label) {
    let (fill, border) = kind.colours();
    let [text, title] = [label.text, label.title].map(|text| text.replace('&', "&amp;").replace('<', "&lt;"));
    let title = if title.is_empty() { title } else { format!("<title>{title}</title>") };
    let dash = if matches!(kind, Kind::Source { is_missing: true } | Kind::Skipped) {
        " stroke-dasharray=\"4 3\""
    } else {
        ""
    };
    let _ = writeln!(
        svg,
        "<g>{title}\
         <rect x=\"{x}\" y=\"{y}\" width=\"{width}\" height=\"{BOX}\" rx=\"4\" fill=\"{fill}\" stroke=\"{border}\"{dash}/>\
         <text x=\"{}\" y=\"{}\">{text}</text></g>",
        x + 7,
        y + 14
    );
}

fn kind_of(forecast: &Forecast) -> Kind {
    match forecast {
        Forecast::UpToDate => Kind::UpToDate,
        Forecast::Runs { .. } => Kind::WouldRun,
        Forecast::MayRun { .. } => Kind::MayRun,
        Forecast::Failed | Forecast::Blocked { .. } => Kind::Faulty,
    }
}
