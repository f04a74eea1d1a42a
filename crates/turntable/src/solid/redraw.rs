//! A solid drawn again: how well it explains the lines of the drawings.

use super::solid_views::SolidSheet;
use crate::silhouette::Silhouettes;
use crate::surface::projection::{DepthBuffer, Rig};
use mesh::Mesh;

/// Solids are drawn this many times smaller than the drawings.
const SCALE: f64 = 2.0;
/// Ink closer than this to the outline may be the outline's own, pixels of the
/// smaller drawing.
const OUTLINE_PX: isize = 3;
/// Lines explain each other within this distance, pixels of the smaller drawing.
const REACH_PX: isize = 2;
/// A step in depth is more than this share of the subject's longest side.
const STEP: f32 = 0.02;
/// A crease bends the surface by more than this over two pixels, slope.
const BEND: f32 = 0.7;

/// How a solid's lines meet the drawings', over all views.
#[derive(Clone, Copy, Debug, Default, PartialEq, serde::Serialize)]
pub struct Explained {
    /// The share of inner ink that lies at a step or a crease of the solid.
    pub ink: f64,
    /// The share of the solid's steps in depth that have ink on them.
    pub steps: f64,
    /// Intersection over union of the outlines.
    pub silhouettes: f64,
    /// The share of the drawn insides that is ink.
    pub drawn: f64,
}

/// Bits of a drawing, row by row.
struct Bits {
    width: isize,
    height: isize,
    bits: Vec<bool>,
}

impl Bits {
    fn new(width: usize, height: usize, at: impl Fn(isize, isize) -> bool) -> Self {
        let (width, height) = (width as isize, height as isize);
        let places = (0..height).flat_map(|y| (0..width).map(move |x| (x, y)));
        Self { width, height, bits: places.map(|(x, y)| at(x, y)).collect() }
    }

    fn get(&self, x: isize, y: isize) -> bool {
        let inside = x >= 0 && y >= 0 && x < self.width && y < self.height;
        inside && self.bits[(y * self.width + x) as usize]
    }

    fn count(&self) -> usize {
        self.bits.iter().filter(|&&bit| bit).count()
    }

    /// Where all, or any, of the places within `reach` are set.
    fn around(&self, reach: isize, all: bool) -> Self {
        let range = || -reach..=reach;
        let joined = |mut places: &mut dyn Iterator<Item = bool>| {
            if all {
                Iterator::all(&mut places, |bit| bit)
            } else {
                Iterator::any(&mut places, |bit| bit)
            }
        };
        let (width, height) = (self.width as usize, self.height as usize);
        let wide =
            Self::new(width, height, |x, y| joined(&mut range().map(|dx| self.get(x + dx, y))));
        Self::new(width, height, |x, y| joined(&mut range().map(|dy| wide.get(x, y + dy))))
    }

    fn shared(&self, other: &Self) -> usize {
        self.bits.iter().zip(&other.bits).filter(|(a, b)| **a && **b).count()
    }
}

/// Draws `mesh` from every view and compares.
pub(super) fn explained(
    mesh: &Mesh,
    rig: &Rig,
    sheet: &SolidSheet,
    silhouettes: &Silhouettes,
) -> Explained {
    use rayon::prelude::*;
    let longest = mesh.bounds().map_or(1.0, |(low, high)| (high - low).max()) as f32;
    let counts: Vec<[usize; 7]> = (0..rig.viewpoints.len())
        .into_par_iter()
        .map(|view| {
            let buffer = DepthBuffer::of_view(mesh, rig, view, SCALE);
            let mask = silhouettes.silhouettes[view].mask();
            let side = |px: u32| (f64::from(px) / SCALE).ceil() as usize;
            let (width, height) = (side(rig.width), side(rig.height));
            let scale = SCALE as isize;
            let pixels = |x: isize, y: isize| {
                (0..scale * scale).map(move |n| (x * scale + n % scale, y * scale + n / scale))
            };
            let source = (sheet.width as isize, sheet.height as isize);
            let within = |x: isize, y: isize| x < source.0 && y < source.1;
            let ink = &sheet.ink[view];
            let inked = Bits::new(width, height, |x, y| {
                pixels(x, y).any(|(x, y)| within(x, y) && ink[(y * source.0 + x) as usize])
            });
            let shown = Bits::new(width, height, |x, y| {
                let (x, y) = (x * scale, y * scale);
                within(x, y) && mask.get_pixel(x as u32, y as u32).0[0] != 0
            });
            let inner = shown.around(OUTLINE_PX, true);
            let inner_ink = Bits::new(width, height, |x, y| inked.get(x, y) && inner.get(x, y));
            let depth = |x: isize, y: isize| {
                let inside = x >= 0 && y >= 0;
                inside.then(|| buffer.nearest(x as usize, y as usize)).flatten()
            };
            let covered =
                Bits::new(width, height, |x, y| (x as usize) < width && depth(x, y).is_some());
            let step = STEP * longest;
            let neighbours = |x: isize, y: isize| {
                [(1, 0), (0, 1)].map(|(dx, dy)| (depth(x - dx, y - dy), depth(x + dx, y + dy)))
            };
            let steps = Bits::new(width, height, |x, y| {
                inner.get(x, y)
                    && depth(x, y).is_some_and(|here| {
                        neighbours(x, y).into_iter().any(|(_, after)| {
                            after.is_some_and(|after| (after - here).abs() > step)
                        })
                    })
            });
            let bends = Bits::new(width, height, |x, y| {
                inner.get(x, y)
                    && depth(x, y).is_some_and(|here| {
                        neighbours(x, y).into_iter().any(|pair| match pair {
                            (Some(before), Some(after)) => {
                                (before + after - 2.0 * here).abs() > BEND * SCALE as f32
                            }
                            _ => false,
                        })
                    })
            });
            let lines = Bits::new(width, height, |x, y| steps.get(x, y) || bends.get(x, y));
            let both = covered.shared(&shown);
            [
                inner_ink.shared(&lines.around(REACH_PX, false)),
                inner_ink.count(),
                steps.shared(&inked.around(REACH_PX, false)),
                steps.count(),
                both,
                covered.count() + shown.count() - both,
                inner.count(),
            ]
        })
        .collect();
    let sum = |index: usize| counts.iter().map(|counts| counts[index]).sum::<usize>();
    let share = |part: usize, whole: usize| {
        if sum(whole) == 0 { 1.0 } else { sum(part) as f64 / sum(whole) as f64 }
    };
    Explained { ink: share(0, 1), steps: share(2, 3), silhouettes: share(4, 5), drawn: share(1, 6) }
}
