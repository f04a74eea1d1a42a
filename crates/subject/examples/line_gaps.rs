//! Silhouettes of line art with gaps in its outline, by the width of its lines.
//!
//!     line_gaps [--size WIDTHxHEIGHT] [--pictures FOLDER] [MODEL...]
//!
//! Models are names of built-in ones (all where none is given) or GLB files, drawn at 0, 45, 90
//! and 180 degrees. For each width of line and of gap, px: the silhouettes' IoU with those of the
//! drawings without gaps, its mean, its least, the share of views below 0.95, and how many gaps
//! were closed a view; of drawings without gaps every one is false.

use std::error::Error;
use std::path::PathBuf;

use drawing::{DrawOptions, Drawer, PreparedModel};
use frames::Azimuth;
use image::{GrayImage, Rgba, RgbaImage};
use mesh::builtin::ProceduralModel;
use mesh::read::{Limits, Model, ModelFormat, load};
use rayon::prelude::*;
use subject::raster::{Bits, filled};
use subject::{Hints, SubjectOptions, find};

const AZIMUTHS_DEG: [f64; 4] = [0.0, 45.0, 90.0, 180.0];
const LINE_WIDTHS_PX: [f64; 6] = [1.5, 2.0, 3.0, 3.7, 5.0, 8.0];
/// At 540 rows; wider where there are more.
const GAPS_PX: [f64; 3] = [0.0, 20.0, 40.0];
const GAPS_A_VIEW: usize = 6;
/// Darker is ink, levels.
const INK: u8 = 128;

struct Outcome {
    iou: f64,
    closed: usize,
}

fn main() -> Result<(), Box<dyn Error>> {
    let (mut size, mut pictures, mut names) = ("960x540".to_owned(), None, Vec::new());
    let mut words = std::env::args().skip(1);
    while let Some(word) = words.next() {
        match word.as_str() {
            "--size" => size = words.next().unwrap_or_default(),
            "--pictures" => pictures = words.next().map(PathBuf::from),
            _ => names.push(word),
        }
    }
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let (width_px, height_px): (u32, u32) = (width.parse()?, height.parse()?);
    if names.is_empty() {
        names = ProceduralModel::ALL.iter().map(|model| model.name().to_owned()).collect();
    }
    let models: Vec<(String, Model)> =
        names.into_iter().filter_map(|name| Some((name.clone(), model(&name)?))).collect();
    println!("| line, px | gap, px | mean | least | below 0.95 | closed a view |");
    println!("|---|---|---|---|---|---|");
    for line_width_px in LINE_WIDTHS_PX {
        let options =
            DrawOptions { width_px, height_px, line_width_px, fit: true, ..DrawOptions::default() };
        let views: Vec<(String, GrayImage)> = models
            .par_iter()
            .flat_map_iter(|(name, model)| drawn(name, model, &options).unwrap_or_default())
            .collect();
        for gap in GAPS_PX {
            let gap_px = gap * f64::from(height_px) / 540.0;
            let outcomes: Vec<Outcome> = views
                .par_iter()
                .filter_map(|(name, view)| {
                    let save = pictures.as_ref().map(|folder| {
                        folder.join(format!("{name}_line{line_width_px}_gap{gap}.png"))
                    });
                    measured(view, gap_px, save)
                })
                .collect();
            let count = outcomes.len().max(1) as f64;
            let ious = || outcomes.iter().map(|outcome| outcome.iou);
            println!(
                "| {line_width_px} | {gap_px:.0} | {:.4} | {:.3} | {:.3} | {:.2} |",
                ious().sum::<f64>() / count,
                ious().fold(1.0, f64::min),
                ious().filter(|iou| *iou < 0.95).count() as f64 / count,
                outcomes.iter().map(|outcome| outcome.closed).sum::<usize>() as f64 / count,
            );
        }
    }
    Ok(())
}

fn model(name: &str) -> Option<Model> {
    if let Some(model) = ProceduralModel::from_name(name) {
        return Some(model.build());
    }
    let bytes = std::fs::read(name).ok()?;
    load(&bytes, ModelFormat::Glb, None, &Limits::default()).ok()
}

/// Each view with its name.
fn drawn(
    name: &str,
    model: &Model,
    options: &DrawOptions,
) -> Result<Vec<(String, GrayImage)>, Box<dyn Error>> {
    let stem = PathBuf::from(name).file_stem().unwrap_or_default().to_string_lossy().into_owned();
    let model = PreparedModel::new(model)?;
    let options = &DrawOptions { fit: name.ends_with(".glb"), ..options.clone() };
    let placed = model.placed(options);
    let drawer = Drawer::new(&placed, options)?;
    AZIMUTHS_DEG
        .iter()
        .map(|&degrees| {
            let view = drawer.draw_view(Azimuth::from_degrees(degrees)?.into())?;
            Ok((format!("{stem}_{degrees}"), view.image.to_luma8()))
        })
        .collect()
}

/// What is found in a view without its outline at some places; `None` where nothing is.
fn measured(view: &GrayImage, gap_px: f64, save: Option<PathBuf>) -> Option<Outcome> {
    let (w, h) = (view.width() as usize, view.height() as usize);
    let ink = Bits { width: w, height: h, data: view.iter().map(|level| *level < INK).collect() };
    let truth = filled(&ink);
    let outline: Vec<(f64, f64)> = (0..truth.data.len())
        .filter(|i| {
            let (x, y) = ((i % w) as i64, (i / w) as i64);
            let sides = [(1, 0), (-1, 0), (0, 1), (0, -1)];
            truth.data[*i] && sides.iter().any(|(dx, dy)| !truth.at(x + dx, y + dy))
        })
        .map(|i| ((i % w) as f64, (i / w) as f64))
        .collect();
    // Low bits of such a generator are poor.
    let mut state = 5_u64;
    let mut centres: Vec<(f64, f64)> = Vec::new();
    for _ in 0..2000 {
        state = state.wrapping_mul(6364136223846793005).wrapping_add(1442695040888963407);
        let place = *outline.get((state >> 33) as usize % outline.len().max(1))?;
        let apart = |c: &(f64, f64)| (c.0 - place.0).hypot(c.1 - place.1) > 2.0 * gap_px;
        if gap_px > 0.0 && centres.len() < GAPS_A_VIEW && centres.iter().all(apart) {
            centres.push(place);
        }
    }
    let drawing = RgbaImage::from_fn(view.width(), view.height(), |x, y| {
        let away = |c: &(f64, f64)| (c.0 - f64::from(x)).hypot(c.1 - f64::from(y)) < gap_px / 2.0;
        let level = if centres.iter().any(away) { 255 } else { view.get_pixel(x, y).0[0] };
        Rgba([level, level, level, 255])
    });
    let found = find(&drawing, &Hints::default(), &SubjectOptions::default(), &|| false).ok()?;
    let pairs = || found.mask.iter().zip(&truth.data).map(|(level, truth)| (*level != 0, *truth));
    let both = pairs().filter(|(a, b)| *a && *b).count() as f64;
    let either = pairs().filter(|(a, b)| *a || *b).count() as f64;
    let iou = both / either.max(1.0);
    if let Some(path) = save.filter(|_| iou < 0.95) {
        let mut picture = drawing;
        for (pixel, level) in picture.pixels_mut().zip(found.mask.iter()) {
            if *level != 0 && pixel.0[0] > INK {
                pixel.0 = [255, 190, 190, 255];
            }
        }
        let _ = picture.save(path);
    }
    Some(Outcome { iou, closed: found.closed_gaps.len() })
}
