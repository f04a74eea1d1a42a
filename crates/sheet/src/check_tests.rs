//! What a document may and may not say.

use super::*;
use crate::HoleDocument;

const THREE: SheetRequirements =
    SheetRequirements { min_views: 3, max_views: 5, equal_sizes: true, elevated: true };

/// None of them need be level.
const ANY: SheetRequirements = SheetRequirements { min_views: 0, ..THREE };

fn document(degrees: &[f64]) -> SheetDocument {
    let view = |a: &f64| ViewDocument {
        image: format!("{a}.png"),
        azimuth_deg: *a,
        ..ViewDocument::default()
    };
    SheetDocument { views: degrees.iter().map(view).collect(), ..SheetDocument::default() }
}

fn level(degrees: f64) -> Viewpoint {
    Azimuth::from_degrees(degrees).unwrap().into()
}

#[test]
fn views_come_out_by_azimuth_with_the_default_elevation() {
    let mut sheet = document(&[90.0, -45.0, 0.0]);
    sheet.elevation_deg = 10.0;
    sheet.views[1].elevation_deg = Some(-5.0);
    let placed = check_document(&sheet, &ANY).unwrap();
    let found: Vec<_> =
        placed.iter().map(|v| (v.azimuth.degrees(), v.elevation.degrees(), &*v.image)).collect();
    assert_eq!(found, [(0.0, 10.0, "0.png"), (90.0, 10.0, "90.png"), (315.0, -5.0, "-45.png")]);
}

#[test]
fn places_by_hand_must_be_numbers_in_range() {
    let refused = |change: fn(&mut ViewDocument)| {
        let mut sheet = document(&[0.0, 45.0, 90.0]);
        change(&mut sheet.views[1]);
        check_document(&sheet, &THREE).err().map(|problem| problem.to_string())
    };
    assert_eq!(refused(|view| view.scale = Some(2.0)), None);
    let told = refused(|view| view.scale = Some(0.0)).unwrap();
    assert_eq!(told, "views[1].scale is 0; give a factor from 0.125 to 8");
    let told = refused(|view| view.azimuth_confidence = Some(1.5)).unwrap();
    assert_eq!(told, "views[1].azimuth_confidence is 1.5; give a share from 0 to 1");
    assert!(refused(|view| view.axis_x = Some(f64::NAN)).unwrap().contains("views[1].axis_x"));
    assert!(refused(|view| view.ground_y = Some(1e9)).unwrap().contains("views[1].ground_y"));
}

#[test]
fn counts_views_against_the_method_and_the_limit() {
    assert_eq!(
        check_document(&document(&[0.0, 45.0]), &THREE),
        Err(SheetProblem::TooFewViews { found: 2, required: 3 })
    );
    let six = document(&[0.0, 1.0, 2.0, 3.0, 4.0, 5.0]);
    assert_eq!(
        check_document(&six, &THREE),
        Err(SheetProblem::TooManyViews { found: 6, limit: 5 })
    );
}

#[test]
fn names_both_views_of_one_angle() {
    assert_eq!(
        check_document(&document(&[0.0, 45.0, 360.0]), &THREE),
        Err(SheetProblem::DuplicateView { view: level(0.0), first: 0, second: 2 })
    );
}

/// A document with these azimuths and elevations.
fn raised(views: &[(f64, f64)]) -> SheetDocument {
    let mut sheet = document(&views.iter().map(|view| view.0).collect::<Vec<_>>());
    for (view, &(_, elevation)) in sheet.views.iter_mut().zip(views) {
        view.elevation_deg = Some(elevation);
    }
    sheet
}

#[test]
fn views_are_told_apart_by_azimuth_and_elevation() {
    let refused = |views: &[(f64, f64)]| {
        check_document(&raised(views), &ANY).err().map(|problem| problem.to_string())
    };
    assert_eq!(refused(&[(0.0, 0.0), (0.0, 30.0), (0.0, -30.0), (0.0, 90.0)]), None);
    let told = refused(&[(45.0, 0.0), (0.0, 30.0), (360.0, 30.0)]).unwrap();
    assert!(told.contains("views[1] and views[2]"), "{told}");
    assert!(told.contains("azimuth 0, elevation 30"), "{told}");
    // Straight down the azimuth only turns the picture.
    let told = refused(&[(0.0, 90.0), (90.0, 90.0)]).unwrap();
    assert!(told.contains("straight above") && told.contains("turns the picture"), "{told}");
    assert_eq!(refused(&[(0.0, 90.0), (0.0, -90.0)]), None);
}

