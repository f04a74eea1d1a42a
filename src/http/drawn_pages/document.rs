//! A page as it is stored, as clients see it, and as they edit it.

use std::collections::BTreeMap;

use jiff::Timestamp;
use serde::{Deserialize, Serialize};
use utoipa::ToSchema;
use uuid::Uuid;

use crate::http::openapi::sheet_reference;
use crate::http::problem::Problem;
use frames::Azimuth;
use jobs::StoredPage;
use page::LeftOut;
use sheet::{HoleDocument, SheetDocument, ViewDocument};
use subject::Box2;

/// A page of drawings with the figures found on it.
#[derive(Debug, Serialize, ToSchema)]
#[schema(as = Page)]
pub(super) struct PageView {
    pub id: Uuid,
    /// Counts the changes of what is on it, from 1.
    pub version: u64,
    /// What people call it.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub name: Option<String>,
    /// What it is found by.
    pub labels: BTreeMap<String, String>,
    /// When it is deleted by itself, unless it is pinned; null keeps it.
    #[schema(value_type = Option<String>, format = DateTime)]
    pub expires_at: Option<Timestamp>,
    /// Whether it stays although its time is over.
    pub pinned: bool,
    #[schema(value_type = String, format = DateTime)]
    pub created_at: Timestamp,
    #[schema(value_type = String, format = DateTime)]
    pub changed_at: Timestamp,
    #[serde(flatten)]
    pub content: PageContent,
    /// The figures that are kept, as a sheet whose files are below this page.
    #[schema(schema_with = sheet_reference)]
    pub sheet: SheetDocument,
    pub links: PageLinks,
}

/// What was found on a page and put right by hand. Places are px of its picture.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(in crate::http) struct PageContent {
    /// The page, or one picture for each view of a turn.
    pub pictures: Vec<PagePicture>,
    /// In reading order.
    pub figures: Vec<PageFigure>,
    /// What is on the page and no view.
    pub left_out: Vec<LeftOutThing>,
    /// How likely all azimuths together are.
    #[schema(minimum = 0, maximum = 1)]
    pub confidence: f64,
}

/// A picture of the page.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(in crate::http) struct PagePicture {
    /// Px.
    pub width: u32,
    /// Px.
    pub height: u32,
    /// The paper's mean colour, sRGB 0 to 255.
    pub paper: [u8; 3],
    /// The picture as PNG, at most 1600 px a side.
    #[schema(format = "uri-reference")]
    pub picture: String,
    /// The same with what was found drawn on it.
    #[schema(format = "uri-reference")]
    pub preview: String,
}

/// A rectangle of pixels; `right` and `bottom` are the first outside.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize, ToSchema)]
#[serde(deny_unknown_fields)]
pub(in crate::http) struct PixelBox {
    pub left: u32,
    pub top: u32,
    pub right: u32,
    pub bottom: u32,
}

