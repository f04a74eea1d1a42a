//! From the pictures of a page and the figures on them to its files: crops,
//! masks and previews. Nothing here waits; it runs on blocking threads.

use std::collections::BTreeMap;

use bytes::Bytes;
use image::{GrayImage, RgbImage, RgbaImage};
use page::{Figure, PageProposal};
use rayon::prelude::*;
use subject::{Box2, Hints, Point, SubjectError, SubjectOptions};

use super::document::{
    LeftOutThing, PageContent, PageFigure, PagePicture, PixelBox, figure_file, picture_file,
};
use super::edit::FigureEdit;
use crate::http::problem::{
    DIFFERING_SIZES, DUPLICATE_AZIMUTH, INVALID_ANGLE, INVALID_PAGE, NO_FIGURE, Problem,
};
use frames::{Azimuth, Elevation};

/// Corners and points by hand of one figure.
const MAX_POINTS: usize = 10_000;

/// A page as it was searched.
pub(super) struct Searched {
    pub pictures: Vec<RgbaImage>,
    pub proposals: Vec<PageProposal>,
}

/// A page with its figures cut out: what is stored.
pub(super) struct Cut {
    pub content: PageContent,
    /// By their names below the page's version.
    pub files: Vec<(String, Bytes)>,
}

/// A figure on its way to its crop and mask.
struct Wanted {
    figure: PageFigure,
    /// Which of its picture's proposed figures has the same bounds.
    proposed: Option<usize>,
    mask: Option<GrayImage>,
}

impl Searched {
    /// The page as proposed.
    pub(super) fn as_proposed(&self) -> Result<Cut, Problem> {
        let mut wanted = Vec::new();
        for (picture, proposal) in self.proposals.iter().enumerate() {
            for (index, found) in proposal.figures.iter().enumerate() {
                let mut figure = self.figure(picture, &found.place);
                figure.azimuth_deg = found.azimuth.degrees();
                figure.confidence = found.confidence;
                figure.row = found.row;
                figure.facing = found.facing;
                figure.axis_column = found.axis_column;
                wanted.push(Wanted { figure, proposed: Some(index), mask: None });
            }
        }
        let confidence = self.proposals.first().map_or(0.0, |proposal| proposal.confidence);
        self.cut(wanted, confidence, |figure, _, error| {
            // Nobody looked at it yet, so it is left to be put right.
            figure.kept = false;
            figure.warnings.push(format!("left out: {error}"));
            Ok(())
        })
    }

    /// The page as edited.
    ///
    /// * `masks`: those sent or to be kept, by number of the figure.
    pub(super) fn as_edited(
        &self,
        edits: Vec<FigureEdit>,
        mut masks: BTreeMap<usize, GrayImage>,
    ) -> Result<Cut, Problem> {
        let mut wanted = Vec::new();
        for (number, edit) in edits.into_iter().enumerate() {
            wanted.push(self.edited(number, edit, masks.remove(&number))?);
        }
        if let Some(number) = masks.keys().next() {
            let detail = format!("there is no figure {number} for the mask; number them from 0");
            return Err(Problem::new(INVALID_PAGE, detail).part(format!("mask[{number}]")));
        }
        check_azimuths(&wanted)?;
        self.cut(wanted, 1.0, |figure, number, error| {
            if !figure.kept {
                figure.warnings.push(error.to_string());
                return Ok(());
            }
            let detail = format!(
                "figures[{number}]: {error}; draw its box around a figure on bare paper, or leave it out"
            );
            Err(Problem::new(NO_FIGURE, detail).part(format!("figures[{number}]")))
        })
    }

    /// A figure of which only the place is known.
    fn figure(&self, picture: usize, place: &Box2) -> PageFigure {
        let crop = page::with_margin(place, self.pictures[picture].dimensions());
        PageFigure {
            picture,
            place: (*place).into(),
            crop: crop.into(),
            azimuth_deg: 0.0,
            elevation_deg: 0.0,
            confidence: 1.0,
            kept: true,
            mirrored: false,
            outline: Vec::new(),
            polygon: Vec::new(),
            erase: Vec::new(),
            attach: Vec::new(),
            ignore: Vec::new(),
            axis_x: None,
            ground_y: None,
            scale_by_hand: None,
            holes: Vec::new(),
            mask_given: false,
            mask_with_outline: false,
            baseline_row: place.bottom,
            axis_column: (f64::from(place.left) + f64::from(place.right)) / 2.0,
            facing: 0.0,
            scale: 1.0,
            row: 0,
            warnings: Vec::new(),
            crop_picture: String::new(),
            mask_picture: String::new(),
        }
    }

