//! What is drawn on a page: strokes and areas of colour at working size, before
//! anything is taken for a subject.

use image::RgbaImage;

use crate::alpha::{Meaning, laid_on_paper};
use crate::clutter;
use crate::options::{CleanOptions, SubjectOptions};
use crate::paper::Paper;
use crate::raster::{Bits, Component, Raster, filled};
use crate::report::{PaperSummary, Removed};
use crate::straight::Line;
use crate::structure::{CLEAR_COLOUR, PAINTED, above, enclosed_lines, reduced_mask, stroke_of};
use crate::tone::Tone;

/// The side of a square of the same area as a page of three by two, share of
/// its longer side; a little more, against rounding.
const STRIP: f64 = 0.82;

/// Strokes and areas of colour on a page of any number of drawings. Rasters
/// are of working size.
pub struct Marks {
    /// A working pixel is so many page pixels wide.
    pub factor: usize,
    /// Strokes and what else is darker (on dark paper lighter) than the paper.
    pub lines: Bits,
    /// Areas whose colour is not the paper's, wider than strokes.
    pub areas: Bits,
    /// The width of most strokes, working px.
    pub stroke_px: f64,
    /// The paper.
    pub paper: PaperSummary,
    /// Its colour everywhere.
    pub field: Paper,
    /// Whether the page's paper is transparent.
    pub is_clear: bool,
    colour: Raster<f32>,
    tolerance: f32,
    is_cut_out: bool,
    /// Straight lines that were removed.
    removed: Vec<Line>,
}

impl Marks {
    /// Reads `page`, 8-bit sRGB with alpha, reduced to the area of a page of
    /// three by two whose longer side has `working_side_px`; `None` if it has no
    /// pixels.
    pub fn of(page: &RgbaImage, working_side_px: u32) -> Option<Self> {
        let (width, height) = page.dimensions();
        if width == 0 || height == 0 {
            return None;
        }
        // By area: a long strip of views is not reduced for its length.
        let size = (f64::from(width) * f64::from(height)).sqrt();
        let factor = size / (STRIP * f64::from(working_side_px.max(64)));
        let factor = factor.ceil().max(1.0) as usize;
        let opaque = laid_on_paper(page);
        let image = opaque.image.as_ref();
        let meaning = match opaque.meaning {
            Meaning::CutOut(mask) if is_panels(&reduced_mask(&mask, factor)) => Meaning::Nothing,
            other => other,
        };
        let field = Paper::under(page, image, &meaning);
        let tone = Tone::new(image, &field);
        let (ink, colour) = tone.reduced(factor);
        let (threshold, tolerance) = (tone.threshold, tone.tolerance.max(CLEAR_COLOUR));
        let mut own = Self {
            factor,
            lines: above(&ink, threshold),
            areas: Bits::filled(ink.width, ink.height, false),
            stroke_px: 1.0,
            paper: field.summary(),
            field,
            colour,
            tolerance,
            is_cut_out: false,
            removed: Vec::new(),
            is_clear: !matches!(meaning, Meaning::Nothing),
        };
        own.stroke_px = stroke_of(&own.lines);
        if let Meaning::CutOut(mask) = &meaning {
            own.areas = reduced_mask(mask, factor);
            own.is_cut_out = true;
        } else {
            own.find_areas();
        }
        Some(own)
    }

    /// Clears `gone` from lines and areas.
    pub fn clear(&mut self, gone: &Bits) {
        let lines = std::mem::replace(&mut self.lines, Bits::filled(0, 0, false));
        self.lines = lines.and_not(gone);
        self.colour.data.iter_mut().zip(&gone.dilated(2.0).data).for_each(|(level, gone)| {
            if *gone {
                *level = 0.0;
            }
        });
        if self.is_cut_out {
            let areas = std::mem::replace(&mut self.areas, Bits::filled(0, 0, false));
            self.areas = areas.and_not(gone);
        } else {
            self.find_areas();
        }
    }

    /// Removes guides, ground lines and dimension lines; boxes are in working px.
    pub fn remove_straight_lines(&mut self, options: &CleanOptions) -> Vec<Removed> {
        let drawn = self.lines.clone().or(&self.areas);
        let cleaned = clutter::without_page_lines(&self.lines, &drawn, self.stroke_px, options);
        if !cleaned.removed.is_empty() {
            let gone = self.lines.clone().and_not(&cleaned.ink);
            self.clear(&gone);
            // Strokes that cross a line stay.
            self.lines = cleaned.ink;
        }
        self.removed.extend(cleaned.lines);
        cleaned.removed
    }

    /// Where a figure's own edge lies on straight lines that were removed: soles on a ground line.
    ///
    /// * `own`: its strokes and areas, from column `left` and row `top` of the rasters.
    /// * `drawn`: all strokes of the page, before lines were removed.
    pub fn own_edges(&self, own: &Bits, drawn: &Bits, (left, top): (i64, i64)) -> Bits {
        clutter::own_edges(own, drawn, &self.removed, (left, top), self.stroke_px)
    }

    fn find_areas(&mut self) {
        let painted = above(&self.colour, self.tolerance);
        self.areas = painted.opened((1.5 * self.stroke_px + 1.0) as f32);
    }
}

/// Whether all that is opaque are rectangles: panels of paper, not subjects.
fn is_panels(mask: &Bits) -> bool {
    const LEAST: usize = 200;
    const FULL: f64 = 0.97;
    let parts = mask.components(true).parts;
    let large = parts.iter().filter(|part| part.area * LEAST >= mask.data.len());
    let is_full = |part: &Component| {
        let b = part.bounds;
        part.area as f64 >= FULL * f64::from(b.width()) * f64::from(b.height())
    };
    large.clone().count() > 0 && large.into_iter().all(is_full)
}

/// What `lines` and `areas` of one figure enclose, gaps in its outline closed
/// as [`find`](crate::find) closes them; holes stay filled.
pub fn enclosed(lines: &Bits, areas: &Bits, stroke_px: f64, options: &SubjectOptions) -> Bits {
    let barrier = lines.clone().or(areas);
    let inside = filled(&barrier);
    let coverage = areas.count() as f64 / inside.count().max(1) as f64;
    if coverage > PAINTED {
        return inside;
    }
    enclosed_lines(&barrier, lines, stroke_px, options)
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    #[test]
    fn strokes_and_areas_of_several_drawings_are_seen() {
        let page = RgbaImage::from_fn(300, 200, |x, y| {
            let outline = (20..100).contains(&x) && (40..160).contains(&y);
            let inner = (22..98).contains(&x) && (42..158).contains(&y);
            let painted = (160..240).contains(&x) && (40..160).contains(&y);
            match (outline && !inner, painted) {
                (true, _) => Rgba([0, 0, 0, 255]),
                (_, true) => Rgba([250, 180, 120, 255]),
                _ => Rgba([255; 4]),
            }
        });
        let marks = Marks::of(&page, 1200).unwrap();
        assert!(marks.lines.at(20, 100) && !marks.lines.at(60, 100));
        assert!(marks.areas.at(200, 100) && !marks.areas.at(60, 100));
        let inside = enclosed(&marks.lines, &marks.areas, 2.0, &SubjectOptions::default());
        assert!(inside.at(60, 100) && inside.at(200, 100) && !inside.at(130, 100));
        assert!(Marks::of(&RgbaImage::new(0, 3), 1200).is_none());
    }
}
