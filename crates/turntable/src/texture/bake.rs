//! The texels of islands.

use image::{Rgb, RgbImage};
use mesh::Mesh;
use mesh::colour::srgb_byte_from_linear;
use mesh::shading::ShadedMesh;
use nalgebra::{Point2, Point3, Vector3};
use progress::{Cancelled, Observer};
use rayon::prelude::*;

use super::atlas::{Atlas, Island, PADDING};
use super::blend::{ColourOf, LinearColour};

/// Colours every texel whose centre lies on a face, then the padding around.
///
/// * `vertices`: colours of the mesh's vertices, for points that `colour` does not know.
///
/// # Errors
/// [`Cancelled`] if `observer` says so.
pub(super) fn texture(
    mesh: &Mesh,
    shaded: &ShadedMesh,
    atlas: &Atlas,
    vertices: &[LinearColour],
    colour: &ColourOf<'_>,
    observer: &dyn Observer,
) -> Result<RgbImage, Cancelled> {
    let baker = Baker { mesh, shaded, vertices, colour };
    let tile = |island| observer.check().map(|()| baker.tile(island));
    let tiles: Vec<Vec<Option<LinearColour>>> =
        atlas.islands.par_iter().map(tile).collect::<Result<_, _>>()?;
    let mut texture = RgbImage::new(atlas.side, atlas.side);
    for (island, tile) in atlas.islands.iter().zip(tiles) {
        let [left, top] = island.place;
        for (index, colour) in (0..).zip(tile) {
            let (x, y) = (left + index % island.width, top + index / island.width);
            let colour: [f32; 3] = colour.unwrap_or_default().into();
            texture.put_pixel(x, y, Rgb(colour.map(srgb_byte_from_linear)));
        }
    }
    Ok(texture)
}

struct Baker<'a> {
    mesh: &'a Mesh,
    shaded: &'a ShadedMesh,
    vertices: &'a [LinearColour],
    colour: &'a ColourOf<'a>,
}

impl Baker<'_> {
    /// The island's texels, row by row.
    fn tile(&self, island: &Island) -> Vec<Option<LinearColour>> {
        let (width, height) = (island.width as usize, island.height as usize);
        let mut tile = vec![None; width * height];
        for (&face, corners) in island.triangles.iter().zip(&island.corners) {
            for_texels(corners, (width, height), |index, weights| {
                tile[index] = Some(self.colour_at(face as usize, weights));
            });
        }
        // Faces between the texels' centres: their corners, where nothing is yet.
        for (&face, corners) in island.triangles.iter().zip(&island.corners) {
            for (corner, place) in corners.iter().enumerate() {
                let index = place.y as usize * width + place.x as usize;
                let mut weights = [0.0; 3];
                weights[corner] = 1.0;
                if tile[index].is_none() {
                    tile[index] = Some(self.colour_at(face as usize, weights));
                }
            }
        }
        (0..PADDING).for_each(|_| pad(&mut tile, width));
        tile
    }

    fn colour_at(&self, face: usize, weights: [f64; 3]) -> LinearColour {
        let corners = self.mesh.corners(face).map(|point| point.coords);
        let normals = self.shaded.triangles[face].map(|v| self.shaded.normals[v as usize]);
        let mixed = |values: [Vector3<f64>; 3]| {
            values[0] * weights[0] + values[1] * weights[1] + values[2] * weights[2]
        };
        let normal = mixed(normals).try_normalize(1e-9).unwrap_or_default();
        (self.colour)(&Point3::from(mixed(corners)), &normal).unwrap_or_else(|| {
            let colours = self.mesh.triangles[face].map(|v| self.vertices[v as usize]);
            let terms = colours.iter().zip(weights).map(|(colour, w)| colour * w as f32);
            terms.sum()
        })
    }
}

/// Calls `visit` with each texel whose centre is in the triangle, and its barycentric weights.
pub(super) fn for_texels(
    corners: &[Point2<f64>; 3],
    (width, height): (usize, usize),
    mut visit: impl FnMut(usize, [f64; 3]),
) {
    let [a, b, c] = corners;
    let area = (b - a).perp(&(c - a));
    if area == 0.0 {
        return;
    }
    let (low, high) = (a.inf(b).inf(c), a.sup(b).sup(c));
    // Casts saturate at 0.
    let range = |low: f64, high: f64, size: usize| {
        (low - 0.5).ceil() as usize..((high + 0.5).floor() as usize).min(size)
    };
    for y in range(low.y, high.y, height) {
        for x in range(low.x, high.x, width) {
            let p = Point2::new(x as f64 + 0.5, y as f64 + 0.5);
            let v = (p - a).perp(&(c - a)) / area;
            let w = (b - a).perp(&(p - a)) / area;
            let weights = [1.0 - v - w, v, w];
            if weights.iter().all(|weight| *weight >= -1e-9) {
                visit(y * width + x, weights);
            }
        }
    }
}

/// Gives texels beside known ones the mean of those.
fn pad(tile: &mut [Option<LinearColour>], width: usize) {
    let known = tile.to_vec();
    let height = tile.len() / width;
    for (index, texel) in tile.iter_mut().enumerate().filter(|(_, texel)| texel.is_none()) {
        let (x, y) = (index % width, index / width);
        let columns = x.saturating_sub(1)..(x + 2).min(width);
        let around = columns
            .flat_map(|x| (y.saturating_sub(1)..(y + 2).min(height)).map(move |y| y * width + x));
        let colours = around.filter_map(|other| known[other]);
        let (sum, count) =
            colours.fold((LinearColour::zeros(), 0.0), |(sum, n), colour| (sum + colour, n + 1.0));
        *texel = (count > 0.0).then(|| sum / count);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn texels_in_a_triangle_are_visited_with_their_weights() {
        let corners = [(1.0, 1.0), (5.0, 1.0), (1.0, 5.0)].map(|(x, y)| Point2::new(x, y));
        let mut seen = Vec::new();
        for_texels(&corners, (8, 8), |index, weights| seen.push((index, weights)));
        let indices: Vec<usize> = seen.iter().map(|(index, _)| *index).collect();
        assert_eq!(indices, [9, 10, 11, 12, 17, 18, 19, 25, 26, 33]);
        let (_, weights) = seen[0];
        assert!((weights[0] - 0.75).abs() < 1e-9 && (weights[1] - 0.125).abs() < 1e-9);
        let turned = [corners[0], corners[2], corners[1]];
        let mut count = 0;
        for_texels(&turned, (8, 8), |_, _| count += 1);
        assert_eq!(count, 10);
    }

    #[test]
    fn padding_repeats_the_edge() {
        let mut tile = vec![None; 25];
        tile[12] = Some(LinearColour::x());
        pad(&mut tile, 5);
        assert_eq!(tile.iter().flatten().count(), 9);
        pad(&mut tile, 5);
        assert!(tile.iter().all(|texel| *texel == Some(LinearColour::x())));
    }
}
