//! The visual hull of all directions: what every outline leaves, slice by slice.

use nalgebra::Point3;

use super::crease::Slice;
use super::guessed;
use super::outline::Outline;
use super::report::SolidError;
use super::section;
use super::solid_views::{self, SolidSheet};
use crate::options::SolidOptions;
use crate::silhouette::Silhouettes;
use crate::surface::field::{Lattice, Plane};
use crate::views::ViewSet;

/// The outlines that bound the depth as well: those of `directions`, and where they are of
/// one, what a view from the side is taken to show.
///
/// * `boxy`: the subject is made of flat walls.
pub(super) fn bounding(directions: &[Outline], boxy: bool) -> Vec<Outline> {
    match directions {
        [front] => vec![front.clone(), guessed::side(front, boxy)],
        several => several.to_vec(),
    }
}

/// Points around the visual hull of level views: the corners of its sections, turntable frame, px.
pub(crate) fn hull_points(views: &ViewSet, silhouettes: &Silhouettes) -> Vec<Point3<f64>> {
    let outlines = silhouettes.silhouettes.iter();
    let outlines = outlines.map(|found| Outline::from_silhouette(found, views.axis_px()));
    let directions = bounding(&solid_views::distinct(outlines), false);
    let half_px = half_extent_px(&directions);
    let mut points = Vec::new();
    for row in 0..views.height() as usize {
        let rows: Vec<_> = directions.iter().map(|outline| outline.row(row)).collect();
        let z = views.origin_row_px() - row as f64 - 0.5;
        for section in section::sections_of_row(&directions, &rows, half_px) {
            points.extend(section.corners.iter().map(|corner| Point3::new(corner.x, corner.y, z)));
        }
    }
    points
}

/// The lattice that holds all that is inside every silhouette.
pub(super) fn lattice_of(
    sheet: &SolidSheet,
    directions: &[Outline],
    options: &SolidOptions,
) -> Result<Lattice, SolidError> {
    let ranges: Option<Vec<_>> = directions.iter().map(Outline::row_range).collect();
    let (first, last) = ranges
        .ok_or(SolidError::NoCommonRow)?
        .into_iter()
        .fold((0, usize::MAX), |all, range| (all.0.max(range.0), all.1.min(range.1)));
    if first >= last {
        return Err(SolidError::NoCommonRow);
    }
    let half_px = half_extent_px(directions);
    let longest_px = (last - first).max((half_px * 2.0) as usize) as f64;
    let pitch_px = (longest_px / f64::from(options.resolution.clamp(16, 512))).max(1.0);
    let across = (half_px * 2.0 / pitch_px).ceil() as usize + 1;
    let up = ((last - first) as f64 / pitch_px).ceil() as usize;
    let low_z = sheet.origin_row_px - last as f64 + pitch_px / 2.0;
    let low = -(across as f64 - 1.0) / 2.0 * pitch_px;
    Ok(Lattice {
        origin: Point3::new(low, low, low_z),
        pitch_px,
        nodes: [across, across, up.max(1)],
    })
}

/// Nothing that a view shows is farther from the axis than this, px.
fn half_extent_px(directions: &[Outline]) -> f64 {
    let reach = |outline: &Outline| {
        outline.column_range().map_or(0.0, |(low, high)| high.abs().max(low.abs()))
    };
    directions.iter().map(reach).fold(1.0, f64::max)
}

pub(super) fn slices_of(
    sheet: &SolidSheet,
    directions: &[Outline],
    lattice: &Lattice,
) -> Vec<Slice> {
    use rayon::prelude::*;
    let half_px = half_extent_px(directions);
    (0..lattice.nodes[2])
        .into_par_iter()
        .map(|k| {
            let row = (sheet.origin_row_px - lattice.z(k)).floor().max(0.0) as usize;
            let rows: Vec<_> = directions.iter().map(|outline| outline.row(row)).collect();
            let sections = section::sections_of_row(directions, &rows, half_px);
            Slice { row, sections }
        })
        .collect()
}

/// The sections of each slice as signed distances.
pub(super) fn planes(lattice: &Lattice, slices: &[Slice]) -> Vec<Plane> {
    use rayon::prelude::*;
    let of_slice = |slice: &Slice| {
        let sections = slice.sections.iter();
        let polygons: Vec<_> = sections.map(|section| section.corners.clone()).collect();
        Plane::of_polygons(lattice, &polygons)
    };
    slices.par_iter().map(of_slice).collect()
}
