//! Lines inside of outlines as grooves: a normal map and the frame it is in.

use image::{GrayImage, Rgb, RgbImage, imageops};
use imageproc::filter::gaussian_blur_f32;
use imageproc::morphology::{Mask, grayscale_close};
use mesh::shading::ShadedMesh;
use nalgebra::Vector3;

/// Of the widest line that is a groove, texels either side.
const REACH: u8 = 3;
/// How dark a line is before it is one, share of the way from paper to ink: less is shading.
const FAINTEST: f32 = 0.1;
/// How softly grooves begin, texels.
const SOFTNESS: f32 = 0.8;
/// A groove's depth, texels, where paper meets ink.
const DEPTH: f32 = 2.0;

/// Normals of the texture's surface, its lines cut into it: as glTF has them, X to the right, Y
/// up and Z out of the picture, -1 to 1 as bytes.
///
/// A line is what is darker than all around within [`REACH`]: the black top-hat of the luminance.
pub(super) fn normal_map(texture: &RgbImage) -> RgbImage {
    let grey = imageops::grayscale(texture);
    let closed = grayscale_close(&grey, &Mask::disk(REACH));
    let lines = GrayImage::from_fn(grey.width(), grey.height(), |x, y| {
        let darker = f32::from(closed.get_pixel(x, y).0[0] - grey.get_pixel(x, y).0[0]) / 255.0;
        let ink = (darker - FAINTEST) / (1.0 - FAINTEST);
        image::Luma([(ink.max(0.0) * 255.0).round() as u8])
    });
    let lines = gaussian_blur_f32(&lines, SOFTNESS);
    let (right, bottom) = (lines.width() - 1, lines.height() - 1);
    let height = |x: u32, y: u32| {
        -DEPTH * f32::from(lines.get_pixel(x.min(right), y.min(bottom)).0[0]) / 255.0
    };
    RgbImage::from_fn(lines.width(), lines.height(), |x, y| {
        let across = (height(x + 1, y) - height(x.saturating_sub(1), y)) / 2.0;
        let down = (height(x, y + 1) - height(x, y.saturating_sub(1))) / 2.0;
        let normal = Vector3::new(-across, down, 1.0).normalize();
        Rgb(normal.map(|value| ((value * 0.5 + 0.5) * 255.0).round() as u8).into())
    })
}

/// Per position of `mesh`, the direction in which the texture goes right, a unit vector across
/// the normal, and whether up in the texture is left of it (1) or right (-1), seen from outside.
///
/// * `coordinates`: one a position, origin top left.
pub(super) fn tangents(mesh: &ShadedMesh, coordinates: &[[f32; 2]]) -> Vec<(Vector3<f64>, f32)> {
    let mut right = vec![Vector3::zeros(); mesh.positions.len()];
    let mut up = right.clone();
    for triangle in &mesh.triangles {
        let corners = triangle.map(|vertex| vertex as usize);
        let [a, b, c] = corners.map(|vertex| mesh.positions[vertex]);
        let [p, q, r] = corners.map(|vertex| coordinates[vertex].map(f64::from));
        let (u, v) = ([q[0] - p[0], r[0] - p[0]], [q[1] - p[1], r[1] - p[1]]);
        let area = u[0] * v[1] - u[1] * v[0];
        if area == 0.0 {
            continue;
        }
        // Along u, and against v, which grows downward; the larger the face, the more.
        let along_u = ((b - a) * v[1] - (c - a) * v[0]) * area.signum();
        let against_v = ((b - a) * u[1] - (c - a) * u[0]) * area.signum();
        for vertex in corners {
            right[vertex] += along_u;
            up[vertex] += against_v;
        }
    }
    mesh.normals
        .iter()
        .zip(right.iter().zip(&up))
        .map(|(normal, (right, up))| {
            let flat = |direction: &Vector3<f64>| direction - normal * normal.dot(direction);
            let tangent = flat(right).try_normalize(1e-12);
            let any = flat(&Vector3::ith(normal.iamin(), 1.0)).normalize();
            let tangent = tangent.unwrap_or(any);
            let sign = if normal.cross(&tangent).dot(up) < 0.0 { -1.0 } else { 1.0 };
            (tangent, sign)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use nalgebra::Point3;

    #[test]
    fn a_line_is_a_groove_and_shading_is_flat() {
        let texture = RgbImage::from_fn(64, 64, |x, y| {
            // A ramp of grey, a black line down, nothing else.
            Rgb([if x == 32 { 0 } else { 160 + y as u8 }; 3])
        });
        let normals = normal_map(&texture);
        assert_eq!(normals.get_pixel(10, 30).0, [128, 128, 255]);
        // Left of the line the ground falls to the right: the normal leans right.
        assert!(normals.get_pixel(31, 30).0[0] > 160);
        assert!(normals.get_pixel(33, 30).0[0] < 96);
        // Across: the ground above the line falls downward, the normal leans down.
        let turned = RgbImage::from_fn(64, 64, |x, y| *texture.get_pixel(y, x));
        let normals = normal_map(&turned);
        assert!(normals.get_pixel(30, 31).0[1] < 96);
        assert!(normals.get_pixel(30, 33).0[1] > 160);
    }

    #[test]
    fn broad_dark_areas_are_colour() {
        let texture = RgbImage::from_fn(64, 64, |x, _| Rgb([if x < 32 { 20 } else { 200 }; 3]));
        assert!(normal_map(&texture).pixels().all(|pixel| pixel.0 == [128, 128, 255]));
    }

    #[test]
    fn tangents_follow_the_texture() {
        let mesh = ShadedMesh {
            positions: [(0.0, 0.0), (1.0, 0.0), (0.0, 1.0)]
                .map(|(x, z)| Point3::new(x, 0.0, z))
                .into(),
            normals: vec![-Vector3::y(); 3],
            sources: vec![0, 1, 2],
            triangles: vec![[0, 1, 2]],
        };
        let upright = tangents(&mesh, &[[0.2, 0.8], [0.4, 0.8], [0.2, 0.6]]);
        assert!(upright.iter().all(|found| *found == (Vector3::x(), 1.0)), "{upright:?}");
        let mirrored = tangents(&mesh, &[[0.4, 0.8], [0.2, 0.8], [0.4, 0.6]]);
        assert!(mirrored.iter().all(|found| *found == (-Vector3::x(), -1.0)), "{mirrored:?}");
        let turned = tangents(&mesh, &[[0.2, 0.6], [0.2, 0.8], [0.4, 0.6]]);
        assert!(turned.iter().all(|found| *found == (Vector3::z(), 1.0)), "{turned:?}");
    }
}
