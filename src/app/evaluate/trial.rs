//! One view set of one sheet, reconstructed and measured.

use std::collections::BTreeMap;
use std::fs;
use std::io;
use std::path::{Path, PathBuf};
use std::time::Instant;

use anyhow::{Context, Result, bail};
use serde::Serialize;
use serde_json::Value;

use super::contact;
use super::corpus::{Source, Subject};
use super::sets::ViewSet;
use crate::app::{draw, inputs};
use crate::draft::{self, Decoded, DraftError};
use artifacts::{Artifact, PFM_MEDIA_TYPE};
use bytes::Bytes;
use drawing::{DrawError, DrawOptions, Drawer, PreparedModel, SheetLimits, draw_sheet};
use evaluation::{
    ComparisonOptions, SolidComparison, SolidTruth, ViewReport, ViewTruth, compare_silhouettes,
    decode_truth, disparity_from_depth, evaluate_view, true_mask,
};
use frames::{Azimuth, Elevation, Viewpoint};
use mesh::Mesh;
use mesh::read::Model;
use mesh::topology::{check_manifold, genus};
use picture::ImageLimits;
use progress::Silent;
use sheet::{SheetDocument, ViewDocument};
use turntable::Draft;
use turntable::depth::{DepthSource, Fallback, ViewDepth};

/// A sheet with its truth.
pub(super) struct TruthSheet {
    name: String,
    document: SheetDocument,
    files: Files,
    limits: ImageLimits,
    elevation_error: f64,
    /// The true model in sheet pixels.
    solid: Option<(Mesh, SolidTruth)>,
}

/// The files that a sheet names.
enum Files {
    Folder(PathBuf),
    Drawn(BTreeMap<String, Bytes>),
}

impl Files {
    fn read(&self, name: &str) -> io::Result<Vec<u8>> {
        match self {
            Self::Folder(path) => inputs::read_file(&path.join(name)),
            Self::Drawn(files) => {
                let found = files.get(name).ok_or(io::ErrorKind::NotFound)?;
                Ok(found.to_vec())
            }
        }
    }
}

/// How trials are made.
pub(super) struct Setting<'a> {
    pub limits: ImageLimits,
    /// Of models that are drawn first.
    pub draw: &'a DrawOptions,
    /// Views that they are drawn in.
    pub viewpoints: &'a [Viewpoint],
    /// How much lower views that are not level are drawn than they say, degrees.
    pub elevation_error: f64,
    pub comparison: ComparisonOptions,
}

/// What came of one view set on one sheet.
#[derive(Default, Serialize)]
pub(super) struct Trial {
    /// Views of the set that the sheet lacks, or why there is no draft.
    pub failure: Option<String>,
    /// Wall time from decoding to the mesh, seconds; no artifact is written.
    pub seconds: f64,
    /// The most memory the process had in use meanwhile, MiB; where the system
    /// tells.
    pub peak_memory_mib: Option<f64>,
    pub solid: Option<SolidComparison>,
    pub mesh: Option<MeshFigures>,
    /// The views that have truth.
    pub views: Vec<ViewTrial>,
    #[serde(skip)]
    pub picture: Option<contact::Row>,
    #[serde(skip)]
    pub solids: Option<contact::SolidRow>,
}

#[derive(Serialize)]
pub(super) struct MeshFigures {
    pub triangles: usize,
    pub watertight: bool,
    /// Holes through it, over all its pieces; absent unless watertight.
    pub genus: Option<i64>,
}

#[derive(Serialize)]
pub(super) struct ViewTrial {
    pub azimuth_deg: f64,
    pub depth: ViewReport,
    /// What the depth was read from.
    pub source: DepthSource,
    /// Why the view's own lines tell nothing.
    pub fallback: Option<Fallback>,
    /// Mean distance between the mesh's outline and the truth's, px.
    pub boundary_distance_px: Option<f64>,
}

impl TruthSheet {
    /// Reads a sheet, or draws a model.
    pub(super) fn open(subject: &Subject, setting: &Setting<'_>) -> Result<Self> {
        let (document, files) = match &subject.source {
            Source::Sheet(path) => {
                (inputs::sheet_document(&path.join("sheet.json"))?, Files::Folder(path.clone()))
            }
            Source::Model(path) => drawn(path, setting)?,
        };
        let name = subject.name.clone();
        let solid = solid_truth(&files, &document, setting.comparison).context(name.clone())?;
        let Setting { limits, elevation_error, .. } = *setting;
        Ok(Self { name, document, files, limits, elevation_error, solid })
    }

