//! Rows of the study's tables, published figures beside ours.

use super::dense::{Bad2, DepthReports};
use super::protocol::{Blocks, descriptor_name, detector_name};
use super::published::{
    FIGURE_4_8, PublishedFeatures, PublishedSheet, TABLE_4_2, TABLE_4_4, TABLE_4_7,
};
use super::ranking::published;
use super::run::{BestTry, Search, Study};
use super::sparse::{Metric, Sweep};
use super::table::{Cell, Table};
use evaluation::{ViewReport, mean};

/// Which of two figures is the better one.
#[derive(Clone, Copy)]
enum Best {
    Most,
    Least,
}

impl Best {
    fn better(self, a: f64, b: f64) -> bool {
        match self {
            Self::Most => a > b,
            Self::Least => a < b,
        }
    }
}

/// What is told of maps by block size.
type BlockFigure = (&'static str, Best, fn(&ViewReport) -> Option<f64>);

const BLOCK_FIGURES: [BlockFigure; 4] = [
    ("correlation", Best::Most, |report| report.correlation),
    ("bad2.0 px", Best::Least, |report| Bad2::Px.of(report)),
    ("bad2.0 grey", Best::Least, |report| Bad2::Grey.of(report)),
    ("bad2.0 grey as listed", Best::Least, |report| Bad2::GreyListed.of(report)),
];

/// The dissertation's sheet for tables 4.1 to 4.4.
pub(super) const DUDE: &str = "dude";

impl Study {
    pub(super) fn dude(&self) -> Option<usize> {
        self.sheets.iter().position(|(name, _)| name == DUDE)
    }

    /// Table 4.2; `only_orb` keeps the rows of table 4.1.
    pub(super) fn feature_table(&self, only_orb: bool) -> Table {
        let rows = self.features.labels.iter().enumerate();
        let kept = rows.filter(|(_, labels)| !only_orb || labels[1] == "ORB");
        let settings: Vec<usize> = kept.map(|(setting, _)| setting).collect();
        self.metric_table(&self.features, &settings, &|labels| {
            TABLE_4_2.iter().find(|row| {
                [detector_name(row.detector), descriptor_name(row.descriptor)] == labels[..]
            })
        })
    }

    /// Table 4.4.
    pub(super) fn cross_check_table(&self) -> Table {
        self.metric_table(&self.cross_check, &[0, 1], &|labels| {
            let on = labels == ["on"];
            TABLE_4_4.iter().find(|(published, _)| *published == on).map(|(_, row)| row)
        })
    }

    fn metric_table(
        &self,
        sweep: &Sweep,
        settings: &[usize],
        published_row: &dyn Fn(&[String]) -> Option<&'static PublishedFeatures>,
    ) -> Table {
        let mut columns = sweep.columns.clone();
        for metric in Metric::ALL {
            let name = metric.name();
            if metric != Metric::SampsonInliers {
                columns.push(format!("{name}, published"));
            }
            columns.extend([format!("{name}, dude"), format!("{name}, mean")]);
        }
        let counts = ["rejected/matches, published", "rejected/matches, dude"];
        let usable = ["usable pairs, dude", "usable pairs, all"];
        columns.extend(counts.into_iter().chain(usable).map(str::to_owned));
        let mut table = Table::new(columns);
        for &setting in settings {
            let labels = &sweep.labels[setting];
            let row = published_row(labels);
            let mut cells: Vec<Cell> = labels.iter().map(|label| label.as_str().into()).collect();
            for metric in Metric::ALL {
                if metric != Metric::SampsonInliers {
                    cells.push(row.map(|row| published(row, metric)).into());
                }
                let dude = self.dude().and_then(|dude| sweep.of_sheet(metric, setting, dude));
                cells.extend([dude.into(), sweep.mean_of_sheets(metric, setting).into()]);
            }
            cells.push(row.map(|row| format!("{}/{}", row.outliers.0, row.outliers.1)).into());
            cells.push(self.dude().map(|dude| fraction(sweep.matches(setting, dude))).into());
            cells.push(self.dude().map(|dude| of(sweep.usable(setting, dude..dude + 1))).into());
            cells.push(of(sweep.usable(setting, 0..sweep.sheets.len())).into());
            table.push(cells);
        }
        table
    }

    /// Figure 4.3: each metric by the varied parameter.
    pub(super) fn parameter_table(&self, sweep: &Sweep) -> Table {
        let names = Metric::ALL
            .map(|metric| [format!("{}, dude", metric.name()), format!("{}, mean", metric.name())]);
        let usable = ["usable pairs".to_owned()];
        let columns = sweep.columns.iter().cloned().chain(names.into_iter().flatten());
        let mut table = Table::new(columns.chain(usable));
        for (setting, labels) in sweep.labels.iter().enumerate() {
            let mut cells: Vec<Cell> = labels.iter().map(|label| label.as_str().into()).collect();
            for metric in Metric::ALL {
                let dude = self.dude().and_then(|dude| sweep.of_sheet(metric, setting, dude));
                cells.extend([dude.into(), sweep.mean_of_sheets(metric, setting).into()]);
            }
            cells.push(of(sweep.usable(setting, 0..sweep.sheets.len())).into());
            table.push(cells);
        }
        table
    }

    /// Figure 4.6, every sheet.
    pub(super) fn block_table(&self) -> Table {
        let columns = ["block_size", "sheet"].into_iter().chain(VIEW_COLUMNS).chain(["failure"]);
        let mut table = Table::new(columns);
        for row in &self.blocks {
            let sheet = self.sheets[row.sheet].0.as_str();
            let mut cells = vec![row.blocks.name().into(), sheet.into()];
            cells.extend(view_cells(row.report.as_ref().ok()));
            cells.push(row.report.as_ref().err().cloned().into());
            table.push(cells);
        }
        table
    }

    /// Figure 4.6: a figure of the dude, or the mean of all sheets that have
    /// it, under one setting.
    fn block_figure(
        &self,
        blocks: &Blocks,
        dude_only: bool,
        figure: &dyn Fn(&ViewReport) -> Option<f64>,
    ) -> Option<f64> {
        let rows = self.blocks.iter().filter(|row| row.blocks == *blocks);
        let rows = rows.filter(|row| !dude_only || Some(row.sheet) == self.dude());
        mean(rows.filter_map(|row| figure(row.report.as_ref().ok()?)))
    }

    /// Figure 4.6's curve, by single block size.
    pub(super) fn by_block(
        &self,
        dude_only: bool,
        figure: &dyn Fn(&ViewReport) -> Option<f64>,
    ) -> Vec<(f64, f64)> {
        let point = |blocks: &Blocks| {
            let value = self.block_figure(blocks, dude_only, figure)?;
            Some((f64::from(blocks.single()?), value))
        };
        self.protocol.blocks().iter().filter_map(point).collect()
    }

    /// Figure 4.6 in short, fused block sizes last.
    pub(super) fn block_means(&self) -> Table {
        let names = BLOCK_FIGURES
            .map(|(name, _, _)| ["dude", "mean"].map(|of| format!("{name}, {of}")))
            .into_iter()
            .flatten();
        let mut table = Table::new(std::iter::once("block size".to_owned()).chain(names));
        for blocks in self.protocol.blocks() {
            let mut cells: Vec<Cell> = vec![blocks.name().into()];
            for (_, _, figure) in BLOCK_FIGURES {
                let of = |dude_only| self.block_figure(&blocks, dude_only, &figure);
                cells.extend([of(true).into(), of(false).into()]);
            }
            table.push(cells);
        }
        table
    }

    /// Means over the sheets: the best single block size, and the fused ones.
    pub(super) fn fusion_table(&self) -> Table {
        let fusions = self.protocol.blocks().into_iter().filter(|it| it.single().is_none());
        let fusions: Vec<Blocks> = fusions.collect();
        let head = ["figure", "best single block", "its mean"].map(str::to_owned);
        let fused = fusions.iter().flat_map(|it| [it.name(), format!("{} is better", it.name())]);
        let mut table = Table::new(head.into_iter().chain(fused));
        for (name, best, figure) in BLOCK_FIGURES {
            let better = |a: f64, b: f64| best.better(a, b);
            let single = self.by_block(false, &figure).into_iter();
            let single = single.reduce(|a, b| if better(b.1, a.1) { b } else { a });
            let mut cells: Vec<Cell> = vec![
                name.into(),
                single.map(|(size, _)| size.to_string()).into(),
                single.map(|(_, value)| value).into(),
            ];
            for blocks in &fusions {
                let value = self.block_figure(blocks, false, &figure);
                cells.push(value.into());
                let verdict = value.zip(single).map(|(value, (_, single))| better(value, single));
                cells.push(verdict.map(|yes| if yes { "yes" } else { "no" }.to_owned()).into());
            }
            table.push(cells);
        }
        table
    }

    /// Figure 4.8: left, right, mean; depth by both relations.
    pub(super) fn map_table(&self) -> Table {
        let head = ["sheet", "map", "bad2.0, published", "correlation, published"];
        let mut table = Table::new(head.into_iter().chain(VIEW_COLUMNS).chain(["failure"]));
        for ((name, _), row) in self.sheets.iter().zip(&self.maps) {
            for (index, (map, report)) in row.maps.iter().enumerate() {
                let published = (name == DUDE).then(|| FIGURE_4_8[index]);
                let mut cells: Vec<Cell> = vec![
                    name.as_str().into(),
                    map.name().into(),
                    published.map(|figures| figures.0).into(),
                    published.map(|figures| figures.1).into(),
                ];
                cells.extend(view_cells(report.as_ref().ok()));
                cells.push(report.as_ref().err().cloned().into());
                table.push(cells);
            }
        }
        table
    }

    /// Depth of the mean maps by the inverse and by the affine relation.
    pub(super) fn depth_table(&self) -> Table {
        let columns = ["sheet", "relation"].into_iter().chain(VIEW_COLUMNS);
        let mut table = Table::new(columns.chain(["depth error over range"]));
        for ((name, _), row) in self.sheets.iter().zip(&self.maps) {
            for (relation, report) in relations(row.depths.as_ref()) {
                let mut cells: Vec<Cell> = vec![name.as_str().into(), relation.into()];
                cells.extend(view_cells(report));
                cells.push(report.and_then(|report| report.depth_error_over_range).into());
                table.push(cells);
            }
        }
        table
    }

    /// Table 4.7: the mean map at the best block size and least disparity.
    pub(super) fn whole_table(&self) -> Table {
        let head = [
            "sheet",
            "spacing (°)",
            "published as",
            "bad2.0, published",
            "correlation, published",
            "chosen by",
            "block",
            "min disparity",
        ];
        let tail = ["depth correlation, inverse", "depth correlation, affine", "failure"];
        let mut table = Table::new(head.into_iter().chain(VIEW_COLUMNS).chain(tail));
        for search in &self.searches {
            for (bad2, found) in &search.best {
                table.push(whole_row(search, *bad2, found.as_ref()));
            }
        }
        table
    }

    /// Table 4.8: block sizes and least disparities.
    pub(super) fn parameters_table(&self) -> Table {
        let head = ["sheet", "published as", "block, published", "min disparity, published"];
        let ours = Bad2::ALL.map(|bad2| {
            [format!("block by {}", bad2.name()), format!("min disparity by {}", bad2.name())]
        });
        let columns = head.map(str::to_owned).into_iter().chain(ours.into_iter().flatten());
        let mut table = Table::new(columns);
        for search in &self.searches {
            let row = published_sheet(search);
            let mut cells: Vec<Cell> = vec![
                sheet_name(search).into(),
                row.map(|row| row.name).into(),
                row.map(|row| row.block_size).into(),
                row.map(|row| row.min_disparity_px).into(),
            ];
            for (_, found) in &search.best {
                let found = found.as_ref();
                cells.push(found.map(|found| found.block_size).into());
                cells.push(found.map(|found| found.min_disparity_px).into());
            }
            table.push(cells);
        }
        table
    }

    /// Every point of every search.
    pub(super) fn grid_table(&self) -> Table {
        let head = ["sheet", "spacing_deg", "block_size", "min_disparity_px"];
        let mut table = Table::new(head.into_iter().chain(VIEW_COLUMNS).chain(["failure"]));
        for search in &self.searches {
            for found in &search.tries {
                let mut cells: Vec<Cell> = vec![
                    search.name.as_str().into(),
                    search.spacing_deg.into(),
                    found.block_size.into(),
                    found.min_disparity_px.into(),
                ];
                cells.extend(view_cells(found.measured.as_ref().ok()));
                cells.push(found.measured.as_ref().err().cloned().into());
                table.push(cells);
            }
        }
        table
    }
}

fn whole_row(search: &Search, bad2: Bad2, found: Option<&BestTry>) -> Vec<Cell> {
    let row = published_sheet(search);
    let mut cells: Vec<Cell> = vec![
        search.name.as_str().into(),
        search.spacing_deg.into(),
        row.map(|row| row.name).into(),
        row.map(|row| row.bad2).into(),
        row.map(|row| row.correlation).into(),
        bad2.name().into(),
        found.map(|found| found.block_size).into(),
        found.map(|found| found.min_disparity_px).into(),
    ];
    cells.extend(view_cells(found.and_then(|found| found.mean.as_ref().ok())));
    let depths = relations(found.and_then(|found| found.depths.as_ref()));
    cells.extend(depths.map(|(_, report)| Cell::from(report.and_then(|r| r.correlation))));
    let failure = match found {
        Some(found) => found.mean.as_ref().err().cloned(),
        None => search.tries.iter().find_map(|found| found.measured.as_ref().err().cloned()),
    };
    cells.push(failure.into());
    cells
}

fn relations(depths: Option<&DepthReports>) -> [(&'static str, Option<&ViewReport>); 2] {
    [
        ("inverse", depths.and_then(|depths| depths.inverse.as_ref())),
        ("affine", depths.and_then(|depths| depths.affine.as_ref())),
    ]
}

fn published_sheet(search: &Search) -> Option<&'static PublishedSheet> {
    TABLE_4_7
        .iter()
        .find(|row| row.sheet == search.name && (row.spacing_deg - search.spacing_deg).abs() < 1e-3)
}

/// With the spacing where it is not the usual one.
fn sheet_name(search: &Search) -> String {
    format!("{} at {}°", search.name, search.spacing_deg)
}

const VIEW_COLUMNS: [&str; 7] = [
    "correlation",
    "bad2.0 px",
    "best constant px",
    "bad2.0 grey",
    "bad2.0 grey as listed",
    "best constant grey",
    "coverage",
];

fn view_cells(report: Option<&ViewReport>) -> [Cell; 7] {
    [
        report.and_then(|report| report.correlation).into(),
        report.and_then(|report| Bad2::Px.of(report)).into(),
        report.and_then(|report| report.bad2_px.map(|bad| bad.best_constant)).into(),
        report.and_then(|report| Bad2::Grey.of(report)).into(),
        report.and_then(|report| Bad2::GreyListed.of(report)).into(),
        report.map(|report| report.bad2_grey.best_constant).into(),
        report.map(|report| report.coverage).into(),
    ]
}

/// `8/60`.
fn fraction((part, whole): (f64, f64)) -> String {
    format!("{part}/{whole}")
}

fn of((part, whole): (usize, usize)) -> String {
    format!("{part} of {whole}")
}
