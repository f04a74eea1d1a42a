//! Drafts of many models against the models: intersection over union by kind.
//!
//!     corpus_iou INDEX FOLDER [--sets T5,FQS] [--prior off,on,auto] [--size 480x270]
//!                [--every N] [--limit N] [--names a,b] [--hull] [--cells 128] [--holes auto] [--boxy auto]
//!                [--pictures FOLDER] [--meshes FOLDER] [--degrade light|middle|heavy]
//!                [--apart PERCENT] [--seed N]
//!
//! INDEX is a Markdown table whose first two columns are name and kind; FOLDER
//! holds NAME.glb. Outlines are closed: each view comes with its true mask.

use std::collections::BTreeMap;
use std::error::Error;
use std::path::{Path, PathBuf};
use std::time::Instant;

use drawing::{DegradeOptions, DegradePreset, DrawOptions, Drawer, PreparedModel};
use evaluation::{ComparisonOptions, SolidTruth};
use frames::Azimuth;
use image::{GrayImage, Luma};
use imageproc::geometric_transformations::{Border, Interpolation, warp_with};
use mesh::Mesh;
use mesh::read::{Limits, ModelFormat, load};
use progress::Silent;
use sheet::{Sheet, View};
use turntable::options::{Holes, SolidKind, Switch, TurntableOptions};

type Fallible<T> = Result<T, Box<dyn Error>>;

/// Models whose inside is open tell little.
const CLOSED: f64 = 0.6;

struct Arguments {
    positional: Vec<String>,
    named: BTreeMap<String, String>,
}

impl Arguments {
    fn parse() -> Self {
        let (mut positional, mut named) = (Vec::new(), BTreeMap::new());
        let mut words = std::env::args().skip(1).peekable();
        while let Some(word) = words.next() {
            match word.strip_prefix("--") {
                Some(name) => {
                    let value = words.next_if(|next| !next.starts_with("--"));
                    named.insert(name.to_owned(), value.unwrap_or_default());
                }
                None => positional.push(word),
            }
        }
        Self { positional, named }
    }

    fn get<'a>(&'a self, name: &str, default: &'a str) -> &'a str {
        self.named.get(name).map_or(default, String::as_str)
    }
}

struct Entry {
    name: String,
    figure: bool,
    solid: f64,
}

fn entries(index: &str, folder: &Path) -> Vec<Entry> {
    let rows = index.lines().filter_map(|line| {
        let cells: Vec<&str> = line.split('|').map(str::trim).collect();
        let (name, kind) = (*cells.get(1)?, *cells.get(2)?);
        // Dev rows have a family before the source and a leak after the share.
        let solid = cells.get(if cells.len() > 9 { 7 } else { 6 })?.parse().unwrap_or(0.0);
        let figure =
            ["humanoid", "animal", "quadruped", "bird"].iter().any(|k| kind.starts_with(k));
        folder.join(format!("{name}.glb")).exists().then(|| Entry {
            name: name.to_owned(),
            figure,
            solid,
        })
    });
    rows.collect()
}

fn azimuths(set: &str) -> Vec<f64> {
    match set {
        "FB" => vec![0.0, 180.0],
        "FS" => vec![0.0, 90.0],
        "FSB" => vec![0.0, 90.0, 180.0],
        "FQS" => vec![0.0, 45.0, 90.0],
        "FQSB" => vec![0.0, 45.0, 90.0, 180.0],
        "T5" => vec![0.0, 45.0, 90.0, 135.0, 180.0],
        "8-turn" => (0..8).map(|i| f64::from(i) * 45.0).collect(),
        dense => {
            let step: f64 = dense.rsplit(':').next().and_then(|s| s.parse().ok()).unwrap_or(15.0);
            (0..=(90.0 / step) as u32).map(|i| f64::from(i) * step).collect()
        }
    }
}

fn sheet_of(
    drawer: &Drawer<'_>,
    degrees: &[f64],
    degraded: bool,
    apart: f64,
    seed: u64,
) -> Fallible<Sheet> {
    use rayon::prelude::*;
    let view = |&degrees: &f64| -> Result<View, String> {
        let azimuth = Azimuth::from_degrees(degrees).map_err(|e| e.to_string())?;
        let drawn = drawer.draw_view(azimuth.into()).map_err(|e| e.to_string())?;
        let mask = (!degraded).then_some(drawn.truth.mask);
        Ok(View::level(azimuth, drawn.image.to_luma8(), mask))
    };
    let mut views: Vec<View> = degrees.par_iter().map(view).collect::<Result<_, _>>()?;
    if apart > 0.0 {
        for (view, seed) in views.iter_mut().zip(seed * 1000..) {
            *view = drawn_apart(view, apart, seed);
        }
    }
    Ok(Sheet::new(views)?)
}