    /// Whether the true model's surface closes; `None` without a model.
    pub(super) fn is_closed(&self) -> Option<bool> {
        self.solid.as_ref().map(|(mesh, _)| check_manifold(mesh).is_ok())
    }

    /// Runs the method on the views of `set` and measures what comes out.
    pub(super) fn try_out(&self, set: &ViewSet, options: Value, threads: usize) -> Result<Trial> {
        let mut document = SheetDocument { options: Some(options), ..self.document.clone() };
        document.views = match self.views(set) {
            Ok(views) => views,
            Err(failure) => return Ok(Trial::failed(failure)),
        };
        let read = |name: &str| self.files.read(name);
        forget_peak_memory();
        let begin = Instant::now();
        let tried =
            Decoded::read(&document, &read, &self.limits.into(), threads).and_then(|decoded| {
                let draft = decoded.turntable()?;
                let seconds = begin.elapsed().as_secs_f64();
                let peak_memory_mib = peak_memory_mib();
                let mut trial = Trial { seconds, peak_memory_mib, ..Trial::default() };
                Ok(self.measure(set, &draft, &mut trial).map(|()| trial))
            });
        match tried {
            Ok(measured) => measured,
            Err(DraftError::Input { code, detail }) => {
                Ok(Trial::failed(format!("{code}: {detail}")))
            }
            Err(error) => bail!(error),
        }
    }

    fn views(&self, set: &ViewSet) -> Result<Vec<ViewDocument>, String> {
        let viewpoints = set.viewpoints();
        let found = viewpoints.iter().map(|&wanted| {
            let drawn = drawn_from(wanted, self.elevation_error).ok()?;
            let mut view = self.view_at(drawn)?.clone();
            view.elevation_deg = Some(wanted.elevation.degrees());
            Some(view)
        });
        let found: Vec<_> = found.flatten().collect();
        if found.len() == viewpoints.len() {
            return Ok(found);
        }
        Err(format!("has {} of the {} views", found.len(), viewpoints.len()))
    }

    fn view_at(&self, viewpoint: Viewpoint) -> Option<&ViewDocument> {
        self.document.views.iter().find(|view| {
            let elevation_deg = view.elevation_deg.unwrap_or(self.document.elevation_deg);
            Azimuth::from_degrees(view.azimuth_deg) == Ok(viewpoint.azimuth)
                && Elevation::from_degrees(elevation_deg) == Ok(viewpoint.elevation)
        })
    }

    fn measure(&self, set: &ViewSet, draft: &Draft<'_>, trial: &mut Trial) -> Result<()> {
        let mesh = &draft.solid.mesh;
        let watertight = check_manifold(mesh).is_ok();
        trial.mesh = Some(MeshFigures {
            triangles: mesh.triangles.len(),
            watertight,
            genus: watertight.then(|| genus(mesh)),
        });
        if let Some((true_mesh, truth)) = self.solid.as_ref().filter(|_| set.judges_solid) {
            trial.solid = Some(truth.evaluate(mesh)?);
            trial.solids = Some(contact::SolidRow {
                drawing: draft.views.views()[0].image.clone(),
                truth: mesh::thumbnail(true_mesh)?,
                ours: mesh::thumbnail(mesh)?,
            });
        }
        let outlines = Outlines::of(mesh, draft)?;
        for depth in &draft.depths {
            let Some(truth) = self.view_truth(depth.azimuth.into())? else { continue };
            let mask = outlines.mask(depth.azimuth.into())?;
            let outline = compare_silhouettes(&mask, &true_mask(&truth))?;
            let ours = disparity_from_depth(&depth.map.depth_px);
            trial.views.push(ViewTrial {
                azimuth_deg: depth.azimuth.degrees(),
                depth: evaluate_view(&ours, &truth)?,
                source: depth.source,
                fallback: depth.fallback,
                boundary_distance_px: outline.mean_boundary_distance_px,
            });
            if set.shown_deg == Some(depth.azimuth.degrees()) {
                trial.picture = Some(self.picture(draft, depth, truth));
            }
        }
        Ok(())
    }