    fn edited(
        &self,
        number: usize,
        edit: FigureEdit,
        mask: Option<GrayImage>,
    ) -> Result<Wanted, Problem> {
        let refuse = |detail: String| {
            let part = format!("figures[{number}]");
            Problem::new(INVALID_PAGE, format!("{part}{detail}")).part(part)
        };
        let Some(picture) = self.pictures.get(edit.picture) else {
            let count = self.pictures.len();
            let detail = format!(".picture is {}, but there are {count}, from 0 on", edit.picture);
            return Err(refuse(detail));
        };
        let (width, height) = picture.dimensions();
        let PixelBox { left, top, right, bottom } = edit.place;
        if left >= right || top >= bottom || right > width || bottom > height {
            let detail = format!(
                ".box is columns {left} to {right}, rows {top} to {bottom}; it must lie inside of the picture of {width}x{height} px and have a pixel"
            );
            return Err(refuse(detail));
        }
        let points = [&edit.polygon, &edit.attach, &edit.ignore, &edit.holes];
        let points: Vec<_> = edit.erase.iter().chain(points).flatten().flatten().collect();
        if points.len() > 2 * MAX_POINTS || points.iter().any(|value| !value.is_finite()) {
            let detail = format!(" has more than {MAX_POINTS} points, or one that is not finite");
            return Err(refuse(detail));
        }
        let azimuth = Azimuth::from_degrees(edit.azimuth_deg).map_err(|_| {
            let detail = format!("figures[{number}].azimuth_deg is no finite angle in degrees");
            Problem::new(INVALID_ANGLE, detail).part(format!("figures[{number}]"))
        })?;
        let elevation = Elevation::from_degrees(edit.elevation_deg).map_err(|_| {
            let detail = format!("figures[{number}].elevation_deg must be from -90 to 90 degrees");
            Problem::new(INVALID_ANGLE, detail).part(format!("figures[{number}]"))
        })?;
        check_place(&edit, (width, height)).map_err(refuse)?;
        let figures = &self.proposals[edit.picture].figures;
        let place = Box2::from(edit.place);
        let proposed = figures.iter().position(|figure| figure.place == place);
        let mut figure = self.figure(edit.picture, &place);
        if let Some(found) = proposed.map(|index| &figures[index]) {
            figure.row = found.row;
            figure.facing = found.facing;
            figure.axis_column = found.axis_column;
        }
        // An azimuth that was left as it was guessed is still a guess.
        let is_guess = proposed.is_some_and(|index| figures[index].azimuth == azimuth);
        figure.confidence = edit.confidence.filter(|_| is_guess).unwrap_or(1.0).clamp(0.0, 1.0);
        figure.azimuth_deg = azimuth.degrees();
        figure.elevation_deg = elevation.degrees();
        (figure.axis_x, figure.ground_y) = (edit.axis_x, edit.ground_y);
        (figure.scale_by_hand, figure.holes) = (edit.scale_by_hand, edit.holes);
        (figure.kept, figure.mirrored) = (edit.kept, edit.mirrored);
        (figure.polygon, figure.erase) = (edit.polygon, edit.erase);
        (figure.attach, figure.ignore) = (edit.attach, edit.ignore);
        figure.mask_given = mask.is_some();
        figure.mask_with_outline = mask.is_some() && edit.mask_with_outline;
        if let Some(mask) = &mask {
            let wanted = figure.crop_size();
            if mask.dimensions() != wanted {
                let (w, h) = mask.dimensions();
                let detail = format!(
                    "the mask of figures[{number}] is {w}x{h} px, its crop {}x{}; start from the mask that the page answers",
                    wanted.0, wanted.1
                );
                return Err(Problem::new(DIFFERING_SIZES, detail).part(format!("mask[{number}]")));
            }
        }
        Ok(Wanted { figure, proposed, mask })
    }