/// A drawing and its mask as a hand would draw them apart from the other views:
/// heights, widths and places off by up to `amount` of the subject's height.
fn drawn_apart(view: &View, amount: f64, seed: u64) -> View {
    use rand::{Rng, SeedableRng};
    let mut random = rand_chacha::ChaCha8Rng::seed_from_u64(seed);
    let (width, height) = view.image.dimensions();
    let mut wave = || {
        let waves: Vec<[f64; 3]> = (1..4)
            .map(|n| {
                [
                    random.random_range(-1.0..1.0),
                    f64::from(n) * std::f64::consts::PI,
                    random.random_range(0.0..6.3),
                ]
            })
            .collect();
        move |at: f64| {
            waves
                .iter()
                .map(|[size, pace, start]| size * (pace * at + start).sin() / 2.0)
                .sum::<f64>()
        }
    };
    let (up, lean, wide) = (wave(), wave(), wave());
    let reach = amount * f64::from(height);
    let source = |x: f32, y: f32| {
        let (x, y) = (f64::from(x), f64::from(y));
        let at = y / f64::from(height);
        let middle = f64::from(width) / 2.0;
        let from_axis = (x - middle) * (1.0 + amount * wide(at));
        ((middle + from_axis + reach * lean(at)) as f32, (y + reach * up(at)) as f32)
    };
    let warped = |picture: &GrayImage, outside: u8| {
        warp_with(picture, source, Interpolation::Bilinear, Border::Constant(Luma([outside])))
    };
    let mask = view.mask.as_ref().map(|mask| {
        let mut warped = warped(mask, 0);
        warped.pixels_mut().for_each(|p| p.0[0] = if p.0[0] >= 128 { 255 } else { 0 });
        warped
    });
    View { image: warped(&view.image, 255), mask, ..view.clone() }
}

fn switch(word: &str) -> Switch {
    match word {
        "on" => Switch::On,
        "off" => Switch::Off,
        _ => Switch::Auto,
    }
}

fn variants(arguments: &Arguments) -> Vec<(String, TurntableOptions)> {
    let mut base = TurntableOptions::default();
    base.solid.holes = match arguments.get("holes", "auto") {
        "off" => Holes::Off,
        "eager" => Holes::Eager,
        _ => Holes::Auto,
    };
    let mut variants = Vec::new();
    if arguments.named.contains_key("hull") {
        let mut options = base.clone();
        options.solid.kind = SolidKind::Hull;
        options.solid.holes = Holes::Off;
        options.solid.prior = Switch::Off;
        variants.push(("hull".to_owned(), options));
    }
    for prior in arguments.get("prior", "off,on,auto").split(',') {
        let mut options = base.clone();
        options.solid.boxy =
            switch(if prior == "boxy" { "on" } else { arguments.get("boxy", "auto") });
        options.solid.prior = switch(prior);
        variants.push((prior.to_owned(), options));
    }
    variants
}

/// As Wavefront OBJ, turntable frame.
fn obj(mesh: &Mesh) -> String {
    let vertices = mesh.positions.iter().map(|p| format!("v {} {} {}\n", p.x, p.y, p.z));
    let faces = mesh.triangles.iter().map(|[a, b, c]| format!("f {} {} {}\n", a + 1, b + 1, c + 1));
    vertices.chain(faces).collect()
}

