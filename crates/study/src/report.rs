//! The report in Markdown.

use std::fmt::Write;

use super::protocol::{Protocol, is_gradient};
use super::published::TABLE_4_2;
use super::ranking::{Ranking, published, rank_correlation};
use super::run::Study;
use super::sparse::Metric;
use super::table::{Cell, Table, short};
use uncalibrated::options::Detector;

/// A statistic of a metric under a setting: the dude's, or over all sheets.
type Statistic<'a> = &'a dyn Fn(Metric, usize) -> Option<f64>;

pub(super) fn report(study: &Study) -> String {
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = write_report(study, &mut text);
    text
}

fn write_report(study: &Study, text: &mut String) -> std::fmt::Result {
    writeln!(text, "# The tables and figures of Arys 2020, chapter 4, on our sheets\n")?;
    write_protocol(study, text)?;
    section(text, "Table 4.1: detectors with ORB descriptors", &study.feature_table(true))?;
    section(text, "Table 4.2: detectors and descriptors", &study.feature_table(false))?;
    write_ranking(study, text)?;
    section(text, "Table 4.4: cross-check", &study.cross_check_table())?;
    let thresholds = study.parameter_table(&study.thresholds);
    section(text, "Figure 4.3a: metrics by reprojection threshold", &thresholds)?;
    writeln!(text, "\n![figure 4.3a](figure_4_3a.svg)")?;
    let confidences = study.parameter_table(&study.confidences);
    section(text, "Figure 4.3b: metrics by confidence", &confidences)?;
    writeln!(text, "\n![figure 4.3b](figure_4_3b.svg)")?;
    section(text, "Figure 4.6: the mean map by block size", &study.block_means())?;
    writeln!(text, "\n![figure 4.6](figure_4_6.svg)")?;
    let title = "Fusion against the best single block size, means of the sheets";
    section(text, title, &study.fusion_table())?;
    section(text, "Figure 4.8: left map, right map and their mean", &study.map_table())?;
    writeln!(text, "\n![figure 4.8](figure_4_8.svg)")?;
    section(text, "Depth of the mean maps, by both relations", &study.depth_table())?;
    section(text, "Table 4.7: the whole method", &study.whole_table())?;
    section(text, "Table 4.8: block size and least disparity", &study.parameters_table())
}

fn section(text: &mut String, title: &str, table: &Table) -> std::fmt::Result {
    write!(text, "\n## {title}\n\n{}", table.markdown())
}

fn write_protocol(study: &Study, text: &mut String) -> std::fmt::Result {
    let Protocol { base, grid, .. } = &study.protocol;
    let names: Vec<_> =
        study.sheets.iter().map(|(name, spacing)| format!("{name} ({spacing}°)")).collect();
    writeln!(
        text,
        "Sheets, each with the angle between its views: {}. Of each, three neighbouring views are \
         used, the middle one with truth and as near to 45° as there is: two pairs a sheet. \
         \"dude\" is that sheet's mean over its two pairs, \"mean\" the mean of all sheets' means; \
         pairs without a figure are left out of means and counted under usable pairs. \
         Failures are rows too. Seed {}, nothing is run twice for a better result.\n",
        names.join(", "),
        base.seed
    )?;
    writeln!(
        text,
        "Units. MSD is a square, px²: over all matches, and over the inliers. SEV is of F with \
         F₃₃ = 1. Eo and Ea are relative deviations from 90° and 1, the mean of both \
         homographies; published percentages are given as shares. Maps are measured over the \
         truth's mask, missing pixels being bad. `px`: errors over 2 px of the 5° pair's \
         disparity, nothing fitted. `grey`: over 2 levels, both maps stretched to 8 bits. `grey \
         as listed`: as the dissertation's listing counts, in which an 8-bit subtraction \
         saturates and nothing that is too bright is bad. `best constant`: what the best map \
         without any content would score. Which unit the published bad2.0 have is not said.\n"
    )?;
    writeln!(
        text,
        "Tables 4.7 and 4.8 search least disparities {} to {} px and blocks {:?} px on the left \
         map, by each reading of bad2.0, and show the mean map there. Published figures are for \
         the dissertation's own sheets, which are not public; its Batman stands beside another \
         figure.",
        grid.min_disparities_px.iter().min().copied().unwrap_or_default(),
        grid.min_disparities_px.iter().max().copied().unwrap_or_default(),
        grid.block_sizes,
    )
}

