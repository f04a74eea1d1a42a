//! Reads the parts of an upload of drawings.

use std::collections::BTreeMap;

use bytes::{Bytes, BytesMut};
use multer::{Field, Multipart};

use super::assemble::assemble;
use super::document::Document;
use super::intake::multipart_problem;
use super::matches;
use super::option_parts::GivenOptions;
use super::page::PageParts;
use super::pictures::{check_start, image_problem};
use super::{Form, Inputs, JobForm, Upload, fetch, reuse, source, truths};
use crate::http::access::Caller;
use crate::http::problem::{
    BODY_TOO_LARGE, CONFLICTING_PARTS, DUPLICATE_AZIMUTH, DUPLICATE_PART, EMPTY_FILE,
    INVALID_ANGLE, INVALID_JSON, INVALID_PART_NAME, MISSING_PART, PART_TOO_LARGE, Problem,
    TOO_MANY_VIEWS, UNKNOWN_PART,
};
use crate::http::{Api, HttpLimits};
use crate::kinds::{RECONSTRUCTION, ReconstructionPayload};
use frames::{Azimuth, Elevation, Viewpoint};
use mesh::read::ModelFormat;

const MAX_PARTS: usize = 1024;
const MAX_NAME_BYTES: usize = 200;
const MAX_FIELD_BYTES: usize = 4096;

/// A picture as it came.
#[derive(Clone, Debug)]
pub(crate) struct FilePart {
    /// Name of the part; in the sheet form, of the file.
    pub file: String,
    pub bytes: Bytes,
}

/// Everything an upload holds, none of it checked against the rest.
#[derive(Debug, Default)]
pub(crate) struct Parts {
    pub views: Vec<(Viewpoint, FilePart)>,
    /// How likely the azimuths are that were guessed.
    pub guessed: BTreeMap<Viewpoint, f64>,
    pub masks: Vec<(Viewpoint, FilePart)>,
    /// Pictures of true values.
    pub truths: Vec<(Viewpoint, FilePart)>,
    /// The true model, under its file's name.
    pub truth_model: Option<FilePart>,
    /// How true values are to be read.
    pub truth: Option<Document>,
    /// Files that a sheet document places.
    pub files: Vec<FilePart>,
    pub sheet: Option<Document>,
    /// Matches of pairs, in any form of upload.
    pub matches: Vec<Document>,
    /// Drawings whose angles come in parts of their own, in the same order.
    pub loose_views: Vec<FilePart>,
    pub loose_azimuths: Vec<Azimuth>,
    /// None where all are level.
    pub loose_elevations: Vec<Elevation>,
    pub given: GivenOptions,
    pub page: PageParts,
    pub source: Option<String>,
    /// Whether an earlier result will do.
    pub reuse: Option<bool>,
}

enum Kind {
    View(Viewpoint),
    LooseView,
    LooseAzimuths,
    LooseElevations,
    Mask(Viewpoint),
    Truth(Viewpoint),
    TruthModel(String),
    TruthFields,
    /// A drawing or mask that a sheet document places.
    Picture(String),
    /// A file of any kind that a sheet document places.
    File(String),
    Sheet,
    Matches,
    Options,
    Page,
    PageId,
    Azimuths,
    Source,
    Reuse,
    Field,
}

/// Reads all parts.
pub(super) async fn read<F: Form>(
    mut multipart: Multipart<'_>,
    limits: &HttpLimits,
) -> Result<F, Problem> {
    let mut form = F::default();
    let mut count = 0;
    while let Some(field) = multipart.next_field().await.map_err(multipart_problem)? {
        count += 1;
        if count > MAX_PARTS {
            let detail = format!("the body has more than {MAX_PARTS} parts; send fewer");
            return Err(Problem::new(BODY_TOO_LARGE, detail));
        }
        form.read_one(field, limits).await?;
    }
    Ok(form)
}

