//! Measures the page finder on composed pages: figures, boxes and azimuths
//! against what is true of each page.
//!
//! `cargo run --release -p page --example page_accuracy -- [--models DIR]
//! [--large WIDTHxHEIGHT] [--most N] [--names A,B] [--pages N] [--seed N] [--traits A,B]
//! [--only INDEX,INDEX] [--failures DIR] [--save DIR]`. With traits only pages that have one of them
//! are searched, such as `guides,ground`. What it saves is what the example `page_drafts` of the
//! service makes drafts of: a folder a page with `page.png`, `views/AZIMUTH.png`, the same drawings
//! alone, `model.obj`, Z up, and `azimuths.txt`, those of the views in reading order.

mod compose;
mod models;

use std::collections::BTreeMap;
use std::path::{Path, PathBuf};
use std::time::Instant;

use compose::{Page, Placed, compose};
use image::{GrayImage, RgbaImage};
use page::{PageOptions, PageProposal, cut_out, preview, propose, with_margin};
use progress::Silent;
use rand::SeedableRng;
use rand_chacha::ChaCha8Rng;
use rayon::prelude::*;
use subject::{Hints, SubjectOptions};

/// A cut-out is as good as the drawing alone if their silhouettes have at least this IoU.
const WELL_CUT: f64 = 0.95;

/// What was right about one page.
#[derive(Default)]
struct Outcome {
    /// Every figure found and none false.
    whole: bool,
    found: usize,
    missed: usize,
    false_ones: usize,
    ious: Vec<f64>,
    /// Each figure's number and the IoU of the silhouette found in its cut-out with the one found
    /// in the drawing alone.
    cut: Vec<(usize, f64)>,
    tellable: usize,
    right: usize,
    all_views: usize,
    all_right: usize,
    traits: Vec<&'static str>,
    subject: String,
    /// The stated confidence of each azimuth that can be told, and whether it is right.
    stated: Vec<(f64, bool)>,
    note: String,
}

fn main() {
    let mut arguments: BTreeMap<String, String> = BTreeMap::new();
    let mut given = std::env::args().skip(1);
    while let Some(name) = given.next() {
        arguments.insert(name, given.next().unwrap_or_default());
    }
    let number = |name: &str, other: u64| {
        arguments.get(name).map_or(other, |text| text.parse().expect("a number"))
    };
    let started = Instant::now();
    let names = arguments.get("--names").map_or("", String::as_str);
    let names: Vec<&str> = names.split(',').filter(|name| !name.is_empty()).collect();
    let subjects = match arguments.get("--models") {
        Some(folder) => {
            models::of_folder(&PathBuf::from(folder), number("--most", 60) as usize, &names)
        }
        None => models::built_in(),
    };
    println!("{} subjects drawn in {:.1} s", subjects.len(), started.elapsed().as_secs_f64());
    if let Some(size) = arguments.get("--large") {
        return large(&subjects, size);
    }
    let failures = arguments.get("--failures").map(PathBuf::from);
    if let Some(folder) = &failures {
        std::fs::create_dir_all(folder).expect("the folder for failures");
    }
    let saved = arguments.get("--save").map(PathBuf::from);
    let seed = number("--seed", 1);
    let traits = arguments.get("--traits").map_or("", String::as_str);
    let traits: Vec<&str> = traits.split(',').filter(|name| !name.is_empty()).collect();
    let only = arguments.get("--only").map_or("", String::as_str);
    let only: Vec<u64> = only.split(',').filter_map(|text| text.parse().ok()).collect();
    let outcomes: Vec<Outcome> = (0..number("--pages", 300))
        .into_par_iter()
        .filter(|index| only.is_empty() || only.contains(index))
        .filter_map(|index| {
            let mut random = ChaCha8Rng::seed_from_u64(seed * 1_000_003 + index);
            let subject = &subjects[index as usize % subjects.len()];
            let page = compose(subject, &subjects, &mut random);
            if !traits.is_empty() && !page.traits.iter().any(|own| traits.contains(own)) {
                return None;
            }
            let rgba = image::DynamicImage::ImageRgb8(page.picture.clone()).into_rgba8();
            let proposal = propose(&rgba, &PageOptions::default(), &Silent);
            let outcome = judged(&page, &rgba, proposal.as_ref().ok(), &subject.name);
            if let Some(folder) = &saved {
                save(&folder.join(format!("{index:03}_{}", subject.name)), &page, subject)
                    .expect("a writable folder");
            }
            if let Some(folder) = &failures
                && (!outcome.whole || outcome.right < outcome.tellable)
            {
                let kind = if outcome.whole { "azimuth" } else { "figures" };
                page.picture.save(folder.join(format!("page_{index:03}.png"))).expect("the page");
                let path = folder.join(format!("{kind}_{index:03}_{}.png", subject.name));
                match &proposal {
                    Ok(proposal) => preview(&rgba, proposal).save(path),
                    Err(_) => page.picture.save(path),
                }
                .expect("the preview");
            }
            if let (Some(folder), Ok(proposal)) = (&failures, &proposal) {
                for &(k, iou) in outcome.cut.iter().filter(|(_, iou)| *iou < WELL_CUT) {
                    let name = format!("cut_{index:03}_{}_{k}_{iou:.2}.png", subject.name);
                    cut_out(&rgba, proposal, k).save(folder.join(name)).expect("the cut-out");
                }
            }
            Some(outcome)
        })
        .collect();
    report(&outcomes);
}

