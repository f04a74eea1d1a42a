//! Fits the parts of an upload together to a sheet.

use std::collections::BTreeMap;

use bytes::Bytes;
use serde_json::{Map, Value};

use super::files::Files;
use super::matches;
use super::parts::{FilePart, Parts, unknown_part};
use super::pictures::Decoded;
use super::truths::{CheckedTruth, ModelFile, TruthFields, TruthPicture};
use crate::draft;
use crate::draft::options::{Method, Options};
use crate::http::HttpLimits;
use crate::http::problem::{
    DIFFERING_SIZES, DUPLICATE_AZIMUTH, ELEVATED_VIEW, INVALID_ANGLE, INVALID_SHEET, INVALID_TRUTH,
    JOB_TOO_LARGE, MISSING_PART, Problem, TOO_FEW_VIEWS, TOO_MANY_VIEWS,
};
use frames::Viewpoint;
use sheet::{
    PictureSize, PlacedView, SheetDocument, SheetProblem, SheetRequirements, ViewDocument,
};

/// A picture with its place in the sheet.
#[derive(Clone, Debug)]
pub(super) struct Picture {
    /// Name of the part it came in, for messages.
    pub part: String,
    pub bytes: Bytes,
}

/// A view with its pictures.
#[derive(Clone, Debug)]
pub(super) struct PicturedView {
    pub view: PlacedView,
    pub drawing: Picture,
    pub mask: Option<Picture>,
    pub truth: Option<TruthPicture>,
    /// As the client described it.
    pub given: ViewDocument,
}

/// An upload whose parts fit together; its pictures are not decoded yet.
#[derive(Clone, Debug)]
pub(super) struct Assembled {
    /// Everything but the views and the options.
    pub document: SheetDocument,
    pub options: Options,
    /// By rising azimuth and elevation.
    pub views: Vec<PicturedView>,
    /// The true model.
    pub model: Option<ModelFile>,
}

/// Puts the parts of the forms `view[…]` and `sheet` together.
pub(super) fn assemble(mut parts: Parts, limits: &HttpLimits) -> Result<Assembled, Problem> {
    let first_view = parts.any_of_views_form();
    if parts.sheet.is_some() {
        parts.expect_only("sheet", [first_view.as_ref(), None, None])?;
        return assemble_sheet(parts, limits);
    }
    if let Some(file) = parts.files.first() {
        if first_view.is_some() {
            return Err(unknown_part(&file.file));
        }
        let detail =
            format!("a part `sheet` is missing that says at which angle `{}` is", file.file);
        return Err(Problem::new(MISSING_PART, detail).part("sheet"));
    }
    if parts.views.is_empty() {
        let detail = "no drawing was sent; name the parts like `view[45]`, or send a part `sheet` with the files it names";
        return Err(Problem::new(MISSING_PART, detail).part("view[…]"));
    }
    assemble_views(&mut parts, limits)
}