impl Form for Parts {
    /// Pictures are refused as soon as their first bytes say enough.
    async fn read_one(&mut self, field: Field<'_>, limits: &HttpLimits) -> Result<(), Problem> {
        let name = part_name(&field)?;
        match kind(&name, field.file_name())? {
            Kind::View(view) => {
                self.expect_new_view(view, &name, limits)?;
                let picture = read_picture(field, name, limits).await?;
                self.views.push((view, picture));
            }
            Kind::LooseView => {
                if self.loose_views.len() == limits.max_views {
                    return Err(too_many(&name, limits));
                }
                let file = format!("{name}, number {}", self.loose_views.len() + 1);
                self.loose_views.push(read_picture(field, file, limits).await?);
            }
            Kind::LooseAzimuths => {
                let text = read_text(field, &name).await?;
                // Some clients send a list as one part.
                for angle in text.trim_matches(['[', ']']).split(',') {
                    self.loose_azimuths.push(parse_azimuth(angle, &name)?);
                }
            }
            Kind::LooseElevations => {
                let text = read_text(field, &name).await?;
                for angle in text.trim_matches(['[', ']']).split(',') {
                    self.loose_elevations.push(parse_elevation(angle, &name)?);
                }
            }
            Kind::Mask(view) => {
                expect_new(!self.masks.iter().any(|(own, _)| *own == view), &name)?;
                self.expect_room(&name, limits)?;
                let picture = read_picture(field, name, limits).await?;
                self.masks.push((view, picture));
            }
            Kind::Truth(view) => {
                expect_new(!self.truths.iter().any(|(own, _)| *own == view), &name)?;
                self.expect_room(&name, limits)?;
                let file = read_file(field, name, limits.image.max_bytes).await?;
                self.truths.push((view, file));
            }
            Kind::TruthModel(file) => {
                expect_new(self.truth_model.is_none(), &name)?;
                self.truth_model = Some(read_file(field, file, model_bytes(limits)).await?);
            }
            Kind::TruthFields => {
                expect_new(self.truth.is_none(), &name)?;
                self.truth = Some(Document::read(field, &name, limits).await?);
            }
            Kind::Picture(file) => {
                self.expect_new_file(&file, &name, limits)?;
                let picture = read_picture(field, file, limits).await?;
                self.files.push(picture);
            }
            Kind::File(file) => {
                self.expect_new_file(&file, &name, limits)?;
                let most = match ModelFormat::from_file_name(&file) {
                    Some(_) => model_bytes(limits),
                    None => limits.image.max_bytes,
                };
                self.files.push(read_file(field, file, most).await?);
            }
            Kind::Sheet => {
                expect_new(self.sheet.is_none(), &name)?;
                self.sheet = Some(Document::read(field, &name, limits).await?);
            }
            Kind::Matches => {
                self.matches.push(Document::read(field, &name, limits).await?);
                expect_budget(&self.matches, &name, limits.max_matches_bytes)?;
            }
            Kind::Options => self.given.read_document(field, &name, limits).await?,
            Kind::Page => {
                expect_new(self.page.page.is_none() && self.page.id.is_none(), &name)?;
                self.page.page = Some(read_picture(field, name, limits).await?);
            }
            Kind::PageId => {
                expect_new(self.page.page.is_none() && self.page.id.is_none(), &name)?;
                self.page.id = Some(read_text(field, &name).await?);
            }
            Kind::Azimuths => {
                expect_new(self.page.azimuths.is_none(), &name)?;
                self.page.azimuths = Some(read_text(field, &name).await?);
            }
            Kind::Source => {
                expect_new(self.source.is_none(), &name)?;
                self.source = Some(read_text(field, &name).await?);
            }
            Kind::Reuse => {
                expect_new(self.reuse.is_none(), &name)?;
                self.reuse = Some(reuse::read(field, &name).await?);
            }
            Kind::Field => self.given.read_field(field, name).await?,
        }
        Ok(())
    }
}

impl JobForm for Parts {
    async fn check(mut self, api: &Api, caller: &Caller) -> Result<Upload, Problem> {
        self.place_loose_views(&api.limits)?;
        let reuse = self.reuse.unwrap_or(true);
        if let Some(page) = self.page.id.take() {
            let (source, document) = source::of_page(api, caller, &page, self).await?;
            let page = Some(source.id.0);
            let inputs =
                Inputs::Copied { source, names: source::input_names(&document), own: Vec::new() };
            let payload =
                ReconstructionPayload { document, source: None, page, has_matches: false };
            return Ok(Upload { reuse, ..Upload::new(RECONSTRUCTION, &payload, inputs)? });
        }
        if let Some(part) = self.page.any() {
            let others = [self.source.as_ref().map(|_| "source".to_owned()), self.any_of_others()];
            self.expect_only(&part, [others[0].as_ref(), others[1].as_ref(), None])?;
            let page = std::mem::take(&mut self.page);
            for view in page.views(&api.decoders, &api.limits).await? {
                self.guessed.extend(view.confidence.map(|sure| (view.viewpoint, sure)));
                self.views.push((view.viewpoint, view.drawing));
            }
        }
        let fetched = fetch::fetch(api, &mut self).await?;
        let has_matches;
        let (document, source, inputs) = match self.source.take() {
            Some(source) => {
                let (source, mut document) = source::rerun(api, caller, &source, self).await?;
                let names = source::input_names(&document);
                let matches = matches::set_apart(&mut document)?;
                has_matches = matches.is_some();
                let own = matches.into_iter().collect();
                (document, Some(source.id.0), Inputs::Copied { source, names, own })
            }
            None => {
                let limits = api.limits;
                let assembled = api.decoders.run(move || assemble(self, &limits)).await??;
                let pictures = assembled.pictures();
                let decoded = api.decoders.decode_all(&pictures, &api.limits.image).await?;
                let truths = truths::check_all(&api.decoders, &assembled, &api.limits).await?;
                let (mut document, mut inputs) =
                    assembled.finish(&decoded, &truths, &api.limits)?;
                let matches = matches::set_apart(&mut document)?;
                has_matches = matches.is_some();
                inputs.extend(matches);
                (document, None, Inputs::Uploaded(inputs))
            }
        };
        let payload = ReconstructionPayload { document, source, page: None, has_matches };
        Ok(Upload { reuse, fetched, ..Upload::new(RECONSTRUCTION, &payload, inputs)? })
    }
}

