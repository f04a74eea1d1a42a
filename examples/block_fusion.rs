//! Whether fusing block sizes beats each of them alone.
//!
//! ```text
//! cargo run --release --example block_fusion -- SHEETS_DIR
//! ```
//!
//! SHEETS_DIR holds sheets with true depth at 40, 45 and 50 degrees. Level views need no
//! rectification, so that nothing but the disparity stage is measured: bad2.0 of the left view's
//! map, in px of the pair, over the truth's mask, missing pixels being bad.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::{env, fs};

use evaluation::{DepthScale, decode_truth};
use image::GrayImage;
use picture::FloatImage;
use picture::ImageLimits;
use serde_json::Value;
use uncalibrated::options::DisparityOptions;
use uncalibrated::vision::disparity_maps;

type Result<T> = std::result::Result<T, Box<dyn Error>>;

const PAIRS: [(u32, u32); 2] = [(40, 45), (45, 50)];
const SINGLE: [i32; 6] = [5, 9, 15, 21, 37, 51];
const FUSED: [&[i32]; 4] = [&[5, 15, 37], &[9, 21, 51], &[5, 9, 15, 21, 37], &[15, 21, 37, 51]];

fn main() -> Result<()> {
    let sheets_dir = PathBuf::from(env::args_os().nth(1).ok_or("which folder of sheets?")?);
    let mut folders: Vec<_> = fs::read_dir(&sheets_dir)?
        .filter_map(|entry| Some(entry.ok()?.path()))
        .filter(|path| path.join("sheet.json").is_file())
        .collect();
    folders.sort();
    let settings = settings();
    let names: Vec<_> = settings.iter().map(|(name, _)| name.as_str()).collect();
    println!("| sheet | {} |", names.join(" | "));
    println!("|---|{}", "---|".repeat(names.len()));
    let mut sums = vec![0.0; settings.len()];
    let mut count = 0;
    for folder in &folders {
        let Ok(row) = row(folder, &settings) else { continue };
        count += 1;
        sums.iter_mut().zip(&row).for_each(|(sum, value)| *sum += value);
        print_row(&folder.file_name().unwrap_or_default().to_string_lossy(), &row);
    }
    let means: Vec<_> = sums.iter().map(|sum| sum / f64::from(count.max(1))).collect();
    print_row("mean", &means);
    Ok(())
}

fn settings() -> Vec<(String, DisparityOptions)> {
    let wide = DisparityOptions {
        min_disparity_px: -32,
        num_disparities: 64,
        ..DisparityOptions::default()
    };
    let single = SINGLE.map(|block_size| {
        (block_size.to_string(), DisparityOptions { block_size, ..wide.clone() })
    });
    let fused = FUSED.map(|sizes| {
        let name: Vec<_> = sizes.iter().map(ToString::to_string).collect();
        (name.join("+"), DisparityOptions { block_sizes: sizes.to_vec(), ..wide.clone() })
    });
    single.into_iter().chain(fused).collect()
}

fn print_row(name: &str, values: &[f64]) {
    let cells: Vec<_> = values.iter().map(|value| format!("{value:.3}")).collect();
    println!("| {name} | {} |", cells.join(" | "));
}

fn row(folder: &Path, settings: &[(String, DisparityOptions)]) -> Result<Vec<f64>> {
    let document: Value = serde_json::from_slice(&fs::read(folder.join("sheet.json"))?)?;
    let mut sums = vec![0.0; settings.len()];
    for (left, right) in PAIRS {
        let truth = true_disparity(folder, &document, left, right)?;
        let [left, right] = [drawing(folder, left)?, drawing(folder, right)?];
        for (sum, (_, options)) in sums.iter_mut().zip(settings) {
            let [map, _] = disparity_maps(&left, &right, options)?;
            *sum += bad2(&map, &truth);
        }
    }
    Ok(sums.iter().map(|sum| sum / PAIRS.len() as f64).collect())
}

fn drawing(folder: &Path, azimuth: u32) -> Result<GrayImage> {
    Ok(image::open(folder.join(format!("view_{azimuth:03}.png")))?.to_luma8())
}

/// `x (1 - cos t) - d sin t` at the left view's pixels, px.
fn true_disparity(folder: &Path, document: &Value, left: u32, right: u32) -> Result<FloatImage> {
    let number = |value: &Value| value.as_f64().ok_or("the sheet lacks a number of its truth");
    let scale = DepthScale {
        counts_per_unit: number(&document["truth"]["depth_counts_per_unit"])?,
        camera_distance: number(&document["truth"]["camera_distance"])?,
        pixels_per_unit: number(&document["pixels_per_unit"])?,
    };
    let bytes = fs::read(folder.join(format!("depth_{left:03}.png")))?;
    let mut map = decode_truth(&bytes, &ImageLimits::default())?.values;
    let (sin, cos) = f64::from(right - left).to_radians().sin_cos();
    let middle = f64::from(map.width()) / 2.0;
    for (column, _, value) in map.enumerate_pixels_mut() {
        let from_camera = f64::from(value.0[0]) / scale.counts_per_unit;
        let depth_px = (from_camera - scale.camera_distance) * scale.pixels_per_unit;
        let x = f64::from(column) + 0.5 - middle;
        value.0[0] = (x * (1.0 - cos) - depth_px * sin) as f32;
    }
    Ok(map)
}

fn bad2(map: &FloatImage, truth: &FloatImage) -> f64 {
    let known: Vec<_> = map.iter().zip(truth.iter()).filter(|(_, truth)| !truth.is_nan()).collect();
    let good = known.iter().filter(|(ours, truth)| (**ours - **truth).abs() <= 2.0).count();
    1.0 - good as f64 / known.len().max(1) as f64
}
