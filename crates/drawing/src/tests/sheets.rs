//! Whole sheets, their files and options.

use serde_json::{Value, json};

use super::*;
use ::options::{OptionProblemKind, OptionSet, parse_set};
use artifacts::Artifact;
use progress::{Cancelled, Observer, Progress, Silent};

#[test]
fn refuses_what_cannot_be_drawn() {
    let model = PreparedModel::new(&cuboid([40.0; 3])).unwrap();
    let error = Drawer::new(&model, &DrawOptions::default()).err().unwrap();
    assert!(matches!(error, DrawError::CameraInsideModel { .. }), "{error}");
    assert_eq!(PreparedModel::new(&Model::default()).unwrap_err(), DrawError::NoTriangles);
    let mut broken = cuboid([1.0; 3]);
    broken.mesh.positions[3].y = f64::NAN;
    let error = PreparedModel::new(&broken).unwrap_err();
    assert!(matches!(error, DrawError::InvalidModel { .. }), "{error}");
    let options = DrawOptions { scale: f64::NAN, ..DrawOptions::default() };
    let cube = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let error = Drawer::new(&cube, &options).err().unwrap();
    let DrawError::Options(problems) = error else { panic!("{error}") };
    assert_eq!(problems.0[0].option, "scale");
    let wobble_rms_px = Some(f64::INFINITY);
    let degrade = DegradeOptions { wobble_rms_px, ..DegradeOptions::default() };
    let options = DrawOptions { degrade, ..DrawOptions::default() };
    let error = Drawer::new(&cube, &options).err().unwrap();
    assert!(matches!(error, DrawError::Options(_)), "{error}");
}

/// All files of a sheet.
fn sheet(
    model: &PreparedModel,
    azimuths: &[Azimuth],
    options: &DrawOptions,
    observer: &dyn Observer,
) -> Result<Vec<Artifact>, DrawError> {
    let mut files = Vec::new();
    let mut keep = |file| -> Result<(), DrawError> {
        files.push(file);
        Ok(())
    };
    let viewpoints: Vec<_> = azimuths.iter().map(|&azimuth| options.viewpoint(azimuth)).collect();
    draw_sheet(model, &viewpoints, options, &SheetLimits::default(), observer, &mut keep)?;
    Ok(files)
}

#[test]
fn a_fitted_model_fills_the_frame_without_leaving_it() {
    let model = PreparedModel::new(&cuboid([400.0, 100.0, 900.0])).unwrap();
    for elevation_deg in [0.0, 40.0] {
        let options = DrawOptions { fit: true, elevation_deg, ..small() };
        let azimuths = [0.0, 37.0, 90.0].map(azimuth);
        let files = sheet(&model, &azimuths, &options, &Silent).unwrap();
        let mask = files.iter().find(|file| file.name.starts_with("mask_000")).unwrap();
        let mask = image::load_from_memory(&mask.bytes).unwrap().into_luma8();
        let covered: Vec<_> = mask.enumerate_pixels().filter(|p| p.2.0[0] > 0).collect();
        assert!(covered.iter().all(|(x, y, _)| (1..191).contains(x) && (1..107).contains(y)));
        let rows = covered.iter().map(|p| p.1).max().unwrap() - covered[0].1;
        assert!(rows > 60, "{rows} rows");
    }
}

/// Asks to stop at once.
struct Stop;

impl Observer for Stop {
    fn progress(&self, _: Progress) {}

    fn is_cancelled(&self) -> bool {
        true
    }
}

#[test]
fn a_sheet_has_every_file_and_a_document_that_names_them() {
    let model = PreparedModel::new(&torus(1.2, 0.5, 24, 12)).unwrap();
    let azimuths = [90.0, 0.0, 22.5].map(azimuth);
    let files = sheet(&model, &azimuths, &small(), &Silent).unwrap();
    let names: Vec<_> = files.iter().map(|file| file.name.as_str()).collect();
    for stem in ["000", "022.5", "090"] {
        for kind in ["view_S.png", "view_S.svg", "depth_S.png", "depth_S.pfm", "mask_S.png"] {
            assert!(names.contains(&kind.replace('S', stem).as_str()), "{kind} {stem}");
        }
    }
    assert!(names.contains(&"disparity_000_022.5.pfm"));
    assert!(names.contains(&"disparity_022.5_000.pfm"));
    assert!(!names.iter().any(|name| name.starts_with("disparity_090")), "too far apart");
    assert!(!names.contains(&"degradation.json"));
    let sheet = &files.last().unwrap();
    assert_eq!(sheet.name, "sheet.json");
    let document: serde_json::Value = serde_json::from_slice(&sheet.bytes).unwrap();
    assert_eq!(document["truth"]["camera_distance"], 8.0);
    assert_eq!(document["truth"]["depth_counts_per_unit"], 4096.0);
    assert_eq!(document["views"][1]["azimuth_deg"], 22.5);
    for view in document["views"].as_array().unwrap() {
        assert!(names.contains(&view["image"].as_str().unwrap()));
        assert!(names.contains(&view["depth"].as_str().unwrap()));
    }
    assert!(names.contains(&document["truth"]["model"].as_str().unwrap()));
}

