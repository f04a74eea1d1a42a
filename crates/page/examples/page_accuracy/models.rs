//! Views of models to compose pages from: built-in ones, or files of a folder.

use std::path::Path;

use drawing::{DrawOptions, Drawer, PreparedModel};
use frames::Azimuth;
use image::{GrayImage, RgbImage, imageops};
use mesh::Mesh;
use mesh::builtin::ProceduralModel;
use mesh::read::{Limits, Model, ModelFormat, load};

/// Views are drawn at eight azimuths.
pub(crate) const STEP_DEG: f64 = 45.0;
/// Height of the drawings, px.
const SIDE_PX: u32 = 400;

/// One drawn view, cropped to its own bounds.
pub(crate) struct Drawn {
    /// 255 is full ink.
    pub(crate) ink: GrayImage,
    /// 255 inside.
    pub(crate) mask: GrayImage,
    /// Normals as colours.
    pub(crate) normals: RgbImage,
}

/// The views of one model, by azimuth in steps of [`STEP_DEG`].
pub(crate) struct Subject {
    pub(crate) name: String,
    /// As it was drawn: Z up, centred.
    pub(crate) mesh: Mesh,
    pub(crate) views: Vec<Drawn>,
    /// Whether a person could tell each view from all others.
    pub(crate) tellable: Vec<bool>,
}

/// Views of the built-in models that are one piece.
pub(crate) fn built_in() -> Vec<Subject> {
    let whole = |model: &ProceduralModel| !matches!(model, ProceduralModel::Objects);
    let models = ProceduralModel::ALL.into_iter().filter(whole);
    models.filter_map(|model| drawn(model.name(), &model.build())).collect()
}

/// Views of the GLB models in a folder, evenly chosen, at most `most`; only those
/// whose name holds one of `names`, if there are any.
pub(crate) fn of_folder(folder: &Path, most: usize, names: &[&str]) -> Vec<Subject> {
    let entries = std::fs::read_dir(folder).expect("the folder of models");
    let mut paths: Vec<_> = entries.flatten().map(|entry| entry.path()).collect();
    paths.retain(|path| path.extension().is_some_and(|extension| extension == "glb"));
    let named = |path: &std::path::PathBuf| {
        let name = path.to_string_lossy();
        names.is_empty() || names.iter().any(|wanted| name.contains(wanted))
    };
    paths.retain(named);
    paths.sort();
    let step = paths.len().div_ceil(most.max(1)).max(1);
    let chosen: Vec<_> = paths.into_iter().step_by(step).collect();
    let read = |path: &std::path::PathBuf| {
        let bytes = std::fs::read(path).ok()?;
        let model = load(&bytes, ModelFormat::Glb, None, &Limits::default()).ok()?;
        drawn(&path.file_stem()?.to_string_lossy(), &model)
    };
    use rayon::prelude::*;
    chosen.par_iter().filter_map(read).collect()
}

fn drawn(name: &str, model: &Model) -> Option<Subject> {
    let options = DrawOptions {
        width_px: SIDE_PX * 3 / 2,
        height_px: SIDE_PX,
        fit: true,
        line_width_px: 1.8,
        ..DrawOptions::default()
    };
    let fitted = drawing_fit(model, &options)?;
    let drawer = Drawer::new(&fitted, &DrawOptions { fit: false, ..options }).ok()?;
    let view = |k: usize| {
        let azimuth = Azimuth::from_degrees(k as f64 * STEP_DEG).ok()?;
        let view = drawer.draw_view(azimuth.into()).ok()?;
        let ink = view.image.to_luma8();
        let bounds = bounds_of(&ink, &view.truth.mask)?;
        let [x, y, w, h] = bounds;
        let mut ink = imageops::crop_imm(&ink, x, y, w, h).to_image();
        ink.iter_mut().for_each(|level| *level = 255 - *level);
        Some(Drawn {
            ink,
            mask: imageops::crop_imm(&view.truth.mask, x, y, w, h).to_image(),
            normals: imageops::crop_imm(&view.truth.normals, x, y, w, h).to_image(),
        })
    };
    let views: Vec<Drawn> = (0..8).map(view).collect::<Option<_>>()?;
    let tellable = (0..8).map(|k| (0..8).all(|j| j == k || differ(&views[k], &views[j]))).collect();
    Some(Subject { name: name.to_owned(), mesh: fitted.mesh().clone(), views, tellable })
}

/// The model centred and scaled to the drawing's frame.
fn drawing_fit(model: &Model, options: &DrawOptions) -> Option<PreparedModel> {
    let positions = &model.mesh.positions;
    let mut model = model.clone();
    let (mut low, mut high) = (positions.first()?.coords, positions.first()?.coords);
    for p in positions {
        (low, high) = (low.inf(&p.coords), high.sup(&p.coords));
    }
    let centre = (low + high) / 2.0;
    let reach =
        positions.iter().map(|p| (p.x - centre.x).hypot(p.y - centre.y)).fold(0.0, f64::max);
    let across = 0.45 * options.scale / reach.max(1e-9);
    let up = 0.46 * options.scale * f64::from(options.height_px)
        / f64::from(options.width_px)
        / ((high.z - low.z) / 2.0).max(1e-9);
    let scale = across.min(up);
    model.mesh.positions.iter_mut().for_each(|p| p.coords = (p.coords - centre) * scale);
    PreparedModel::new(&model).ok()
}

/// Left, top, width and height of what is inked or inside.
fn bounds_of(ink: &GrayImage, mask: &GrayImage) -> Option<[u32; 4]> {
    let is = |x: u32, y: u32| ink.get_pixel(x, y).0[0] < 128 || mask.get_pixel(x, y).0[0] > 0;
    let (w, h) = ink.dimensions();
    let columns: Vec<u32> = (0..w).filter(|&x| (0..h).any(|y| is(x, y))).collect();
    let rows: Vec<u32> = (0..h).filter(|&y| (0..w).any(|x| is(x, y))).collect();
    let (x, y) = (*columns.first()?, *rows.first()?);
    Some([x, y, columns.last()? - x + 1, rows.last()? - y + 1])
}

/// Whether two views look different: by their silhouettes, or by the lines in
/// them where the silhouettes are the same.
fn differ(a: &Drawn, b: &Drawn) -> bool {
    const SIDE: u32 = 96;
    let aspect = |d: &Drawn| f64::from(d.mask.width()) / f64::from(d.mask.height());
    if (aspect(a) / aspect(b)).ln().abs() > 0.06 {
        return true;
    }
    let small =
        |image: &GrayImage| imageops::resize(image, SIDE, SIDE, imageops::FilterType::Triangle);
    let off = |p: &GrayImage, q: &GrayImage| {
        let off = p.iter().zip(q.iter()).map(|(p, q)| f64::from(p.abs_diff(*q))).sum::<f64>();
        off / 255.0 / f64::from(SIDE * SIDE)
    };
    let blurred = |image: &GrayImage| imageops::blur(&small(image), 1.5);
    let (p, q) = (blurred(&a.ink), blurred(&b.ink));
    let drawn = p.iter().map(|p| f64::from(*p)).sum::<f64>() / 255.0 / f64::from(SIDE * SIDE);
    off(&small(&a.mask), &small(&b.mask)) > 0.03 || off(&p, &q) > 0.5 * drawn
}