type Sums = BTreeMap<(String, &'static str), Vec<(String, f64)>>;

fn measure(entry: &Entry, folder: &Path, arguments: &Arguments, sums: &mut Sums) -> Fallible<()> {
    let size: Vec<u32> =
        arguments.get("size", "480x270").split('x').filter_map(|side| side.parse().ok()).collect();
    let mut draw =
        DrawOptions { width_px: size[0], height_px: size[1], fit: true, ..DrawOptions::default() };
    if let Some(preset) = arguments.named.get("degrade") {
        let preset = match preset.as_str() {
            "light" => DegradePreset::Light,
            "middle" => DegradePreset::Middle,
            "heavy" => DegradePreset::Heavy,
            other => return Err(format!("--degrade {other}: give light, middle or heavy").into()),
        };
        draw.degrade = DegradeOptions::preset(preset, arguments.get("seed", "1").parse()?);
    }
    let bytes = std::fs::read(folder.join(format!("{}.glb", entry.name)))?;
    let model = load(&bytes, ModelFormat::Glb, None, &Limits::default())?;
    let model = PreparedModel::new(&model)?;
    let prepared = model.placed(&draw);
    let drawer = Drawer::new(&prepared, &draw)?;
    let mut truth = prepared.mesh().clone();
    truth.positions.iter_mut().for_each(|p| p.coords *= draw.pixels_per_unit());
    let cells = arguments.get("cells", "128").parse()?;
    let comparison = ComparisonOptions { grid_cells: cells, samples: 2000, ..Default::default() };
    let truth = SolidTruth::new(&truth, comparison)?;
    for set in arguments.get("sets", "T5").split(',') {
        let (apart, seed) = (
            arguments.get("apart", "0").parse::<f64>()? / 100.0,
            arguments.get("seed", "1").parse()?,
        );
        let degraded = arguments.named.contains_key("degrade");
        let sheet = sheet_of(&drawer, &azimuths(set), degraded, apart, seed)?;
        let mut line =
            format!("{:28} {} {set:7}", entry.name, if entry.figure { 'f' } else { 'o' });
        for (name, options) in variants(arguments) {
            let start = Instant::now();
            let draft = turntable::reconstruct(&sheet, &[], &options, &Silent)?;
            let seconds = start.elapsed().as_secs_f64();
            let found = truth.evaluate(&draft.solid.mesh)?;
            let (iou, normals) = (found.iou, found.surface.normal_consistency);
            line += &format!("  {name} {iou:.3} ({seconds:.1} s) nc {normals:.3}");
            if let Some(report) = &draft.solid.report.prior {
                line += &format!(" prior {}", report.used);
            }
            if let Some(folder) = arguments.named.get("meshes") {
                let path = PathBuf::from(folder).join(format!("{}_{set}_{name}.obj", entry.name));
                std::fs::write(path, obj(&draft.solid.mesh))?;
            }
            if let Some(folder) = arguments.named.get("pictures") {
                let path = PathBuf::from(folder).join(format!("{}_{set}_{name}.png", entry.name));
                std::fs::write(path, mesh::thumbnail(&draft.solid.mesh)?)?;
            }
            let kind = if entry.figure { "figures" } else { "others" };
            for group in [kind, "all"] {
                let of = sums.entry((format!("{set} {name}"), group)).or_default();
                of.push((entry.name.clone(), iou));
            }
            if entry.solid >= CLOSED {
                let of = sums.entry((format!("{set} {name}"), "closed")).or_default();
                of.push((entry.name.clone(), iou));
            }
        }
        println!("{line}");
    }
    Ok(())
}

fn main() -> Fallible<()> {
    let arguments = Arguments::parse();
    let [index, folder] = &arguments.positional[..] else {
        return Err("give INDEX and FOLDER".into());
    };
    let folder = Path::new(folder);
    let all = entries(&std::fs::read_to_string(index)?, folder);
    let every: usize = arguments.get("every", "1").parse()?;
    let limit: usize = arguments.get("limit", "100000").parse()?;
    let names: Vec<&str> =
        arguments.get("names", "").split(',').filter(|n| !n.is_empty()).collect();
    let chosen = all.iter().filter(|entry| names.is_empty() || names.contains(&&*entry.name));
    let closed = arguments.named.contains_key("closed");
    let chosen = chosen.filter(|entry| !closed || entry.solid >= CLOSED);
    let mut sums = Sums::new();
    for entry in chosen.step_by(every).take(limit) {
        if let Err(error) = measure(entry, folder, &arguments, &mut sums) {
            println!("{:28} {error}", entry.name);
        }
    }
    for ((variant, group), ious) in &sums {
        let mean = ious.iter().map(|(_, iou)| iou).sum::<f64>() / ious.len() as f64;
        println!("MEAN {variant:14} {group:8} {:4} {mean:.3}", ious.len());
    }
    Ok(())
}
