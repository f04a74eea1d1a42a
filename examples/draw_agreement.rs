//! Compares our drawings with another renderer's, view by view.
//!
//! ```text
//! cargo run --release --example draw_agreement -- SHEETS_DIR [SIDE_BY_SIDE_DIR]
//! ```
//!
//! SHEETS_DIR holds sheets (sheet.json, model.obj, view_AAA.png, depth_AAA.png), SIDE_BY_SIDE_DIR
//! gets a picture of every view with the other's ink in red, ours in blue and both in black.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

use drawing::{DrawOptions, Drawer, DrawnView, PreparedModel};
use frames::Azimuth;
use image::{GrayImage, ImageBuffer, Luma, Rgb, RgbImage};
use mesh::read::{self, Limits, ModelFormat};
use serde_json::Value;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

/// Ink of one drawing counts as found if the other has ink within this distance.
const INK_RADIUS_PX: i64 = 2;
const DEPTH_TOLERANCE_UNITS: f64 = 0.005;

fn main() -> Result<()> {
    let mut arguments = env::args_os().skip(1).map(PathBuf::from);
    let sheets_dir = arguments.next().ok_or("which folder of sheets?")?;
    let pictures_dir = arguments.next();
    let mut names: Vec<_> = fs::read_dir(&sheets_dir)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("sheet.json").is_file())
        .collect();
    names.sort();
    println!("| sheet | views | their ink found | our ink found | depth | IoU mean | IoU worst |");
    println!("|---|---|---|---|---|---|---|");
    for sheet_dir in names {
        let name = sheet_dir.file_name().unwrap_or_default().to_string_lossy().into_owned();
        let pictures = pictures_dir.as_ref().map(|dir| dir.join(&name));
        let row = compare_sheet(&sheet_dir, pictures.as_deref())?;
        println!(
            "| {name} | {} | {:.2} % | {:.2} % | {:.2} % | {:.4} | {:.4} |",
            row.views,
            100.0 * mean(&row.theirs_found),
            100.0 * mean(&row.ours_found),
            100.0 * mean(&row.depth_agrees),
            mean(&row.iou),
            row.iou.iter().copied().fold(f64::INFINITY, f64::min),
        );
    }
    Ok(())
}

#[derive(Default)]
struct Row {
    views: usize,
    theirs_found: Vec<f64>,
    ours_found: Vec<f64>,
    depth_agrees: Vec<f64>,
    iou: Vec<f64>,
}

fn compare_sheet(dir: &Path, pictures: Option<&Path>) -> Result<Row> {
    let sheet: Value = serde_json::from_slice(&fs::read(dir.join("sheet.json"))?)?;
    let bytes = fs::read(dir.join("model.obj"))?;
    let model = read::load(&bytes, ModelFormat::Obj, None, &Limits::default())?;
    let prepared = PreparedModel::new(&model)?;
    let number = |value: &Value| value.as_f64().ok_or("a number is missing in sheet.json");
    let width = number(&sheet["width"])?;
    let options = DrawOptions {
        width_px: width as u32,
        height_px: number(&sheet["height"])? as u32,
        scale: width / number(&sheet["pixels_per_unit"])?,
        ..DrawOptions::default()
    };
    let counts_per_unit = number(&sheet["truth"]["depth_counts_per_unit"])?;
    let drawer = Drawer::new(&prepared, &options)?;
    let mut row = Row::default();
    for view in sheet["views"].as_array().ok_or("no views in sheet.json")? {
        let file = |key: &str| view[key].as_str().map(|file| dir.join(file));
        let drawn =
            drawer.draw_view(Azimuth::from_degrees(number(&view["azimuth_deg"])?)?.into())?;
        let ours = drawn.image.to_luma8();
        let theirs = image::open(file("image").ok_or("a view without image")?)?.into_luma8();
        row.views += 1;
        row.theirs_found.push(share_found(&theirs, &ours));
        row.ours_found.push(share_found(&ours, &theirs));
        if let Some(depth) = file("depth") {
            let depth = image::open(depth)?.into_luma16();
            compare_depth(&drawn, &depth, counts_per_unit, &mut row);
        }
        if let Some(pictures) = pictures {
            fs::create_dir_all(pictures)?;
            let azimuth = drawn.viewpoint.azimuth.to_string();
            overlay(&theirs, &ours).save(pictures.join(format!("{azimuth:0>3}.png")))?;
        }
    }
    Ok(row)
}

fn is_ink(image: &GrayImage, x: i64, y: i64) -> bool {
    let inside =
        (0..i64::from(image.width())).contains(&x) && (0..i64::from(image.height())).contains(&y);
    inside && image.get_pixel(x as u32, y as u32).0[0] < 128
}

/// The share of one drawing's ink that has ink of the other near it.
fn share_found(image: &GrayImage, other: &GrayImage) -> f64 {
    let (mut ink, mut found) = (0_u32, 0_u32);
    for (x, y, pixel) in image.enumerate_pixels() {
        if pixel.0[0] < 128 {
            let (x, y) = (i64::from(x), i64::from(y));
            let radius = -INK_RADIUS_PX..=INK_RADIUS_PX;
            let near = radius.clone().any(|dy| {
                radius.clone().any(|dx| {
                    dx * dx + dy * dy <= INK_RADIUS_PX * INK_RADIUS_PX
                        && is_ink(other, x + dx, y + dy)
                })
            });
            ink += 1;
            found += u32::from(near);
        }
    }
    f64::from(found) / f64::from(ink.max(1))
}

fn compare_depth(
    drawn: &DrawnView,
    theirs: &ImageBuffer<Luma<u16>, Vec<u16>>,
    counts_per_unit: f64,
    row: &mut Row,
) {
    let (mut both, mut either, mut agreeing) = (0_u32, 0_u32, 0_u32);
    for (ours, theirs) in drawn.truth.depth.pixels().zip(theirs.pixels()) {
        let covered = [ours.0[0].is_finite(), theirs.0[0] > 0];
        either += u32::from(covered[0] || covered[1]);
        if covered == [true, true] {
            both += 1;
            let theirs = f64::from(theirs.0[0]) / counts_per_unit;
            agreeing += u32::from((f64::from(ours.0[0]) - theirs).abs() < DEPTH_TOLERANCE_UNITS);
        }
    }
    row.depth_agrees.push(f64::from(agreeing) / f64::from(both.max(1)));
    row.iou.push(f64::from(both) / f64::from(either.max(1)));
}

fn overlay(theirs: &GrayImage, ours: &GrayImage) -> RgbImage {
    RgbImage::from_fn(ours.width(), ours.height(), |x, y| {
        let (theirs, ours) = (theirs.get_pixel(x, y).0[0], ours.get_pixel(x, y).0[0]);
        Rgb([ours, theirs.min(ours), theirs])
    })
}

fn mean(values: &[f64]) -> f64 {
    values.iter().sum::<f64>() / values.len().max(1) as f64
}
