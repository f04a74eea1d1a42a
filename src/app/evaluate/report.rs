//! What `evaluate` writes: tables of all trials and their means.

use std::fmt::Write;

use drawing::DrawOptions;
use serde::Serialize;
use serde_json::Value;

use super::corpus::Entry;
use super::sets::{Variant, ViewSet};
use super::trial::{Trial, ViewTrial};
use evaluation::mean;

/// The view whose depth stands for a sheet's.
const QUARTER_DEG: f64 = 45.0;

/// All trials, by view set, variant and sheet.
#[derive(Serialize)]
pub(super) struct Report {
    version: &'static str,
    options: Value,
    /// Of models that were drawn first.
    draw: DrawOptions,
    /// Subjects that could not be read, and why.
    refused: Vec<(String, String)>,
    runs: Vec<Run>,
}

/// A view set under one variant of the options.
#[derive(Serialize)]
struct Run {
    set: String,
    views: Vec<String>,
    variant: &'static str,
    sheets: Vec<SheetTrial>,
}

#[derive(Serialize)]
struct SheetTrial {
    sheet: String,
    kind: Option<String>,
    /// Whether the true surface closes.
    closed: Option<bool>,
    #[serde(flatten)]
    trial: Trial,
}

/// A figure of a trial, absent where it cannot be had.
type Figure = fn(&Trial) -> Option<f64>;

/// More sheets are told of by kind, one a row, instead of one a column.
const MOST_COLUMNS: usize = 12;

/// What is told by kind: name, how many decimals, figure.
const BY_KIND: &[(&str, usize, Figure)] = &[
    ("IoU", 3, |t| t.solid.map(|s| s.iou)),
    ("Chamfer-L1, %", 2, |t| t.solid.map(|s| 100.0 * s.surface.chamfer_l1)),
    ("normal consistency", 3, |t| t.solid.map(|s| s.surface.normal_consistency)),
    ("shelf share", 3, |t| t.solid.map(|s| s.surface.shelf_share)),
    ("genus", 1, |t| Some(t.mesh.as_ref()?.genus? as f64)),
    ("time, s", 2, |t| t.mesh.as_ref().map(|_| t.seconds)),
];

/// A table: what it shows, how many decimals, and the figure.
const TABLES: &[(&str, usize, Figure)] = &[
    ("Solid: intersection over union", 3, |t| t.solid.map(|s| s.iou)),
    ("Solid: Chamfer-L1, % of the longest side", 2, |t| {
        t.solid.map(|s| 100.0 * s.surface.chamfer_l1)
    }),
    ("Solid: F-score at 1 % of the longest side", 3, |t| t.solid.map(|s| s.surface.f_score)),
    ("Outlines of the mesh: mean distance from the truth's, px, over views with truth", 2, |t| {
        mean(t.views.iter().filter_map(|view| view.boundary_distance_px))
    }),
    ("Depth of view 45: correlation", 3, |t| quarter(t)?.depth.correlation),
    ("Depth of view 45: bad2.0", 3, |t| Some(quarter(t)?.depth.bad2_px?.honest)),
    ("Depth of view 45: bad2.0 of the best constant", 3, |t| {
        Some(quarter(t)?.depth.bad2_px?.best_constant)
    }),
    ("Depth of all views with truth and near neighbours: correlation", 3, |t| {
        mean(lined(t).filter_map(|view| view.depth.correlation))
    }),
    ("Depth of all views with truth and near neighbours: bad2.0", 3, |t| {
        mean(lined(t).filter_map(|view| Some(view.depth.bad2_px?.honest)))
    }),
    ("Depth of all views with truth and near neighbours: bad2.0 of the best constant", 3, |t| {
        mean(lined(t).filter_map(|view| Some(view.depth.bad2_px?.best_constant)))
    }),
    ("Depth of views without near neighbours: bad2.0", 3, |t| {
        let far = t.views.iter().filter(|view| view.fallback.is_some());
        mean(far.filter_map(|view| Some(view.depth.bad2_px?.honest)))
    }),
    ("Triangles", 0, |t| Some(t.mesh.as_ref()?.triangles as f64)),
    ("Watertight and manifold (1 = yes)", 0, |t| {
        Some(f64::from(u8::from(t.mesh.as_ref()?.watertight)))
    }),
    ("Time, s, decoding to mesh", 2, |t| t.mesh.as_ref().map(|_| t.seconds)),
    ("Peak memory, MiB", 0, |t| t.mesh.as_ref().and(t.peak_memory_mib)),
];

/// A cell of a table with its right border, empty without a figure.
fn cell(figure: Option<f64>, decimals: usize) -> String {
    figure.map_or_else(|| " |".to_owned(), |value| format!(" {value:.decimals$} |"))
}

fn quarter(trial: &Trial) -> Option<&ViewTrial> {
    trial.views.iter().find(|view| view.azimuth_deg == QUARTER_DEG)
}

/// Views whose depth rests on lines.
fn lined(trial: &Trial) -> impl Iterator<Item = &ViewTrial> {
    trial.views.iter().filter(|view| view.fallback.is_none())
}

impl Report {
    pub(super) fn new(options: &Value, draw: &DrawOptions) -> Self {
        let version = env!("CARGO_PKG_VERSION");
        let (options, draw) = (options.clone(), draw.clone());
        Self { version, options, draw, refused: Vec::new(), runs: Vec::new() }
    }

    /// Notes a subject that could not be read.
    pub(super) fn refused(&mut self, name: &str, reason: &str) {
        self.refused.push((name.to_owned(), reason.to_owned()));
    }

