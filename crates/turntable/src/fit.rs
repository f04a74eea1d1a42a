//! The draft drawn again from every view and held against the drawings.

use evaluation::compare_silhouettes;
use image::{GrayImage, Luma, Rgb, RgbImage};
use imageproc::distance_transform::euclidean_squared_distance_transform;
use mesh::Mesh;
use rayon::prelude::*;
use serde::Serialize;

use crate::draft::{Draft, DraftView};
use crate::ink::inked;
use crate::silhouette::Silhouette;
use crate::surface::projection::{DepthBuffer, Rig};

/// How well the draft, drawn again, matches one drawing.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct ViewFit {
    /// The view's azimuth, degrees.
    pub azimuth_deg: f64,
    /// Its elevation, degrees.
    pub elevation_deg: f64,
    /// Intersection over union of the draft's silhouette with the drawing's, holes
    /// filled in both.
    pub silhouette_iou: f64,
    /// Mean distance between both outlines, px; absent if one is empty.
    pub outline_distance_px: Option<f64>,
    /// The same as a share of the figure's height.
    pub outline_distance_share: Option<f64>,
    /// Share of the drawing's ink that lies at an edge of the draft: an outline,
    /// a step in depth or a crease.
    pub ink_explained: f64,
    /// Where they disagree most, if they disagree.
    pub disagreement: Option<Disagreement>,
}

/// Where draft and drawing disagree most.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Disagreement {
    /// In words, such as `upper left`.
    pub place: &'static str,
    /// Whether the drawing shows the subject there and the draft does not; else
    /// the other way round.
    pub missing: bool,
    /// Share of the figure's area.
    pub share: f64,
}

/// A fit below this is worth a word. Of 120 clean views of 30 models, 5 are below
/// it, all of drafts that are bad: three with an IoU of 0.54 or less.
const MIN_IOU: f64 = 0.9;
/// Ink this near to an edge of the draft is explained, share of the height.
const REACH: f64 = 0.008;
/// Neighbouring depths that differ by more are a step, share of the height.
const STEP: f64 = 0.02;
/// Depths that bend by more over three pixels are a crease, px.
const BEND_PX: f32 = 0.6;

impl ViewFit {
    fn name(&self) -> String {
        match self.elevation_deg {
            0.0 => self.azimuth_deg.to_string(),
            raised => format!("{}_e{raised}", self.azimuth_deg),
        }
    }

    /// What to tell a person; `None` if the draft fits.
    pub fn warning(&self) -> Option<String> {
        if self.silhouette_iou >= MIN_IOU {
            return None;
        }
        let places = self.disagreement.as_ref().map(|found| {
            let what = if found.missing {
                "the drawing shows more than the draft"
            } else {
                "the draft has more than the drawing"
            };
            format!(": at the {} {what}", found.place)
        });
        Some(format!(
            "view {} disagrees with the draft, which drawn again covers {:.0} % of it{}",
            self.name(),
            self.silhouette_iou * 100.0,
            places.unwrap_or_default()
        ))
    }
}

/// The draft as one of its views sees it.
#[derive(Clone, Debug)]
pub struct Redrawn {
    /// How it matches the drawing.
    pub fit: ViewFit,
    /// 255 where the draft is, of the drawing's size.
    mask: GrayImage,
}

/// Draws the draft from each of its views, level or not, and compares, in the order of
/// [`Draft::all_views`].
pub fn redraw(draft: &Draft<'_>) -> Vec<Redrawn> {
    let rig = draft.rig();
    let views = draft.all_views();
    views.par_iter().enumerate().map(|(index, view)| redrawn(draft, &rig, index, view)).collect()
}

