//! The model's own colours, and how a drawing is put together from paper, paint and ink.

use image::{DynamicImage, GrayImage, Luma, LumaA, Rgb, RgbImage, Rgba, RgbaImage};
use nalgebra::Vector3;

use super::background::Background;
use super::options::Ink;
use mesh::colour::srgb_byte_from_linear;
use mesh::read::LinearRgb;

/// The subject in colour.
pub(super) struct Paint {
    /// sRGB.
    pub colours: RgbImage,
    /// How much of each pixel the subject covers, 0..255.
    pub cover: GrayImage,
}

/// Light of a surface that looks away from the lamp, over that of one that faces it.
const AMBIENT: f64 = 0.35;

/// What a painter would put where the surface has this colour and looks this way.
///
/// * `normal`: unit, x right, y up, z towards the viewer.
pub(super) fn painted(colour: LinearRgb, normal: Vector3<f64>, ink: Ink) -> [u8; 3] {
    let light = match ink {
        Ink::Lines | Ink::Flat => 1.0,
        Ink::Shaded => {
            let lamp = Vector3::new(-0.4, 0.6, 0.7).normalize();
            AMBIENT + (1.0 - AMBIENT) * normal.dot(&lamp).max(0.0)
        }
    };
    colour.map(|channel| srgb_byte_from_linear(channel * light as f32))
}

/// The colour of a material whose model gives none: tints apart enough to be told from each other.
pub(super) fn material_colour(material: u32) -> LinearRgb {
    const TINTS: [LinearRgb; 6] = [
        [0.60, 0.45, 0.30],
        [0.35, 0.08, 0.07],
        [0.08, 0.20, 0.42],
        [0.10, 0.30, 0.10],
        [0.60, 0.42, 0.06],
        [0.28, 0.12, 0.36],
    ];
    TINTS[material as usize % TINTS.len()]
}

/// A drawing of ink over paint over paper, of as few channels as it needs.
///
/// * `ink`: how much of each pixel lines cover.
/// * `paint`: of the same size; `None` for lines alone.
pub(super) fn composed(
    ink: &GrayImage,
    paint: Option<&Paint>,
    background: Background,
) -> DynamicImage {
    let pen = if paint.is_some() { 0 } else { background.contrasting() };
    let (width, height) = ink.dimensions();
    let grey = |level: [u8; 3]| level[0] == level[1] && level[1] == level[2];
    match (paint, background.paper()) {
        (None, None) => image::ImageBuffer::from_fn(width, height, |x, y| {
            LumaA([pen, ink.get_pixel(x, y).0[0]])
        })
        .into(),
        (None, Some(paper)) if grey(paper) => GrayImage::from_fn(width, height, |x, y| {
            Luma([mixed(paper[0], pen, ink.get_pixel(x, y).0[0])])
        })
        .into(),
        (paint, Some(paper)) => RgbImage::from_fn(width, height, |x, y| {
            let under = paint.map_or(paper, |paint| paint.over(paper, x, y));
            Rgb(under.map(|level| mixed(level, pen, ink.get_pixel(x, y).0[0])))
        })
        .into(),
        (Some(paint), None) => RgbaImage::from_fn(width, height, |x, y| {
            let (Rgb(colour), Luma([cover])) =
                (*paint.colours.get_pixel(x, y), *paint.cover.get_pixel(x, y));
            let ink = ink.get_pixel(x, y).0[0];
            let alpha = mixed(cover, 255, ink);
            // Of what is there, so much is ink.
            let share = (u32::from(ink) * 255).checked_div(u32::from(alpha)).unwrap_or(0).min(255);
            let [r, g, b] = colour.map(|level| mixed(level, pen, share as u8));
            Rgba([r, g, b, alpha])
        })
        .into(),
    }
}

impl Paint {
    fn over(&self, paper: [u8; 3], x: u32, y: u32) -> [u8; 3] {
        let (colour, cover) = (self.colours.get_pixel(x, y).0, self.cover.get_pixel(x, y).0[0]);
        std::array::from_fn(|channel| mixed(paper[channel], colour[channel], cover))
    }
}

/// A drawing seen through pencil and grain.
///
/// * `layer`: 255 leaves the drawing as it is, 0 makes it black.
pub(super) fn multiplied(drawing: DynamicImage, layer: &GrayImage) -> DynamicImage {
    let product = |level: u8, by: u8| mixed(0, level, by);
    match drawing {
        DynamicImage::ImageLuma8(mut grey) => {
            let levels = grey.iter_mut().zip(layer.iter());
            levels.for_each(|(level, by)| *level = product(*level, *by));
            grey.into()
        }
        other => {
            let mut colours = other.into_rgb8();
            for (pixel, Luma([by])) in colours.pixels_mut().zip(layer.pixels()) {
                pixel.0 = pixel.0.map(|level| product(level, *by));
            }
            colours.into()
        }
    }
}

/// From `under` at 0 to `over` at 255.
pub(super) fn mixed(under: u8, over: u8, share: u8) -> u8 {
    let (under, over, share) = (u32::from(under), u32::from(over), u32::from(share));
    ((under * (255 - share) + over * share + 127) / 255) as u8
}