fn save(
    folder: &Path,
    page: &Page,
    subject: &models::Subject,
) -> Result<(), Box<dyn std::error::Error>> {
    std::fs::create_dir_all(folder.join("views"))?;
    page.picture.save(folder.join("page.png"))?;
    for view in &page.truth {
        view.alone.save(folder.join(format!("views/{}.png", view.azimuth_deg)))?;
    }
    let azimuths: Vec<String> = page.truth.iter().map(|v| v.azimuth_deg.to_string()).collect();
    std::fs::write(folder.join("azimuths.txt"), azimuths.join(","))?;
    let vertices = subject.mesh.positions.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = subject.mesh.triangles.iter().map(|t| {
        let [a, b, c] = t.map(|index| index + 1);
        format!("f {a} {b} {c}\n")
    });
    std::fs::write(folder.join("model.obj"), vertices.chain(faces).collect::<String>())?;
    Ok(())
}

/// Time and memory for one composed page enlarged to `size`.
fn large(subjects: &[models::Subject], size: &str) {
    let sides: Vec<u32> = size.split('x').map(|side| side.parse().expect("a size")).collect();
    let mut random = ChaCha8Rng::seed_from_u64(7);
    let page = compose(&subjects[0], subjects, &mut random).picture;
    let filter = image::imageops::FilterType::Triangle;
    let page = image::imageops::resize(&page, sides[0], sides[1], filter);
    let page = image::DynamicImage::ImageRgb8(page).into_rgba8();
    let memory = |name: &str| -> f64 {
        let status = std::fs::read_to_string("/proc/self/status").unwrap_or_default();
        let line = status.lines().find(|line| line.starts_with(name)).unwrap_or_default();
        line.split_whitespace().nth(1).and_then(|kib| kib.parse().ok()).unwrap_or(0.0) * 1024.0
    };
    // The peak so far is forgotten, that of the search alone counts.
    let _ = std::fs::write("/proc/self/clear_refs", "5");
    let before = memory("VmRSS:") - page.as_raw().len() as f64;
    let started = Instant::now();
    let found = propose(&page, &PageOptions::default(), &Silent).map(|p| p.figures.len());
    let seconds = started.elapsed().as_secs_f64();
    let bytes = (memory("VmHWM:") - before) / f64::from(sides[0]) / f64::from(sides[1]);
    println!(
        "{size}: {found:?} figures in {seconds:.2} s, {bytes:.1} bytes a pixel, page included"
    );
}