fn assemble_views(parts: &mut Parts, limits: &HttpLimits) -> Result<Assembled, Problem> {
    let options = parse_options(parts, None)?;
    let fields = TruthFields::parse(parts.truth.as_ref())?;
    let model = parts.truth_model.take().map(ModelFile::new).transpose()?;
    let mut masks: BTreeMap<Viewpoint, FilePart> = parts.masks.drain(..).collect();
    let mut truths: BTreeMap<Viewpoint, FilePart> = parts.truths.drain(..).collect();
    let mut drawings: BTreeMap<Viewpoint, FilePart> = parts.views.drain(..).collect();
    let views = drawings
        .iter()
        .map(|(view, file)| ViewDocument {
            image: file.file.clone(),
            azimuth_deg: view.azimuth.degrees(),
            elevation_deg: Some(view.elevation.degrees()),
            mask: masks.get(view).map(|mask| mask.file.clone()),
            ..ViewDocument::default()
        })
        .collect();
    let matches = matches::parse(&parts.matches)?;
    let mut document = SheetDocument { views, matches, ..SheetDocument::default() };
    fields.describe(&mut document, model.as_ref());
    let placed = check(&document, options.method, limits, None)?;
    document.views.clear();
    let pictured = |view: PlacedView| {
        let drawing = drawings.remove(&view.viewpoint())?.into();
        let mask = masks.remove(&view.viewpoint()).map(Picture::from);
        let truth = truths.remove(&view.viewpoint());
        let truth = truth.map(|file| TruthPicture { kind: fields.kind, picture: file.into() });
        let azimuth_confidence = parts.guessed.get(&view.viewpoint()).copied();
        let given = ViewDocument { azimuth_confidence, ..ViewDocument::default() };
        Some(PicturedView { view, drawing, mask, truth, given })
    };
    let views = placed.into_iter().filter_map(pictured).collect();
    if let Some((view, file)) = masks.into_iter().chain(truths).next() {
        let part = view_part(view);
        let detail = format!("`{}` has no drawing; send `{part}` too, or leave it out", file.file);
        return Err(Problem::new(MISSING_PART, detail).part(file.file));
    }
    Ok(Assembled { document, options, views, model })
}

/// Truth that the document names and the upload does not bring is left out.
fn assemble_sheet(mut parts: Parts, limits: &HttpLimits) -> Result<Assembled, Problem> {
    let sheet = parts.sheet.take().map(|sheet| sheet.parse::<SheetDocument>(INVALID_SHEET));
    let mut document = sheet.transpose()?.unwrap_or_default();
    let given = matches::parse(&parts.matches)?;
    matches::lay_over(&mut document.matches, given);
    let options = parse_options(&mut parts, document.options.take())?;
    let placed = check(&document, options.method, limits, Some("sheet"))?;
    let given = std::mem::take(&mut document.views);
    let mut files = Files::new(parts.files.into_iter().chain(parts.truth_model.take()));
    let mut views = Vec::with_capacity(placed.len());
    for view in placed {
        let drawing = files.take(&view.image)?;
        let mask = view.mask.as_deref().map(|mask| files.take(mask)).transpose()?;
        let truth = match &view.truth {
            None => None,
            Some((kind, name)) => {
                files.take_if_sent(name)?.map(|picture| TruthPicture { kind: Some(*kind), picture })
            }
        };
        let given = given.get(view.index).cloned().unwrap_or_default();
        views.push(PicturedView { view, drawing, mask, truth, given });
    }
    let model = match document.truth.as_mut().and_then(|truth| truth.model.take()) {
        None => None,
        Some(name) => files.take_if_sent(&name)?.map(|file| ModelFile::named(&name, file)),
    };
    files.expect_all_used()?;
    Ok(Assembled { document, options, views, model: model.transpose()? })
}

impl From<FilePart> for Picture {
    fn from(file: FilePart) -> Self {
        Self { part: file.file, bytes: file.bytes }
    }
}

/// Holds a document against its method and the limits.
pub(super) fn check(
    document: &SheetDocument,
    method: Method,
    limits: &HttpLimits,
    part: Option<&str>,
) -> Result<Vec<PlacedView>, Problem> {
    sheet::check_document(document, &requirements(method, limits)).map_err(|error| {
        let problem = sheet_problem(&error);
        match part {
            Some(part) => problem.part(part),
            None => problem,
        }
    })
}

fn requirements(method: Method, limits: &HttpLimits) -> SheetRequirements {
    SheetRequirements {
        min_views: method.minimum_views(),
        max_views: limits.max_views,
        equal_sizes: method.needs_equal_sizes(),
        elevated: method.takes_elevated(),
    }
}

