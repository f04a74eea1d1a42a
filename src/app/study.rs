//! The command `study`: the dissertation's tables and figures on a folder of sheets.

use std::fs;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use indicatif::{ProgressBar, ProgressStyle};
use rayon::ThreadPoolBuilder;

use super::failure::Failure;
use super::inputs;
use evaluation::{decode_truth, has_values};
use frames::Azimuth;
use picture::ImageLimits;
use sheet::{PlacedView, SheetDocument, SheetRequirements, View};
use study::{Protocol, Study, StudySheet, TripleError, choose_triple, units};

/// The sheet that is also studied at a wider spacing, degrees: it stands where
/// the dissertation's Batman does.
const WIDER: (&str, f64) = ("hero", 15.0);

/// What a sheet must have to be studied.
const REQUIREMENTS: SheetRequirements =
    SheetRequirements { min_views: 3, max_views: 360, equal_sizes: true, elevated: false };

#[derive(Args, Debug)]
pub(super) struct StudyArgs {
    /// Folder of sheets: a folder for each, with its sheet.json, drawings and truth
    #[arg(value_name = "DIR")]
    sheets: PathBuf,
    /// Folder for the report, its tables and plots; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Threads to compute with; 0 uses all processors
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
}

/// Runs the dissertation's study on a folder of sheets.
pub(super) fn run(args: &StudyArgs) -> Result<(), Failure> {
    let started = Instant::now();
    let folders = sheet_folders(&args.sheets).map_err(Failure::Input)?;
    let (mut sheets, mut wider) = (Vec::new(), Vec::new());
    for folder in &folders {
        let (sheet, wide) = load(folder).map_err(Failure::Input)?;
        sheets.push(sheet);
        wider.extend(wide);
    }
    let protocol = Protocol::default();
    let bar = ProgressBar::new(units(&protocol, sheets.len(), wider.len()) as u64);
    bar.set_style(
        ProgressStyle::with_template("{bar:40} {pos}/{len} {eta}").expect("the template is valid"),
    );
    let pool = ThreadPoolBuilder::new()
        .num_threads(inputs::threads(args.threads))
        .build()
        .map_err(|error| Failure::Internal(error.into()))?;
    let study = pool.install(|| Study::run(&sheets, &wider, &protocol, &|| bar.inc(1)));
    bar.finish_and_clear();
    let files = study.files().map_err(|error| Failure::Internal(error.into()))?;
    write(&args.output, &files).map_err(Failure::Internal)?;
    println!(
        "{} sheets: {} files in {}, {:.0} s",
        sheets.len(),
        files.len(),
        args.output.display(),
        started.elapsed().as_secs_f64()
    );
    Ok(())
}

/// The folders that hold a sheet, by name.
fn sheet_folders(folder: &Path) -> Result<Vec<PathBuf>> {
    let entries = fs::read_dir(folder).with_context(|| folder.display().to_string())?;
    let mut folders = Vec::new();
    for entry in entries {
        let path = entry.with_context(|| folder.display().to_string())?.path();
        if path.join("sheet.json").is_file() {
            folders.push(path);
        }
    }
    folders.sort();
    if folders.is_empty() {
        bail!("{}: no folder in it has a sheet.json", folder.display());
    }
    Ok(folders)
}

/// A sheet at its smallest spacing, and at the wider one if it is to stand
/// there.
fn load(folder: &Path) -> Result<(StudySheet, Option<StudySheet>)> {
    let path = folder.join("sheet.json");
    let document = inputs::sheet_document(&path)?;
    let placed = sheet::check_document(&document, &REQUIREMENTS)
        .with_context(|| path.display().to_string())?;
    let name = folder.file_name().unwrap_or_default().to_string_lossy().into_owned();
    let loaded = |spacing| {
        study_sheet(&name, folder, &document, &placed, spacing)
            .with_context(|| path.display().to_string())
    };
    let sheet = loaded(None)?;
    let wide = (name == WIDER.0).then(|| loaded(Some(WIDER.1)));
    let wide = match wide {
        Some(Err(error)) if error.downcast_ref::<TripleError>().is_some() => None,
        wide => wide.transpose()?,
    };
    Ok((sheet, wide))
}

fn study_sheet(
    name: &str,
    folder: &Path,
    document: &SheetDocument,
    placed: &[PlacedView],
    spacing_deg: Option<f64>,
) -> Result<StudySheet> {
    let known: Vec<(Azimuth, bool)> =
        placed.iter().map(|view| (view.azimuth, view.truth.is_some())).collect();
    let [before, middle, after] = choose_triple(&known, spacing_deg)?;
    let [before, middle, after] = [&placed[before], &placed[middle], &placed[after]];
    let (kind, truth) = middle.truth.as_ref().context("the middle view has no truth")?;
    let limits = ImageLimits::default();
    let raw =
        decode_truth(&read(folder, truth)?, &limits).map_err(|error| anyhow!("{truth} {error}"))?;
    let truth_map = raw.of_sheet(*kind, document);
    let views = [view(folder, before)?, view(folder, middle)?, view(folder, after)?];
    let size = views[1].image.dimensions();
    if raw.values.dimensions() != size || views.iter().any(|view| view.image.dimensions() != size) {
        bail!("the views and the truth of {name} differ in size");
    }
    if !has_values(&truth_map) {
        bail!("{truth} has no value");
    }
    Ok(StudySheet {
        name: name.to_owned(),
        spacing_deg: before.azimuth.degrees_to(middle.azimuth),
        views,
        truth: truth_map,
    })
}

fn view(folder: &Path, placed: &PlacedView) -> Result<View> {
    let drawing = picture::decode(&read(folder, &placed.image)?, &ImageLimits::default())
        .map_err(|error| anyhow!("{} {error}", placed.image))?;
    let level = View::level(placed.azimuth, drawing.gray, drawing.alpha);
    Ok(View { elevation: placed.elevation, ..level })
}

fn read(folder: &Path, name: &str) -> Result<Vec<u8>> {
    let path = folder.join(name);
    fs::read(&path).with_context(|| path.display().to_string())
}

fn write(folder: &Path, files: &[study::StudyFile]) -> Result<()> {
    fs::create_dir_all(folder).with_context(|| folder.display().to_string())?;
    for file in files {
        let path = folder.join(&file.name);
        fs::write(&path, &file.text).with_context(|| path.display().to_string())?;
    }
    Ok(())
}