fn iou(a: [u32; 4], b: [u32; 4]) -> f64 {
    let side = |low: u32, high: u32| f64::from(high.saturating_sub(low));
    let area = |r: [u32; 4]| side(r[0], r[2]) * side(r[1], r[3]);
    let both = side(a[0].max(b[0]), a[2].min(b[2])) * side(a[1].max(b[1]), a[3].min(b[3]));
    both / (area(a) + area(b) - both).max(1.0)
}

/// The silhouette in a drawing, that a reconstruction would find; none where it refuses.
fn silhouette(drawing: &RgbaImage) -> GrayImage {
    let found = subject::find(drawing, &Hints::default(), &SubjectOptions::default(), &|| false);
    found.map_or_else(|_| GrayImage::new(drawing.width(), drawing.height()), |found| found.mask)
}

/// IoU of what is found in a view's cut-out and in its drawing alone, each in its place.
fn silhouette_iou(page: &RgbaImage, proposal: &PageProposal, k: usize, view: &Placed) -> f64 {
    let cut = silhouette(&cut_out(page, proposal, k));
    let around = with_margin(&proposal.figures[k].place, page.dimensions());
    let alone = silhouette(&image::DynamicImage::ImageRgb8(view.alone.clone()).into_rgba8());
    let margin = (alone.height() - (view.bounds[3] - view.bounds[1])) / 2;
    let at = |mask: &GrayImage, x: i64, y: i64| {
        let place = u32::try_from(x).ok().zip(u32::try_from(y).ok());
        let pixel = place.and_then(|(x, y)| mask.get_pixel_checked(x, y));
        pixel.is_some_and(|pixel| pixel.0[0] > 0)
    };
    let (mut both, mut either) = (0_u32, 0_u32);
    // Both lie within the cut-out and the drawing about the view.
    let rows = view.bounds[1].min(around.top)..view.bounds[3].max(around.bottom);
    let columns = view.bounds[0].min(around.left)..view.bounds[2].max(around.right);
    for y in rows.map(i64::from) {
        for x in columns.clone().map(i64::from) {
            let a = at(&cut, x - i64::from(around.left), y - i64::from(around.top));
            let (left, top) = (i64::from(view.bounds[0]), i64::from(view.bounds[1]));
            let margin = i64::from(margin);
            let b = at(&alone, x - left + margin, y - top + margin);
            both += u32::from(a && b);
            either += u32::from(a || b);
        }
    }
    f64::from(both) / f64::from(either.max(1))
}

fn judged(
    page: &Page,
    rgba: &RgbaImage,
    proposal: Option<&PageProposal>,
    subject: &str,
) -> Outcome {
    let mut own = Outcome {
        traits: page.traits.clone(),
        subject: subject.to_owned(),
        tellable: page.truth.iter().filter(|view| view.tellable).count(),
        all_views: page.truth.len(),
        ..Outcome::default()
    };
    let Some(proposal) = proposal else {
        own.missed = page.truth.len();
        return own;
    };
    let mut free: Vec<bool> = vec![true; proposal.figures.len()];
    let mut told = Vec::new();
    for view in &page.truth {
        let iou_of = |k: usize| {
            let p = proposal.figures[k].place;
            iou([p.left, p.top, p.right, p.bottom], view.bounds)
        };
        let best =
            (0..free.len()).filter(|&k| free[k]).max_by(|&a, &b| iou_of(a).total_cmp(&iou_of(b)));
        let Some(k) = best.filter(|&k| iou_of(k) >= 0.5) else {
            own.missed += 1;
            continue;
        };
        free[k] = false;
        own.found += 1;
        own.ious.push(iou_of(k));
        own.cut.push((k, silhouette_iou(rgba, proposal, k, view)));
        let figure = &proposal.figures[k];
        let off = (figure.azimuth.degrees() - view.azimuth_deg).rem_euclid(360.0);
        let right = off.min(360.0 - off) < 22.5;
        told.push(format!("{}/{}", figure.azimuth, view.azimuth_deg));
        own.all_right += usize::from(right);
        if view.tellable {
            own.right += usize::from(right);
            own.stated.push((figure.confidence, right));
        }
    }
    own.false_ones = free.iter().filter(|is| **is).count();
    own.whole = own.missed == 0 && own.false_ones == 0;
    own.note = told.join(" ");
    own
}