    fn picture(&self, draft: &Draft<'_>, depth: &ViewDepth, truth: ViewTruth) -> contact::Row {
        let drawing = draft.views.views().iter().find(|view| view.azimuth == depth.azimuth);
        contact::Row {
            sheet: self.name.clone(),
            drawing: drawing.map(|view| view.image.clone()).unwrap_or_default(),
            truth: match truth {
                ViewTruth::Metric(map) | ViewTruth::Relative(map) => map,
            },
            ours: disparity_from_depth(&depth.map.depth_px),
        }
    }

    fn view_truth(&self, viewpoint: Viewpoint) -> Result<Option<ViewTruth>> {
        let view = self.view_at(viewpoint);
        let Some((kind, name)) = view.and_then(ViewDocument::truth) else { return Ok(None) };
        let raw = self
            .files
            .read(name)
            .map_err(anyhow::Error::from)
            .and_then(|bytes| Ok(decode_truth(&bytes, &self.limits)?));
        let raw = raw.with_context(|| format!("{}: {name}", self.name))?;
        Ok(Some(raw.of_sheet(kind, &self.document)))
    }
}

impl Trial {
    fn failed(failure: String) -> Self {
        Self { failure: Some(failure), ..Self::default() }
    }
}

/// Where a view is drawn from: level views as they say, others lower by `error_deg`.
pub(super) fn drawn_from(view: Viewpoint, error_deg: f64) -> Result<Viewpoint> {
    if view.is_level() {
        return Ok(view);
    }
    let elevation = Elevation::from_degrees(view.elevation.degrees() - error_deg)?;
    Ok(Viewpoint { elevation, ..view })
}

/// A model as a sheet of all views that are asked for, in memory.
fn drawn(path: &Path, setting: &Setting<'_>) -> Result<(SheetDocument, Files)> {
    let model = PreparedModel::new(&draw::load(path, None)?)?;
    let mut files = BTreeMap::new();
    let mut keep = |file: Artifact| {
        if file.media_type != PFM_MEDIA_TYPE {
            files.insert(file.name, file.bytes);
        }
        Ok::<(), DrawError>(())
    };
    let limits = SheetLimits::default();
    draw_sheet(&model, setting.viewpoints, setting.draw, &limits, &Silent, &mut keep)?;
    let document = files.get("sheet.json").context("the drawing has no sheet.json")?;
    Ok((serde_json::from_slice(document)?, Files::Drawn(files)))
}

/// The true model in sheet pixels, and prepared for comparing with it.
fn solid_truth(
    files: &Files,
    document: &SheetDocument,
    comparison: ComparisonOptions,
) -> Result<Option<(Mesh, SolidTruth)>> {
    let truth = draft::true_model(document, &|name| files.read(name))?;
    let Some((mut mesh, pixels_per_unit)) = truth else { return Ok(None) };
    mesh.positions.iter_mut().for_each(|p| *p *= pixels_per_unit);
    let truth = SolidTruth::new(&mesh, comparison)?;
    Ok(Some((mesh, truth)))
}

/// Draws the mesh's silhouettes.
struct Outlines {
    model: PreparedModel,
    options: DrawOptions,
}

impl Outlines {
    /// In units of the picture's width: the camera stays outside of the mesh.
    fn of(mesh: &Mesh, draft: &Draft<'_>) -> Result<Self> {
        let (width_px, height_px) = (draft.views.width(), draft.views.height());
        let unit = f64::from(width_px.max(height_px));
        let mut mesh = mesh.clone();
        mesh.positions.iter_mut().for_each(|p| *p /= unit);
        let materials = vec![0; mesh.triangles.len()];
        let model = PreparedModel::new(&Model { mesh, materials, ..Model::default() })?;
        let scale = f64::from(width_px) / unit;
        let options = DrawOptions { width_px, height_px, scale, ..DrawOptions::default() };
        Ok(Self { model, options })
    }

    fn mask(&self, viewpoint: Viewpoint) -> Result<image::GrayImage> {
        Ok(Drawer::new(&self.model, &self.options)?.truth_of_view(viewpoint)?.mask)
    }
}

/// Lets the system count the most memory in use anew, where it can.
fn forget_peak_memory() {
    let _ = fs::write("/proc/self/clear_refs", "5");
}

fn peak_memory_mib() -> Option<f64> {
    let status = fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix("VmHWM:"))?;
    let kib: f64 = line.trim().trim_end_matches("kB").trim().parse().ok()?;
    Some(kib / 1024.0)
}
