//! The command `reconstruct`: local drawings to artifacts in a folder.

use std::collections::BTreeSet;
use std::fs::{self, File};
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

use super::progress_bar::Bar;
use anyhow::{Context, Result, anyhow, bail};
use clap::Args;
use serde_json::{Value, json};

use super::config::LimitConfig;
use super::failure::Failure;
use super::inputs;
use crate::draft::{self, DraftError, Summary};
use artifacts::{Artifact, ArtifactName, ArtifactSink, ArtifactWriter};

use frames::{Azimuth, Elevation, Viewpoint, ViewpointList};
use sheet::{SheetDocument, ViewDocument};

#[derive(Args, Debug)]
pub(super) struct ReconstructArgs {
    /// Sheet document; its image names are relative to it
    #[arg(required_unless_present = "view", conflicts_with = "view", value_name = "SHEET.json")]
    sheet: Option<PathBuf>,
    /// A drawing and its azimuth in degrees, such as 45=quarter.png; from above or below with its
    /// elevation, such as 0@90=top.png; repeatable
    #[arg(long, value_name = "AZIMUTH[@ELEVATION]=FILE")]
    view: Vec<String>,
    /// The subject's mask in a view, such as 45=mask.png; repeatable
    #[arg(long, value_name = "AZIMUTH=FILE")]
    mask: Vec<String>,
    /// Folder for the artifacts; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Use only these views, degrees: 0,45,90 or FROM:TO:STEP, with elevations 0@90
    #[arg(long, value_name = "AZIMUTHS")]
    azimuths: Option<ViewpointList>,
    /// How the sheet becomes a 3D draft; see GET /v1/options
    #[arg(long)]
    method: Option<String>,
    /// An option by its dotted name, such as disparity.block_size=15; repeatable
    #[arg(long, value_name = "OPTION=VALUE")]
    set: Vec<String>,
    /// Threads to compute with; 0 uses all processors
    #[arg(long, value_name = "N", default_value_t = 0)]
    threads: usize,
    #[command(flatten)]
    limits: LimitConfig,
}

/// Reconstructs a sheet from local files and writes the artifacts to a folder.
pub(super) fn run(args: &ReconstructArgs) -> Result<(), Failure> {
    let (mut document, base) = document(args).map_err(Failure::Input)?;
    document.options = Some(chosen_options(args, document.options.take())?);
    let read =
        |name: &str| inputs::read_file(&base.join(name)).map_err(|error| name_file(name, &error));
    let bar = Bar::new();
    let summary = draft::produce(
        &document,
        &read,
        &args.limits.image().into(),
        inputs::threads(args.threads),
        &bar,
        &mut Folder(&args.output),
    );
    drop(bar);
    report(&summary.map_err(classify)?, &args.output);
    Ok(())
}

/// The sheet document and the folder its names are relative to.
fn document(args: &ReconstructArgs) -> Result<(SheetDocument, PathBuf)> {
    let (mut document, base) = match &args.sheet {
        Some(path) => {
            let document = inputs::sheet_document(path)?;
            (document, path.parent().unwrap_or(Path::new("")).to_owned())
        }
        None => (SheetDocument { views: views(args)?, ..Default::default() }, PathBuf::new()),
    };
    for mask in &args.mask {
        let (viewpoint, file) = viewpoint_and_file(mask)?;
        let usual = document.elevation_deg;
        let view = document.views.iter_mut().find(|view| at(view, usual, viewpoint));
        view.with_context(|| format!("--mask {mask}: there is no view at {viewpoint}"))?.mask =
            Some(file);
    }
    if let Some(list) = &args.azimuths {
        let usual = document.elevation_deg;
        let wanted = list.at(Elevation::from_degrees(usual)?);
        for viewpoint in &wanted {
            if !document.views.iter().any(|view| at(view, usual, *viewpoint)) {
                bail!("--azimuths: the sheet has no view at {viewpoint}");
            }
        }
        document.views.retain(|view| wanted.iter().any(|own| at(view, usual, *own)));
        // Of pairs that are still there; views left out part neighbours.
        let is_wanted =
            |degrees| wanted.iter().any(|own| Azimuth::from_degrees(degrees) == Ok(own.azimuth));
        document
            .matches
            .retain(|pair| is_wanted(pair.left_azimuth_deg) && is_wanted(pair.right_azimuth_deg));
    }
    Ok((document, base))
}