/// One figure on a page.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(in crate::http) struct PageFigure {
    /// Which of the pictures it is on, from 0.
    pub picture: usize,
    /// Its bounds.
    #[serde(rename = "box")]
    pub place: PixelBox,
    /// What is cut out: the bounds with a margin. Crop and mask have this size.
    pub crop: PixelBox,
    /// Degrees in [0, 360): 0 is the front, 90 shows the subject's left side.
    #[schema(minimum = 0, exclusive_maximum = 360)]
    pub azimuth_deg: f64,
    /// How far the camera is raised, degrees: 0 is level, 90 looks straight down.
    #[serde(default)]
    #[schema(minimum = -90, maximum = 90, required = true)]
    pub elevation_deg: f64,
    /// How likely the azimuth is; 1 if it was given.
    #[schema(minimum = 0, maximum = 1)]
    pub confidence: f64,
    /// Whether it is a view of the sheet.
    pub kept: bool,
    /// Whether the drawing is mirrored: it is turned back before it is used.
    pub mirrored: bool,
    /// The outline of its silhouette.
    #[schema(value_type = Vec<Vec<f64>>)]
    pub outline: Vec<[f64; 2]>,
    /// The outline by hand; empty if there is none.
    #[schema(value_type = Vec<Vec<f64>>)]
    pub polygon: Vec<[f64; 2]>,
    /// Areas by hand that are paper: polygons.
    #[schema(value_type = Vec<Vec<Vec<f64>>>)]
    pub erase: Vec<Vec<[f64; 2]>>,
    /// Points by hand in pieces that are of the subject.
    #[schema(value_type = Vec<Vec<f64>>)]
    pub attach: Vec<[f64; 2]>,
    /// Points by hand in pieces that are not of the subject.
    #[schema(value_type = Vec<Vec<f64>>)]
    pub ignore: Vec<[f64; 2]>,
    /// The column of its turning axis by hand; null if it is to be found.
    #[serde(default)]
    #[schema(required = true)]
    pub axis_x: Option<f64>,
    /// The row where the axis meets the ground by hand; null if it is to be found.
    #[serde(default)]
    #[schema(required = true)]
    pub ground_y: Option<f64>,
    /// By what it is multiplied to fit the others, by hand; null if that is to be found.
    #[serde(default)]
    #[schema(required = true)]
    pub scale_by_hand: Option<f64>,
    /// Points by hand in holes through the subject.
    #[serde(default)]
    #[schema(value_type = Vec<Vec<f64>>, required = true)]
    pub holes: Vec<[f64; 2]>,
    /// Whether its mask was sent.
    pub mask_given: bool,
    /// Whether the mask that was sent covers the outline's stroke, as masks that are found do;
    /// else it ends in the stroke's middle.
    #[serde(default)]
    #[schema(required = true)]
    pub mask_with_outline: bool,
    /// The row on which it stands: the first below it, or what `ground_y` says.
    pub baseline_row: u32,
    /// The column of its turning axis, or what `axis_x` says.
    pub axis_column: f64,
    /// Which way it faces on the page: -1 to the left, 1 to the right, 0 if that
    /// could not be told.
    pub facing: f64,
    /// Its height as a share of the figures' median height.
    pub scale: f64,
    /// Which row of figures it is in, from the top, 0 the first.
    pub row: usize,
    /// What a person should look at.
    pub warnings: Vec<String>,
    /// It with paper about it, as a picture.
    #[schema(format = "uri-reference")]
    pub crop_picture: String,
    /// Its silhouette, white inside, of the size of the crop: what a
    /// reconstruction with default options takes as the subject.
    #[schema(format = "uri-reference")]
    pub mask_picture: String,
}

/// Something on a page that is no view.
#[derive(Clone, Debug, Serialize, Deserialize, ToSchema)]
pub(in crate::http) struct LeftOutThing {
    /// Which of the pictures it is on, from 0.
    pub picture: usize,
    /// What it is thought to be.
    #[schema(example = "caption")]
    pub kind: String,
    /// Its bounds.
    #[serde(rename = "box")]
    pub place: PixelBox,
    /// Why it is no view.
    pub why: String,
}

/// Where to go on, as relative URIs.
#[derive(Debug, Serialize, ToSchema)]
pub(super) struct PageLinks {
    #[serde(rename = "self")]
    #[schema(format = "uri-reference")]
    pub this: String,
    /// The first picture with what was found drawn on it.
    #[schema(format = "uri-reference")]
    pub preview: String,
}

impl PageView {
    pub(super) fn of(stored: &StoredPage) -> Result<Self, Problem> {
        let content = PageContent::of(stored)?;
        let this = format!("/v1/pages/{}", stored.id);
        Ok(Self {
            id: stored.id.0,
            version: stored.version,
            name: stored.tags.name.clone(),
            labels: stored.tags.labels.clone(),
            expires_at: stored.tags.expires_at,
            pinned: stored.tags.pinned,
            created_at: stored.created_at,
            changed_at: stored.changed_at,
            sheet: content.sheet(""),
            content: content.placed_at(&this),
            links: PageLinks { preview: format!("{this}/preview.png"), this },
        })
    }
}

/// The name of a figure's file.
pub(super) fn figure_file(index: usize, name: &str) -> String {
    format!("figures/{index}/{name}.png")
}

/// The name of a picture's file.
pub(super) fn picture_file(index: usize, name: &str) -> String {
    format!("pictures/{index}/{name}.png")
}