    pub(super) fn add(
        &mut self,
        set: &ViewSet,
        variant: &Variant,
        sheet: &str,
        entry: &Entry,
        trial: Trial,
    ) {
        let Entry { kind, closed } = entry.clone();
        let trial = SheetTrial { sheet: sheet.to_owned(), kind, closed, trial };
        let known = |run: &&mut Run| run.set == set.name && run.variant == variant.name;
        match self.runs.iter_mut().find(known) {
            Some(run) => run.sheets.push(trial),
            None => self.runs.push(Run {
                set: set.name.clone(),
                views: set.viewpoints().iter().map(ToString::to_string).collect(),
                variant: variant.name,
                sheets: vec![trial],
            }),
        }
    }

    /// One table a figure, one row a view set and variant, one column a sheet;
    /// failures are told below.
    pub(super) fn markdown(&self) -> String {
        let mut text = format!("# Evaluation\n\nturnaround {}\n", self.version);
        let by_kind = self.runs.iter().any(Run::is_told_by_kind);
        if by_kind {
            text += &self.runs.iter().map(Run::by_kind).collect::<String>();
            text += &self.runs.iter().map(Run::by_subject).collect::<String>();
        }
        for (title, decimals, figure) in TABLES.iter().filter(|_| !by_kind) {
            let rows = self.runs.iter().filter_map(|run| run.row(*decimals, *figure));
            let rows: Vec<String> = rows.collect();
            if !rows.is_empty() {
                let _ = write!(text, "\n## {title}\n\n{}{}", self.head(), rows.concat());
            }
        }
        let refused = self.refused.iter().map(|(name, reason)| format!("- {name}: {reason}\n"));
        let failures: String = refused.chain(self.runs.iter().map(Run::failures)).collect();
        if !failures.is_empty() {
            let _ = write!(text, "\n## Not run\n\n{failures}");
        }
        text
    }

    fn head(&self) -> String {
        let sheets = self.runs.first().map(|run| run.sheets.as_slice()).unwrap_or_default();
        let names: String = sheets.iter().map(|sheet| format!(" {} |", sheet.sheet)).collect();
        format!("| views |{names} mean |\n|---|{}---|\n", "---|".repeat(sheets.len()))
    }
}

impl Run {
    fn is_told_by_kind(&self) -> bool {
        self.sheets.len() > MOST_COLUMNS || self.sheets.iter().any(|sheet| sheet.kind.is_some())
    }

    /// Means by kind, then over subjects whose truth is closed and over all.
    fn by_kind(&self) -> String {
        let names: String = BY_KIND.iter().map(|(name, ..)| format!(" {name} |")).collect();
        let rule = "---|".repeat(BY_KIND.len() + 2);
        let mut text =
            format!("\n## {} by kind\n\n| kind | subjects |{names}\n|{rule}\n", self.name());
        let mut kinds: Vec<&str> =
            self.sheets.iter().filter_map(|sheet| sheet.kind.as_deref()).collect();
        kinds.sort_unstable();
        kinds.dedup();
        for kind in kinds {
            text += &self.means(kind, &|sheet| sheet.kind.as_deref() == Some(kind));
        }
        text += &self.means("closed truths", &|sheet| sheet.closed == Some(true));
        text + &self.means("all", &|_| true)
    }

    fn means(&self, title: &str, is_in: &dyn Fn(&SheetTrial) -> bool) -> String {
        let group: Vec<_> = self.sheets.iter().filter(|sheet| is_in(sheet)).collect();
        let cells = BY_KIND.iter().map(|(_, decimals, figure)| {
            cell(mean(group.iter().filter_map(|sheet| figure(&sheet.trial))), *decimals)
        });
        let cells: String = cells.collect();
        format!("| {title} | {} |{cells}\n", group.len())
    }

    /// One row a subject, in the order of solids.png.
    fn by_subject(&self) -> String {
        let names: String = BY_KIND.iter().map(|(name, ..)| format!(" {name} |")).collect();
        let rule = "---|".repeat(BY_KIND.len() + 2);
        let rows = self.sheets.iter().map(|sheet| {
            let cells =
                BY_KIND.iter().map(|(_, decimals, figure)| cell(figure(&sheet.trial), *decimals));
            let kind = sheet.kind.as_deref().unwrap_or("");
            format!("| {} | {kind} |{}\n", sheet.sheet, cells.collect::<String>())
        });
        let rows: String = rows.collect();
        format!("\n## {} by subject\n\n| subject | kind |{names}\n|{rule}\n{rows}", self.name())
    }

    fn row(&self, decimals: usize, figure: Figure) -> Option<String> {
        let figures: Vec<_> = self.sheets.iter().map(|sheet| figure(&sheet.trial)).collect();
        let mean = mean(figures.iter().flatten().copied())?;
        let cells: String = figures.iter().map(|figure| cell(*figure, decimals)).collect();
        Some(format!("| {} |{cells} {mean:.decimals$} |\n", self.name()))
    }

    fn name(&self) -> String {
        match self.variant {
            "as chosen" => self.set.clone(),
            variant => format!("{} ({variant})", self.set),
        }
    }

    fn failures(&self) -> String {
        let failed = self.sheets.iter().filter_map(|sheet| {
            let failure = sheet.trial.failure.as_ref()?;
            Some(format!("- {}, {}: {failure}\n", sheet.sheet, self.name()))
        });
        failed.collect()
    }
}
