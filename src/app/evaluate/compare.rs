//! What changed since another run of `evaluate`.

use std::fmt::Write;
use std::fs;
use std::path::Path;

use anyhow::{Context, Result};
use evaluation::mean;
use serde::Deserialize;

/// A change of IoU that is told of by name.
const TOLD: f64 = 0.005;
/// At most so many subjects are named either way.
const MOST_NAMED: usize = 12;

/// What is compared: name, key in `solid`, factor, whether more is better.
const FIGURES: &[(&str, &str, f64, bool)] = &[
    ("IoU", "iou", 1.0, true),
    ("Chamfer-L1, %", "chamfer_l1", 100.0, false),
    ("normal consistency", "normal_consistency", 1.0, true),
    ("shelf share", "shelf_share", 1.0, false),
];

/// As much of `evaluation.json` as is compared.
#[derive(Deserialize)]
pub(super) struct Evaluation {
    runs: Vec<Run>,
}

#[derive(Deserialize)]
struct Run {
    set: String,
    variant: String,
    sheets: Vec<Sheet>,
}

#[derive(Deserialize)]
struct Sheet {
    sheet: String,
    solid: Option<serde_json::Map<String, serde_json::Value>>,
    seconds: f64,
}

impl Evaluation {
    /// * `path`: `evaluation.json`, or the folder that it is in.
    pub(super) fn read(path: &Path) -> Result<Self> {
        let path = if path.is_dir() { path.join("evaluation.json") } else { path.to_owned() };
        let named = || format!("--compare {}", path.display());
        let bytes = fs::read(&path).with_context(named)?;
        serde_json::from_slice(&bytes).with_context(named)
    }

    /// Tables of what got better and worse from `before` to this run, over what both have.
    pub(super) fn since(&self, before: &Self) -> String {
        let mut text = "# What changed\n".to_owned();
        for run in &self.runs {
            let same = |other: &&Run| other.set == run.set && other.variant == run.variant;
            if let Some(old) = before.runs.iter().find(same) {
                text += &changes(old, run);
            }
        }
        text
    }
}

impl Sheet {
    fn figure(&self, key: &str) -> Option<f64> {
        self.solid.as_ref()?.get(key)?.as_f64()
    }
}

fn changes(before: &Run, after: &Run) -> String {
    let pairs: Vec<(&Sheet, &Sheet)> = after
        .sheets
        .iter()
        .filter_map(|new| Some((before.sheets.iter().find(|old| old.sheet == new.sheet)?, new)))
        .collect();
    let mut text = format!("\n## {} ({})\n\n", after.set, after.variant);
    text += "| measure | subjects | before | after | change | better | worse |\n";
    text += "|---|---|---|---|---|---|---|\n";
    for &(name, key, factor, more_is_better) in FIGURES {
        let both = pairs
            .iter()
            .filter_map(|(old, new)| Some((factor * old.figure(key)?, factor * new.figure(key)?)));
        let both: Vec<(f64, f64)> = both.collect();
        text += &row(name, &both, more_is_better);
    }
    let times: Vec<(f64, f64)> =
        pairs.iter().map(|(old, new)| (old.seconds, new.seconds)).collect();
    text += &row("time, s", &times, false);
    let mut moved: Vec<(f64, &str, f64)> = pairs
        .iter()
        .filter_map(|(old, new)| {
            let (old, iou) = (old.figure("iou")?, new.figure("iou")?);
            Some((iou - old, new.sheet.as_str(), iou))
        })
        .filter(|(change, ..)| change.abs() >= TOLD)
        .collect();
    moved.sort_by(|a, b| b.0.total_cmp(&a.0).then(a.1.cmp(b.1)));
    let list = |title: &str, moved: Vec<&(f64, &str, f64)>| {
        let named = moved.iter().take(MOST_NAMED);
        let words: Vec<String> =
            named.map(|(change, name, iou)| format!("{name} {change:+.3} (to {iou:.3})")).collect();
        match words.len() {
            0 => String::new(),
            _ => format!("\nIoU {title}: {}.\n", words.join(", ")),
        }
    };
    text += &list("better", moved.iter().filter(|moved| moved.0 > 0.0).collect());
    text + &list("worse", moved.iter().rev().filter(|moved| moved.0 < 0.0).collect())
}

fn row(name: &str, both: &[(f64, f64)], more_is_better: bool) -> String {
    let (Some(before), Some(after)) =
        (mean(both.iter().map(|pair| pair.0)), mean(both.iter().map(|pair| pair.1)))
    else {
        return String::new();
    };
    let rose = both.iter().filter(|(old, new)| new > old).count();
    let sank = both.iter().filter(|(old, new)| new < old).count();
    let (better, worse) = if more_is_better { (rose, sank) } else { (sank, rose) };
    let mut text = String::new();
    // Writing to a string cannot fail.
    let _ = writeln!(
        text,
        "| {name} | {} | {before:.3} | {after:.3} | {:+.3} | {better} | {worse} |",
        both.len(),
        after - before
    );
    text
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    fn evaluation(ious: &[(&str, f64)]) -> Evaluation {
        let sheet = |(name, iou): &(&str, f64)| json!({"sheet": name, "seconds": 1.0, "solid": {"iou": iou, "chamfer_l1": 0.01}});
        let sheets: Vec<_> = ious.iter().map(sheet).collect();
        let run = json!({"set": "T5", "variant": "as chosen", "sheets": sheets, "more": 1});
        serde_json::from_value(json!({"runs": [run], "version": "0"})).unwrap()
    }

    #[test]
    fn what_both_have_is_compared_and_named() {
        let before = evaluation(&[("fox", 0.5), ("cat", 0.7), ("dog", 0.9), ("gone", 0.1)]);
        let after = evaluation(&[("new", 0.2), ("cat", 0.75), ("fox", 0.45), ("dog", 0.901)]);
        let text = after.since(&before);
        assert!(text.contains("| IoU | 3 | 0.700 | 0.700 | +0.000 | 2 | 1 |"), "{text}");
        assert!(text.contains("IoU better: cat +0.050 (to 0.750).\n"), "{text}");
        assert!(text.contains("IoU worse: fox -0.050 (to 0.450).\n"), "{text}");
        assert!(text.contains("| time, s | 3 |") && !text.contains("shelf"), "{text}");
    }
}
