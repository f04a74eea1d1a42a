//! Drafts of pages against drafts of the same drawings sent apart.
//!
//! `cargo run --release --example page_drafts -- FOLDER...`, folders that
//! `cargo run --release -p page --example page_accuracy -- --save DIR` wrote into DIR. For each the
//! draft's IoU with the true solid, laid on it by their bounds: of the drawings apart, of the
//! page's views at the true azimuths, and at the guessed ones; then the means where the first two
//! are. A page whose views are not as many as those drawn has none at the true azimuths.

use std::collections::BTreeMap;
use std::error::Error;
use std::io::Cursor;
use std::path::{Path, PathBuf};

use evaluation::{ComparisonOptions, SolidTruth, lay_on};
use frames::UpAxis;
use image::{ImageFormat, RgbaImage};
use mesh::Mesh;
use mesh::read::{Limits, ModelFormat, load};
use page::{PageOptions, cut_out, propose};
use progress::Silent;
use serde_json::json;
use sheet::{SheetDocument, ViewDocument};
use turnaround::draft::{Decoded, DraftLimits};

type Drawings = Vec<(f64, RgbaImage)>;

fn main() {
    let folders: Vec<PathBuf> = std::env::args().skip(1).map(PathBuf::from).collect();
    println!("| page | apart | page, true azimuths | page, guessed azimuths |\n|---|---|---|---|");
    let mut sums = [0.0; 3];
    let (mut count, mut wrong) = (0, 0);
    for folder in &folders {
        let name = folder.file_name().unwrap_or_default().to_string_lossy();
        match measured(folder) {
            Err(error) => println!("| {name} | {error} | | |"),
            Ok([Some(apart), found, guessed]) => {
                let text = |iou: Option<f64>| iou.map_or("-".to_owned(), |iou| format!("{iou:.3}"));
                println!("| {name} | {apart:.3} | {} | {} |", text(found), text(guessed));
                match found {
                    Some(found) => {
                        count += 1;
                        let all = [apart, found, guessed.unwrap_or(0.0)];
                        sums.iter_mut().zip(all).for_each(|(sum, iou)| *sum += iou);
                    }
                    None => wrong += 1,
                }
            }
            Ok(_) => println!("| {name} | no draft of the drawings apart | | |"),
        }
    }
    let [apart, found, guessed] = sums.map(|sum| sum / f64::from(count.max(1)));
    println!("| mean of {count} | {apart:.3} | {found:.3} | {guessed:.3} |");
    println!("{wrong} pages with more or fewer views than were drawn");
}

/// IoU of the drafts of the drawings apart and of the page at true and at guessed azimuths.
fn measured(folder: &Path) -> Result<[Option<f64>; 3], Box<dyn Error>> {
    let text = std::fs::read_to_string(folder.join("azimuths.txt"))?;
    let azimuths = text.split(',').map(str::parse).collect::<Result<Vec<f64>, _>>()?;
    let bytes = std::fs::read(folder.join("model.obj"))?;
    let model = load(&bytes, ModelFormat::Obj, Some(UpAxis::Z), &Limits::default())?.mesh;
    let read = |name: &str| image::open(folder.join(name)).map(image::DynamicImage::into_rgba8);
    let apart = azimuths
        .iter()
        .map(|degrees| Ok((*degrees, read(&format!("views/{degrees}.png"))?)))
        .collect::<Result<Drawings, image::ImageError>>()?;
    let page = read("page.png")?;
    let Ok(proposal) = propose(&page, &PageOptions::default(), &Silent) else {
        return Ok([iou(&apart, &model)?, None, None]);
    };
    let cut: Vec<RgbaImage> =
        (0..proposal.figures.len()).map(|k| cut_out(&page, &proposal, k)).collect();
    let with = |azimuths: Vec<f64>| azimuths.into_iter().zip(cut.clone()).collect::<Drawings>();
    let guessed: Vec<f64> = proposal.figures.iter().map(|f| f.azimuth.degrees()).collect();
    let right = (cut.len() == azimuths.len()).then(|| with(azimuths.clone()));
    let found = match right {
        Some(right) => Some(iou(&right, &model)?.unwrap_or(0.0)),
        None => None,
    };
    let guessed = match found {
        Some(found) if guessed == azimuths => Some(found),
        _ => iou(&with(guessed), &model)?,
    };
    Ok([iou(&apart, &model)?, found, guessed])
}

/// `None` where no draft is made of the drawings.
fn iou(drawings: &Drawings, truth: &Mesh) -> Result<Option<f64>, Box<dyn Error>> {
    let mut files: BTreeMap<String, Vec<u8>> = BTreeMap::new();
    let mut document =
        SheetDocument { options: Some(json!({"method": "turntable"})), ..Default::default() };
    for (degrees, drawing) in drawings {
        let mut png = Cursor::new(Vec::new());
        drawing.write_to(&mut png, ImageFormat::Png)?;
        let image = format!("{degrees}.png");
        files.insert(image.clone(), png.into_inner());
        let view = ViewDocument { image, azimuth_deg: *degrees, ..ViewDocument::default() };
        document.views.push(view);
    }
    let read = |name: &str| Ok(files[name].clone());
    let Ok(decoded) = Decoded::read(&document, &read, &DraftLimits::default(), 2) else {
        return Ok(None);
    };
    let Ok(draft) = decoded.turntable() else { return Ok(None) };
    let mut mesh = draft.solid.mesh;
    lay_on(&mut mesh, truth);
    let options = ComparisonOptions { grid_cells: 128, ..ComparisonOptions::default() };
    Ok(Some(SolidTruth::new(truth, options)?.evaluate(&mesh)?.iou))
}