fn share(part: usize, whole: usize) -> String {
    format!("{part}/{whole} = {:.1} %", 100.0 * part as f64 / whole.max(1) as f64)
}

fn report(outcomes: &[Outcome]) {
    let sum = |of: &dyn Fn(&Outcome) -> usize| outcomes.iter().map(of).sum::<usize>();
    let ious: Vec<f64> = outcomes.iter().flat_map(|o| o.ious.clone()).collect();
    for outcome in outcomes.iter().filter(|o| !o.whole || o.right < o.tellable) {
        println!(
            "{} missed {} false {} azimuths {}/{} [{}] ({})",
            outcome.subject,
            outcome.missed,
            outcome.false_ones,
            outcome.right,
            outcome.tellable,
            outcome.note,
            outcome.traits.join(", "),
        );
    }
    println!(
        "pages with every figure and none false: {}",
        share(sum(&|o| o.whole.into()), outcomes.len())
    );
    println!(
        "figures found {}, missed {}, false {}",
        sum(&|o| o.found),
        sum(&|o| o.missed),
        sum(&|o| o.false_ones)
    );
    println!(
        "boxes with IoU above .9: {}; mean {:.3}",
        share(ious.iter().filter(|v| **v > 0.9).count(), ious.len()),
        ious.iter().sum::<f64>() / ious.len().max(1) as f64
    );
    let silhouettes: Vec<f64> = outcomes.iter().flat_map(|o| &o.cut).map(|(_, iou)| *iou).collect();
    println!(
        "silhouettes of cut-outs as of drawings alone, IoU above .95: {}; mean {:.3}",
        share(silhouettes.iter().filter(|v| **v > WELL_CUT).count(), silhouettes.len()),
        silhouettes.iter().sum::<f64>() / silhouettes.len().max(1) as f64
    );
    println!(
        "azimuths right where they can be told: {}",
        share(sum(&|o| o.right), sum(&|o| o.tellable))
    );
    println!(
        "azimuths right of all views: {}",
        share(sum(&|o| o.all_right), sum(&|o| o.all_views))
    );
    report_confidence(&outcomes.iter().flat_map(|o| o.stated.clone()).collect::<Vec<_>>());
    let mut by: BTreeMap<&str, (usize, usize)> = BTreeMap::new();
    for outcome in outcomes {
        for name in &outcome.traits {
            let (whole, all) = by.entry(name).or_default();
            *whole += usize::from(outcome.whole);
            *all += 1;
        }
    }
    for (name, (whole, all)) in by {
        println!("  {name}: {}", share(whole, all));
    }
}

/// How far the stated confidence is what it says, all in all and by fifths.
fn report_confidence(stated: &[(f64, bool)]) {
    let mean = |of: &[(f64, bool)]| {
        of.iter().map(|(confidence, _)| confidence).sum::<f64>() / of.len().max(1) as f64
    };
    let (right, wrong): (Vec<_>, Vec<_>) = stated.iter().partition(|(_, right)| *right);
    println!(
        "mean confidence {:.3}, where right {:.2}, where wrong {:.2}",
        mean(stated),
        mean(&right),
        mean(&wrong)
    );
    for fifth in 0..5 {
        let within = |(confidence, _): &&(f64, bool)| (confidence * 5.0).min(4.0) as usize == fifth;
        let own: Vec<(f64, bool)> = stated.iter().filter(within).copied().collect();
        if !own.is_empty() {
            let right = own.iter().filter(|(_, right)| *right).count();
            println!("  stated {:.2}: right {}", mean(&own), share(right, own.len()));
        }
    }
}