    fn cut(
        &self,
        wanted: Vec<Wanted>,
        confidence: f64,
        without_subject: impl Fn(&mut PageFigure, usize, &SubjectError) -> Result<(), Problem>,
    ) -> Result<Cut, Problem> {
        let cut = wanted.into_par_iter().with_max_len(1).map(|wanted| self.crop(wanted));
        let cut: Vec<_> = cut.collect();
        let mut files = Vec::new();
        let mut figures = Vec::new();
        for (index, (mut figure, crop, mask)) in cut.into_iter().enumerate() {
            let mask = match mask {
                Ok(mask) => mask,
                Err(error) => {
                    without_subject(&mut figure, index, &error)?;
                    GrayImage::new(crop.width(), crop.height())
                }
            };
            files.push((figure_file(index, "crop"), encoded(&crop)?));
            files.push((figure_file(index, "mask"), encoded(&mask)?));
            figures.push(figure);
        }
        scale(&mut figures);
        for (index, (picture, proposal)) in self.pictures.iter().zip(&self.proposals).enumerate() {
            let preview = preview(picture, proposal, index, &figures);
            files.push((picture_file(index, "preview"), encoded(&preview)?));
            let reduced = page::reduced(picture, proposal);
            files.push((picture_file(index, "picture"), encoded(&reduced)?));
        }
        let pictures = self.proposals.iter().map(|proposal| PagePicture {
            width: proposal.width,
            height: proposal.height,
            paper: proposal.paper.colour,
            picture: String::new(),
            preview: String::new(),
        });
        let left_out = self.proposals.iter().enumerate().flat_map(|(index, proposal)| {
            proposal.left_out.iter().map(move |left| LeftOutThing::on(index, left))
        });
        let content = PageContent {
            pictures: pictures.collect(),
            figures,
            left_out: left_out.collect(),
            confidence,
        };
        Ok(Cut { content, files })
    }

    /// Cuts a figure out and looks for the subject as a reconstruction does, so
    /// that what is seen is what will be used.
    fn crop(&self, wanted: Wanted) -> (PageFigure, RgbaImage, Result<GrayImage, SubjectError>) {
        let Wanted { mut figure, proposed, mask } = wanted;
        let (page, proposal) = (&self.pictures[figure.picture], &self.proposals[figure.picture]);
        let crop = match proposed {
            Some(index) => page::cut_out(page, proposal, index),
            None => page::cut_box(page, proposal, &figure.place.into()),
        };
        let points = |given: &[[f64; 2]]| {
            figure.in_crop(given).into_iter().map(|[x, y]| Point { x, y }).collect()
        };
        let hints = Hints {
            mask,
            polygon: (!figure.polygon.is_empty()).then(|| points(&figure.polygon)),
            erase: figure.erase.iter().map(|area| points(area)).collect(),
            attach: points(&figure.attach),
            ignore: points(&figure.ignore),
        };
        let doubt = sheet::azimuth_doubt(figure.azimuth_deg, figure.confidence);
        figure.warnings.extend(doubt);
        let found = subject::find(&crop, &hints, &SubjectOptions::default(), &|| false);
        let mask = found.map(|subject| {
            figure.warnings.extend(subject.warnings.iter().map(ToString::to_string));
            let (left, top) = (f64::from(figure.crop.left), f64::from(figure.crop.top));
            let corners = page::outline_of(&subject.mask);
            figure.outline = corners.iter().map(|p| [p.x + left, p.y + top]).collect();
            // The outline is of the largest part: a speck below it is no foot.
            let lowest = figure.outline.iter().map(|[_, y]| *y).reduce(f64::max);
            if let Some(lowest) = lowest {
                figure.baseline_row = lowest.ceil() as u32;
            }
            subject.mask
        });
        if let Some(x) = figure.axis_x {
            figure.axis_column = x;
        }
        if let Some(y) = figure.ground_y {
            // On the picture, as was checked.
            figure.baseline_row = y.round() as u32;
        }
        (figure, crop, mask)
    }
}

