//! Which files the study makes.

use super::dense::{Bad2, Map};
use super::plots::{Panel, PlotError, Series, svg};
use super::report::report;
use super::run::{Study, StudyFile};
use super::sparse::{Metric, Sweep};

/// Figure 4.3's metrics.
const CURVES: [Metric; 4] =
    [Metric::SampsonAll, Metric::Outliers, Metric::Orthogonality, Metric::AspectRatio];

pub(super) fn files(study: &Study) -> Result<Vec<StudyFile>, PlotError> {
    let file = |name: &str, text| StudyFile { name: name.to_owned(), text };
    Ok(vec![
        file("report.md", report(study)),
        file("table_4_1.csv", study.feature_table(true).csv()),
        file("table_4_2.csv", study.feature_table(false).csv()),
        file("table_4_2_pairs.csv", study.features.table().csv()),
        file("table_4_4.csv", study.cross_check_table().csv()),
        file("table_4_4_pairs.csv", study.cross_check.table().csv()),
        file("table_4_7.csv", study.whole_table().csv()),
        file("table_4_8.csv", study.parameters_table().csv()),
        file("table_4_8_grid.csv", study.grid_table().csv()),
        file("figure_4_3a.csv", study.parameter_table(&study.thresholds).csv()),
        file("figure_4_3a_pairs.csv", study.thresholds.table().csv()),
        file("figure_4_3a.svg", threshold_plot(study)?),
        file("figure_4_3b.csv", study.parameter_table(&study.confidences).csv()),
        file("figure_4_3b_pairs.csv", study.confidences.table().csv()),
        file("figure_4_3b.svg", confidence_plot(study)?),
        file("figure_4_6.csv", study.block_table().csv()),
        file("figure_4_6.svg", block_plot(study)?),
        file("figure_4_8.csv", study.map_table().csv()),
        file("figure_4_8.svg", map_plot(study)?),
        file("depth.csv", study.depth_table().csv()),
    ])
}

fn threshold_plot(study: &Study) -> Result<String, PlotError> {
    let xs = &study.protocol.thresholds_px;
    let panels = metric_panels(study, &study.thresholds, xs, "reprojection threshold (px)");
    svg("figure_4_3a", &panels, 2)
}

fn confidence_plot(study: &Study) -> Result<String, PlotError> {
    let panels =
        metric_panels(study, &study.confidences, &study.protocol.confidences, "confidence");
    svg("figure_4_3b", &panels, 2)
}

fn metric_panels(study: &Study, sweep: &Sweep, xs: &[f64], x_label: &str) -> Vec<Panel> {
    CURVES
        .iter()
        .map(|&metric| {
            // Distances span decades.
            let log = metric == Metric::SampsonAll;
            let scaled = |y: f64| if log { y.max(1e-12).log10() } else { y };
            let curve = |of: &dyn Fn(usize) -> Option<f64>| {
                let points = xs.iter().enumerate();
                points.filter_map(|(setting, &x)| Some((x, scaled(of(setting)?)))).collect()
            };
            let dude = curve(&|setting| sweep.of_sheet(metric, setting, study.dude()?));
            let mean = curve(&|setting| sweep.mean_of_sheets(metric, setting));
            Panel {
                title: metric.name().to_owned(),
                x_label: x_label.to_owned(),
                y_label: if log { "log10".to_owned() } else { String::new() },
                series: vec![Series::new("dude", dude), Series::new("mean of the sheets", mean)],
                ..Panel::default()
            }
        })
        .collect()
}

fn block_plot(study: &Study) -> Result<String, PlotError> {
    let panel = |title: &str, series: Vec<Series>| Panel {
        title: title.to_owned(),
        x_label: "block size (px)".to_owned(),
        series,
        ..Panel::default()
    };
    let correlation = |dude| study.by_block(dude, &|report| report.correlation);
    let bad = |dude| {
        Bad2::ALL
            .map(|bad2| Series::new(bad2.name(), study.by_block(dude, &|report| bad2.of(report))))
    };
    let panels = [
        panel(
            "correlation",
            vec![
                Series::new("dude", correlation(true)),
                Series::new("mean of the sheets", correlation(false)),
            ],
        ),
        panel("bad2.0, dude", bad(true).into()),
        panel("bad2.0, mean of the sheets", bad(false).into()),
    ];
    svg("figure_4_6", &panels, 3)
}

fn map_plot(study: &Study) -> Result<String, PlotError> {
    let categories: Vec<String> = study.sheets.iter().map(|(name, _)| name.clone()).collect();
    let panel = |title: &str, figure: &dyn Fn(&evaluation::ViewReport) -> Option<f64>| {
        let series = Map::ALL.iter().enumerate().map(|(index, map)| {
            let rows = study.maps.iter().enumerate();
            let points = rows.filter_map(|(sheet, row)| {
                let report = row.maps[index].1.as_ref().ok()?;
                Some((sheet as f64, figure(report)?))
            });
            Series::new(map.name(), points.collect())
        });
        Panel {
            title: title.to_owned(),
            series: series.collect(),
            categories: categories.clone(),
            ..Panel::default()
        }
    };
    let panels = [
        panel("correlation", &|report| report.correlation),
        panel("bad2.0 (px)", &|report| Bad2::Px.of(report)),
        panel("bad2.0 (grey as listed)", &|report| Bad2::GreyListed.of(report)),
    ];
    svg("figure_4_8", &panels, 1)
}
