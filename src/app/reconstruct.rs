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

use frames::{Azimuth, AzimuthList};
use sheet::{SheetDocument, ViewDocument};

#[derive(Args, Debug)]
pub(super) struct ReconstructArgs {
    /// Sheet document; its image names are relative to it
    #[arg(required_unless_present = "view", conflicts_with = "view", value_name = "SHEET.json")]
    sheet: Option<PathBuf>,
    /// A drawing and its azimuth in degrees, such as 45=quarter.png; repeatable
    #[arg(long, value_name = "AZIMUTH=FILE")]
    view: Vec<String>,
    /// The subject's mask in a view, such as 45=mask.png; repeatable
    #[arg(long, value_name = "AZIMUTH=FILE")]
    mask: Vec<String>,
    /// Folder for the artifacts; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Use only these views, degrees: 0,45,90 or FROM:TO:STEP
    #[arg(long, value_name = "AZIMUTHS")]
    azimuths: Option<AzimuthList>,
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
        let (azimuth_deg, file) = azimuth_and_file(mask)?;
        let azimuth = Azimuth::from_degrees(azimuth_deg)?;
        let view = document.views.iter_mut().find(|view| at(view, azimuth));
        view.with_context(|| format!("--mask {mask}: there is no view at {azimuth}"))?.mask =
            Some(file);
    }
    if let Some(AzimuthList(wanted)) = &args.azimuths {
        for azimuth in wanted {
            if !document.views.iter().any(|view| at(view, *azimuth)) {
                bail!("--azimuths: the sheet has no view at {azimuth}");
            }
        }
        document.views.retain(|view| wanted.iter().any(|azimuth| at(view, *azimuth)));
        // Of pairs that are still there; views left out part neighbours.
        let is_wanted = |degrees| wanted.iter().any(|a| Azimuth::from_degrees(degrees) == Ok(*a));
        document
            .matches
            .retain(|pair| is_wanted(pair.left_azimuth_deg) && is_wanted(pair.right_azimuth_deg));
    }
    Ok((document, base))
}

fn at(view: &ViewDocument, azimuth: Azimuth) -> bool {
    Azimuth::from_degrees(view.azimuth_deg) == Ok(azimuth)
}

fn views(args: &ReconstructArgs) -> Result<Vec<ViewDocument>> {
    args.view
        .iter()
        .map(|view| {
            let (azimuth_deg, image) = azimuth_and_file(view)?;
            Ok(ViewDocument { image, azimuth_deg, ..Default::default() })
        })
        .collect()
}

fn azimuth_and_file(text: &str) -> Result<(f64, String)> {
    let (azimuth, file) =
        text.split_once('=').with_context(|| format!("{text:?} is not AZIMUTH=FILE"))?;
    let azimuth_deg: f64 =
        azimuth.trim().parse().map_err(|_| anyhow!("{azimuth:?} is no angle in degrees"))?;
    Ok((azimuth_deg, file.to_owned()))
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