fn write_ranking(study: &Study, text: &mut String) -> std::fmt::Result {
    writeln!(text, "\n### Does the published order hold?\n")?;
    writeln!(
        text,
        "The dissertation has the gradient detectors, Harris and Shi-Tomasi, ahead. \"Holds\": \
         the median over their combinations is better than the others', and they are more than \
         half of as many best rows as there are of them. \"In part\": one of both. The last \
         column is Spearman's rank correlation of our order with the published one, over the \
         combinations that have both.\n"
    )?;
    let mut table = Table::new([
        "metric",
        "figures",
        "median, gradient",
        "median, others",
        "among the best",
        "verdict",
        "rank correlation",
    ]);
    for metric in Metric::ALL {
        let of_dude = |metric, setting| study.features.of_sheet(metric, setting, study.dude()?);
        let mean = |metric, setting| study.features.mean_of_sheets(metric, setting);
        let median = |metric, setting| study.features.median_of_sheets(metric, setting);
        if metric != Metric::SampsonInliers {
            let rows = TABLE_4_2.iter().map(|row| (row.detector, Some(published(row, metric))));
            table.push(ranking_row(metric, "published", &rows.collect::<Vec<_>>(), None));
        }
        let statistics: [(&str, Statistic<'_>); 3] =
            [("dude", &of_dude), ("mean of the sheets", &mean), ("median of the sheets", &median)];
        for (name, statistic) in statistics {
            let rows = rows_of(study, metric, statistic);
            table.push(ranking_row(metric, name, &rows, agreement(study, metric, statistic)));
        }
    }
    write!(text, "{}", table.markdown())?;
    writeln!(text)?;
    for (name, index) in [("the dude", 0), ("the mean of the sheets", 1)] {
        writeln!(text, "{}", sentence(study, name, index))?;
    }
    Ok(())
}

/// Combinations that can be run, with their figures.
fn rows_of(study: &Study, metric: Metric, of: Statistic<'_>) -> Vec<(Detector, Option<f64>)> {
    let combinations = study.protocol.combinations.iter().enumerate();
    let known = combinations.filter(|(_, combination)| has_published(combination));
    known.map(|(setting, (detector, _))| (*detector, of(metric, setting))).collect()
}

fn has_published(combination: &(Detector, uncalibrated::options::Descriptor)) -> bool {
    TABLE_4_2.iter().any(|row| (row.detector, row.descriptor) == *combination)
}

fn ranking_row(
    metric: Metric,
    figures: &str,
    rows: &[(Detector, Option<f64>)],
    agreement: Option<f64>,
) -> Vec<Cell> {
    let found = Ranking::of(rows);
    vec![
        metric.name().into(),
        figures.into(),
        found.gradient.into(),
        found.others.into(),
        format!("{} of {}", found.among_best, found.gradient_rows).into(),
        found.verdict().name().into(),
        agreement.into(),
    ]
}

fn agreement(study: &Study, metric: Metric, of: Statistic<'_>) -> Option<f64> {
    let combinations = study.protocol.combinations.iter().enumerate();
    let pairs = combinations.filter_map(|(setting, combination)| {
        let row = TABLE_4_2.iter().find(|row| (row.detector, row.descriptor) == *combination)?;
        Some((published(row, metric), of(metric, setting)?))
    });
    rank_correlation(&pairs.collect::<Vec<_>>())
}

/// The verdicts on MSD and outliers in words.
fn sentence(study: &Study, name: &str, index: usize) -> String {
    let verdicts = [Metric::SampsonAll, Metric::SampsonInliers, Metric::Outliers].map(|metric| {
        let of_dude = |metric, setting| study.features.of_sheet(metric, setting, study.dude()?);
        let mean = |metric, setting| study.features.mean_of_sheets(metric, setting);
        let statistics: [Statistic<'_>; 2] = [&of_dude, &mean];
        let found = Ranking::of(&rows_of(study, metric, statistics[index]));
        let value = |value: Option<f64>| value.map_or("–".to_owned(), short);
        format!(
            "{}: {} ({} against {})",
            metric.name(),
            found.verdict().name(),
            value(found.gradient),
            value(found.others)
        )
    });
    let gradient =
        study.protocol.combinations.iter().filter(|(detector, _)| is_gradient(*detector));
    format!(
        "\nGradient detectors ahead, {} combinations, for {name}: {}.",
        gradient.count(),
        verdicts.join("; ")
    )
}
