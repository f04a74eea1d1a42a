//! Tests of whole drafts by the method `turntable`.

use std::collections::{BTreeMap, BTreeSet};

use image::{GrayImage, Luma};
use imageproc::drawing::draw_line_segment_mut;
use serde_json::{Value, json};

use super::tests::{
    Files, Watcher, input_error, metrics, png, run, sheet_of as uncalibrated_sheet, without_timings,
};
use super::*;
use artifacts::Artifact;
use progress::Silent;
use sheet::ViewDocument;

const SIDE: u32 = 128;
/// Half extents of the box that the tests draw, px.
const HALF: [f64; 3] = [26.0, 16.0, 38.0];

/// The box's visible edges as a camera on the turntable sees them.
fn drawing(azimuth_deg: f64) -> GrayImage {
    let (sin, cos) = azimuth_deg.to_radians().sin_cos();
    let centre = f64::from(SIDE) / 2.0;
    let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]].map(|[x, y]| {
        let (x, y) = (x * HALF[0], y * HALF[1]);
        (centre + x * cos + y * sin, y * cos - x * sin)
    });
    let (top, bottom) = ((centre - HALF[2]) as f32, (centre + HALF[2]) as f32);
    let mut image = GrayImage::from_pixel(SIDE, SIDE, Luma([255]));
    for index in 0..4 {
        let ends = [corners[index], corners[(index + 1) % 4]];
        // Faces run left to right when they face the camera.
        if ends[0].0 + 0.5 >= ends[1].0 {
            continue;
        }
        let [left, right] = ends.map(|(x, _)| x as f32);
        for thick in [-0.5, 0.5] {
            for (from, to) in [
                ((left, top + thick), (right, top + thick)),
                ((left, bottom + thick), (right, bottom + thick)),
                ((left + thick, top), (left + thick, bottom)),
                ((right + thick, top), (right + thick, bottom)),
            ] {
                draw_line_segment_mut(&mut image, from, to, Luma([0]));
            }
        }
    }
    image
}

fn turntable(drawings: impl IntoIterator<Item = (f64, GrayImage)>) -> (SheetDocument, Files) {
    let (mut document, files) = uncalibrated_sheet(drawings);
    document.options = Some(json!({
        "method": "turntable",
        "turntable": {"solid": {"resolution": 64, "target_faces": 3000}},
    }));
    (document, files)
}

fn boxes(azimuths: &[f64]) -> (SheetDocument, Files) {
    turntable(azimuths.iter().map(|&azimuth| (azimuth, drawing(azimuth))))
}

fn bytes_of<'a>(artifacts: &'a [Artifact], name: &str) -> &'a [u8] {
    let found = artifacts.iter().find(|artifact| artifact.name == name);
    &found.unwrap_or_else(|| panic!("{name} is missing")).bytes
}

/// Positions and triangles of the first mesh in a GLB.
fn model(glb: &[u8]) -> (Vec<[f32; 3]>, Vec<[u32; 3]>) {
    let (document, buffers, _) = gltf::import_slice(glb).unwrap();
    let mesh = document.meshes().next().unwrap();
    let (mut positions, mut triangles) = (Vec::new(), Vec::new());
    for primitive in mesh.primitives() {
        let first = positions.len() as u32;
        let reader = primitive.reader(|buffer| Some(&buffers[buffer.index()]));
        positions.extend(reader.read_positions().unwrap());
        let indices: Vec<u32> = reader.read_indices().unwrap().into_u32().collect();
        triangles
            .extend(indices.chunks_exact(3).map(|corner| [0, 1, 2].map(|k| corner[k] + first)));
    }
    (positions, triangles)
}