#[test]
fn the_same_bytes_whatever_the_number_of_threads() {
    let model = PreparedModel::new(&torus(1.2, 0.5, 24, 12)).unwrap();
    let options =
        DrawOptions { degrade: DegradeOptions::preset(DegradePreset::Middle, 7), ..small() };
    let azimuths = [0.0, 15.0, 30.0, 45.0].map(azimuth);
    let with_threads = |count: usize| {
        let pool = rayon::ThreadPoolBuilder::new().num_threads(count).build().unwrap();
        pool.install(|| sheet(&model, &azimuths, &options, &Silent).unwrap())
    };
    assert_eq!(with_threads(1), with_threads(3));
}

#[test]
fn drawing_stops_when_cancelled_and_refuses_bad_lists() {
    let model = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let draw = |azimuths: &[Azimuth], observer: &dyn Observer| {
        sheet(&model, azimuths, &small(), observer).map(|files| files.len())
    };
    let many: Vec<_> = (0..90).map(|step| azimuth(4.0 * f64::from(step))).collect();
    let cancelled = draw(&many, &Stop);
    assert_eq!(cancelled, Err(DrawError::Cancelled(Cancelled)));
    assert_eq!(draw(&[], &Silent), Err(DrawError::NoViews));
    let twice = draw(&[azimuth(0.0), azimuth(360.0)], &Silent);
    assert_eq!(twice, Err(DrawError::DuplicateView { view: azimuth(0.0).into() }));
}

#[test]
fn the_page_holds_all_views_with_labels() {
    let model = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let azimuths: Vec<_> = (0..9).map(|step| azimuth(40.0 * f64::from(step))).collect();
    let files = sheet(&model, &azimuths, &small(), &Silent).unwrap();
    let page = files.iter().find(|file| file.name == "page.png").unwrap();
    let page = image::load_from_memory(&page.bytes).unwrap().into_luma8();
    let cell = page.width() / 8;
    let ink_in = |left: u32, top: u32| {
        let inside = |x: u32, y: u32| x / cell == left && y / (page.height() / 2) == top;
        page.enumerate_pixels().filter(|(x, y, p)| inside(*x, *y) && p.0[0] < 128).count()
    };
    assert!((0..8).all(|column| ink_in(column, 0) > 50));
    assert!(ink_in(0, 1) > 50 && ink_in(1, 1) == 0, "the ninth view begins a row");
}

#[test]
fn options_have_ranges_and_refuse_unknown_names() {
    let schema = &DrawOptions::schema().document;
    assert_eq!(schema["properties"]["supersampling"]["maximum"], 4);
    assert_eq!(schema["properties"]["scale"]["default"], 7.3);
    let problem = |given: Value| parse_set::<DrawOptions>(&given).unwrap_err().0.remove(0);
    let unknown = problem(json!({"line_width": 2}));
    assert_eq!((unknown.option.as_str(), unknown.kind), ("line_width", OptionProblemKind::Unknown));
    assert!(unknown.detail.contains("/v1/sheet-options"), "{unknown:?}");
    let thick = problem(json!({"degrade": {"width_max_px": 33}}));
    assert_eq!(thick.option, "degrade.width_max_px");
    assert_eq!(problem(json!({"elevation_deg": 90})).option, "elevation_deg");
    let parsed: DrawOptions = parse_set(&json!({"degrade": {"preset": "heavy"}})).unwrap();
    assert_eq!(parsed.degrade.preset, Some(DegradePreset::Heavy));
    assert_eq!(parse_set::<DrawOptions>(&json!({})).unwrap(), DrawOptions::default());
    let all = serde_json::to_value(DrawOptions::default()).unwrap();
    assert_eq!(parse_set::<DrawOptions>(&all).unwrap(), DrawOptions::default());
}

