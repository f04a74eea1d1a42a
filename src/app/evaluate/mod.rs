//! Runs the turntable method on sheets with ground truth, and on 3D models that it
//! draws first, and tabulates how good its depths and solids are.

mod compare;
mod contact;
mod corpus;
mod report;
mod sets;
mod trial;

use std::collections::BTreeMap;
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
use drawing::DrawOptions;
use evaluation::ComparisonOptions;

use compare::Evaluation;
use corpus::Subject;
use report::Report;
use sets::{Variant, ViewSet, usual_sets, variants};
use trial::{Setting, Trial, TruthSheet};

#[derive(Args, Debug)]
pub(super) struct EvaluateArgs {
    /// Folders that hold sheet.json with its drawings, true depths and true model; 3D models,
    /// which are drawn first; or folders of either, other files in them being passed over
    #[arg(value_name = "PATH", required = true)]
    paths: Vec<PathBuf>,
    /// Folder for evaluation.json, evaluation.md, contact.png and solids.png; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// View sets to run, by name; all by default, none beside those of --view-set
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    sets: Vec<String>,
    /// A view set of one's own, such as T5=0:180:45, or with views from above FST=0,90,0@90;
    /// repeatable
    #[arg(long = "view-set", value_name = "NAME=AZIMUTHS")]
    view_sets: Vec<ViewSet>,
    /// Markdown tables with columns name, kind and solid: means are told by kind, and over
    /// subjects whose truth is closed (solid from 0.6 on)
    #[arg(long, value_name = "FILE")]
    index: Option<PathBuf>,
    /// Subjects to run, by name; all by default
    #[arg(long, value_name = "NAMES", value_delimiter = ',')]
    only: Vec<String>,
    /// A drawing option for models, such as ink=flat or width_px=480; repeatable. They are fitted
    /// to the frame
    #[arg(long, value_name = "OPTION=VALUE")]
    draw: Vec<String>,
    /// How much lower views from above and below are drawn than they say, degrees
    #[arg(long, value_name = "DEGREES", default_value_t = 0.0, allow_hyphen_values = true)]
    elevation_error: f64,
    /// Another run's folder: changes.md tells what got better and worse since
    #[arg(long, value_name = "DIR")]
    compare: Option<PathBuf>,
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
    let sets = chosen_sets(&args.sets, &args.view_sets).map_err(Failure::Usage)?;
    let (options, comparison) = chosen_options(&args.set)?;
    let draw = drawing_options(&args.draw).map_err(Failure::Usage)?;
    let before = args.compare.as_deref().map(Evaluation::read).transpose();
    let before = before.map_err(Failure::Input)?;
    let subjects = chosen_subjects(args).map_err(Failure::Input)?;
    let mut viewpoints = Vec::new();
    for view in sets.iter().flat_map(ViewSet::viewpoints) {
        viewpoints.push(trial::drawn_from(view, args.elevation_error).map_err(Failure::Usage)?);
    }
    viewpoints.sort_unstable();
    viewpoints.dedup();
    let limits = args.limits.image();
    let setting = Setting {
        limits,
        draw: &draw,
        viewpoints: &viewpoints,
        elevation_error: args.elevation_error,
        comparison,
    };
    let variants = variants(args.ablation);
    let threads = inputs::threads(args.threads);
    let bar = progress_bar(subjects.len() * sets.len() * variants.len());
    let mut report = Report::new(&options, &draw);
    let mut pictures = Pictures::default();
    for subject in &subjects {
        let name = &subject.name;
        let sheet = match TruthSheet::open(subject, &setting) {
            Ok(sheet) => sheet,
            // One bad model does not cost the run of a corpus.
            Err(error) if subjects.len() > 1 => {
                bar.suspend(|| eprintln!("{name}: {error:#}"));
                report.refused(name, &format!("{error:#}"));
                bar.inc((sets.len() * variants.len()) as u64);
                continue;
            }
            Err(error) => return Err(Failure::Input(error)),
        };
        let mut entry = subject.entry.clone();
        entry.closed = entry.closed.or_else(|| sheet.is_closed());
        for (set, variant) in sets.iter().flat_map(|set| variants.iter().map(move |v| (set, v))) {
            bar.set_message(format!("{name} {} {}", set.name, variant.name));
            let mut trial = try_out(&sheet, set, variant, &options, threads)?;
            pictures.depths.extend(trial.picture.take());
            let is_first = set.name == sets[0].name && variant.name == variants[0].name;
            pictures.solids.extend(trial.solids.take().filter(|_| is_first));
            report.add(set, variant, name, &entry, trial);
            bar.inc(1);
        }
    }
    bar.finish_and_clear();
    write(&args.output, &report, &pictures, before.as_ref()).map_err(Failure::Internal)?;
    print!("{}", report.markdown());
    Ok(())
}

