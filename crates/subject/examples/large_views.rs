//! Time and memory of finding and aligning the subjects of large drawings.
//!
//!     large_views [WIDTHxHEIGHT] [lines|flat] [MEGAPIXELS]
//!
//! Five views of the built-in caped figure, reduced to so many megapixels first, 4 as in the
//! service; on Linux memory is the process's peak over what the
//! drawings take.

use std::error::Error;
use std::time::Instant;

use drawing::{DrawOptions, Drawer, Ink, PreparedModel};
use frames::Azimuth;
use image::RgbaImage;
use mesh::builtin::ProceduralModel;
use rayon::prelude::*;
use subject::{
    AlignOptions, Hints, Subject, SubjectError, SubjectOptions, View, align, apply, find, reduced,
};

const AZIMUTHS_DEG: [f64; 5] = [0.0, 45.0, 90.0, 135.0, 180.0];

fn main() -> Result<(), Box<dyn Error>> {
    let words: Vec<String> = std::env::args().skip(1).collect();
    let size = words.first().map_or("6000x4000", String::as_str);
    let (width, height) = size.split_once('x').ok_or("the size is WIDTHxHEIGHT")?;
    let flat = words.get(1).is_some_and(|word| word == "flat");
    let megapixels: f64 = words.get(2).map_or(Ok(4.0), |word| word.parse())?;
    let options = DrawOptions {
        width_px: width.parse()?,
        height_px: height.parse()?,
        supersampling: 1,
        fit: true,
        line_width_px: height.parse::<f64>()? / 360.0,
        ink: if flat { Ink::Flat } else { Ink::Lines },
        ..DrawOptions::default()
    };
    let model = PreparedModel::new(&ProceduralModel::CapedFigure.build())?;
    let placed = model.placed(&options);
    let drawer = Drawer::new(&placed, &options)?;
    let drawn = AZIMUTHS_DEG.map(|degrees| -> Result<RgbaImage, Box<dyn Error>> {
        Ok(drawer.draw_view(Azimuth::from_degrees(degrees)?.into())?.image.into_rgba8())
    });
    let drawings: Vec<RgbaImage> = drawn.into_iter().collect::<Result<_, _>>()?;
    // Forgets what drawing took.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = memory_kib("VmRSS:");
    let begin = Instant::now();
    let found: Result<Vec<Subject>, SubjectError> = drawings
        .par_iter()
        .with_max_len(1)
        .map(|drawing| {
            let pixels = f64::from(drawing.width()) * f64::from(drawing.height());
            let factor = (pixels / (megapixels * 1e6)).sqrt();
            let less = (factor > 1.0).then(|| reduced(drawing, factor));
            let drawing = less.as_ref().unwrap_or(drawing);
            find(drawing, &Hints::default(), &SubjectOptions::default(), &|| false)
        })
        .collect();
    let found = found?;
    let after_find = begin.elapsed();
    let views: Vec<View<'_>> = AZIMUTHS_DEG
        .iter()
        .zip(&found)
        .map(|(&azimuth_deg, subject)| View { azimuth_deg, subject })
        .collect();
    let alignment = align(&views, &AlignOptions::default());
    let aligned = apply(&alignment, &views);
    let seconds = begin.elapsed().as_secs_f64();
    let pixels: u64 = drawings.iter().map(|drawing| drawing.pixels().len() as u64).sum();
    println!(
        "{} views, {pixels} px: {seconds:.2} s, {:.2} s to find",
        aligned.len(),
        after_find.as_secs_f64()
    );
    if let (Some(before), Some(peak)) = (before, memory_kib("VmHWM:")) {
        let bytes = 1024.0 * peak.saturating_sub(before) as f64 / pixels as f64;
        println!("{bytes:.1} bytes a pixel beside the drawings");
    }
    Ok(())
}

fn memory_kib(entry: &str) -> Option<u64> {
    let status = std::fs::read_to_string("/proc/self/status").ok()?;
    let line = status.lines().find_map(|line| line.strip_prefix(entry))?;
    line.trim().trim_end_matches("kB").trim().parse().ok()
}