fn sheet_problem(error: &SheetProblem) -> Problem {
    let kind = match error {
        SheetProblem::TooFewViews { .. } | SheetProblem::TooFewLevelViews { .. } => TOO_FEW_VIEWS,
        SheetProblem::ElevationUnsupported { .. } => ELEVATED_VIEW,
        SheetProblem::TooManyViews { .. } => TOO_MANY_VIEWS,
        SheetProblem::InvalidAngle { .. } => INVALID_ANGLE,
        SheetProblem::DuplicateView { .. } => DUPLICATE_AZIMUTH,
        SheetProblem::DifferingSizes { .. }
        | SheetProblem::MaskSize { .. }
        | SheetProblem::TruthSize { .. } => DIFFERING_SIZES,
        SheetProblem::ModelWithoutScale => INVALID_TRUTH,
        SheetProblem::InvalidNumber { .. }
        | SheetProblem::EmptyName { .. }
        | SheetProblem::TwoTruths { .. }
        | SheetProblem::TooLong { .. } => INVALID_SHEET,
    };
    Problem::new(kind, error.to_string())
}

/// Reads all options given, lying over `base`.
pub(super) fn parse_options(parts: &mut Parts, base: Option<Value>) -> Result<Options, Problem> {
    let given = std::mem::take(&mut parts.given);
    let all = given.over(base.unwrap_or_else(|| Value::Object(Map::new())))?;
    draft::options::parse(&all).map_err(|problems| Problem::options(&problems))
}

impl Assembled {
    /// The pictures to decode, drawings before masks of each view.
    pub(super) fn pictures(&self) -> Vec<(&str, &Bytes)> {
        let mut pictures = Vec::new();
        for PicturedView { drawing, mask, .. } in &self.views {
            pictures.extend(std::iter::once(drawing).chain(mask));
        }
        pictures.into_iter().map(|picture| (picture.part.as_str(), &picture.bytes)).collect()
    }

    /// The pictures of true values to decode, by rising azimuth.
    pub(super) fn truths(&self) -> Vec<&TruthPicture> {
        self.views.iter().filter_map(|view| view.truth.as_ref()).collect()
    }

    /// Checks the sizes found by decoding [`Self::pictures`] and
    /// [`Self::truths`] and names the files for storage. Returns the complete
    /// document of the job and the named files.
    pub(super) fn finish(
        self,
        decoded: &[Decoded],
        truths: &[CheckedTruth],
        limits: &HttpLimits,
    ) -> Result<(SheetDocument, Vec<(String, Bytes)>), Problem> {
        let Self { mut document, options, views, model } = self;
        let mut decoded = decoded.iter();
        let mut truths = truths.iter();
        let mut drawings = Vec::new();
        let mut inputs = Vec::new();
        for PicturedView { view, drawing, mask, truth, given } in views {
            let found = *next(&mut decoded)?;
            let viewpoint = view.viewpoint();
            let image = format!("views/{viewpoint}.{}", found.format.extension());
            inputs.push((image.clone(), drawing.bytes));
            drawings.push((viewpoint, drawing.part, found.size));
            let mut stored = view_document(&view, image, given);
            if let Some(mask) = mask {
                let (name, bytes) = named_mask(viewpoint, mask, found.size, next(&mut decoded)?)?;
                inputs.push((name.clone(), bytes));
                stored.mask = Some(name);
            }
            if let Some(truth) = truth {
                let checked = next(&mut truths)?;
                let (name, bytes) = named_truth(viewpoint, truth, found.size, checked)?;
                inputs.push((name.clone(), bytes));
                stored.set_truth(Some((checked.kind, name)));
            }
            document.views.push(stored);
        }
        inputs.extend(model.map(|model| model.store(&mut document)));
        check_sizes(&drawings, &requirements(options.method, limits))?;
        let sizes: Vec<_> = drawings.iter().map(|(view, _, size)| (*view, *size)).collect();
        check_memory(&sizes, &options, document.has_truth(), limits)?;
        matches::check(&document.matches, &sizes, &options)?;
        describe(&mut document, &drawings, &options)?;
        Ok((document, inputs))
    }
}