/// Directed edges between places that are not run back as often as forth.
fn open_edges(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> usize {
    let place = |index: u32| positions[index as usize].map(f32::to_bits);
    let mut balance: BTreeMap<_, i64> = BTreeMap::new();
    for corners in triangles {
        for k in 0..3 {
            let (a, b) = (place(corners[k]), place(corners[(k + 1) % 3]));
            *balance.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
        }
    }
    balance.values().filter(|&&count| count != 0).count()
}

/// Volume by the divergence theorem.
fn volume(positions: &[[f32; 3]], triangles: &[[u32; 3]]) -> f64 {
    let at = |index: u32| nalgebra::Vector3::from(positions[index as usize].map(f64::from));
    triangles.iter().map(|&[a, b, c]| at(a).cross(&at(b)).dot(&at(c)) / 6.0).sum()
}

#[test]
fn front_and_back_alone_make_a_draft_that_says_its_depth_is_a_guess() {
    let (document, files) = boxes(&[0.0, 180.0]);
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    assert_eq!(metrics["solid"]["depth_guessed"], true);
    assert_eq!(metrics["mesh"]["watertight"], true);
    let said = "views 0 and 180 look along one line";
    assert!(summary.warnings.iter().any(|w| w.starts_with(said)), "{summary:?}");
    // One from above cannot be placed on what is a guess.
    let (mut document, files) = boxes(&[0.0, 180.0, 90.0]);
    document.views[2].elevation_deg = Some(90.0);
    let (summary, _) = run(&document, &files, 2, &Silent).unwrap();
    for said in [said, "views from above and below are left out"] {
        assert!(summary.warnings.iter().any(|w| w.starts_with(said)), "{summary:?}");
    }
}

#[test]
fn three_views_become_a_closed_solid_of_the_right_size() {
    let (document, files) = boxes(&[0.0, 45.0, 90.0]);
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let (positions, triangles) = model(bytes_of(&artifacts, "solid.glb"));
    assert_eq!(open_edges(&positions, &triangles), 0);
    let extent = |axis: usize| {
        let values = positions.iter().map(|p| f64::from(p[axis]));
        (values.clone().fold(f64::INFINITY, f64::min), values.fold(f64::NEG_INFINITY, f64::max))
    };
    let (low, high) = extent(1);
    assert!(low.abs() < 1e-6 && (high - 1.8).abs() < 1e-6, "stands from {low} to {high} m");
    let metrics = metrics(&artifacts);
    let metre = metrics["pixels_per_metre"].as_f64().unwrap();
    for (axis, half) in [(0, HALF[0]), (1, HALF[2]), (2, HALF[1])] {
        let (low, high) = extent(axis);
        let found = (high - low) * metre;
        assert!((found - 2.0 * half).abs() < 4.0, "axis {axis} spans {found} px");
    }
    let truth = 8.0 * HALF.iter().product::<f64>();
    let share = volume(&positions, &triangles) * metre.powi(3) / truth;
    assert!((0.8..1.15).contains(&share), "{share} of the box's volume");
    assert_eq!(metrics["mesh"]["watertight"], true);
    assert!(metrics["mesh"]["triangles"].as_u64().unwrap() <= 3000);
    assert_eq!(metrics["views"][1]["depth"]["fallback"]["reason"], "no_neighbours");
    assert!(summary.warnings.iter().any(|w| w.contains("neighbours near")), "{summary:?}");
    // Without lines to match, depth is the solid's: the front of the box.
    let front = &metrics["views"][0]["depth"];
    assert_eq!(front["source"], "solid");
    for end in ["min", "max"] {
        let depth = front["range_px"][end].as_f64().unwrap();
        assert!((depth + HALF[1]).abs() < 3.0, "{front}");
    }
}

#[test]
fn depth_is_read_from_what_is_asked_for() {
    let source_of = |from: &str, azimuths: &[f64]| {
        let (mut document, files) = boxes(azimuths);
        let mut options = document.options.take().unwrap_or_else(|| json!({}));
        options["turntable"]["depth"] = json!({ "from": from });
        document.options = Some(options);
        let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
        let source = &metrics(&artifacts)["views"][1]["depth"]["source"];
        source.as_str().unwrap().to_owned()
    };
    let near = [0.0, 5.0, 10.0];
    let around = [0.0, 5.0, 10.0, 45.0, 90.0];
    assert_eq!(
        ["auto", "lines", "solid"].map(|from| source_of(from, &near)),
        ["lines", "lines", "solid"]
    );
    assert_eq!(
        ["auto", "lines", "solid"].map(|from| source_of(from, &around)),
        ["solid", "lines", "solid"]
    );
}

#[test]
fn a_view_that_contradicts_the_others_is_named_and_carves_nothing() {
    let quarter = (0..=6).map(|k| 15.0 * f64::from(k));
    let drawn =
        quarter.map(|azimuth| (azimuth, drawing(if azimuth == 45.0 { 90.0 } else { azimuth })));
    let (document, files) = turntable(drawn);
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    let contradicts = |index: usize| metrics["views"][index]["registration"]["contradicts"].clone();
    assert_eq!([contradicts(2), contradicts(3), contradicts(4)], [false, true, false]);
    let warned = |w: &String| w.contains("view 45 contradicts the others");
    assert!(summary.warnings.iter().any(warned), "{summary:?}");
    let (positions, triangles) = model(bytes_of(&artifacts, "solid.glb"));
    let metre = metrics["pixels_per_metre"].as_f64().unwrap();
    let truth = 8.0 * HALF.iter().product::<f64>();
    let share = volume(&positions, &triangles) * metre.powi(3) / truth;
    assert!((0.85..1.15).contains(&share), "{share} of the box's volume");
}

#[test]
fn every_artifact_is_there_and_readable() {
    let (document, files) = boxes(&[0.0, 45.0, 90.0]);
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let found: BTreeSet<_> = summary.artifacts.iter().map(String::as_str).collect();
    let of_views = ["0", "45", "90"].into_iter().flat_map(|azimuth| {
        [
            "depth.pfm",
            "depth.png",
            "disparity.pfm",
            "disparity.png",
            "fit.png",
            "normals.png",
            "silhouette.png",
            "subject.png",
        ]
        .map(|file| format!("views/{azimuth}/{file}"))
    });
    let whole = [
        "bundle.zip",
        "metrics.json",
        "sheet/page.png",
        "sheet/sheet.json",
        "sheet/view_000.png",
        "sheet/view_045.png",
        "sheet/view_090.png",
        "solid.glb",
        "solid.obj",
        "solid.mtl",
        "texture.png",
        "low_2000.glb",
        "low_500.glb",
        "solid.stl",
        "solid.3mf",
        "textured.glb",
        "relief.glb",
        "thumbnail.png",
        "timings.json",
    ];
    let expected: Vec<_> = of_views.chain(whole.map(str::to_owned)).collect();
    assert_eq!(found, expected.iter().map(String::as_str).collect());
    for artifact in artifacts.iter().filter(|artifact| artifact.media_type == "image/png") {
        image::load_from_memory(&artifact.bytes).unwrap();
    }
    let (textured, _, images) = gltf::import_slice(bytes_of(&artifacts, "textured.glb")).unwrap();
    assert!(textured.nodes().any(|node| node.name() == Some("ref_045")));
    // The model's texture, and a drawing behind it for each view.
    assert_eq!(images.len(), 4);
    let absent = metrics(&artifacts)["absent_artifacts"].clone();
    assert_eq!(absent[1]["name"], "hull.glb");
}

#[test]
fn large_drawings_are_reduced_and_places_go_along() {
    let (mut document, files) = boxes(&[0.0, 45.0, 90.0]);
    let whole = run(&document, &files, 2, &Silent).unwrap().1;
    let (width, height) = (
        metrics(&whole)["width_px"].as_f64().unwrap(),
        metrics(&whole)["height_px"].as_f64().unwrap(),
    );
    document.options.get_or_insert_with(|| json!({}))["sheet"] =
        json!({"max_megapixels": width * height / 4.0 / 1e6});
    document.holes =
        vec![HoleDocument { azimuth_deg: 45.0, elevation_deg: None, x: 60.0, y: 30.0 }];
    let (summary, reduced) = run(&document, &files, 2, &Silent).unwrap();
    assert!(summary.warnings[0].contains("reduced by 2.00"), "{:?}", summary.warnings);
    let found = metrics(&reduced);
    assert_eq!(found["width_px"].as_f64(), Some(width / 2.0));
    assert_eq!(found["sheet"]["drawings"][0]["reduced_by"], 2.0);
    let cleaned: Value = serde_json::from_slice(bytes_of(&reduced, "sheet/sheet.json")).unwrap();
    assert_eq!(
        (&cleaned["holes"][0]["x"], &cleaned["holes"][0]["y"]),
        (&json!(30.0), &json!(15.0))
    );
    // The same box, but for a pixel that is twice as large.
    let sides = |artifacts: &[Artifact]| {
        let (positions, _) = model(bytes_of(artifacts, "solid.glb"));
        [0, 1, 2].map(|axis| {
            let all = || positions.iter().map(|p| p[axis]);
            all().fold(f32::MIN, f32::max) - all().fold(f32::MAX, f32::min)
        })
    };
    for (whole, reduced) in sides(&whole).into_iter().zip(sides(&reduced)) {
        assert!((whole - reduced).abs() < 0.06 * whole, "{whole} {reduced}");
    }
}

#[test]
fn dense_views_take_depth_from_lines_and_near_is_white() {
    let (document, files) = boxes(&[35.0, 40.0, 45.0, 50.0, 55.0]);
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    assert!(metrics["views"][2]["depth"]["fallback"].is_null(), "{}", metrics["views"][2]);
    // At 45 degrees the corner (26, -16) is nearest, those at the outline are
    // 10 and 42 px behind it, seen from the camera.
    let picture = image::load_from_memory(bytes_of(&artifacts, "views/45/disparity.png"));
    let picture = picture.unwrap().to_luma8();
    let column = |x: f64, y: f64| {
        let turn = std::f64::consts::FRAC_1_SQRT_2;
        (f64::from(SIDE) / 2.0 + (x + y) * turn).round() as u32
    };
    let grey = |column: u32| picture.get_pixel(column, SIDE / 2).0[0];
    let near = grey(column(HALF[0], -HALF[1]));
    let far = grey(column(-HALF[0], -HALF[1]) + 3);
    assert!(near > 200 && near > far + 50, "near {near}, far {far}");
}

#[test]
fn threads_change_no_byte() {
    let (document, files) = boxes(&[0.0, 10.0, 20.0, 90.0]);
    let one = without_timings(run(&document, &files, 1, &Silent).unwrap().1);
    let four = without_timings(run(&document, &files, 4, &Silent).unwrap().1);
    for (one, four) in one.iter().zip(&four) {
        assert!(one == four, "{} depends on the number of threads", one.name);
    }
    assert_eq!(one.len(), four.len());
}

#[test]
fn progress_rises_and_cancelling_stops_at_the_next_unit() {
    let (document, files) = boxes(&[0.0, 90.0]);
    let whole = Watcher::default();
    run(&document, &files, 1, &whole).unwrap();
    let fractions = whole.fractions.into_inner().unwrap();
    assert!(fractions.windows(2).all(|pair| pair[0] <= pair[1]), "{fractions:?}");
    assert!((fractions[fractions.len() - 1] - 1.0).abs() < 1e-12);
    for cancel_after in [1, 4, 8, fractions.len() - 2] {
        let watcher = Watcher { cancel_after: Some(cancel_after), ..Watcher::default() };
        let error = run(&document, &files, 1, &watcher).unwrap_err();
        assert!(matches!(error, DraftError::Cancelled(_)), "{error}");
        let seen = watcher.fractions.into_inner().unwrap().len();
        assert!(seen <= cancel_after + 1, "{seen} steps after cancelling at {cancel_after}");
    }
}

#[test]
fn unsuitable_views_are_refused_with_a_remedy() {
    let blank = GrayImage::from_pixel(SIDE, SIDE, Luma([255]));
    let (document, files) = turntable([(0.0, drawing(0.0)), (90.0, blank)]);
    let (code, detail) = input_error(&document, &files);
    assert_eq!(code, "blank_view");
    assert!(detail.contains("view 90") && detail.contains("give a mask"), "{detail}");

    let (document, files) = boxes(&[0.0]);
    assert_eq!(input_error(&document, &files).0, "too_few_views");

    let (mut document, files) = boxes(&[0.0, 90.0]);
    document.views[1].elevation_deg = Some(30.0);
    assert_eq!(input_error(&document, &files).0, "too_few_views");

    let (mut document, mut files) = boxes(&[0.0, 90.0]);
    files.insert("90.png".to_owned(), png(&GrayImage::new(SIDE, SIDE / 2)));
    assert_eq!(input_error(&document, &files).0, "blank_view");
    ::options::merge(
        document.options.get_or_insert_default(),
        json!({"sheet": {"prepare": "off"}}),
    );
    assert_eq!(input_error(&document, &files).0, "invalid_views");
}

#[test]
fn views_in_frames_of_their_own_are_laid_on_one_canvas() {
    let (document, mut files) = boxes(&[0.0, 45.0, 90.0]);
    let (_, as_drawn) = run(&document, &files, 2, &Silent).unwrap();
    // The side, twice as large on a page of its own.
    let page = image::imageops::resize(
        &drawing(90.0),
        SIDE * 2,
        SIDE * 2,
        image::imageops::FilterType::Triangle,
    );
    let cropped = image::imageops::crop_imm(&page, 30, 20, SIDE * 2 - 70, SIDE * 2 - 40);
    files.insert("90.png".to_owned(), png(&cropped.to_image()));
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    let views = metrics["sheet"]["alignment"]["views"].as_array().unwrap();
    let scale = |index: usize| views[index]["transform"]["scale"].as_f64().unwrap();
    assert!((scale(2) / scale(0) - 0.5).abs() < 0.01, "{views:?}");
    let height = |artifacts: &[Artifact]| {
        let solid = bytes_of(artifacts, "solid.obj");
        let text = String::from_utf8_lossy(solid).into_owned();
        let vertices = text.lines().filter(|line| line.starts_with("v "));
        vertices
            .map(|line| line.split(' ').nth(1).unwrap().parse::<f64>().unwrap())
            .fold(0.0, f64::max)
    };
    assert!((height(&artifacts) / height(&as_drawn) - 1.0).abs() < 0.05);
    for fit in metrics["fit"].as_array().unwrap() {
        assert!(fit["silhouette_iou"].as_f64().unwrap() > 0.95, "{fit}");
    }
}

#[test]
fn views_of_almost_one_size_are_laid_on_one_canvas() {
    let (document, mut files) = boxes(&[0.0, 45.0, 90.0]);
    // Cut by hand: too little off to be moved for, and no longer of one size.
    let whole = drawing(45.0);
    let cut = image::imageops::crop_imm(&whole, 1, 0, SIDE - 2, SIDE - 1);
    files.insert("45.png".to_owned(), png(&cut.to_image()));
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    assert_eq!(metrics["sheet"]["alignment"]["views"].as_array().unwrap().len(), 3);
    for fit in metrics["fit"].as_array().unwrap() {
        assert!(fit["silhouette_iou"].as_f64().unwrap() > 0.95, "{fit}");
    }
}

/// The outline of a rectangle with paper around it.
fn rectangle(width: u32, height: u32, margin: u32) -> GrayImage {
    let within =
        |at: u32, size: u32, inset: u32| (margin + inset..margin + size - inset).contains(&at);
    GrayImage::from_fn(width + 2 * margin, height + 2 * margin, |x, y| {
        let inside = |inset: u32| within(x, width, inset) && within(y, height, inset);
        Luma([if inside(0) && !inside(2) { 0 } else { 255 }])
    })
}

#[test]
fn a_top_view_in_a_frame_of_its_own_is_laid_beside_the_others() {
    let (mut document, mut files) = boxes(&[0.0, 90.0]);
    // Twice as large as the others, on a page of its own.
    files.insert("top.png".to_owned(), png(&rectangle(4 * 26 + 2, 4 * 16 + 2, 9)));
    document.views.push(ViewDocument {
        image: "top.png".to_owned(),
        azimuth_deg: 0.0,
        elevation_deg: Some(90.0),
        ..ViewDocument::default()
    });
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let doubted = |text: &String| text.contains("0_e90");
    assert!(!summary.warnings.iter().any(doubted), "{:?}", summary.warnings);
    let metrics = metrics(&artifacts);
    let fit = &metrics["fit"][2];
    assert_eq!(fit["elevation_deg"], json!(90.0));
    // At its own scale it would be a quarter; one pixel all round is a tenth of so small an area.
    assert!(fit["silhouette_iou"].as_f64().unwrap() > 0.9, "{fit}");
    assert_eq!(metrics["solid"]["cuts"][0]["used"], json!(true));
    for name in ["views/0_e90/subject.png", "views/0_e90/depth.pfm", "sheet/view_000_e90.png"] {
        bytes_of(&artifacts, name);
    }
}

#[test]
fn small_figures_in_colour_are_enlarged_and_line_art_is_not() {
    let (document, mut files) =
        turntable([0.0, 90.0].map(|azimuth| (azimuth, rectangle(48, 64, 12))));
    let side = |metrics: &serde_json::Value| metrics["height_px"].as_u64();
    assert_eq!(side(&metrics(&run(&document, &files, 1, &Silent).unwrap().1)), Some(88));
    // An egg of 40 rows.
    let egg = image::RgbImage::from_fn(48, 64, |x, y| {
        let (u, v) = ((f64::from(x) - 23.5) / 12.0, (f64::from(y) - 31.5) / 20.0);
        image::Rgb(if u * u + v * v < 1.0 { [150, 90, 40] } else { [255; 3] })
    });
    for bytes in files.values_mut() {
        let mut png = std::io::Cursor::new(Vec::new());
        egg.write_to(&mut png, image::ImageFormat::Png).unwrap();
        *bytes = png.into_inner();
    }
    let (_, artifacts) = run(&document, &files, 1, &Silent).unwrap();
    let told = metrics(&artifacts);
    assert_eq!(side(&told), Some(64 * 5), "{told}");
    assert_eq!(told["sheet"]["alignment"]["views"][0]["transform"]["scale"], 5.0);
    // From the front it is an ellipse, without steps of five pixels.
    let (positions, _) = model(bytes_of(&artifacts, "solid.glb"));
    let (low, high) = positions
        .iter()
        .fold((f32::MAX, f32::MIN), |(low, high), p| (low.min(p[1]), high.max(p[1])));
    let (middle, half) = (f32::midpoint(low, high), (high - low) / 2.0);
    let radius = |p: &[f32; 3]| (p[0] / (half * 0.6)).hypot((p[1] - middle) / half);
    let farthest = positions.iter().map(radius).fold(0.0, f32::max);
    assert!((0.97..1.05).contains(&farthest), "{farthest}");
}

#[test]
fn the_canvas_grows_for_what_is_long_and_low() {
    let (mut document, files) = turntable([
        (0.0, rectangle(40, 24, 12)),
        (90.0, rectangle(150, 24, 12)),
        (1.0, rectangle(40, 150, 12)),
    ]);
    let top = document.views.iter_mut().find(|view| view.azimuth_deg == 1.0).unwrap();
    (top.azimuth_deg, top.elevation_deg) = (0.0, Some(90.0));
    let (_, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    let metrics = metrics(&artifacts);
    assert!(metrics["height_px"].as_u64().unwrap() >= 150, "{}", metrics["height_px"]);
    for fit in metrics["fit"].as_array().unwrap() {
        assert!(fit["silhouette_iou"].as_f64().unwrap() > 0.93, "{fit}");
    }
}

#[test]
fn a_canvas_larger_than_every_drawing_is_reduced() {
    let wide = GrayImage::from_fn(1600, 150, |x, y| {
        let inside =
            |margin| (margin..1600 - margin).contains(&x) && (margin..150 - margin).contains(&y);
        Luma([if inside(10) && !inside(14) { 0 } else { 255 }])
    });
    let (mut document, files) =
        turntable([(0.0, wide.clone()), (90.0, image::imageops::rotate90(&wide))]);
    let allowed = 0.4;
    document.options.get_or_insert_with(|| json!({}))["sheet"] = json!({"max_megapixels": allowed});
    let (summary, artifacts) = run(&document, &files, 2, &Silent).unwrap();
    assert!(
        summary.warnings.iter().any(|warning| warning.contains("canvas")),
        "{:?}",
        summary.warnings
    );
    let metrics = metrics(&artifacts);
    let side = |name: &str| metrics[name].as_f64().unwrap();
    let pixels = side("width_px") * side("height_px");
    assert!((0.9 * allowed..1.05 * allowed).contains(&(pixels / 1e6)), "{pixels}");
}

/// A drawing moved to the right and down.
fn moved(drawing: &GrayImage, right: u32, down: u32) -> GrayImage {
    GrayImage::from_fn(drawing.width(), drawing.height(), |x, y| {
        let from = x.checked_sub(right).zip(y.checked_sub(down));
        from.map_or(Luma([255]), |(x, y)| *drawing.get_pixel(x, y))
    })
}

#[test]
fn the_cleaned_sheet_sent_again_gives_the_same_draft() {
    let shaded = |azimuth: f64| {
        // Grey within, on paper that is not white.
        let mut image = drawing(azimuth);
        let (width, height) = image.dimensions();
        let paper = image.pixels().map(|level| level.0[0] > 200).collect();
        let outside = picture::flooded(
            width as usize,
            paper,
            picture::border(width as usize, height as usize),
        );
        for (level, outside) in image.pixels_mut().zip(outside) {
            level.0[0] = if outside { 225 } else { level.0[0].min(150) };
        }
        image
    };
    let sheets = [
        turntable([0.0, 45.0, 90.0].map(|azimuth| (azimuth, drawing(azimuth)))),
        turntable([0.0, 45.0, 90.0].map(|azimuth| (azimuth, shaded(azimuth)))),
        // Registered by a few pixels.
        turntable([
            (0.0, drawing(0.0)),
            (45.0, moved(&drawing(45.0), 0, 3)),
            (90.0, drawing(90.0)),
        ]),
    ];
    for (index, (mut document, files)) in sheets.into_iter().enumerate() {
        document.views[1].azimuth_confidence = Some(0.52);
        let (summary, first) = run(&document, &files, 2, &Silent).unwrap();
        let cleaned: SheetDocument =
            serde_json::from_slice(bytes_of(&first, "sheet/sheet.json")).unwrap();
        let named = |artifact: &Artifact| {
            let name = artifact.name.strip_prefix("sheet/")?;
            Some((name.to_owned(), artifact.bytes.to_vec()))
        };
        let files: Files = first.iter().filter_map(named).collect();
        let (summary_again, again) = run(&cleaned, &files, 2, &Silent).unwrap();
        // What was a guess is one still.
        let doubt = "view 45: its azimuth of 45 degrees is a guess that is 52 % sure";
        for summary in [summary, summary_again] {
            let told = summary.warnings.iter().filter(|text| text.starts_with(doubt)).count();
            assert_eq!(told, 1, "{:?}", summary.warnings);
        }
        for name in ["solid.glb", "solid.stl", "sheet/page.png", "sheet/sheet.json"] {
            assert!(bytes_of(&first, name) == bytes_of(&again, name), "{name} of sheet {index}");
        }
        let page = image::load_from_memory(bytes_of(&first, "sheet/page.png")).unwrap();
        assert!(page.width() > 3 * page.height() / 2, "three views side by side");
    }
}