impl Parts {
    /// Gives the parts `view` the angles of the parts `azimuth_deg` and `elevation_deg`.
    fn place_loose_views(&mut self, limits: &HttpLimits) -> Result<(), Problem> {
        let (views, azimuths) = (self.loose_views.len(), self.loose_azimuths.len());
        if views != azimuths {
            let detail = format!(
                "there are {views} parts `view` and {azimuths} azimuths in parts `azimuth_deg`; send one for each"
            );
            return Err(Problem::new(MISSING_PART, detail).part("azimuth_deg"));
        }
        let mut elevations = std::mem::take(&mut self.loose_elevations);
        if !elevations.is_empty() && elevations.len() != views {
            let detail = format!(
                "there are {views} parts `view` and {} elevations in parts `elevation_deg`; send one for each, 0 for level views, or none",
                elevations.len()
            );
            return Err(Problem::new(MISSING_PART, detail).part("elevation_deg"));
        }
        elevations.resize(views, Elevation::LEVEL);
        let views = std::mem::take(&mut self.loose_views);
        let azimuths = std::mem::take(&mut self.loose_azimuths);
        for ((azimuth, elevation), file) in azimuths.into_iter().zip(elevations).zip(views) {
            let view = Viewpoint { azimuth, elevation };
            self.expect_new_view(view, &file.file, limits)?;
            self.views.push((view, file));
        }
        Ok(())
    }

    fn expect_new_view(
        &self,
        view: Viewpoint,
        part: &str,
        limits: &HttpLimits,
    ) -> Result<(), Problem> {
        if let Some((_, earlier)) = self.views.iter().find(|(own, _)| own.looks_like(view)) {
            let (earlier, azimuth) = (&earlier.file, view.azimuth);
            let detail = if view.elevation.is_vertical() {
                format!(
                    "`{part}` and `{earlier}` are both straight from above or below, where the azimuth only turns the picture; give one of them"
                )
            } else {
                let elevation = view.elevation.degrees();
                let raised = if view.is_level() {
                    String::new()
                } else {
                    format!(", elevation {elevation}")
                };
                format!(
                    "`{part}` and `{earlier}` are both at azimuth {azimuth}{raised}; give each angle once (360 and 0 are the same)"
                )
            };
            return Err(Problem::new(DUPLICATE_AZIMUTH, detail).part(part));
        }
        if self.views.len() == limits.max_views {
            return Err(too_many(part, limits));
        }
        Ok(())
    }

    fn expect_new_file(&self, file: &str, part: &str, limits: &HttpLimits) -> Result<(), Problem> {
        if self.files.iter().any(|known| known.file == file) {
            let detail = format!("two files are named `{file}`; give every file its own name");
            return Err(Problem::new(DUPLICATE_PART, detail).part(part));
        }
        self.expect_room(part, limits)
    }

    /// A sheet of the most views has a drawing, a mask and a picture of true
    /// values for each, and a model.
    fn expect_room(&self, part: &str, limits: &HttpLimits) -> Result<(), Problem> {
        let most = 3 * limits.max_views + 1;
        if [self.files.len(), self.masks.len(), self.truths.len()].iter().all(|&n| n < most) {
            return Ok(());
        }
        Err(too_many(part, limits))
    }

    /// The name of a part that places drawings in another way than a page.
    pub(super) fn any_of_others(&self) -> Option<String> {
        let sheet = self.sheet.as_ref().map(|_| "sheet".to_owned());
        let file = self.files.first().map(|file| file.file.clone());
        self.any_of_views_form().or(sheet).or(file)
    }