fn next<'d, T>(decoded: &mut std::slice::Iter<'d, T>) -> Result<&'d T, Problem> {
    decoded
        .next()
        .ok_or_else(|| Problem::internal("upload", &"fewer pictures were decoded than sent"))
}

fn named_truth(
    view: Viewpoint,
    truth: TruthPicture,
    drawing: PictureSize,
    found: &CheckedTruth,
) -> Result<(String, Bytes), Problem> {
    sheet::check_truth_size(view, drawing, found.size)
        .map_err(|error| sheet_problem(&error).part(truth.picture.part))?;
    Ok((format!("truth/{view}.{}", found.encoding.extension()), truth.picture.bytes))
}

fn named_mask(
    view: Viewpoint,
    mask: Picture,
    drawing: PictureSize,
    found: &Decoded,
) -> Result<(String, Bytes), Problem> {
    sheet::check_mask_size(view, drawing, found.size)
        .map_err(|error| sheet_problem(&error).part(mask.part))?;
    Ok((format!("masks/{view}.{}", found.format.extension()), mask.bytes))
}

/// What was said of a view by hand stays; its files have other names now.
fn view_document(view: &PlacedView, image: String, given: ViewDocument) -> ViewDocument {
    ViewDocument {
        image,
        azimuth_deg: view.azimuth.degrees(),
        elevation_deg: Some(view.elevation.degrees()),
        mask: None,
        depth: None,
        disparity: None,
        ..given
    }
}

/// The name of the part that a view's drawing comes in.
fn view_part(view: Viewpoint) -> String {
    if view.is_level() {
        format!("view[{}]", view.azimuth)
    } else {
        format!("view[{},{}]", view.azimuth, view.elevation.degrees())
    }
}

/// Refuses what could not run here, before it waits for a worker.
pub(super) fn check_memory(
    views: &[(Viewpoint, PictureSize)],
    options: &Options,
    has_truth: bool,
    limits: &HttpLimits,
) -> Result<(), Problem> {
    let largest = |side: fn(&PictureSize) -> u32| views.iter().map(|(_, size)| side(size)).max();
    let size = (largest(|it| it.width).unwrap_or(0), largest(|it| it.height).unwrap_or(0));
    let (threads, most) = (limits.threads_per_job, limits.draft.max_working_bytes);
    draft::check_memory(views.len(), size, options, threads, has_truth, most)
        .map_err(|error| Problem::new(JOB_TOO_LARGE, error.to_string()))
}

fn check_sizes(
    drawings: &[(Viewpoint, String, PictureSize)],
    requirements: &SheetRequirements,
) -> Result<(), Problem> {
    let sizes: Vec<_> = drawings.iter().map(|(view, _, size)| (*view, *size)).collect();
    sheet::check_sizes(&sizes, requirements).map_err(|error| {
        let problem = sheet_problem(&error);
        let SheetProblem::DifferingSizes { view, .. } = error else { return problem };
        match drawings.iter().find(|(own, ..)| *own == view) {
            Some((_, part, _)) => problem.part(part),
            None => problem,
        }
    })
}

/// Completes the stored description of a job: the resolved options, and the
/// size of the views where it is one for all.
fn describe(
    document: &mut SheetDocument,
    drawings: &[(Viewpoint, String, PictureSize)],
    options: &Options,
) -> Result<(), Problem> {
    let first = drawings.first().map(|(.., size)| *size);
    let size = first.filter(|first| drawings.iter().all(|(.., size)| size == first));
    document.width = size.map(|size| size.width);
    document.height = size.map(|size| size.height);
    let has_truth = document.views.iter().any(|view| view.truth().is_some());
    document.truth = document.truth.take().filter(|truth| has_truth || truth.model.is_some());
    document.options =
        Some(serde_json::to_value(options).map_err(|e| Problem::internal("options", &e))?);
    Ok(())
}