/// * `usual`: the elevation of views that say none, degrees.
fn at(view: &ViewDocument, usual: f64, viewpoint: Viewpoint) -> bool {
    let elevation_deg = view.elevation_deg.unwrap_or(usual);
    Azimuth::from_degrees(view.azimuth_deg) == Ok(viewpoint.azimuth)
        && Elevation::from_degrees(elevation_deg) == Ok(viewpoint.elevation)
}

fn views(args: &ReconstructArgs) -> Result<Vec<ViewDocument>> {
    args.view
        .iter()
        .map(|view| {
            let (Viewpoint { azimuth, elevation }, image) = viewpoint_and_file(view)?;
            Ok(ViewDocument {
                image,
                azimuth_deg: azimuth.degrees(),
                elevation_deg: Some(elevation.degrees()),
                ..Default::default()
            })
        })
        .collect()
}

fn viewpoint_and_file(text: &str) -> Result<(Viewpoint, String)> {
    let (angles, file) = text
        .split_once('=')
        .with_context(|| format!("{text:?} is not AZIMUTH[@ELEVATION]=FILE"))?;
    let list: ViewpointList = angles.parse().map_err(|error| anyhow!("{text:?}: {error}"))?;
    match list.at(Elevation::LEVEL)[..] {
        [viewpoint] => Ok((viewpoint, file.to_owned())),
        _ => bail!("{angles:?} is not one view"),
    }
}

/// The sheet's own options with those of the command line laid over them.
fn chosen_options(args: &ReconstructArgs, own: Option<Value>) -> Result<Value, Failure> {
    let mut chosen = own.unwrap_or_else(|| json!({}));
    if let Some(method) = &args.method {
        options::merge(&mut chosen, json!({ "method": method }));
    }
    inputs::lay_over(&mut chosen, &args.set).map_err(Failure::Usage)?;
    draft::options::parse(&chosen)
        .map_err(|problems| Failure::Input(anyhow!("options: {problems}")))?;
    Ok(chosen)
}

fn name_file(name: &str, error: &io::Error) -> io::Error {
    io::Error::new(error.kind(), format!("{name}: {error}"))
}

/// Where the artifacts are written.
struct Folder<'a>(&'a Path);

impl Folder<'_> {
    /// Where a file of this name is, in a folder that exists.
    fn place(&self, name: &str) -> io::Result<PathBuf> {
        let path = self.0.join(name);
        fs::create_dir_all(path.parent().expect("joined to a folder"))?;
        Ok(path)
    }
}

impl ArtifactSink for Folder<'_> {
    fn put(&mut self, artifact: Artifact) -> io::Result<()> {
        fs::write(self.place(&artifact.name)?, &artifact.bytes)
            .map_err(|error| name_file(&artifact.name, &error))
    }

    fn create(&mut self, name: ArtifactName) -> io::Result<Box<dyn ArtifactWriter>> {
        let name = name.to_string();
        let path = self.place(&name)?;
        let file = File::create(&path).map_err(|error| name_file(&name, &error))?;
        Ok(Box::new(GrowingFile { file: BufWriter::new(file), unfinished: Some(path) }))
    }
}

/// A file that is deleted unless it is finished.
struct GrowingFile {
    file: BufWriter<File>,
    unfinished: Option<PathBuf>,
}

impl Write for GrowingFile {
    fn write(&mut self, bytes: &[u8]) -> io::Result<usize> {
        self.file.write(bytes)
    }

    fn flush(&mut self) -> io::Result<()> {
        self.file.flush()
    }
}

impl ArtifactWriter for GrowingFile {
    fn finish(mut self: Box<Self>) -> io::Result<()> {
        self.file.flush()?;
        self.unfinished = None;
        Ok(())
    }
}

impl Drop for GrowingFile {
    fn drop(&mut self) {
        // The run has failed already: what is left behind matters less.
        let _ = self.unfinished.take().map(fs::remove_file);
    }
}

fn classify(error: DraftError) -> Failure {
    match error {
        DraftError::Input { code, detail } => Failure::Input(anyhow!("{code}: {detail}")),
        DraftError::Io(error) if error.kind() == io::ErrorKind::NotFound => {
            Failure::Input(error.into())
        }
        other => Failure::Internal(other.into()),
    }
}

fn report(summary: &Summary, folder: &Path) {
    for warning in summary.warnings.iter().collect::<BTreeSet<_>>() {
        eprintln!("warning: {warning}");
    }
    println!(
        "{} views, {} of {} pairs usable: {} artifacts in {}",
        summary.views,
        summary.usable_pairs,
        summary.pairs,
        summary.artifacts.len(),
        folder.display()
    );
}