/// How the silhouettes of `mesh` agree with those of each drawing, intersection
/// over union, holes filled in both.
pub(crate) fn silhouette_ious(mesh: &Mesh, rig: &Rig, silhouettes: &[Silhouette]) -> Vec<f64> {
    /// Both are this many times smaller than the drawings: half a pixel decides nothing.
    const SCALE: u32 = 2;
    let of_view = |(index, silhouette): (usize, &Silhouette)| {
        let drawn = shown(silhouette);
        let (width, height) = (drawn.width().div_ceil(SCALE), drawn.height().div_ceil(SCALE));
        let drawn =
            GrayImage::from_fn(width, height, |x, y| *drawn.get_pixel(x * SCALE, y * SCALE));
        let buffer = DepthBuffer::of_view(mesh, rig, index, f64::from(SCALE));
        let ours = mask_of(&buffer, drawn.dimensions());
        compare_silhouettes(&ours, &drawn).map_or(0.0, |found| found.iou)
    };
    silhouettes.par_iter().enumerate().map(of_view).collect()
}

fn redrawn(draft: &Draft<'_>, rig: &Rig, index: usize, view: &DraftView<'_>) -> Redrawn {
    let drawn = shown(view.silhouette);
    let buffer = DepthBuffer::of_view(&draft.solid.mesh, rig, index, 1.0);
    let ours = mask_of(&buffer, drawn.dimensions());
    let height_px = rows_of(&drawn).max(1) as f64;
    // Both are of the view's size: they can be compared. Holes are filled in
    // both, for line art does not say which areas are holes.
    let compared = compare_silhouettes(&ours, &drawn).ok();
    let distance_px = compared.as_ref().and_then(|found| found.mean_boundary_distance_px);
    let iou = compared.map_or(0.0, |found| found.iou);
    let fit = ViewFit {
        azimuth_deg: view.view.azimuth.degrees(),
        elevation_deg: view.view.elevation.degrees(),
        silhouette_iou: iou,
        outline_distance_px: distance_px,
        outline_distance_share: distance_px.map(|px| px / height_px),
        ink_explained: ink_explained(&view.view.image, &buffer, height_px),
        disagreement: if iou < MIN_IOU { disagreement(&ours, &drawn) } else { None },
    };
    Redrawn { fit, mask: ours }
}

/// The subject's area to the middle of the outline's stroke.
fn shown(silhouette: &Silhouette) -> GrayImage {
    let (width, height) = silhouette.mask().dimensions();
    let mut mask = GrayImage::new(width, height);
    for y in 0..height {
        for &(left, right) in silhouette.intervals_px(y as usize) {
            let first = (left - 0.5).ceil().max(0.0) as u32;
            let end = ((right - 0.5).floor().max(-1.0) + 1.0) as u32;
            (first..end.min(width)).for_each(|x| mask.put_pixel(x, y, Luma([255])));
        }
    }
    mask
}

fn mask_of(buffer: &DepthBuffer, (width, height): (u32, u32)) -> GrayImage {
    GrayImage::from_fn(width, height, |x, y| {
        Luma([if buffer.nearest(x as usize, y as usize).is_some() { 255 } else { 0 }])
    })
}

fn rows_of(mask: &GrayImage) -> usize {
    let width = mask.width().max(1) as usize;
    mask.as_raw().chunks_exact(width).filter(|row| row.iter().any(|level| *level != 0)).count()
}

/// Share of the ink that lies near an edge of the draft.
fn ink_explained(image: &GrayImage, buffer: &DepthBuffer, height_px: f64) -> f64 {
    let (width, height) = image.dimensions();
    let step_px = (STEP * height_px) as f32;
    let depth = |x: i64, y: i64| {
        let (x, y) = (usize::try_from(x).ok()?, usize::try_from(y).ok()?);
        (x < width as usize).then(|| buffer.nearest(x, y)).flatten()
    };
    let bends = |before: Option<f32>, here: f32, after: Option<f32>| match (before, after) {
        (Some(a), Some(b)) => (here - a).abs() > step_px || (a + b - 2.0 * here).abs() > BEND_PX,
        _ => true,
    };
    let edges = GrayImage::from_fn(width, height, |x, y| {
        let (x, y) = (i64::from(x), i64::from(y));
        let is_edge = depth(x, y).is_some_and(|here| {
            bends(depth(x - 1, y), here, depth(x + 1, y))
                || bends(depth(x, y - 1), here, depth(x, y + 1))
        });
        Luma([if is_edge { 255 } else { 0 }])
    });
    let reach_px = (REACH * height_px).max(2.0);
    let distances = euclidean_squared_distance_transform(&edges);
    let ink = inked(image);
    let near = |squared_px: &f64| *squared_px <= reach_px * reach_px;
    let all = ink.iter().filter(|is| **is).count();
    let explained =
        ink.iter().zip(distances.iter()).filter(|(is, squared)| **is && near(squared)).count();
    explained as f64 / all.max(1) as f64
}