#[test]
fn views_from_above_and_below_fit_and_are_named() {
    let model = PreparedModel::new(&cuboid([9.0, 2.0, 1.0])).unwrap();
    let options = DrawOptions { fit: true, ..small() };
    let list: frames::ViewpointList = "0,90,0@90,90@-90,45@-30".parse().unwrap();
    let viewpoints = list.at(options.elevation());
    let mut files = Vec::new();
    let mut keep = |file| -> Result<(), DrawError> {
        files.push(file);
        Ok(())
    };
    draw_sheet(&model, &viewpoints, &options, &SheetLimits::default(), &Silent, &mut keep).unwrap();
    let find = |name: &str| files.iter().find(|file| file.name == name).unwrap();
    let size = |name: &str| {
        let mask = image::load_from_memory(&find(name).bytes).unwrap().into_luma8();
        let covered = mask.enumerate_pixels().filter(|p| p.2.0[0] > 0);
        let places: Vec<[u32; 2]> = covered.map(|(x, y, _)| [x, y]).collect();
        assert!(places.iter().all(|[x, y]| (1..191).contains(x) && (1..107).contains(y)));
        [0, 1].map(|axis| {
            let (low, high) = places
                .iter()
                .fold((u32::MAX, 0), |(low, high), p| (low.min(p[axis]), high.max(p[axis])));
            f64::from(high - low + 1)
        })
    };
    // Wide and deep from above; its picture turned by a quarter at azimuth 90.
    let [front, top, below] = ["mask_000.png", "mask_000_e90.png", "mask_090_e-90.png"].map(size);
    assert!((top[0] - front[0]).abs() <= 1.0 && (top[1] * 4.5 - top[0]).abs() <= 5.0, "{top:?}");
    assert!((below[0] - top[1]).abs() <= 1.0 && (below[1] - top[0]).abs() <= 1.0, "{below:?}");
    let document: Value = serde_json::from_slice(&find("sheet.json").bytes).unwrap();
    let view = |index: usize| &document["views"][index];
    assert_eq!(view(1)["elevation_deg"], 90.0);
    assert_eq!(view(1)["image"], "view_000_e90.png");
    assert_eq!(view(0)["elevation_deg"], Value::Null);
    let twice = [viewpoints[1], Viewpoint { azimuth: azimuth(45.0), ..viewpoints[1] }];
    let refused = check_sheet(&model, &twice, &options, &SheetLimits::default());
    assert!(matches!(refused, Err(DrawError::DuplicateView { .. })), "{refused:?}");
}

#[test]
fn limits_are_checked_before_anything_is_drawn() {
    let model = PreparedModel::new(&cuboid([1.0; 3])).unwrap();
    let limits = SheetLimits { max_views: 3, max_pixels: 50_000, max_view_samples: 100_000 };
    let check = |views: u32, options: &DrawOptions| {
        let azimuths: Vec<_> = (0..views).map(|view| azimuth(f64::from(view)).into()).collect();
        check_sheet(&model, &azimuths, options, &limits)
    };
    assert_eq!(check(2, &small()), Ok(()));
    let too_many_views = DrawError::TooManyViews { found: 4, limit: 3 };
    assert_eq!(check(4, &small()), Err(too_many_views));
    let too_many_pixels = DrawError::TooManyPixels { found: 3 * 192 * 108, limit: 50_000 };
    assert_eq!(check(3, &small()), Err(too_many_pixels));
    let fine = DrawOptions { supersampling: 4, ..small() };
    let too_many_samples = DrawError::TooManySamples { found: 16 * 192 * 108, limit: 100_000 };
    assert_eq!(check(1, &fine), Err(too_many_samples));
    let near = DrawOptions { distance: 0.5, ..small() };
    assert!(matches!(check(1, &near), Err(DrawError::CameraInsideModel { .. })));
}

/// What a flood from the picture's border does not reach.
fn enclosed(image: &image::GrayImage) -> Vec<bool> {
    let (width, height) = (image.width() as usize, image.height() as usize);
    let paper = image.as_raw().iter().map(|&level| level >= 204).collect();
    let outside = picture::flooded(width, paper, picture::border(width, height));
    outside.iter().map(|outside| !outside).collect()
}

#[test]
fn no_flood_from_the_border_gets_into_a_drawing() {
    for built_in in mesh::builtin::ProceduralModel::ALL {
        let prepared = PreparedModel::new(&built_in.build()).unwrap();
        let options = small();
        let drawer = Drawer::new(&prepared, &options).unwrap();
        for degrees in [0.0, 22.5, 45.0, 90.0, 180.0, 270.0] {
            let view = drawer.draw_view(azimuth(degrees).into()).unwrap();
            let inside = enclosed(&view.image.to_luma8());
            let lost =
                view.truth.mask.iter().zip(&inside).filter(|(mask, is)| **mask != 0 && !**is);
            assert_eq!(lost.count(), 0, "{built_in:?} at {degrees}");
        }
    }
}
