//! Faces laid out in islands on one square.

use mesh::Mesh;
use mesh::shading::ShadedMesh;
use nalgebra::{Point2, Point3};
use progress::{Cancelled, Observer};

use super::charts::{self, Projections, parts};
use crate::surface::projection::{Rig, neighbours};

/// Texels around each island that repeat its edge.
pub(super) const PADDING: u32 = 4;
/// The longest side of a texture, texels.
const MAX_SIDE: u32 = 2048;
const MIN_SIDE: u32 = 64;
/// How much smaller islands are tried when they do not fit.
const SHRINK: f64 = 0.85;

/// Faces that hang together and are laid out in one projection.
pub(super) struct Island {
    /// Ascending.
    pub triangles: Vec<u32>,
    /// Per triangle its corners, texels from the island's top left, padding included.
    pub corners: Vec<[Point2<f64>; 3]>,
    /// Texels, padding included.
    pub width: u32,
    pub height: u32,
    /// Its top left corner on the texture.
    pub place: [u32; 2],
}

/// Islands on a square texture.
pub(super) struct Atlas {
    pub islands: Vec<Island>,
    /// Texels.
    pub side: u32,
}

/// A mesh laid out.
#[derive(Default)]
pub(super) struct Unwrapped {
    /// Vertices are repeated where islands meet.
    pub mesh: ShadedMesh,
    /// One a position, shares of the side.
    pub coordinates: Vec<[f32; 2]>,
    /// Per triangle, which it was.
    pub faces: Vec<u32>,
}

impl Atlas {
    /// Lays out faces of one label together, as their view shows them, a texel a pixel, smaller
    /// if they do not fit; faces of no view as seen along the axis that they face most.
    ///
    /// * `mesh`: two triangles a quad, which stay together.
    /// * `labels`: per triangle a view's index, or the number of views.
    ///
    /// # Errors
    /// [`Cancelled`] if `observer` says so.
    pub(super) fn of(
        mesh: &Mesh,
        rig: &Rig,
        labels: &[usize],
        observer: &dyn Observer,
    ) -> Result<Self, Cancelled> {
        let projections = Projections(rig);
        let charts = charts::charts(mesh, &projections, labels, observer)?;
        let flat = |face: u32, point: &Point3<f64>| projections.flat(charts[face as usize], point);
        let parts: Vec<Flat> = parts(&neighbours(mesh), &charts)
            .into_iter()
            .map(|triangles| Flat::new(mesh, triangles, flat))
            .collect();
        let mut scale = 1.0;
        loop {
            let mut islands: Vec<Island> = parts.iter().map(|part| part.scaled(scale)).collect();
            if let Some(side) = packed(&mut islands) {
                return Ok(Self { islands, side });
            }
            scale *= SHRINK;
        }
    }

    /// Lays out the mesh.
    pub(super) fn unwrapped(&self, shaded: &ShadedMesh) -> Unwrapped {
        let Unwrapped { mut mesh, mut coordinates, mut faces } = Unwrapped::default();
        let side = f64::from(self.side);
        let mut new_index = vec![(usize::MAX, 0_u32); shaded.positions.len()];
        for (number, island) in self.islands.iter().enumerate() {
            for (&triangle, corners) in island.triangles.iter().zip(&island.corners) {
                let old = shaded.triangles[triangle as usize];
                let place = |corner: usize| {
                    let [x, y] = island.place.map(f64::from);
                    [(corners[corner].x + x) / side, (corners[corner].y + y) / side]
                };
                let new = [0, 1, 2].map(|corner| {
                    let entry = &mut new_index[old[corner] as usize];
                    if entry.0 != number {
                        *entry = (number, mesh.positions.len() as u32);
                        mesh.positions.push(shaded.positions[old[corner] as usize]);
                        mesh.normals.push(shaded.normals[old[corner] as usize]);
                        mesh.sources.push(shaded.sources[old[corner] as usize]);
                        coordinates.push(place(corner).map(|share| share as f32));
                    }
                    entry.1
                });
                mesh.triangles.push(new);
                faces.push(triangle);
            }
        }
        Unwrapped { mesh, coordinates, faces }
    }
}

