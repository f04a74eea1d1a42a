//! What a drawing's alpha channel means: nothing, the subject's mask, or a
//! layer that holds only the lines.

use std::borrow::Cow;

use image::{GrayImage, Rgba, RgbaImage};
use rayon::prelude::*;

use crate::raster::{Bits, filled};

/// So few transparent pixels are accidents.
const ACCIDENT_SHARE: f64 = 0.005;
/// Strokes are narrower than this share of the drawing's size.
const STROKE_SHARE: f32 = 0.022;
/// A layer with less of its area in wide parts holds only lines.
const LINES_ONLY: f64 = 0.3;
/// The same if all of it has one dark or light colour.
const LINES_OF_ONE_COLOUR: f64 = 0.6;
/// What fills so much of its bounds is a page with a transparent margin.
const PAGE_FILL: f64 = 0.985;
/// The same if so many times its area is within its lines.
const ENCLOSING: f64 = 1.7;
/// The side at which the layer's form is looked at, px.
const FORM_SIDE: u32 = 1400;

/// A drawing without transparency, and what its transparency was.
pub(crate) struct Opaque<'a> {
    pub(crate) image: Cow<'a, RgbaImage>,
    pub(crate) meaning: Meaning,
}

/// What alpha stands for.
#[derive(Debug)]
pub(crate) enum Meaning {
    Nothing,
    /// 255 where the subject is.
    CutOut(GrayImage),
    InkLayer,
}

/// Reads `drawing`'s alpha and lays what is transparent on paper.
pub(crate) fn laid_on_paper(drawing: &RgbaImage) -> Opaque<'_> {
    let clear: usize = drawing
        .as_raw()
        .par_chunks(1 << 16)
        .map(|part| part.chunks_exact(4).filter(|p| p[3] < 255).count())
        .sum();
    if clear == 0 {
        return Opaque { image: Cow::Borrowed(drawing), meaning: Meaning::Nothing };
    }
    let pixels = (drawing.width() as usize * drawing.height() as usize).max(1);
    let hidden: usize = drawing
        .as_raw()
        .par_chunks(1 << 16)
        .map(|part| part.chunks_exact(4).filter(|p| p[3] < 128).count())
        .sum();
    if (hidden as f64) < ACCIDENT_SHARE * pixels as f64 || hidden == pixels {
        let paper = border_colour(drawing);
        return Opaque { image: Cow::Owned(composite(drawing, paper)), meaning: Meaning::Nothing };
    }
    let form = Form::of(drawing);
    if form.is_page {
        let paper = form.edge_colour;
        return Opaque { image: Cow::Owned(composite(drawing, paper)), meaning: Meaning::Nothing };
    }
    let lines = form.wide_share < LINES_ONLY
        || (form.one_colour
            && (form.wide_share < LINES_OF_ONE_COLOUR || form.enclosing > ENCLOSING));
    let paper = if lines && form.luma > 160.0 { [0; 3] } else { [255; 3] };
    let image = Cow::Owned(composite(drawing, paper));
    if lines {
        return Opaque { image, meaning: Meaning::InkLayer };
    }
    let mask = drawing.as_raw().chunks_exact(4).map(|p| if p[3] >= 128 { 255 } else { 0 });
    let mask = GrayImage::from_raw(drawing.width(), drawing.height(), mask.collect());
    Opaque { image, meaning: Meaning::CutOut(mask.unwrap_or_default()) }
}

fn composite(drawing: &RgbaImage, paper: [u8; 3]) -> RgbaImage {
    let mut image = drawing.clone();
    image.par_chunks_mut(1 << 16).for_each(|part| {
        for p in part.chunks_exact_mut(4).filter(|p| p[3] < 255) {
            let alpha = u32::from(p[3]);
            for (level, paper) in p.iter_mut().zip(paper) {
                *level = ((u32::from(*level) * alpha + u32::from(paper) * (255 - alpha) + 127)
                    / 255) as u8;
            }
            p[3] = 255;
        }
    });
    image
}

/// The median colour of what is opaque along the border.
fn border_colour(drawing: &RgbaImage) -> [u8; 3] {
    let (w, h) = drawing.dimensions();
    let along =
        (0..w).flat_map(|x| [(x, 0), (x, h - 1)]).chain((0..h).flat_map(|y| [(0, y), (w - 1, y)]));
    let colours: Vec<&Rgba<u8>> =
        along.map(|(x, y)| drawing.get_pixel(x, y)).filter(|p| p.0[3] == 255).collect();
    median(&colours)
}

fn median(colours: &[&Rgba<u8>]) -> [u8; 3] {
    std::array::from_fn(|channel| {
        let mut levels: Vec<u8> = colours.iter().map(|p| p.0[channel]).collect();
        levels.sort_unstable();
        levels.get(levels.len() / 2).copied().unwrap_or(255)
    })
}

/// The form of what is opaque.
struct Form {
    /// The share of the area that is wider than a stroke.
    wide_share: f64,
    /// What it encloses, of its area.
    enclosing: f64,
    /// Whether all of it has about one colour.
    one_colour: bool,
    luma: f64,
    /// Whether it is a rectangle with an edge of one colour.
    is_page: bool,
    edge_colour: [u8; 3],
}

