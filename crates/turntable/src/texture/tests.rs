//! Textures of shapes whose colours are known.

use frames::Azimuth;
use image::{GrayImage, Luma, Rgb};
use mesh::colour::srgb_byte_from_linear;
use nalgebra::{Point3, Vector3};
use progress::Silent;
use sheet::{Sheet, View};

use super::*;
use crate::options::{SolidOptions, TurntableOptions};

/// The texel at a triangle's middle.
fn middle(found: &Textured, triangle: usize) -> [u8; 3] {
    let side = found.texture.width() as f32;
    let corners = found.mesh.triangles[triangle].map(|v| found.coordinates[v as usize]);
    let [x, y] =
        [0, 1].map(|axis| corners.iter().map(|corner| corner[axis]).sum::<f32>() / 3.0 * side);
    found.texture.get_pixel(x as u32, y as u32).0
}

fn centre(found: &Textured, triangle: usize) -> Point3<f64> {
    let corners = found.mesh.triangles[triangle].map(|v| found.mesh.positions[v as usize]);
    Point3::from((corners[0].coords + corners[1].coords + corners[2].coords) / 3.0)
}

#[test]
fn every_face_shows_the_colour_of_its_place() {
    let mesh = mesh::builtin::torus(30.0, 12.0, 24, 12).mesh;
    let rig = Rig {
        viewpoints: [0.0, 90.0]
            .map(|degrees| Azimuth::from_degrees(degrees).unwrap().into())
            .to_vec(),
        width: 100,
        height: 80,
        axis_px: 50.0,
        origin_row_px: 40.0,
    };
    let linear = |point: &Point3<f64>| {
        LinearColour::from([point.x, point.y, point.z].map(|c| (c / 100.0 + 0.5) as f32))
    };
    // The lower half is not known: filled from the upper one's rim.
    let colour = |point: &Point3<f64>, _: &Vector3<f64>| (point.z > 0.0).then(|| linear(point));
    let labels = best_views(&mesh, &rig, &DepthBuffer::of_views(&mesh, &rig));
    let textured = || textured(&mesh, &rig, &labels, &colour, &Silent).unwrap();
    let found = textured();
    assert_eq!(found.mesh.triangles.len(), mesh.triangles.len());
    for triangle in 0..found.mesh.triangles.len() {
        let (point, texel) = (centre(&found, triangle), middle(&found, triangle));
        if point.z > 3.0 {
            let expected: [f32; 3] = linear(&point).into();
            for (texel, expected) in texel.into_iter().zip(expected) {
                let off = i32::from(texel) - i32::from(srgb_byte_from_linear(expected));
                // A texel's own width makes up to 5 levels.
                assert!(off.abs() <= 8, "{point}: {texel}");
            }
        } else if point.z < -3.0 {
            // The blue of the rim, and no texel is left black.
            let off = i32::from(texel[2]) - i32::from(srgb_byte_from_linear(0.5));
            assert!(off.abs() <= 10, "{point}: {texel:?}");
        }
    }
    assert!(found.coordinates.iter().flatten().all(|share| (0.0..=1.0).contains(share)));
    assert_eq!(textured().texture, found.texture);
}

/// A block, red in front and behind and blue at its sides, its outline black.
#[test]
fn drawings_colour_the_sides_they_show_and_outlines_stay_out() {
    let view = |degrees: f64, fill: [u8; 3]| {
        let inside = |x: u32, y: u32| (20..80).contains(&x) && (10..70).contains(&y);
        let edge = |x: u32, y: u32| !(22..78).contains(&x) || !(12..68).contains(&y);
        let image = GrayImage::from_fn(100, 80, |x, y| {
            Luma([if inside(x, y) && edge(x, y) { 0 } else { 255 }])
        });
        let mask = GrayImage::from_fn(100, 80, |x, y| Luma([if inside(x, y) { 255 } else { 0 }]));
        let color = RgbImage::from_fn(100, 80, |x, y| match (inside(x, y), edge(x, y)) {
            (false, _) => Rgb([255; 3]),
            (true, true) => Rgb([0; 3]),
            (true, false) => Rgb(fill),
        });
        let azimuth = Azimuth::from_degrees(degrees).unwrap();
        View { color: Some(color), ..View::level(azimuth, image, Some(mask)) }
    };
    let (red, blue) = ([200, 30, 20], [20, 40, 190]);
    let sheet = Sheet::new(vec![view(0.0, red), view(90.0, blue), view(180.0, red)]).unwrap();
    let draft = crate::reconstruct(&sheet, &[], &TurntableOptions::default(), &Silent).unwrap();
    let quads = draft.quads(&SolidOptions::default(), &Silent).unwrap();
    let found = texture(&draft, &quads, &Silent).unwrap().unwrap();
    assert_eq!(found.quads.len(), quads.quads.len());
    let mut seen = [0; 2];
    for triangle in 0..found.mesh.triangles.len() {
        let corners = found.mesh.triangles[triangle].map(|v| found.mesh.positions[v as usize]);
        let normal = (corners[1] - corners[0]).cross(&(corners[2] - corners[0]));
        let Some(normal) = normal.try_normalize(1e-9) else { continue };
        // Sides are 60 px wide; views blend along their edges.
        let centre = corners.iter().map(|corner| corner.coords).sum::<Vector3<f64>>() / 3.0;
        let expected = if normal.y.abs() > 0.95 && centre.x.abs() < 26.0 {
            red
        } else if normal.x > 0.95 && centre.y.abs() < 26.0 {
            blue
        } else {
            continue;
        };
        seen[usize::from(expected == blue)] += 1;
        let texel = middle(&found, triangle);
        let off = texel.iter().zip(expected).map(|(a, b)| a.abs_diff(b)).max().unwrap();
        assert!(off <= 12, "{normal}: {texel:?}");
    }
    assert!(seen[0] >= 4 && seen[1] >= 2, "{seen:?}");
    // Ink and paper are on no texel of the model: all are reddish, bluish or between.
    let dark = found.texture.pixels().filter(|p| p.0 != [0; 3]);
    assert!(dark.clone().all(|p| p.0.iter().any(|&level| level > 80)));
    assert!(dark.clone().all(|p| p.0.iter().any(|&level| level < 80)));
}