/// An island before it has a size, px.
struct Flat {
    triangles: Vec<u32>,
    corners: Vec<[Point2<f64>; 3]>,
    low: Point2<f64>,
    high: Point2<f64>,
}

impl Flat {
    fn new(
        mesh: &Mesh,
        triangles: Vec<u32>,
        flat: impl Fn(u32, &Point3<f64>) -> Point2<f64>,
    ) -> Self {
        let corners = triangles
            .iter()
            .map(|&face| mesh.corners(face as usize).map(|point| flat(face, &point)));
        let corners: Vec<[Point2<f64>; 3]> = corners.collect();
        let first = corners[0][0];
        let (low, high) = corners
            .iter()
            .flatten()
            .fold((first, first), |(low, high), point| (low.inf(point), high.sup(point)));
        Self { triangles, corners, low, high }
    }

    fn scaled(&self, scale: f64) -> Island {
        let padding = f64::from(PADDING);
        let size = (self.high - self.low) * scale;
        let place = |p: &Point2<f64>| (p - self.low) * scale + nalgebra::Vector2::repeat(padding);
        // Casts saturate; a texel more, for what is as thin as a line.
        let side = |length: f64| length.ceil() as u32 + 1 + 2 * PADDING;
        Island {
            triangles: self.triangles.clone(),
            corners: self
                .corners
                .iter()
                .map(|corners| corners.each_ref().map(|p| Point2::from(place(p))))
                .collect(),
            width: side(size.x),
            height: side(size.y),
            place: [0; 2],
        }
    }
}

/// Places islands on the smallest square that holds them; `None` if the largest does not.
fn packed(islands: &mut [Island]) -> Option<u32> {
    let mut side = MIN_SIDE;
    while side <= MAX_SIDE {
        if fits(islands, side) {
            return Some(side);
        }
        side *= 2;
    }
    None
}

/// Rows of islands, the highest first.
fn fits(islands: &mut [Island], side: u32) -> bool {
    let mut order: Vec<usize> = (0..islands.len()).collect();
    order.sort_by_key(|&index| (std::cmp::Reverse(islands[index].height), index));
    let (mut x, mut y, mut row_height) = (0, 0, 0);
    for index in order {
        let island = &mut islands[index];
        if island.width > side {
            return false;
        }
        if x + island.width > side {
            (x, y, row_height) = (0, y + row_height, 0);
        }
        row_height = row_height.max(island.height);
        if y + row_height > side {
            return false;
        }
        island.place = [x, y];
        x += island.width;
    }
    true
}

#[cfg(test)]
mod tests {
    use super::*;

    fn island(width: u32, height: u32) -> Island {
        Island { triangles: vec![], corners: vec![], width, height, place: [0; 2] }
    }

    #[test]
    fn islands_do_not_overlap_and_stay_inside() {
        let mut islands: Vec<Island> =
            (0..60).map(|i| island(9 + 7 * i % 41, 9 + 13 * i % 57)).collect();
        let side = packed(&mut islands).unwrap();
        let end =
            |island: &Island| [island.place[0] + island.width, island.place[1] + island.height];
        for (index, a) in islands.iter().enumerate() {
            assert!(end(a)[0] <= side && end(a)[1] <= side);
            for b in &islands[..index] {
                let apart =
                    |axis: usize| end(a)[axis] <= b.place[axis] || end(b)[axis] <= a.place[axis];
                assert!(apart(0) || apart(1));
            }
        }
        let area: u32 = islands.iter().map(|island| island.width * island.height).sum();
        // Half the side would hardly hold them.
        assert!(side * side / 4 < area + area / 4, "{side} {area}");
        assert_eq!(packed(&mut [island(MAX_SIDE + 1, 9)]), None);
    }
}
