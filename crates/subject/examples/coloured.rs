//! Silhouettes of drawings in lines and in colour, on paper of several kinds, against the truth:
//! mean IoU of each, and the views that lose most against line art.
//!
//!     coloured FOLDER [EVERY] [SIZE] [PICTURES]
//!
//! FOLDER holds GLBs; every EVERYth is drawn, 480x270 px or of SIZE, from five sides. The folder
//! PICTURES gets the drawings of which less than nine tenths are found, what is missing red, what
//! is too much blue.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};

use drawing::{Background, DrawOptions, Drawer, Ink, PreparedModel};
use frames::Azimuth;
use image::{GrayImage, RgbaImage};
use mesh::read::{Limits, ModelFormat, load};
use rayon::prelude::*;
use subject::{Hints, SubjectOptions, find};

const AZIMUTHS_DEG: [f64; 5] = [0.0, 45.0, 90.0, 135.0, 180.0];

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let folder = words.first().ok_or("give a FOLDER")?;
    let every: usize = words.get(1).map_or(Ok(1), |word| word.parse())?;
    let size = words.get(2).map_or("480x270", String::as_str);
    let pictures = words.get(3).map(PathBuf::from);
    let (width, height) = size.split_once('x').ok_or("SIZE is WIDTHxHEIGHT")?;
    let (width, height): (u32, u32) = (width.parse()?, height.parse()?);
    let mut paths: Vec<PathBuf> = std::fs::read_dir(folder)?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    paths.retain(|path| path.extension().is_some_and(|ending| ending == "glb"));
    paths.sort();
    let chosen: Vec<PathBuf> = paths.into_iter().step_by(every).collect();
    let found: Vec<Measured> = chosen
        .par_iter()
        .flat_map(|path| measured(path, (width, height), pictures.as_deref()).unwrap_or_default())
        .collect();
    let mut by_variant: BTreeMap<&str, Vec<f64>> = BTreeMap::new();
    let mut lines: BTreeMap<&str, f64> = BTreeMap::new();
    for (view, variant, iou) in &found {
        by_variant.entry(variant).or_default().push(*iou);
        if variant == "Lines white" {
            lines.insert(view, *iou);
        }
    }
    for (variant, ious) in &by_variant {
        let mean = ious.iter().sum::<f64>() / ious.len() as f64;
        let bad = ious.iter().filter(|iou| **iou < 0.9).count();
        println!("{variant:20} {} views, IoU {mean:.4}, below 0.9: {bad}", ious.len());
    }
    let mut lost: Vec<(f64, &str, &str)> = found
        .iter()
        .map(|(view, variant, iou)| (iou - lines[view.as_str()], view.as_str(), variant.as_str()))
        .collect();
    lost.sort_by(|a, b| a.0.total_cmp(&b.0));
    for (change, view, variant) in lost.iter().take(30) {
        println!("{change:+.3} {view} {variant}");
    }
    Ok(())
}

/// View, variant, IoU.
type Measured = (String, String, f64);

/// Per view and variant the IoU of the silhouette that is found; 0 for none.
fn measured(
    path: &Path,
    (width_px, height_px): (u32, u32),
    pictures: Option<&Path>,
) -> Result<Vec<Measured>, Box<dyn Error>> {
    let model = load(&std::fs::read(path)?, ModelFormat::Glb, None, &Limits::default())?;
    let model = PreparedModel::new(&model)?;
    let name = path.file_stem().unwrap_or_default().to_string_lossy();
    let mut found = Vec::new();
    for ink in [Ink::Lines, Ink::Flat, Ink::Shaded] {
        for background in [Background::White, Background::Grey, Background::Transparent] {
            let options = DrawOptions {
                width_px,
                height_px,
                ink,
                background,
                fit: true,
                line_width_px: 1.5 * f64::from(height_px) / 540.0,
                ..DrawOptions::default()
            };
            let placed = model.placed(&options);
            let drawer = Drawer::new(&placed, &options)?;
            for degrees in AZIMUTHS_DEG {
                let view = drawer.draw_view(Azimuth::from_degrees(degrees)?.into())?;
                let drawing = view.image.into_rgba8();
                let subject =
                    find(&drawing, &Hints::default(), &SubjectOptions::default(), &|| false);
                let mask = subject
                    .map_or_else(|_| GrayImage::new(width_px, height_px), |subject| subject.mask);
                let iou = iou(&mask, &view.truth.mask);
                let variant = format!("{ink:?} {background}");
                if let Some(folder) = pictures.filter(|_| iou < 0.9) {
                    let picture = marked(&drawing, &mask, &view.truth.mask);
                    picture.save(folder.join(format!("{name}_{degrees}_{variant}.png")))?;
                }
                found.push((format!("{name} {degrees}"), variant, iou));
            }
        }
    }
    Ok(found)
}

fn marked(drawing: &RgbaImage, mask: &GrayImage, truth: &GrayImage) -> RgbaImage {
    let mut picture = drawing.clone();
    let pairs = mask.iter().zip(truth.iter()).map(|(a, b)| (*a > 127, *b > 127));
    for (pixel, (is, should)) in picture.pixels_mut().zip(pairs) {
        let [r, g, b, a] = pixel.0;
        let half = |level: u8, to: u8| ((u16::from(level) + u16::from(to)) / 2) as u8;
        match (is, should) {
            (false, true) => pixel.0 = [half(r, 255), half(g, 0), half(b, 0), 255],
            (true, false) => pixel.0 = [half(r, 0), half(g, 0), half(b, 255), 255],
            _ => pixel.0 = [r, g, b, a],
        }
    }
    picture
}

fn iou(a: &GrayImage, b: &GrayImage) -> f64 {
    let pairs = || a.as_raw().iter().zip(b.as_raw()).map(|(a, b)| (*a > 127, *b > 127));
    let both = pairs().filter(|(a, b)| *a && *b).count();
    let either = pairs().filter(|(a, b)| *a || *b).count();
    both as f64 / either.max(1) as f64
}