/// Holds what is said by hand of a figure's place against its picture and box; answers what is
/// wrong, to stand behind the figure's name.
fn check_place(edit: &FigureEdit, (width, height): (u32, u32)) -> Result<(), String> {
    for (field, value, side) in
        [("axis_x", edit.axis_x, width), ("ground_y", edit.ground_y, height)]
    {
        if let Some(value) = value.filter(|value| !(0.0..=f64::from(side)).contains(value)) {
            return Err(format!(
                ".{field} is {value}; give a place on the picture, 0 to {side} px, or null to have it found"
            ));
        }
    }
    if let Some(scale) = edit.scale_by_hand.filter(|scale| !(0.125..=8.0).contains(scale)) {
        return Err(format!(
            ".scale_by_hand is {scale}; give a factor from 0.125 to 8, or null to have it found"
        ));
    }
    let PixelBox { left, top, right, bottom } = edit.place;
    let inside = |&&[x, y]: &&[f64; 2]| {
        (f64::from(left)..=f64::from(right)).contains(&x)
            && (f64::from(top)..=f64::from(bottom)).contains(&y)
    };
    match edit.holes.iter().find(|point| !inside(point)) {
        None => Ok(()),
        Some([x, y]) => Err(format!(
            ".holes has ({x}, {y}), outside of its box; point at holes inside of the figure"
        )),
    }
}

/// Two views of one sheet cannot stand at one angle.
fn check_azimuths(wanted: &[Wanted]) -> Result<(), Problem> {
    let kept: Vec<_> = wanted.iter().enumerate().filter(|(_, wanted)| wanted.figure.kept).collect();
    for (at, (number, wanted)) in kept.iter().enumerate() {
        let angle = |wanted: &Wanted| (wanted.figure.azimuth(), wanted.figure.elevation_deg);
        let same = kept[..at].iter().find(|(_, earlier)| angle(earlier) == angle(wanted));
        if let Some((earlier, _)) = same {
            let detail = format!(
                "figures[{earlier}] and figures[{number}] both have azimuth {}; give each angle once (360 and 0 are the same), or leave one out",
                wanted.figure.azimuth_deg
            );
            let part = format!("figures[{number}]");
            return Err(Problem::new(DUPLICATE_AZIMUTH, detail).part(part));
        }
    }
    Ok(())
}

/// Heights as shares of the median.
fn scale(figures: &mut [PageFigure]) {
    let height = |figure: &PageFigure| f64::from(figure.place.bottom - figure.place.top);
    let usual = subject::median(&figures.iter().map(height).collect::<Vec<_>>()).max(1.0);
    figures.iter_mut().for_each(|figure| figure.scale = height(figure) / usual);
}

/// The picture `index` with its figures as they are now.
fn preview(
    picture: &RgbaImage,
    proposal: &PageProposal,
    index: usize,
    figures: &[PageFigure],
) -> RgbImage {
    let shown = figures.iter().filter(|figure| figure.picture == index && figure.kept);
    let figure = |figure: &PageFigure| {
        Some(Figure {
            place: figure.place.into(),
            outline: figure.outline.iter().map(|&[x, y]| Point { x, y }).collect(),
            // The preview is drawn from the outline.
            mask: GrayImage::new(0, 0),
            baseline_row: figure.baseline_row,
            axis_column: figure.axis_column,
            scale: figure.scale,
            row: figure.row,
            azimuth: figure.azimuth()?,
            confidence: figure.confidence,
            facing: figure.facing,
        })
    };
    let mut shown_on = proposal.clone();
    shown_on.figures = shown.filter_map(figure).collect();
    page::preview(picture, &shown_on)
}

/// A mask as it was sent: its levels from one half on are inside.
pub(super) fn mask_of(drawing: picture::Drawing) -> GrayImage {
    let mut mask = drawing.gray;
    mask.pixels_mut().for_each(|pixel| pixel.0[0] = if pixel.0[0] >= 128 { 255 } else { 0 });
    // Transparent is outside whatever its colour.
    if let Some(alpha) = drawing.alpha {
        for (pixel, alpha) in mask.pixels_mut().zip(alpha.pixels()) {
            if alpha.0[0] < 128 {
                pixel.0[0] = 0;
            }
        }
    }
    mask
}

fn encoded<P>(picture: &image::ImageBuffer<P, Vec<u8>>) -> Result<Bytes, Problem>
where
    P: image::Pixel<Subpixel = u8> + image::PixelWithColorType,
{
    let png = picture::png(picture).map_err(|error| Problem::internal("a page's file", &error))?;
    Ok(png.into())
}
