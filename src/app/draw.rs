//! The command `draw`: a model sheet with its truth, to a folder.

use std::fs;
use std::path::{Path, PathBuf};
use std::str::FromStr;

use super::progress_bar::Bar;
use anyhow::{Context, Result, anyhow};
use clap::Args;
use serde_json::json;

use super::failure::Failure;
use super::inputs;
use artifacts::Artifact;
use drawing::{Background, DrawError, DrawOptions, PreparedModel, SheetLimits, draw_sheet};
use mesh::builtin::ProceduralModel;
use mesh::read::{self, Limits, Model, ModelFormat};

use frames::{UpAxis, ViewpointList};

#[derive(Args, Debug)]
pub(super) struct DrawArgs {
    /// Model file (GLB, glTF, OBJ, PLY, STL), or builtin:NAME with NAME one of cube, cone,
    /// sphere, torus_flat, torus_side, dude, objects, caped_figure, teapot
    #[arg(value_name = "MODEL")]
    model: Source,
    /// Folder for the sheet; made if missing
    #[arg(short, long, value_name = "DIR")]
    output: PathBuf,
    /// Views, degrees: 0,45,90 or FROM:TO:STEP; from above or below with the elevation: 0@90
    #[arg(long, value_name = "AZIMUTHS", default_value = "0:90:5")]
    azimuths: ViewpointList,
    /// Which axis of the file points up, y or z; glTF has y, the others are read as z
    #[arg(long, value_name = "AXIS")]
    up_axis: Option<String>,
    /// What is drawn: lines, or lines on the model's colours: flat or shaded
    #[arg(long, value_name = "INK", default_value = "lines")]
    ink: String,
    /// What is behind the subject: white, grey, transparent, or a colour as #rrggbb
    #[arg(long, value_name = "PAPER", default_value_t = Background::White)]
    background: Background,
    /// Imperfections as in drawings by hand: light, middle or heavy
    #[arg(long, value_name = "PRESET")]
    degrade: Option<String>,
    /// Seed of the imperfections
    #[arg(long, default_value_t = 0)]
    seed: u64,
    /// A drawing option, such as line_width_px=2 or degrade.gap_share=0.1; repeatable
    #[arg(long, value_name = "OPTION=VALUE")]
    set: Vec<String>,
}

/// Where the model comes from.
#[derive(Clone, Debug)]
enum Source {
    Builtin(ProceduralModel),
    File(PathBuf),
}

impl FromStr for Source {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        match text.strip_prefix("builtin:") {
            None => Ok(Self::File(text.into())),
            Some(name) => ProceduralModel::from_name(name)
                .map(Self::Builtin)
                .ok_or_else(|| format!("there is no built-in model {name}")),
        }
    }
}

/// Draws a model sheet with its ground truth and writes it to a folder.
pub(super) fn run(args: &DrawArgs) -> Result<(), Failure> {
    let options = chosen_options(args).map_err(Failure::Usage)?;
    let model = chosen_model(args).map_err(Failure::Input)?;
    let prepared = PreparedModel::new(&model)?;
    let bar = Bar::new();
    let mut files = 0;
    let mut keep = |file: Artifact| {
        files += 1;
        write(&args.output, &file).map_err(Failure::Internal)
    };
    fs::create_dir_all(&args.output)
        .with_context(|| args.output.display().to_string())
        .map_err(Failure::Internal)?;
    let (viewpoints, limits) = (args.azimuths.at(options.elevation()), SheetLimits::default());
    draw_sheet(&prepared, &viewpoints, &options, &limits, &bar, &mut keep)?;
    drop(bar);
    println!("{} views: {files} files in {}", viewpoints.len(), args.output.display());
    Ok(())
}

fn chosen_model(args: &DrawArgs) -> Result<Model> {
    let path = match &args.model {
        Source::Builtin(model) => return Ok(model.build()),
        Source::File(path) => path,
    };
    let up_axis: Option<UpAxis> = args
        .up_axis
        .as_ref()
        .map(|axis| serde_json::from_value(json!(axis)))
        .transpose()
        .context("--up-axis")?;
    load(path, up_axis)
}

/// Reads a model of any format.
///
/// * `up_axis`: if it is not the format's usual one.
pub(super) fn load(path: &Path, up_axis: Option<UpAxis>) -> Result<Model> {
    let name = path.display();
    let format = ModelFormat::from_file_name(&path.to_string_lossy()).with_context(|| {
        format!("{name}: the name's ending is none of glb, gltf, obj, ply, stl")
    })?;
    let size = fs::metadata(path).with_context(|| name.to_string())?.len();
    let limits = Limits::default();
    if size > limits.max_bytes as u64 {
        return Err(anyhow!("{name} has {size} bytes, over the limit of {}", limits.max_bytes));
    }
    let bytes = inputs::read_file(path).with_context(|| name.to_string())?;
    read::load(&bytes, format, up_axis, &limits).with_context(|| name.to_string())
}

fn chosen_options(args: &DrawArgs) -> Result<DrawOptions> {
    let mut chosen = json!({
        "ink": args.ink, "background": args.background, "degrade": { "seed": args.seed },
    });
    if let Some(preset) = &args.degrade {
        options::merge(&mut chosen, json!({ "degrade": { "preset": preset } }));
    }
    inputs::lay_over(&mut chosen, &args.set)?;
    options::parse_set(&chosen).context("drawing options")
}

fn write(folder: &Path, file: &Artifact) -> Result<()> {
    let path = folder.join(&file.name);
    fs::write(&path, &file.bytes).with_context(|| path.display().to_string())
}

impl From<DrawError> for Failure {
    fn from(error: DrawError) -> Self {
        match error {
            DrawError::Encoding { .. } => Self::Internal(error.into()),
            _ => Self::Input(error.into()),
        }
    }
}
