//! A drawing's colours without the ink of its outline.

use std::collections::VecDeque;

use image::{GrayImage, Luma, RgbImage};
use imageproc::distance_transform::Norm::LInf;
use imageproc::distance_transform::distance_transform;
use sheet::View;

use super::blend::LinearColour;
use crate::raster::stroke_scale;
use crate::silhouette::Silhouette;
use mesh::colour::linear_from_srgb_byte;

/// How far beyond its edge a drawing's colours are spread, share of the image's height: the
/// draft's outline is not exactly the drawing's.
const SPREAD: f64 = 0.02;
/// Half a stroke of anti-aliasing beside the ink, px in small drawings.
const SOFT_PX: f64 = 1.25;

/// The subject as it is painted.
pub(super) struct Paint {
    colours: RgbImage,
    /// 255 where `colours` tells of the subject.
    known: GrayImage,
    /// From the subject's edge to where its own colours begin, px.
    pub edge_px: f64,
}

impl Paint {
    /// Takes the colours inside of the outline's ink, and spreads them over the ink and beyond.
    pub(super) fn of_view(view: &View, silhouette: &Silhouette) -> Self {
        let mask = silhouette.mask();
        let (width, height) = mask.dimensions();
        let soft = SOFT_PX * stroke_scale(height as usize);
        let edge_px = (2.0 * silhouette.half_line_px().max(0.5 * soft) + soft).min(100.0);
        let mut colours = match &view.color {
            Some(colour) => colour.clone(),
            None => image::DynamicImage::from(view.image.clone()).into_rgb8(),
        };
        let paper =
            GrayImage::from_fn(width, height, |x, y| Luma([255 - mask.get_pixel(x, y).0[0]]));
        let depth = distance_transform(&paper, LInf);
        clear_edge(&mut colours, &depth, edge_px.ceil() as u8);
        let mut known = mask.clone();
        spread(&mut colours, &mut known, (SPREAD * f64::from(height)).ceil() as u32 + 2);
        Self { colours, known, edge_px }
    }

    /// The colour at a place of the drawing, blended between pixels; `None` off the subject.
    pub(super) fn at(&self, x: f64, y: f64) -> Option<LinearColour> {
        let (x, y) = (x - 0.5, y - 0.5);
        let (left, top) = (x.floor(), y.floor());
        let (right_share, low_share) = (x - left, y - top);
        let mut sum = LinearColour::zeros();
        let mut total = 0.0;
        for (dx, dy, share) in [
            (0.0, 0.0, (1.0 - right_share) * (1.0 - low_share)),
            (1.0, 0.0, right_share * (1.0 - low_share)),
            (0.0, 1.0, (1.0 - right_share) * low_share),
            (1.0, 1.0, right_share * low_share),
        ] {
            let (x, y) = (left + dx, top + dy);
            let size = [self.known.width(), self.known.height()].map(f64::from);
            if x < 0.0 || y < 0.0 || x >= size[0] || y >= size[1] {
                continue;
            }
            let (x, y) = (x as u32, y as u32);
            if self.known.get_pixel(x, y).0[0] != 0 {
                sum += linear(self.colours.get_pixel(x, y).0) * share as f32;
                total += share;
            }
        }
        (total > 0.0).then(|| sum / total as f32)
    }
}

fn linear(srgb: [u8; 3]) -> LinearColour {
    LinearColour::from(srgb.map(linear_from_srgb_byte))
}

const AROUND: [(i64, i64); 8] =
    [(0, -1), (-1, 0), (1, 0), (0, 1), (-1, -1), (1, -1), (-1, 1), (1, 1)];

fn neighbours(x: u32, y: u32, size: (u32, u32)) -> impl Iterator<Item = (u32, u32)> {
    AROUND.into_iter().filter_map(move |(dx, dy)| {
        let x = u32::try_from(i64::from(x) + dx).ok().filter(|x| *x < size.0)?;
        let y = u32::try_from(i64::from(y) + dy).ok().filter(|y| *y < size.1)?;
        Some((x, y))
    })
}