#[test]
fn level_views_are_counted_where_others_do_not_do() {
    let two = SheetRequirements { min_views: 2, ..THREE };
    let top = [(0.0, 0.0), (90.0, 0.0), (0.0, 90.0)];
    assert!(check_document(&raised(&top), &two).is_ok());
    assert_eq!(
        check_document(&raised(&top[1..]), &two),
        Err(SheetProblem::TooFewLevelViews { found: 1, elevated: 1, required: 2 })
    );
    let level_only = SheetRequirements { elevated: false, ..two };
    let (place, elevation_deg) = ("views[2]".to_owned(), 90.0);
    assert_eq!(
        check_document(&raised(&top), &level_only),
        Err(SheetProblem::ElevationUnsupported { place, elevation_deg })
    );
}

#[test]
fn says_where_a_number_is_wrong() {
    let place = |sheet: &SheetDocument| match check_document(sheet, &THREE).unwrap_err() {
        SheetProblem::InvalidAngle { place, .. }
        | SheetProblem::InvalidNumber { place, .. }
        | SheetProblem::EmptyName { place } => place,
        other => panic!("{other}"),
    };
    assert_eq!(place(&document(&[0.0, f64::NAN, 90.0])), "views[1].azimuth_deg");
    let mut sheet = document(&[0.0, 45.0, 90.0]);
    sheet.views[2].elevation_deg = Some(91.0);
    assert_eq!(place(&sheet), "views[2].elevation_deg");
    sheet.views[2].elevation_deg = None;
    sheet.views[1].mask = Some(String::new());
    assert_eq!(place(&sheet), "views[1].mask");
    sheet.pixels_per_unit = Some(0.0);
    assert_eq!(place(&sheet), "pixels_per_unit");
    sheet.pixels_per_unit = None;
    sheet.truth = Some(TruthDocument { camera_distance: Some(-1.0), ..TruthDocument::default() });
    assert_eq!(place(&sheet), "truth.camera_distance");
    sheet.truth = None;
    sheet.holes.push(HoleDocument {
        azimuth_deg: f64::INFINITY,
        elevation_deg: None,
        x: 0.0,
        y: 0.0,
    });
    assert_eq!(place(&sheet), "holes[0].azimuth_deg");
}

#[test]
fn truth_must_be_of_one_kind_and_a_model_have_a_scale() {
    let mut sheet = document(&[0.0, 45.0, 90.0]);
    sheet.views[2].depth = Some("d.png".to_owned());
    sheet.views[1].disparity = Some("d.pfm".to_owned());
    let placed = check_document(&sheet, &THREE).unwrap();
    let kinds: Vec<_> = placed.iter().map(|v| v.truth.as_ref().map(|t| t.0)).collect();
    assert_eq!(kinds, [None, Some(TruthKind::Disparity), Some(TruthKind::Depth)]);
    let model = Some("m.obj".to_owned());
    sheet.truth = Some(TruthDocument { model, ..TruthDocument::default() });
    assert_eq!(check_document(&sheet, &THREE), Err(SheetProblem::ModelWithoutScale));
    sheet.pixels_per_unit = Some(100.0);
    check_document(&sheet, &THREE).unwrap();
    sheet.views[1].depth = Some("d.png".to_owned());
    let error = check_document(&sheet, &THREE).unwrap_err();
    assert_eq!(error, SheetProblem::TwoTruths { place: "views[1]".to_owned() });
}

#[test]
fn sizes_must_be_equal_only_where_the_method_asks() {
    let size = |width| PictureSize { width, height: 20 };
    let sizes = [(level(0.0), size(30)), (level(45.0), size(31))];
    let error = check_sizes(&sizes, &THREE).unwrap_err();
    assert!(matches!(error, SheetProblem::DifferingSizes { view, .. } if view == level(45.0)));
    check_sizes(&sizes, &SheetRequirements { equal_sizes: false, ..THREE }).unwrap();
    check_sizes(&sizes[..1], &THREE).unwrap();
    assert!(check_mask_size(level(0.0), size(30), size(31)).is_err());
}
