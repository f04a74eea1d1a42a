//! Drawings in the model's colours.

use image::DynamicImage;

use super::*;
use crate::{Background, Ink};

/// A plate of one linear colour before the middle of the frame.
fn coloured_plate(colour: [f32; 3]) -> Model {
    Model { corner_colours: Some(vec![[colour; 3]; 2]), ..plate(0.0, 0.0, 0.0, 1.0, 0.5) }
}

fn drawn(model: &Model, ink: Ink, background: Background) -> DynamicImage {
    draw(model, 0.0, &DrawOptions { ink, background, ..small() }).image
}

#[test]
fn flat_colours_are_the_models_in_srgb() {
    let model = coloured_plate([0.18, 1.0, 0.0]);
    let rgb = drawn(&model, Ink::Flat, Background::White).into_rgb8();
    assert_eq!(rgb.get_pixel(96, 54).0, [118, 255, 0]);
    assert_eq!(rgb.get_pixel(2, 2).0, [255; 3]);
    let edge = rgb.rows().nth(54).unwrap().map(|pixel| pixel.0[1]).min().unwrap();
    assert!(edge < 40, "the outline is inked: {edge}");
}

#[test]
fn corners_of_different_colours_are_blended_in_linear_light() {
    let [black, white] = [[0.0; 3], [1.0; 3]];
    // Corners: left low, right low, right high, left high.
    let colours = vec![[black, white, white], [black, white, black]];
    let model = Model { corner_colours: Some(colours), ..coloured_plate(black) };
    let rgb = drawn(&model, Ink::Flat, Background::White).into_rgb8();
    let middle = i32::from(rgb.get_pixel(96, 54).0[0]);
    // Half of the light is level 188.
    assert!((middle - 188).abs() <= 3, "{middle}");
}

#[test]
fn shading_is_lightest_towards_the_lamp() {
    let sphere = Model { corner_colours: None, ..uv_sphere(1.0, 24, 48) };
    let rgb = drawn(&sphere, Ink::Shaded, Background::White).into_rgb8();
    let level = |x, y| i32::from(rgb.get_pixel(x, y).0[0]);
    let (lit, dark) = (level(88, 42), level(107, 69));
    assert!(lit > dark + 40, "{lit} {dark}");
    let flat = drawn(&sphere, Ink::Flat, Background::White).into_rgb8();
    assert_eq!(flat.get_pixel(88, 42), flat.get_pixel(107, 69));
}

#[test]
fn transparent_drawings_show_the_same_on_any_paper() {
    let model = coloured_plate([0.2, 0.4, 0.1]);
    for ink in [Ink::Flat, Ink::Shaded] {
        let cut = drawn(&model, ink, Background::Transparent).into_rgba8();
        let blue = [10, 20, 200];
        let on_blue = drawn(&model, ink, Background::Colour(blue)).into_rgb8();
        for (cut, expected) in cut.pixels().zip(on_blue.pixels()) {
            let alpha = cut.0[3];
            for ((under, over), expected) in blue.into_iter().zip(cut.0).zip(expected.0) {
                let level = crate::paint::mixed(under, over, alpha);
                assert!(level.abs_diff(expected) <= 2, "{cut:?} {expected}");
            }
        }
    }
}

#[test]
fn lines_keep_to_as_few_channels_as_they_need() {
    let model = coloured_plate([0.2, 0.4, 0.1]);
    let lines = |background| drawn(&model, Ink::Lines, background);
    assert!(matches!(lines(Background::White), DynamicImage::ImageLuma8(_)));
    assert!(matches!(lines(Background::Grey), DynamicImage::ImageLuma8(_)));
    assert!(matches!(lines(Background::Transparent), DynamicImage::ImageLumaA8(_)));
    let DynamicImage::ImageRgb8(dark) = lines(Background::Colour([0, 0, 90])) else {
        panic!("blue paper is grey");
    };
    assert!(dark.pixels().any(|pixel| pixel.0 == [255; 3]), "white lines on what is dark");
}

#[test]
fn degraded_drawings_keep_their_colours() {
    let model = coloured_plate([0.0, 0.5, 0.0]);
    let degrade =
        DegradeOptions { preset: Some(DegradePreset::Light), ..DegradeOptions::default() };
    let options = DrawOptions { ink: Ink::Flat, degrade, ..small() };
    let [r, g, b] = draw(&model, 0.0, &options).image.into_rgb8().get_pixel(96, 54).0;
    assert!(g > 120 && r < 60 && b < 60, "{r} {g} {b}");
}

#[test]
fn outlines_are_closed_in_colour_as_in_lines() {
    // A soup of separate triangles, whose strokes leave gaps.
    let mut model = torus(1.0, 0.3, 9, 5);
    model.corner_colours = Some(vec![[[0.9, 0.9, 0.9]; 3]; model.mesh.triangles.len()]);
    for degrees in [0.0, 37.0, 90.0] {
        let inked = |ink| {
            let options = DrawOptions { ink, background: Background::Transparent, ..small() };
            draw(&model, degrees, &options)
        };
        let (lines, flat) = (inked(Ink::Lines), inked(Ink::Flat));
        assert_eq!(lines.truth.mask, flat.truth.mask);
        let (lines, flat) = (lines.image.into_luma_alpha8(), flat.image.into_rgba8());
        for ((line, colour), mask) in lines.pixels().zip(flat.pixels()).zip(flat_mask(&flat)) {
            // All ink is there, and all of the subject is opaque.
            assert!(colour.0[3] >= line.0[1]);
            assert!(!mask || colour.0[3] > 0);
        }
    }
}

fn flat_mask(image: &image::RgbaImage) -> impl Iterator<Item = bool> + '_ {
    image.pixels().map(|pixel| pixel.0[3] > 127)
}