    /// The name of a part of the form `view[…]`, if there is one.
    pub(crate) fn any_of_views_form(&self) -> Option<String> {
        let placed = [&self.views, &self.masks, &self.truths];
        let mut names = placed.into_iter().flatten().map(|(_, file)| file.file.clone());
        names.next().or(self.truth.is_some().then(|| "truth".to_owned()))
    }

    /// Refuses parts of another upload form beside `form`.
    pub(crate) fn expect_only(
        &self,
        form: &str,
        others: [Option<&String>; 3],
    ) -> Result<(), Problem> {
        let Some(part) = others.into_iter().flatten().next() else { return Ok(()) };
        let detail = format!("`{part}` does not go with `{form}`; use one form of upload");
        Err(Problem::new(CONFLICTING_PARTS, detail).part(part))
    }
}

/// Parts of which there may be many are held against one limit together.
fn expect_budget(documents: &[Document], part: &str, limit: usize) -> Result<(), Problem> {
    if documents.iter().map(Document::len).sum::<usize>() <= limit {
        return Ok(());
    }
    let detail = format!("the parts `{part}` are over their limit of {limit} bytes together");
    Err(Problem::new(PART_TOO_LARGE, detail).part(part))
}

fn too_many(part: &str, limits: &HttpLimits) -> Problem {
    let detail = format!("the upload has more than {} views; leave some out", limits.max_views);
    Problem::new(TOO_MANY_VIEWS, detail).part(part)
}

pub(super) fn expect_new(is_new: bool, part: &str) -> Result<(), Problem> {
    if is_new {
        return Ok(());
    }
    let detail = format!("`{part}` is given twice; give it once");
    Err(Problem::new(DUPLICATE_PART, detail).part(part))
}

pub(super) fn part_name(field: &Field<'_>) -> Result<String, Problem> {
    match field.name() {
        Some(name) if !name.is_empty() && name.len() <= MAX_NAME_BYTES => Ok(name.to_owned()),
        Some(name) => {
            let detail = format!(
                "the name of part {} has {} bytes; it must have 1 to {MAX_NAME_BYTES}",
                field.index() + 1,
                name.len()
            );
            Err(Problem::new(INVALID_PART_NAME, detail))
        }
        None => {
            let detail = format!("part {} has no name in UTF-8; name it", field.index() + 1);
            Err(Problem::new(INVALID_PART_NAME, detail))
        }
    }
}

fn kind(name: &str, file_name: Option<&str>) -> Result<Kind, Problem> {
    let bracketed = |prefix| name.strip_prefix(prefix)?.strip_suffix(']');
    if let Some(angle) = bracketed("view[") {
        return parse_viewpoint(angle, name).map(Kind::View);
    }
    if let Some(angle) = bracketed("mask[") {
        return parse_viewpoint(angle, name).map(Kind::Mask);
    }
    if let Some(angle) = bracketed("truth[") {
        return parse_viewpoint(angle, name).map(Kind::Truth);
    }
    match (name, file_name) {
        ("view", Some(_)) => Ok(Kind::LooseView),
        ("azimuth_deg", None) => Ok(Kind::LooseAzimuths),
        ("elevation_deg", None) => Ok(Kind::LooseElevations),
        ("sheet", _) => Ok(Kind::Sheet),
        ("truth", Some(file)) if !file.is_empty() => Ok(Kind::File(file.to_owned())),
        ("truth", _) => Ok(Kind::TruthFields),
        ("truth_model", Some(file)) if !file.is_empty() => Ok(Kind::TruthModel(file.to_owned())),
        ("matches", _) => Ok(Kind::Matches),
        ("options", _) => Ok(Kind::Options),
        ("page", Some(_)) => Ok(Kind::Page),
        ("page", None) => Ok(Kind::PageId),
        ("azimuths", None) => Ok(Kind::Azimuths),
        ("source", _) => Ok(Kind::Source),
        ("reuse", None) => Ok(Kind::Reuse),
        ("image" | "mask", Some(file)) if !file.is_empty() => Ok(Kind::Picture(file.to_owned())),
        ("truth_model", _) => {
            let detail = "`truth_model` has no file name to tell its format by";
            Err(Problem::new(INVALID_PART_NAME, detail).part(name))
        }
        ("image" | "mask", _) => {
            let detail = format!("`{name}` has no file name to find it in the sheet by");
            Err(Problem::new(INVALID_PART_NAME, detail).part(name))
        }
        (_, Some(_)) => Ok(Kind::File(name.to_owned())),
        (_, None) if is_option_name(name) => Ok(Kind::Field),
        (_, None) => Err(unknown_part(name)),
    }
}

