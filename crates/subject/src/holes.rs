//! Areas inside of the outline that show paper: holes, or light parts of the subject.

use crate::options::{Hints, HolePolicy, SubjectOptions};
use crate::raster::{Bits, Components, Raster, grown};
use crate::report::{Box2, DrawingKind, Point};
use crate::structure::{Structure, figure_size};

/// A hole whose edge is to this share a mere stroke between it and the outside
/// is a light area with an outline.
const OUTLINED: f64 = 0.15;
/// Smaller holes are the drawing's own noise, share of the figure's size.
const LEAST_HOLE: f64 = 0.012;

/// Takes away areas that show paper through the figure.
pub(crate) fn without(
    structure: &Structure,
    inside: Bits,
    barrier: &Bits,
    colour: &Raster<f32>,
    lines: &Bits,
    options: &SubjectOptions,
    hints: &Hints,
) -> Bits {
    let coloured = matches!(structure.kind, DrawingKind::Flat | DrawingKind::Shaded);
    let cut = match options.holes {
        HolePolicy::ByKind => coloured,
        HolePolicy::Cut => true,
        HolePolicy::Fill => false,
    };
    let bare = inside.clone().and_not(&grown(barrier));
    let size = figure_size(&inside.bounds().unwrap_or_default());
    let least = (LEAST_HOLE * size).max(2.0).powi(2);
    let regions = bare.components(false);
    let outside: Vec<f32> = colour
        .data
        .iter()
        .zip(inside.data.iter().zip(&lines.data))
        .filter(|(_, (inside, line))| !**inside && !**line)
        .map(|(c, _)| *c)
        .collect();
    let usual = outside.iter().sum::<f32>() / outside.len().max(1) as f32;
    let mut sums = vec![0.0_f64; regions.parts.len()];
    for (i, &label) in regions.labels.iter().enumerate().filter(|(_, label)| **label != 0) {
        sums[label as usize - 1] += f64::from(colour.data[i]);
    }
    let hit = |points: &[Point], k: usize| {
        points.iter().any(|p| {
            let (x, y) =
                ((p.x / structure.factor as f64) as i64, (p.y / structure.factor as f64) as i64);
            let inside =
                x >= 0 && y >= 0 && (x as usize) < bare.width && (y as usize) < bare.height;
            inside && regions.labels[y as usize * bare.width + x as usize] == k as u32 + 1
        })
    };
    let outlined = outlined(&inside, &regions, structure.stroke);
    let is_hole = |k: usize| {
        let part = &regions.parts[k];
        if hit(&hints.attach, k) {
            return false;
        }
        if hit(&hints.ignore, k) {
            return true;
        }
        let mean = sums[k] / part.area as f64;
        cut && part.area as f64 >= least
            && mean <= f64::from(usual) + 1.2
            && !holds_islands(&regions.labels, k as u32 + 1, &part.bounds, bare.width)
            && !outlined[k]
    };
    let holes = regions.select(bare.width, is_hole);
    if holes.count() == 0 {
        return inside;
    }
    // Back to the strokes around them.
    let near = grown(&grown(&holes)).and_not(barrier);
    inside.and_not(&holes.or(&near))
}

/// Per region whether a good part of its edge is a mere stroke, with paper beyond or another
/// such region: light areas with an outline, and what lines divide them into.
fn outlined(inside: &Bits, regions: &Components, stroke: f64) -> Vec<bool> {
    let near = (2.0 * stroke + 3.0) as f32;
    let mut light = vec![false; regions.parts.len()];
    let mut outside = inside.not();
    loop {
        let shares = edge_shares(regions, &outside, near);
        let more: Vec<bool> =
            shares.iter().zip(&light).map(|(share, light)| !light && *share >= OUTLINED).collect();
        if !more.contains(&true) {
            return light;
        }
        outside = outside.or(&regions.select(inside.width, |k| more[k]));
        light.iter_mut().zip(more).for_each(|(light, more)| *light |= more);
    }
}

/// Per region the share of its edge that is within `near` of `outside`; for regions in `outside`
/// it tells nothing.
fn edge_shares(regions: &Components, outside: &Bits, near: f32) -> Vec<f64> {
    let (width, near) = (outside.width, outside.dilated(near));
    let mut edges = vec![(0_u32, 0_u32); regions.parts.len()];
    for (i, &label) in regions.labels.iter().enumerate().filter(|(_, label)| **label != 0) {
        let beside = [i.wrapping_sub(1), i + 1, i.wrapping_sub(width), i + width];
        if beside.iter().any(|&j| regions.labels.get(j).copied().unwrap_or(0) != label) {
            let (all, thin) = &mut edges[label as usize - 1];
            *all += 1;
            *thin += u32::from(near.data[i]);
        }
    }
    edges.iter().map(|(all, thin)| f64::from(*thin) / f64::from((*all).max(1))).collect()
}

/// Whether a region encloses drawn parts that do not touch what is around it.
fn holds_islands(labels: &[u32], own: u32, bounds: &Box2, width: usize) -> bool {
    let (w, h) = (bounds.width() as usize + 2, bounds.height() as usize + 2);
    let mut open = Bits::filled(w, h, true);
    let mut area = 0;
    for y in 0..bounds.height() as usize {
        for x in 0..bounds.width() as usize {
            let at = (y + bounds.top as usize) * width + x + bounds.left as usize;
            if labels[at] == own {
                open.data[(y + 1) * w + x + 1] = false;
                area += 1;
            }
        }
    }
    let outside = open.reached_from_border();
    let islands = open.and_not(&outside).count();
    islands * 100 > area
}
