//! Drafts of drawings as studios send them, against the same drawings clean.
//!
//! `cargo run --release --example drawing_variants -- [MODEL...] [--only WORD]
//! [--pictures FOLDER] [--silhouettes]`, models by name (default `caped_figure`) or as
//! GLB files; the variants whose names hold WORD; pictures of what was found, the
//! subject's outline red; with --silhouettes no drafts. For each variant: the silhouettes' IoU with
//! the clean ones (mean and least), the draft's IoU with the true solid, and what
//! the service says. Views are 0, 45, 90 and 180 degrees, 960x540.

mod variants;

use std::collections::BTreeMap;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use drawing::{DrawOptions, Drawer, PreparedModel};
use evaluation::{ComparisonOptions, SolidTruth, lay_on};
use frames::Azimuth;
use image::{GrayImage, ImageFormat, RgbaImage, imageops};
use mesh::Mesh;
use mesh::builtin::ProceduralModel;
use mesh::read::{Limits, Model, ModelFormat, load};
use serde_json::json;
use sheet::{SheetDocument, ViewDocument};
use turnaround::draft::{Decoded, DraftLimits};
use turntable::fit::redraw;
use variants::{Clean, VARIANTS, iou};

const AZIMUTHS_DEG: [f64; 4] = [0.0, 45.0, 90.0, 180.0];

fn main() {
    let (mut names, mut wanted) = (Vec::new(), Wanted::default());
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--only" => wanted.only = words.next().unwrap_or_default(),
            "--silhouettes" => wanted.silhouettes = true,
            "--pictures" => wanted.pictures = words.next().map(PathBuf::from),
            _ => names.push(word),
        }
    }
    if names.is_empty() {
        names.push("caped_figure".to_owned());
    }
    for name in names {
        match model(&name) {
            Some(model) => measure(&name, &model, &wanted),
            None => eprintln!("{name} is neither a built-in model nor a GLB file"),
        }
    }
}

/// What is asked for on the command line.
#[derive(Default)]
struct Wanted {
    only: String,
    pictures: Option<PathBuf>,
    silhouettes: bool,
}

fn model(name: &str) -> Option<Model> {
    if let Some(model) = ProceduralModel::from_name(name) {
        return Some(model.build());
    }
    let bytes = std::fs::read(name).ok()?;
    load(&bytes, ModelFormat::Glb, None, &Limits::default()).ok()
}

fn measure(name: &str, model: &Model, wanted: &Wanted) {
    let options = DrawOptions { fit: name.ends_with(".glb"), ..DrawOptions::default() };
    let prepared = PreparedModel::new(model).expect("a model");
    let prepared = prepared.placed(&options);
    let drawer = Drawer::new(&prepared, &options).expect("usual options");
    let clean: Vec<Clean> = AZIMUTHS_DEG
        .iter()
        .map(|&degrees| {
            let azimuth = Azimuth::from_degrees(degrees).expect("an angle");
            Clean::new(drawer.draw_view(azimuth.into()).expect("a view").image.to_luma8())
        })
        .collect();
    let mut truth = prepared.mesh().clone();
    truth.positions.iter_mut().for_each(|p| *p *= options.pixels_per_unit());
    let comparison = ComparisonOptions {
        grid_cells: if wanted.silhouettes { 8 } else { ComparisonOptions::default().grid_cells },
        ..ComparisonOptions::default()
    };
    let solid = SolidTruth::new(&truth, comparison).expect("a closed model");
    let truth = (solid, truth);
    println!(
        "\n{name}\n| drawing | silhouette IoU, mean | least | solid IoU | said |\n|---|---|---|---|---|"
    );
    for (variant, make) in VARIANTS.iter().filter(|(name, _)| name.contains(&wanted.only)) {
        let views: Vec<(f64, RgbaImage, GrayImage)> = clean
            .iter()
            .zip(AZIMUTHS_DEG)
            .enumerate()
            .map(|(index, (clean, degrees))| {
                let (drawing, mask) = make(clean, index as u32);
                (degrees, drawing, mask)
            })
            .collect();
        report(variant, &views, &truth, wanted);
    }
    let opaque = |clean: &Clean| image::DynamicImage::from(clean.view.clone()).into_rgba8();
    let mistaken = |name: &str, degrees: [f64; 4], mirrored: Option<usize>| {
        let views: Vec<_> = clean
            .iter()
            .zip(degrees)
            .enumerate()
            .map(|(index, (clean, degrees))| {
                let mut drawing = opaque(clean);
                if mirrored == Some(index) {
                    imageops::flip_horizontal_in_place(&mut drawing);
                }
                (degrees, drawing, clean.mask.clone())
            })
            .collect();
        if name.contains(&wanted.only) {
            report(name, &views, &truth, wanted);
        }
    };
    mistaken("90 drawn as 270", [0.0, 45.0, 270.0, 180.0], None);
    mistaken("view 45 mirrored", AZIMUTHS_DEG, Some(1));
    mistaken("view 90 mirrored", AZIMUTHS_DEG, Some(2));
    mistaken("45 called 38", [0.0, 38.0, 90.0, 180.0], None);
}