impl PageContent {
    /// Reads a stored page.
    pub(in crate::http) fn of(stored: &StoredPage) -> Result<Self, Problem> {
        Self::deserialize(&stored.content).map_err(|error| Problem::internal("stored page", &error))
    }

    /// The same with links that lead to the files of the page at `this`.
    fn placed_at(mut self, this: &str) -> Self {
        for (index, picture) in self.pictures.iter_mut().enumerate() {
            picture.picture = format!("{this}/{}", picture_file(index, "picture"));
            picture.preview = format!("{this}/{}", picture_file(index, "preview"));
        }
        for (index, figure) in self.figures.iter_mut().enumerate() {
            figure.crop_picture = format!("{this}/{}", figure_file(index, "crop"));
            figure.mask_picture = format!("{this}/{}", figure_file(index, "mask"));
        }
        self
    }

    /// The figures that are kept, in reading order.
    pub(in crate::http) fn kept(&self) -> impl Iterator<Item = (usize, &PageFigure)> {
        self.figures.iter().enumerate().filter(|(_, figure)| figure.kept)
    }

    /// The sheet that the kept figures make; names of files begin with `prefix`.
    pub(in crate::http) fn sheet(&self, prefix: &str) -> SheetDocument {
        let view = |(index, figure): (usize, &PageFigure)| {
            let mask = figure.mask_given.then(|| format!("{prefix}{}", figure_file(index, "mask")));
            ViewDocument {
                image: format!("{prefix}{}", figure_file(index, "crop")),
                azimuth_deg: figure.azimuth_deg,
                azimuth_confidence: (figure.confidence < 1.0).then_some(figure.confidence),
                mask_with_outline: mask.is_some() && figure.mask_with_outline,
                mask,
                polygon: figure.in_crop(&figure.polygon),
                erase: figure.erase.iter().map(|area| figure.in_crop(area)).collect(),
                attach: figure.in_crop(&figure.attach),
                ignore: figure.in_crop(&figure.ignore),
                elevation_deg: figure.elevation(),
                axis_x: figure.axis_x.map(|x| x - f64::from(figure.crop.left)),
                ground_y: figure.ground_y.map(|y| y - f64::from(figure.crop.top)),
                scale: figure.scale_by_hand,
                mirrored: figure.mirrored,
                ..ViewDocument::default()
            }
        };
        let holes = self.kept().flat_map(|(_, figure)| {
            figure.in_crop(&figure.holes).into_iter().map(|[x, y]| HoleDocument {
                azimuth_deg: figure.azimuth_deg,
                elevation_deg: figure.elevation(),
                x,
                y,
            })
        });
        SheetDocument {
            views: self.kept().map(view).collect(),
            holes: holes.collect(),
            ..SheetDocument::default()
        }
    }
}

impl PageFigure {
    /// Places on the page as places in the crop.
    pub(super) fn in_crop(&self, points: &[[f64; 2]]) -> Vec<[f64; 2]> {
        let (left, top) = (f64::from(self.crop.left), f64::from(self.crop.top));
        points.iter().map(|[x, y]| [x - left, y - top]).collect()
    }

    /// Width and height of its crop, px.
    pub(in crate::http) fn crop_size(&self) -> (u32, u32) {
        (self.crop.right - self.crop.left, self.crop.bottom - self.crop.top)
    }

    /// Its elevation, as documents say it: level views say nothing.
    fn elevation(&self) -> Option<f64> {
        Some(self.elevation_deg).filter(|&degrees| degrees != 0.0)
    }

    /// Its azimuth, which was checked when it was stored.
    pub(in crate::http) fn azimuth(&self) -> Option<Azimuth> {
        Azimuth::from_degrees(self.azimuth_deg).ok()
    }
}

impl LeftOutThing {
    pub(super) fn on(picture: usize, left: &LeftOut) -> Self {
        Self {
            picture,
            kind: left.kind.to_string(),
            place: left.place.into(),
            why: left.why.to_owned(),
        }
    }
}

impl From<Box2> for PixelBox {
    fn from(Box2 { left, top, right, bottom }: Box2) -> Self {
        Self { left, top, right, bottom }
    }
}

impl From<PixelBox> for Box2 {
    fn from(PixelBox { left, top, right, bottom }: PixelBox) -> Self {
        Self { left, top, right, bottom }
    }
}
