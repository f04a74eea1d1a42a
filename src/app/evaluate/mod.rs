//! Runs the turntable method on sheets with ground truth and tabulates how good
//! its depths and solids are.

mod contact;
mod report;
mod sets;
mod trial;

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use serde_json::{Value, json};

use super::config::LimitConfig;
use super::failure::Failure;
use super::inputs;
use crate::draft;

use report::Report;
use sets::{SETS, Variant, ViewSet, variants};
use trial::{SheetFolder, Trial};

#[derive(Args, Debug)]
pub(super) struct EvaluateArgs {
    /// Folders that hold sheet.json with its drawings, true depths and true model
    #[arg(value_name = "DIR", required = true)]
    sheets: Vec<PathBuf>,
    /// Folder for evaluation.json, evaluation.md and contact.png; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// View sets to run, by name; all by default
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    sets: Vec<String>,
    /// Also run with the solid's ingredients added one by one
    #[arg(long)]
    ablation: bool,
    /// An option by its dotted name, such as turntable.solid.holes=eager; repeatable
    #[arg(long, value_name = "OPTION=VALUE")]
    set: Vec<String>,
    /// Threads to compute with; 0 uses all processors
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    #[command(flatten)]
    limits: LimitConfig,
}

/// Runs every view set on every sheet and writes the report.
pub(super) fn run(args: &EvaluateArgs) -> Result<(), Failure> {
    let sets = chosen_sets(&args.sets).map_err(Failure::Usage)?;
    let options = chosen_options(&args.set)?;
    let variants = variants(args.ablation);
    let threads = inputs::threads(args.threads);
    let bar = progress_bar(args.sheets.len() * sets.len() * variants.len());
    let mut report = Report::new(&options);
    let mut contacts = Vec::new();
    for path in &args.sheets {
        let folder = SheetFolder::open(path, &args.limits.image()).map_err(Failure::Input)?;
        for (set, variant) in sets.iter().flat_map(|set| variants.iter().map(move |v| (set, v))) {
            bar.set_message(format!("{} {} {}", folder.name(), set.name, variant.name));
            let trial = try_out(&folder, set, variant, &options, threads)?;
            contacts.extend(trial.picture.clone());
            report.add(set, variant, folder.name(), trial);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    write(&args.output, &report, &contacts).map_err(Failure::Internal)?;
    print!("{}", report.markdown());
    Ok(())
}

fn try_out(
    folder: &SheetFolder,
    set: &ViewSet,
    variant: &Variant,
    options: &Value,
    threads: usize,
) -> Result<Trial, Failure> {
    let mut options = options.clone();
    options::merge(&mut options, variant.options.clone());
    folder.try_out(set, options, threads).map_err(Failure::Internal)
}

fn chosen_sets(names: &[String]) -> Result<Vec<&'static ViewSet>> {
    if names.is_empty() {
        return Ok(SETS.iter().collect());
    }
    let known = || SETS.iter().map(|set| set.name).collect::<Vec<_>>().join(", ");
    let find = |name: &String| {
        let found = SETS.iter().find(|set| set.name.eq_ignore_ascii_case(name));
        found.ok_or_else(|| anyhow!("--sets: there is no view set {name}; there are {}", known()))
    };
    names.iter().map(find).collect()
}

fn chosen_options(settings: &[String]) -> Result<Value, Failure> {
    let mut chosen = json!({"method": "turntable"});
    inputs::lay_over(&mut chosen, settings).map_err(Failure::Usage)?;
    draft::options::parse(&chosen)
        .map_err(|problems| Failure::Input(anyhow!("options: {problems}")))?;
    Ok(chosen)
}

fn write(folder: &Path, report: &Report, contacts: &[contact::Row]) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    fs::write(folder.join("evaluation.json"), serde_json::to_vec_pretty(report)?)?;
    fs::write(folder.join("evaluation.md"), report.markdown())?;
    if let Some(picture) = contact::sheet(contacts) {
        picture.save(folder.join("contact.png"))?;
    }
    Ok(())
}

fn progress_bar(trials: usize) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}").expect("the template is valid");
    ProgressBar::new(trials as u64).with_style(style)
}