/// The ninth of the figure's bounds where most pixels differ.
fn disagreement(ours: &GrayImage, drawn: &GrayImage) -> Option<Disagreement> {
    const PLACES: [&str; 9] = [
        "upper left",
        "top",
        "upper right",
        "left side",
        "middle",
        "right side",
        "lower left",
        "bottom",
        "lower right",
    ];
    let covered = || {
        ours.enumerate_pixels()
            .zip(drawn.pixels())
            .filter(|((_, _, a), b)| a.0[0] != 0 || b.0[0] != 0)
            .map(|((x, y, a), b)| (x, y, a.0[0] != 0, b.0[0] != 0))
    };
    let (left, right) =
        covered().fold((u32::MAX, 0), |(low, high), (x, ..)| (low.min(x), high.max(x)));
    let (top, bottom) =
        covered().fold((u32::MAX, 0), |(low, high), (_, y, ..)| (low.min(y), high.max(y)));
    if left > right {
        return None;
    }
    let third = |at: u32, low: u32, high: u32| ((at - low) * 3 / (high - low + 1)).min(2) as usize;
    let mut counts = [[0_u64; 2]; 9];
    let mut area = 0_u64;
    for (x, y, we, they) in covered() {
        area += u64::from(they);
        if we != they {
            counts[third(y, top, bottom) * 3 + third(x, left, right)][usize::from(they)] += 1;
        }
    }
    let (place, counts) = counts.iter().enumerate().max_by_key(|(_, [a, b])| a + b)?;
    Some(Disagreement {
        place: PLACES[place],
        missing: counts[1] >= counts[0],
        share: counts[0].max(counts[1]) as f64 / area.max(1) as f64,
    })
}

impl Redrawn {
    /// The drawing `image`, of the same view, with the draft's outline over it
    /// in colour.
    pub fn over(&self, image: &GrayImage) -> RgbImage {
        const OUTLINE: Rgb<u8> = Rgb([220, 40, 40]);
        let covered =
            |x: u32, y: u32| self.mask.get_pixel_checked(x, y).is_some_and(|level| level.0[0] != 0);
        RgbImage::from_fn(image.width(), image.height(), |x, y| {
            // Beyond the left and upper border columns and rows wrap to none.
            let beside = [(x.wrapping_sub(1), y), (x + 1, y), (x, y.wrapping_sub(1)), (x, y + 1)];
            if covered(x, y) && beside.iter().any(|&(x, y)| !covered(x, y)) {
                OUTLINE
            } else {
                Rgb([image.get_pixel(x, y).0[0]; 3])
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn square(left: u32, right: u32) -> GrayImage {
        GrayImage::from_fn(60, 60, |x, y| {
            Luma([if (left..right).contains(&x) && (10..50).contains(&y) { 255 } else { 0 }])
        })
    }

    #[test]
    fn the_place_that_differs_most_is_named() {
        let found = disagreement(&square(10, 50), &square(10, 40)).unwrap();
        assert_eq!((found.place, found.missing), ("upper right", false));
        let found = disagreement(&square(20, 50), &square(10, 50)).unwrap();
        assert!(found.missing && found.place.contains("left"), "{found:?}");
    }

    #[test]
    fn a_fit_draft_gives_no_word() {
        let fit = |silhouette_iou| ViewFit {
            azimuth_deg: 45.0,
            elevation_deg: 0.0,
            silhouette_iou,
            outline_distance_px: None,
            outline_distance_share: None,
            ink_explained: 1.0,
            disagreement: None,
        };
        assert_eq!(fit(0.95).warning(), None);
        assert!(fit(0.6).warning().unwrap().contains("view 45 disagrees"));
    }
}
