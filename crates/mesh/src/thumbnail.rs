//! A shaded picture of a mesh: front, quarter and side beside each other.

use image::{GrayImage, Luma};
use nalgebra::{Point3, Vector3};

use crate::Mesh;
use crate::raster::SampleBuffer;
use picture::{EncodeError, png};

/// Side of one of the three tiles, px.
const TILE: u32 = 256;
/// Samples a pixel and axis.
const SAMPLES: u32 = 2;
/// Share of a tile that the mesh fills.
const FILL: f64 = 0.9;
const PAPER: u8 = 255;
/// From where the mesh is seen, degrees.
const AZIMUTHS_DEG: [f64; 3] = [0.0, 45.0, 90.0];

/// A picture of the mesh from the front, the quarter and the side, shaded, all
/// at one scale.
///
/// * `mesh`: turntable frame, any unit.
pub fn thumbnail(mesh: &Mesh) -> Result<Vec<u8>, EncodeError> {
    let mut picture = GrayImage::from_pixel(TILE * 3, TILE, Luma([PAPER]));
    for (index, azimuth_deg) in AZIMUTHS_DEG.into_iter().enumerate() {
        let tile = shrink(&render(mesh, azimuth_deg.to_radians()));
        image::imageops::replace(&mut picture, &tile, i64::from(TILE) * index as i64, 0);
    }
    png(&picture)
}

/// Draws the mesh by z-buffer, flat shaded, seen from `azimuth_rad`.
fn render(mesh: &Mesh, azimuth_rad: f64) -> GrayImage {
    let side = TILE * SAMPLES;
    let mut picture = GrayImage::from_pixel(side, side, Luma([PAPER]));
    let Some((low, high)) = mesh.bounds() else { return picture };
    let centre = nalgebra::center(&low, &high);
    let radius = (high - low).xy().norm().max(high.z - low.z) / 2.0;
    let scale = f64::from(side) / 2.0 * FILL / radius.max(f64::MIN_POSITIVE);
    let (sin, cos) = azimuth_rad.sin_cos();
    let seen = |p: Point3<f64>| {
        let p = (p - centre) * scale;
        let half = f64::from(side) / 2.0;
        Point3::new(p.x * cos + p.y * sin + half, half - p.z, p.y * cos - p.x * sin)
    };
    let corners = |index: usize| mesh.corners(index).map(seen);
    let mut buffer = SampleBuffer::new(side as usize, side as usize);
    // A mesh that hides itself too often is shown as far as it was drawn.
    let _ = buffer.draw((0..mesh.triangles.len()).map(corners));
    for (pixel, sample) in picture.pixels_mut().zip(&buffer.samples) {
        if sample.z.is_finite() {
            let [a, b, c] = corners(sample.face as usize);
            pixel.0 = [shade((b - a).cross(&(c - a)))];
        }
    }
    picture
}

/// Grey of a face, lit from the viewer's upper left; both sides alike.
fn shade(normal: Vector3<f64>) -> u8 {
    let light = Vector3::new(-0.4, -0.6, -0.7).normalize();
    let facing = if normal.z > 0.0 { -normal } else { normal };
    let lit = facing.try_normalize(0.0).map_or(0.0, |n| n.dot(&light).max(0.0));
    (60.0 + 160.0 * lit).round() as u8
}

/// Averages blocks of samples.
fn shrink(picture: &GrayImage) -> GrayImage {
    GrayImage::from_fn(TILE, TILE, |x, y| {
        let samples = (0..SAMPLES * SAMPLES).map(|i| {
            let (dx, dy) = (i % SAMPLES, i / SAMPLES);
            u32::from(picture.get_pixel(x * SAMPLES + dx, y * SAMPLES + dy).0[0])
        });
        Luma([(samples.sum::<u32>() / (SAMPLES * SAMPLES)) as u8])
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn block(half: [f64; 3]) -> Mesh {
        let corners: Vec<_> = (0..8_u32)
            .map(|i| {
                let at = |axis: usize| if i >> axis & 1 == 1 { half[axis] } else { -half[axis] };
                Point3::new(at(0), at(1), at(2))
            })
            .collect();
        let sides =
            [[0, 1, 5, 4], [1, 3, 7, 5], [3, 2, 6, 7], [2, 0, 4, 6], [4, 5, 7, 6], [0, 2, 3, 1]];
        let triangles = sides.iter().flat_map(|&[a, b, c, d]| [[a, b, c], [a, c, d]]).collect();
        Mesh { positions: corners, triangles }
    }

    fn covered(picture: &GrayImage) -> f64 {
        picture.iter().filter(|&&v| v < PAPER).count() as f64 / picture.len() as f64
    }

    #[test]
    fn a_block_fills_its_outline() {
        // Wide, shallow and tall: the front shows width and height.
        let mesh = block([30.0, 10.0, 50.0]);
        let half = 50.0 / (FILL / 2.0);
        let front = covered(&render(&mesh, 0.0));
        let side = covered(&render(&mesh, 90.0_f64.to_radians()));
        let expected = |width: f64| width * 100.0 / (half * half);
        assert!((front - expected(60.0)).abs() < 0.01, "{front}");
        assert!((side - expected(20.0)).abs() < 0.01, "{side}");
    }

    #[test]
    fn the_nearer_face_hides_the_farther() {
        let near =
            [Point3::new(0.0, 0.0, 1.0), Point3::new(8.0, 0.0, 1.0), Point3::new(0.0, 8.0, 1.0)];
        let far =
            [Point3::new(0.0, 0.0, 2.0), Point3::new(8.0, 0.0, 9.0), Point3::new(0.0, 8.0, 2.0)];
        for (order, nearer) in [([near, far], 0), ([far, near], 1)] {
            let mut buffer = SampleBuffer::new(8, 8);
            buffer.draw(order.into_iter()).unwrap();
            assert_eq!(buffer.samples[8 + 1].face, nearer);
        }
    }

    #[test]
    fn an_empty_mesh_is_blank_paper() {
        let bytes = thumbnail(&Mesh::default()).unwrap();
        let picture = image::load_from_memory(&bytes).unwrap().to_luma8();
        assert_eq!(picture.dimensions(), (768, 256));
        assert!(picture.iter().all(|&v| v == PAPER));
    }
}