pub(super) fn unknown_part(name: &str) -> Problem {
    let detail = format!(
        "`{name}` is no part of this upload; drawings are named like `view[45]`, or like a picture in the part `sheet`"
    );
    Problem::new(UNKNOWN_PART, detail).part(name)
}

pub(super) fn is_option_name(name: &str) -> bool {
    name.bytes().all(|b| b.is_ascii_alphanumeric() || matches!(b, b'_' | b'.'))
}

/// An azimuth, or an azimuth and an elevation: `45`, `45,30`.
fn parse_viewpoint(text: &str, part: &str) -> Result<Viewpoint, Problem> {
    match text.split_once(',') {
        None => Ok(parse_azimuth(text, part)?.into()),
        Some((azimuth, elevation)) => Ok(Viewpoint {
            azimuth: parse_azimuth(azimuth, part)?,
            elevation: parse_elevation(elevation, part)?,
        }),
    }
}

fn parse_elevation(text: &str, part: &str) -> Result<Elevation, Problem> {
    let elevation = text.trim().parse::<f64>().ok().and_then(|e| Elevation::from_degrees(e).ok());
    elevation.ok_or_else(|| {
        let detail = format!(
            "`{text}` is no elevation from -90 to 90 degrees; write it like `view[22.5,30]`, 90 being straight from above"
        );
        Problem::new(INVALID_ANGLE, detail).part(part)
    })
}

fn parse_azimuth(text: &str, part: &str) -> Result<Azimuth, Problem> {
    let azimuth = text.trim().parse::<f64>().ok().and_then(|a| Azimuth::from_degrees(a).ok());
    azimuth.ok_or_else(|| {
        let detail =
            format!("`{text}` is not a finite angle in degrees; write it like `view[22.5]`");
        Problem::new(INVALID_ANGLE, detail).part(part)
    })
}

pub(super) async fn read_picture(
    mut field: Field<'_>,
    file: String,
    limits: &HttpLimits,
) -> Result<FilePart, Problem> {
    let mut bytes = BytesMut::new();
    let mut unchecked = true;
    while let Some(chunk) = field.chunk().await.map_err(multipart_problem)? {
        bytes.extend_from_slice(&chunk);
        // Once the header is in reach, and again whenever the limit is passed.
        if unchecked && bytes.len() >= 4096 || bytes.len() as u64 > limits.image.max_bytes {
            check_start(&bytes, &limits.image).map_err(|error| image_problem(&file, &error))?;
            unchecked = false;
        }
    }
    expect_bytes(&bytes, &file)?;
    check_start(&bytes, &limits.image).map_err(|error| image_problem(&file, &error))?;
    Ok(FilePart { file, bytes: bytes.freeze() })
}

/// Reads a file whose kind is not known yet.
async fn read_file(field: Field<'_>, file: String, max_bytes: u64) -> Result<FilePart, Problem> {
    let most = usize::try_from(max_bytes).unwrap_or(usize::MAX);
    let bytes = read_limited(field, &file, most).await?;
    expect_bytes(&bytes, &file)?;
    Ok(FilePart { file, bytes })
}

pub(super) fn expect_bytes(bytes: &[u8], file: &str) -> Result<(), Problem> {
    if !bytes.is_empty() {
        return Ok(());
    }
    let detail = format!("`{file}` is an empty file; check the path it was read from");
    Err(Problem::new(EMPTY_FILE, detail).part(file))
}

fn model_bytes(limits: &HttpLimits) -> u64 {
    limits.model.max_bytes as u64
}

pub(super) async fn read_text(field: Field<'_>, part: &str) -> Result<String, Problem> {
    let bytes = read_limited(field, part, MAX_FIELD_BYTES).await?;
    String::from_utf8(bytes.to_vec()).map_err(|_| {
        let detail = format!("the value of `{part}` is not UTF-8 text");
        Problem::new(INVALID_JSON, detail).part(part)
    })
}

pub(super) async fn read_limited(
    mut field: Field<'_>,
    part: &str,
    limit: usize,
) -> Result<Bytes, Problem> {
    let mut bytes = BytesMut::new();
    while let Some(chunk) = field.chunk().await.map_err(multipart_problem)? {
        if bytes.len() + chunk.len() > limit {
            let detail = format!("`{part}` is over the limit of {limit} bytes");
            return Err(Problem::new(PART_TOO_LARGE, detail).part(part));
        }
        bytes.extend_from_slice(&chunk);
    }
    Ok(bytes.freeze())
}