fn report(
    name: &str,
    views: &[(f64, RgbaImage, GrayImage)],
    truth: &(SolidTruth, Mesh),
    wanted: &Wanted,
) {
    let files: BTreeMap<String, Vec<u8>> = views
        .iter()
        .map(|(degrees, drawing, _)| {
            let mut png = Cursor::new(Vec::new());
            drawing.write_to(&mut png, ImageFormat::Png).expect("a picture");
            (format!("{degrees}.png"), png.into_inner())
        })
        .collect();
    let document = SheetDocument {
        views: views
            .iter()
            .map(|(degrees, ..)| ViewDocument {
                image: format!("{degrees}.png"),
                azimuth_deg: *degrees,
                ..ViewDocument::default()
            })
            .collect(),
        options: Some(json!({"method": "turntable"})),
        ..SheetDocument::default()
    };
    let read = |name: &str| Ok(files[name].clone());
    let decoded = match Decoded::read(&document, &read, &DraftLimits::default(), 2) {
        Ok(decoded) => decoded,
        Err(error) => return println!("| {name} | | | | refused: {error} |"),
    };
    let mut said = decoded.warnings().to_vec();
    let shown = |iou: f64| if iou.is_nan() { "-".to_owned() } else { format!("{iou:.3}") };
    let (mean, least) = silhouettes(&decoded, views);
    let (mean, least) = (shown(mean), shown(least));
    if let Some(folder) = &wanted.pictures {
        pictures(folder, name, &decoded, views);
    }
    if wanted.silhouettes {
        return println!("| {name} | {mean} | {least} | | {} |", said.join("; "));
    }
    let solid = match decoded.turntable() {
        Ok(draft) => {
            said.extend(redraw(&draft).iter().filter_map(|view| view.fit.warning()));
            let mut mesh = draft.solid.mesh;
            if MOVED.iter().any(|word| name.contains(word)) {
                lay_on(&mut mesh, &truth.1);
            }
            let compared = truth.0.evaluate(&mesh);
            compared.map_or_else(|error| error.to_string(), |found| format!("{:.3}", found.iou))
        }
        Err(error) => format!("none: {error}"),
    };
    println!("| {name} | {mean} | {least} | {solid} | {} |", said.join("; "));
}

/// Variants whose pixels are not those of the clean drawing: the draft is laid
/// on the truth by its bounds before they are compared.
const MOVED: [&str; 6] = ["size", "times", "eighth", "cropped", "inner frame", "side"];

/// Writes each drawing with the outline that was found in red.
fn pictures(folder: &Path, name: &str, decoded: &Decoded, views: &[(f64, RgbaImage, GrayImage)]) {
    for (azimuth, found) in decoded.masks() {
        let Some((_, drawing, _)) = views.iter().find(|view| view.0 == azimuth.azimuth.degrees())
        else {
            continue;
        };
        let mut picture = drawing.clone();
        if found.dimensions() != picture.dimensions() {
            continue;
        }
        let is = |x: u32, y: u32| found.get_pixel(x, y).0[0] != 0;
        for y in 1..found.height() {
            for x in 1..found.width() {
                if is(x, y) != is(x - 1, y) || is(x, y) != is(x, y - 1) {
                    picture.put_pixel(x, y, image::Rgba([255, 0, 0, 255]));
                }
            }
        }
        let path = folder.join(format!("{name} {azimuth}.png"));
        picture.save(path).expect("a writable folder");
    }
}

/// IoU of the silhouettes with the true masks, where they are of one size.
fn silhouettes(decoded: &Decoded, views: &[(f64, RgbaImage, GrayImage)]) -> (f64, f64) {
    let found = decoded.masks();
    let scores: Vec<f64> = views
        .iter()
        .filter_map(|(degrees, _, mask)| {
            let (_, ours) = found.iter().find(|(own, _)| own.azimuth.degrees() == *degrees)?;
            (ours.dimensions() == mask.dimensions()).then(|| iou(ours, mask))
        })
        .collect();
    if scores.is_empty() {
        return (f64::NAN, f64::NAN);
    }
    let mean = scores.iter().sum::<f64>() / scores.len() as f64;
    (mean, scores.iter().copied().fold(1.0, f64::min))
}