/// Gives pixels at the edge the colour of what lies farther inside: walking inward until the
/// ink is behind, or the middle of a thin part is reached.
///
/// * `depth`: distance from the paper, px; 0 is paper.
fn clear_edge(colours: &mut RgbImage, depth: &GrayImage, edge: u8) {
    let drawn = colours.clone();
    for (x, y, pixel) in colours.enumerate_pixels_mut() {
        let mut here = (x, y, depth.get_pixel(x, y).0[0]);
        if !(1..=edge).contains(&here.2) {
            continue;
        }
        while here.2 <= edge {
            let deeper = neighbours(here.0, here.1, depth.dimensions())
                .map(|(x, y)| (x, y, depth.get_pixel(x, y).0[0]))
                .fold(here, |most, other| if other.2 > most.2 { other } else { most });
            if deeper.2 == here.2 {
                break;
            }
            here = deeper;
        }
        *pixel = *drawn.get_pixel(here.0, here.1);
    }
}

/// Spreads known colours over `reach_px` pixels around, each from its nearest.
fn spread(colours: &mut RgbImage, known: &mut GrayImage, reach_px: u32) {
    let size = known.dimensions();
    let on_edge = |known: &GrayImage, x: u32, y: u32| {
        neighbours(x, y, size).any(|(x, y)| known.get_pixel(x, y).0[0] == 0)
    };
    let pixels = known.enumerate_pixels().filter(|(.., level)| level.0[0] != 0);
    let edge = pixels.filter(|&(x, y, _)| on_edge(known, x, y));
    let mut queue: VecDeque<(u32, u32, u32)> = edge.map(|(x, y, _)| (x, y, 0)).collect();
    while let Some((x, y, steps)) = queue.pop_front() {
        if steps == reach_px {
            continue;
        }
        let colour = *colours.get_pixel(x, y);
        for (x, y) in neighbours(x, y, size) {
            if known.get_pixel(x, y).0[0] == 0 {
                known.put_pixel(x, y, Luma([255]));
                colours.put_pixel(x, y, colour);
                queue.push_back((x, y, steps + 1));
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use image::Rgb;

    use super::*;

    #[test]
    fn the_outline_gives_way_to_what_it_encloses() {
        // A red block of 20 px with a black edge of 2, and a bar of 3 px that is all edge and middle.
        let depth = |x: u32, y: u32| {
            let block = x.min(19 - x.min(19)).min(y.min(19 - y.min(19))) + 1;
            if x < 20 && y < 20 { block.min(10) as u8 } else { 0 }
        };
        let depth = GrayImage::from_fn(30, 30, |x, y| Luma([depth(x, y)]));
        let mut colours = RgbImage::from_fn(30, 30, |x, y| {
            let d = depth.get_pixel(x, y).0[0];
            Rgb(if d == 0 {
                [255; 3]
            } else if d <= 2 {
                [0; 3]
            } else {
                [200, 0, 0]
            })
        });
        clear_edge(&mut colours, &depth, 3);
        for (x, y, pixel) in colours.enumerate_pixels() {
            let expected = if x < 20 && y < 20 { [200, 0, 0] } else { [255; 3] };
            assert_eq!(pixel.0, expected, "{x} {y}");
        }
    }

    #[test]
    fn thin_parts_take_the_colour_of_their_middle() {
        let depth = GrayImage::from_fn(9, 3, |_, y| Luma([if y == 1 { 2 } else { 1 }]));
        let mut colours =
            RgbImage::from_fn(9, 3, |_, y| Rgb(if y == 1 { [0, 0, 90] } else { [0; 3] }));
        clear_edge(&mut colours, &depth, 3);
        assert!(colours.pixels().all(|pixel| pixel.0 == [0, 0, 90]));
    }

    #[test]
    fn colours_reach_beyond_the_edge_and_no_farther() {
        let mut known = GrayImage::new(20, 1);
        known.put_pixel(4, 0, Luma([255]));
        let mut colours = RgbImage::from_pixel(20, 1, Rgb([255; 3]));
        colours.put_pixel(4, 0, Rgb([9, 8, 7]));
        spread(&mut colours, &mut known, 3);
        let reached: Vec<u32> = (0..20).filter(|&x| known.get_pixel(x, 0).0[0] != 0).collect();
        assert_eq!(reached, [1, 2, 3, 4, 5, 6, 7]);
        assert_eq!(colours.get_pixel(7, 0).0, [9, 8, 7]);
        let paint = Paint { colours, known, edge_px: 1.0 };
        let colour = paint.at(7.9, 0.5).unwrap();
        assert!((colour - linear([9, 8, 7])).amax() < 1e-6, "unknown pixels weigh nothing");
        assert_eq!(paint.at(12.0, 0.5), None);
        assert_eq!(paint.at(-3.0, 0.5), None);
    }
}