impl Form {
    fn of(drawing: &RgbaImage) -> Self {
        let (w, h) = drawing.dimensions();
        let step = w.max(h).div_ceil(FORM_SIDE).max(1);
        let (sw, sh) = (w.div_ceil(step) as usize, h.div_ceil(step) as usize);
        let mut bits = Bits::filled(sw, sh, false);
        let (mut sum, mut squares, mut count) = (0.0, 0.0, 0.0);
        for y in 0..sh as u32 {
            for x in 0..sw as u32 {
                let mut set = 0;
                for v in (y * step..((y + 1) * step).min(h)).step_by(step.div_ceil(4) as usize) {
                    for u in (x * step..((x + 1) * step).min(w)).step_by(step.div_ceil(4) as usize)
                    {
                        let p = drawing.get_pixel(u, v).0;
                        if p[3] >= 128 {
                            set += 1;
                            let luma = f64::from(luma(&p));
                            sum += luma;
                            squares += luma * luma;
                            count += 1.0;
                        }
                    }
                }
                bits.data[y as usize * sw + x as usize] = set > 0;
            }
        }
        let area = bits.count().max(1);
        let bounds = bits.bounds().unwrap_or_default();
        let size = bounds.height().max(bounds.width()) as f32;
        let radius = (size * STROKE_SHARE / 2.0).max(1.5);
        let wide = bits.opened(radius).count();
        let mean: f64 = sum / f64::max(count, 1.0);
        let deviation = (squares / f64::max(count, 1.0) - mean * mean).max(0.0).sqrt();
        let fill = area as f64 / (f64::from(bounds.width()) * f64::from(bounds.height())).max(1.0);
        let edge: Vec<&Rgba<u8>> = edge_pixels(drawing, &bounds, step);
        let edge_colour = median(&edge);
        let alike = edge
            .iter()
            .filter(|p| p.0.iter().zip(edge_colour).take(3).all(|(a, b)| a.abs_diff(b) < 16));
        let even = alike.count() as f64 > 0.9 * edge.len().max(1) as f64;
        let covers = bounds.width() as usize * 2 > sw && bounds.height() as usize * 2 > sh;
        let light = luma(&edge_colour) > 96.0;
        Self {
            wide_share: wide as f64 / area as f64,
            enclosing: filled(&bits).count() as f64 / area as f64,
            one_colour: deviation < 40.0,
            luma: mean,
            is_page: fill > PAGE_FILL && covers && even && light,
            edge_colour,
        }
    }
}

/// Pixels just inside the bounds (in steps) of what is opaque.
fn edge_pixels<'a>(
    drawing: &'a RgbaImage,
    bounds: &crate::report::Box2,
    step: u32,
) -> Vec<&'a Rgba<u8>> {
    let (w, h) = drawing.dimensions();
    let inset = step + bounds.width().max(bounds.height()) * step / 100;
    let (left, top) = (bounds.left * step + inset, bounds.top * step + inset);
    let right = (bounds.right * step).min(w).saturating_sub(inset + 1);
    let bottom = (bounds.bottom * step).min(h).saturating_sub(inset + 1);
    let across = (left..=right).flat_map(|x| [(x, top), (x, bottom)]);
    let down = (top..=bottom).flat_map(|y| [(left, y), (right, y)]);
    let inside = across.chain(down).filter(|&(x, y)| x < w && y < h);
    inside.map(|(x, y)| drawing.get_pixel(x, y)).filter(|p| p.0[3] >= 128).collect()
}

/// Rec. 601 luma of a colour.
pub(crate) fn luma(p: &[u8]) -> f32 {
    let luma = 299 * u32::from(p[0]) + 587 * u32::from(p[1]) + 114 * u32::from(p[2]);
    ((luma + 500) / 1000) as f32
}

#[cfg(test)]
mod tests {
    use super::*;

    fn disc(paint: impl Fn(f64) -> [u8; 4]) -> RgbaImage {
        RgbaImage::from_fn(120, 160, |x, y| {
            Rgba(paint((f64::from(x) - 60.0).hypot(f64::from(y) - 80.0)))
        })
    }

    #[test]
    fn a_ring_on_a_layer_is_ink_and_a_disc_is_cut_out() {
        let ring = disc(|r| if (r - 40.0).abs() < 1.2 { [0, 0, 0, 255] } else { [0; 4] });
        assert!(matches!(laid_on_paper(&ring).meaning, Meaning::InkLayer));
        assert_eq!(laid_on_paper(&ring).image.get_pixel(0, 0).0, [255; 4]);
        let full = disc(|r| if r < 40.0 { [200, 90, 10, 255] } else { [0; 4] });
        assert!(matches!(laid_on_paper(&full).meaning, Meaning::CutOut(_)));
    }

    #[test]
    fn a_few_clear_pixels_mean_nothing() {
        let mut image = disc(|r| if r < 40.0 { [0, 0, 0, 255] } else { [250, 250, 250, 255] });
        for x in 0..40 {
            image.put_pixel(x, 3, Rgba([0; 4]));
        }
        let read = laid_on_paper(&image);
        assert!(matches!(read.meaning, Meaning::Nothing));
        assert_eq!(read.image.get_pixel(3, 3).0, [250, 250, 250, 255]);
    }
}
