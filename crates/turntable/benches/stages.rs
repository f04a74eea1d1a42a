//! The hot stages of the default method, on the built-in caped figure.
//!
//! `cargo bench -p turntable`; times are of this machine: compare runs in turns.

use divan::Bencher;
use drawing::{DrawOptions, Drawer, PreparedModel};
use frames::{Elevation, Viewpoint, ViewpointList};
use mesh::builtin::ProceduralModel;
use progress::Silent;
use sheet::{Sheet, View};
use turntable::depth;
use turntable::options::TurntableOptions;
use turntable::silhouette::Silhouettes;
use turntable::solid::{self, SolidInput};
use turntable::views::ViewSet;

const SETS: [&str; 3] = ["0,45,90", "0:315:45", "0:90:5"];

fn main() {
    divan::main();
}

/// The figure drawn at azimuths as people write them.
fn drawn(azimuths: &str) -> Sheet {
    let model = PreparedModel::new(&ProceduralModel::CapedFigure.build()).expect("a model");
    let options = DrawOptions::default();
    let drawer = Drawer::new(&model, &options).expect("usual options");
    let list: ViewpointList = azimuths.parse().expect("a list of azimuths");
    let list = list.at(Elevation::LEVEL);
    let view = |viewpoint: &Viewpoint| {
        let drawn = drawer.draw_view(*viewpoint).expect("a view");
        View::level(viewpoint.azimuth, drawn.image.to_luma8(), None)
    };
    Sheet::new(list.iter().map(view).collect()).expect("a sheet")
}

fn views(sheet: &Sheet) -> ViewSet<'_> {
    let borrowed = sheet.views().iter().map(std::borrow::Cow::Borrowed);
    ViewSet::new(borrowed.collect()).expect("views that fit")
}

#[divan::bench(args = SETS)]
fn silhouettes(bencher: Bencher<'_, '_>, azimuths: &str) {
    let sheet = drawn(azimuths);
    let (views, options) = (views(&sheet), TurntableOptions::default());
    bencher.bench(|| Silhouettes::of_views(&views, &options.silhouette));
}

#[divan::bench(args = ["0:90:5"])]
fn depth_from_lines(bencher: Bencher<'_, '_>, azimuths: &str) {
    let sheet = drawn(azimuths);
    let (views, options) = (views(&sheet), TurntableOptions::default());
    let silhouettes = Silhouettes::of_views(&views, &options.silhouette).expect("silhouettes");
    bencher.bench(|| depth::estimate(&views, &silhouettes, &options.depth, &Silent));
}

#[divan::bench(args = SETS)]
fn solid_from_outlines(bencher: Bencher<'_, '_>, azimuths: &str) {
    let sheet = drawn(azimuths);
    let (views, options) = (views(&sheet), TurntableOptions::default());
    let silhouettes = Silhouettes::of_views(&views, &options.silhouette).expect("silhouettes");
    let input = SolidInput {
        views: &views,
        silhouettes: &silhouettes,
        elevated: &[],
        depth_maps: &[],
        hole_hints: &[],
    };
    bencher.bench(|| solid::build(&input, &options.solid, &Silent));
}

#[divan::bench(args = SETS)]
fn whole_draft(bencher: Bencher<'_, '_>, azimuths: &str) {
    let sheet = drawn(azimuths);
    let options = TurntableOptions::default();
    bencher.bench(|| turntable::reconstruct(&sheet, &[], &options, &Silent));
}