fn chosen_subjects(args: &EvaluateArgs) -> Result<Vec<Subject>> {
    let index = match &args.index {
        Some(path) => {
            let text = fs::read_to_string(path).with_context(|| path.display().to_string())?;
            corpus::index(&text)
        }
        None => BTreeMap::new(),
    };
    corpus::subjects(&args.paths, &index, &args.only)
}

fn drawing_options(settings: &[String]) -> Result<DrawOptions> {
    let mut chosen = json!({"fit": true});
    inputs::lay_over(&mut chosen, settings)?;
    options::parse_set(&chosen).context("drawing options")
}

fn try_out(
    folder: &TruthSheet,
    set: &ViewSet,
    variant: &Variant,
    options: &Value,
    threads: usize,
) -> Result<Trial, Failure> {
    let mut options = options.clone();
    options::merge(&mut options, variant.options.clone());
    folder.try_out(set, options, threads).map_err(Failure::Internal)
}

fn chosen_sets(names: &[String], own: &[ViewSet]) -> Result<Vec<ViewSet>> {
    let usual = usual_sets();
    if names.is_empty() {
        return Ok(if own.is_empty() { usual } else { own.to_vec() });
    }
    let known = || usual.iter().map(|set| set.name.as_str()).collect::<Vec<_>>().join(", ");
    let find = |name: &String| {
        let found = usual.iter().find(|set| set.name.eq_ignore_ascii_case(name));
        let found = found.cloned();
        found.ok_or_else(|| anyhow!("--sets: there is no view set {name}; there are {}", known()))
    };
    let named: Result<Vec<ViewSet>> = names.iter().map(find).collect();
    Ok([named?, own.to_vec()].concat())
}

fn chosen_options(settings: &[String]) -> Result<(Value, ComparisonOptions), Failure> {
    let mut chosen = json!({"method": "turntable"});
    inputs::lay_over(&mut chosen, settings).map_err(Failure::Usage)?;
    let options = draft::options::parse(&chosen)
        .map_err(|problems| Failure::Input(anyhow!("options: {problems}")))?;
    Ok((chosen, ComparisonOptions::from(&options.evaluation)))
}

/// What the contact sheets show.
#[derive(Default)]
struct Pictures {
    depths: Vec<contact::Row>,
    solids: Vec<contact::SolidRow>,
}

fn write(
    folder: &Path,
    report: &Report,
    pictures: &Pictures,
    before: Option<&Evaluation>,
) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    let json = serde_json::to_vec_pretty(report)?;
    fs::write(folder.join("evaluation.json"), &json)?;
    fs::write(folder.join("evaluation.md"), report.markdown())?;
    if let Some(before) = before {
        let now: Evaluation = serde_json::from_slice(&json)?;
        let changes = now.since(before);
        fs::write(folder.join("changes.md"), &changes)?;
        println!("{changes}");
    }
    if let Some(picture) = contact::sheet(&pictures.depths) {
        picture.save(folder.join("contact.png"))?;
    }
    if let Some(picture) = contact::solids(&pictures.solids)? {
        picture.save(folder.join("solids.png"))?;
    }
    Ok(())
}

fn progress_bar(trials: usize) -> ProgressBar {
    let style =
        ProgressStyle::with_template("{bar:40} {pos}/{len} {msg}").expect("the template is valid");
    ProgressBar::new(trials as u64).with_style(style)
}
