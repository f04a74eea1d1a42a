//! Holds a sheet document and the sizes of its pictures against what a method takes.

use std::collections::BTreeMap;

use frames::Azimuth;

use super::{SheetDocument, TruthDocument, TruthKind, ViewDocument};

const MAX_NAME_BYTES: usize = 200;
const MAX_HOLES: usize = 1000;

/// What a method asks of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SheetRequirements {
    /// The fewest views it works from.
    pub min_views: usize,
    /// The most views it takes.
    pub max_views: usize,
    /// Whether every view must have the same width and height.
    pub equal_sizes: bool,
}

/// A view of a checked document.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedView {
    /// Its index in the document.
    pub index: usize,
    /// Where its camera stands on the turntable.
    pub azimuth: Azimuth,
    /// Camera elevation, degrees, up positive.
    pub elevation_deg: f64,
    /// Name of the drawing.
    pub image: String,
    /// Name of the subject's mask.
    pub mask: Option<String>,
    /// Name of the picture of true values, and what it holds.
    pub truth: Option<(TruthKind, String)>,
}

/// Why a sheet document, or the pictures it names, cannot be worked with.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
pub enum SheetProblem {
    /// The method needs more views.
    #[error("the sheet has {found} views, the method takes {required} or more; add views")]
    TooFewViews {
        /// Views of the sheet.
        found: usize,
        /// The fewest that are taken.
        required: usize,
    },
    /// The sheet has more views than are taken.
    #[error("the sheet has {found} views, over the limit of {limit}; leave some out")]
    TooManyViews {
        /// Views of the sheet.
        found: usize,
        /// The most that are taken.
        limit: usize,
    },
    /// An angle is not finite.
    #[error("{place} is {value}; give a finite angle in degrees")]
    InvalidAngle {
        /// Where in the document, such as `views[2].azimuth_deg`.
        place: String,
        /// What it says, degrees.
        value: f64,
    },
    /// A number is not finite or out of range.
    #[error("{place} is {value}; give {accepted}")]
    InvalidNumber {
        /// Where in the document.
        place: String,
        /// What it says, in the field's own unit.
        value: f64,
        /// What would be accepted, for people.
        accepted: &'static str,
    },
    /// A file's name is empty.
    #[error("{place} is empty; name a file")]
    EmptyName {
        /// Where in the document, such as `views[2].image`.
        place: String,
    },
    /// A view names a true depth and a true disparity picture.
    #[error("{place} has a true depth and a true disparity picture; name one")]
    TwoTruths {
        /// Which view, such as `views[2]`.
        place: String,
    },
    /// A true model is named, but not its scale.
    #[error("the true model needs pixels_per_unit, the sheet's pixels a unit of the model")]
    ModelWithoutScale,
    /// A list or a name is too long.
    #[error("{place} has {found} {unit}, over the limit of {limit}")]
    TooLong {
        /// Where in the document.
        place: &'static str,
        /// Its length, in `unit`.
        found: usize,
        /// What is counted, such as `bytes`.
        unit: &'static str,
        /// The most that is taken, in `unit`.
        limit: usize,
    },
    /// Two views are at one angle.
    #[error(
        "views[{first}] and views[{second}] both have azimuth {azimuth}; give each angle once (360 and 0 are the same)"
    )]
    DuplicateAzimuth {
        /// Their azimuth.
        azimuth: Azimuth,
        /// Index of the earlier one in the document.
        first: usize,
        /// Index of the later one.
        second: usize,
    },
    /// The method takes drawings of one size, and these differ.
    #[error(
        "view {azimuth} is {found}, view {first_azimuth} is {expected}; the method takes views of one size, so pad or scale the drawings"
    )]
    DifferingSizes {
        /// The view that differs.
        azimuth: Azimuth,
        /// Its drawing's size, px.
        found: PictureSize,
        /// The view it differs from.
        first_azimuth: Azimuth,
        /// That view's size, px.
        expected: PictureSize,
    },
    /// A mask is not of its drawing's size.
    #[error(
        "the mask of view {azimuth} is {found}, its drawing {expected}; make them the same size"
    )]
    MaskSize {
        /// Which view.
        azimuth: Azimuth,
        /// The mask's size, px.
        found: PictureSize,
        /// The drawing's size, px.
        expected: PictureSize,
    },
    /// A picture of true values is not of its drawing's size.
    #[error(
        "the picture of true values of view {azimuth} is {found}, its drawing {expected}; make them the same size"
    )]
    TruthSize {
        /// Which view.
        azimuth: Azimuth,
        /// That picture's size, px.
        found: PictureSize,
        /// The drawing's size, px.
        expected: PictureSize,
    },
}

/// Width and height of a picture, px.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct PictureSize {
    /// Columns.
    pub width: u32,
    /// Rows.
    pub height: u32,
}

impl std::fmt::Display for PictureSize {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "{}x{}", self.width, self.height)
    }
}

/// Checks everything that a document says by itself: how many views, their
/// angles and names, and the numbers beside them.
///
/// Returns the views by rising azimuth.
///
/// # Errors
/// [`SheetProblem`], the first found.
pub fn check_document(
    document: &SheetDocument,
    requirements: &SheetRequirements,
) -> Result<Vec<PlacedView>, SheetProblem> {
    let found = document.views.len();
    if found > requirements.max_views {
        return Err(SheetProblem::TooManyViews { found, limit: requirements.max_views });
    }
    check_lengths(document)?;
    check_numbers(document)?;
    if let Some(truth) = &document.truth {
        check_truth(truth, document.pixels_per_unit)?;
    }
    let mut placed: BTreeMap<Azimuth, (usize, PlacedView)> = BTreeMap::new();
    for (index, view) in document.views.iter().enumerate() {
        let view = place(index, view, document.elevation_deg)?;
        if let Some((first, _)) = placed.get(&view.azimuth) {
            let (azimuth, first, second) = (view.azimuth, *first, index);
            return Err(SheetProblem::DuplicateAzimuth { azimuth, first, second });
        }
        placed.insert(view.azimuth, (index, view));
    }
    if found < requirements.min_views {
        return Err(SheetProblem::TooFewViews { found, required: requirements.min_views });
    }
    Ok(placed.into_values().map(|(_, view)| view).collect())
}

/// Checks the sizes of the decoded drawings: one size, if the method asks for it.
///
/// # Errors
/// [`SheetProblem::DifferingSizes`] for the first view that differs from the
/// first of `sizes`.
pub fn check_sizes(
    sizes: &[(Azimuth, PictureSize)],
    requirements: &SheetRequirements,
) -> Result<(), SheetProblem> {
    let Some((first_azimuth, expected)) = sizes.first().copied() else { return Ok(()) };
    let differing = sizes.iter().find(|(_, size)| *size != expected);
    match differing {
        Some((azimuth, found)) if requirements.equal_sizes => Err(SheetProblem::DifferingSizes {
            azimuth: *azimuth,
            found: *found,
            first_azimuth,
            expected,
        }),
        _ => Ok(()),
    }
}

/// Checks that a mask has the size of its drawing.
///
/// # Errors
/// [`SheetProblem::MaskSize`] if it has not.
pub fn check_mask_size(
    azimuth: Azimuth,
    drawing: PictureSize,
    mask: PictureSize,
) -> Result<(), SheetProblem> {
    if mask == drawing {
        return Ok(());
    }
    Err(SheetProblem::MaskSize { azimuth, found: mask, expected: drawing })
}

/// Checks that a picture of true values has the size of its drawing.
///
/// # Errors
/// [`SheetProblem::TruthSize`] if it has not.
pub fn check_truth_size(
    azimuth: Azimuth,
    drawing: PictureSize,
    truth: PictureSize,
) -> Result<(), SheetProblem> {
    if truth == drawing {
        return Ok(());
    }
    Err(SheetProblem::TruthSize { azimuth, found: truth, expected: drawing })
}

fn place(index: usize, view: &ViewDocument, default: f64) -> Result<PlacedView, SheetProblem> {
    let azimuth = Azimuth::from_degrees(view.azimuth_deg).map_err(|error| {
        SheetProblem::InvalidAngle { place: format!("views[{index}].azimuth_deg"), value: error.0 }
    })?;
    let elevation_deg = view.elevation_deg.unwrap_or(default);
    check_elevation(|| format!("views[{index}].elevation_deg"), elevation_deg)?;
    for (key, name) in [
        ("image", Some(&view.image)),
        ("mask", view.mask.as_ref()),
        ("depth", view.depth.as_ref()),
        ("disparity", view.disparity.as_ref()),
    ] {
        if name.is_some_and(|name| name.is_empty()) {
            return Err(SheetProblem::EmptyName { place: format!("views[{index}].{key}") });
        }
    }
    if view.depth.is_some() && view.disparity.is_some() {
        return Err(SheetProblem::TwoTruths { place: format!("views[{index}]") });
    }
    Ok(PlacedView {
        index,
        azimuth,
        elevation_deg,
        image: view.image.clone(),
        mask: view.mask.clone(),
        truth: view.truth().map(|(kind, name)| (kind, name.to_owned())),
    })
}

fn check_truth(truth: &TruthDocument, pixels_per_unit: Option<f64>) -> Result<(), SheetProblem> {
    let positive = |v: f64| v.is_finite() && v > 0.0;
    let not_negative = |v: f64| v.is_finite() && v >= 0.0;
    let angle = |v: f64| v.abs() > 0.0 && v.abs() < 90.0;
    type Check<'a> = (&'static str, Option<f64>, &'a dyn Fn(f64) -> bool, &'static str);
    let checks: [Check<'_>; 3] = [
        ("depth_counts_per_unit", truth.depth_counts_per_unit, &positive, "a number above 0"),
        ("camera_distance", truth.camera_distance, &not_negative, "a finite number from 0"),
        (
            "disparity_pair_deg",
            truth.disparity_pair_deg,
            &angle,
            "an angle within 90 degrees either way, not 0",
        ),
    ];
    for (key, value, accepts, accepted) in checks {
        if let Some(value) = value.filter(|value| !accepts(*value)) {
            let place = format!("truth.{key}");
            return Err(SheetProblem::InvalidNumber { place, value, accepted });
        }
    }
    match &truth.model {
        Some(name) if name.is_empty() => {
            Err(SheetProblem::EmptyName { place: "truth.model".to_owned() })
        }
        Some(_) if pixels_per_unit.is_none() => Err(SheetProblem::ModelWithoutScale),
        _ => Ok(()),
    }
}

fn check_elevation(place: impl Fn() -> String, value: f64) -> Result<(), SheetProblem> {
    if !value.is_finite() {
        return Err(SheetProblem::InvalidAngle { place: place(), value });
    }
    if !(-90.0..=90.0).contains(&value) {
        let accepted = "an elevation from -90 to 90 degrees";
        return Err(SheetProblem::InvalidNumber { place: place(), value, accepted });
    }
    Ok(())
}

/// Descriptions are kept with the job and sent with every listing.
fn check_lengths(document: &SheetDocument) -> Result<(), SheetProblem> {
    let name_bytes = document.name.as_ref().map_or(0, String::len);
    for (place, found, unit, limit) in [
        ("name", name_bytes, "bytes", MAX_NAME_BYTES),
        ("holes", document.holes.len(), "entries", MAX_HOLES),
    ] {
        if found > limit {
            return Err(SheetProblem::TooLong { place, found, unit, limit });
        }
    }
    Ok(())
}

fn check_numbers(document: &SheetDocument) -> Result<(), SheetProblem> {
    check_elevation(|| "elevation_deg".to_owned(), document.elevation_deg)?;
    if let Some(value) = document.pixels_per_unit.filter(|v| !(v.is_finite() && *v > 0.0)) {
        let place = "pixels_per_unit".to_owned();
        return Err(SheetProblem::InvalidNumber { place, value, accepted: "a number above 0" });
    }
    for (index, view) in document.views.iter().enumerate() {
        if let Some((field, value, accepted)) = view.wrong_place() {
            let place = format!("views[{index}].{field}");
            return Err(SheetProblem::InvalidNumber { place, value, accepted });
        }
    }
    for (index, hole) in document.holes.iter().enumerate() {
        if !hole.azimuth_deg.is_finite() {
            let place = format!("holes[{index}].azimuth_deg");
            return Err(SheetProblem::InvalidAngle { place, value: hole.azimuth_deg });
        }
        if let Some(value) = [hole.x, hole.y].into_iter().find(|v| !v.is_finite()) {
            let place = format!("holes[{index}]");
            return Err(SheetProblem::InvalidNumber { place, value, accepted: "finite pixels" });
        }
    }
    Ok(())
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::HoleDocument;

    const THREE: SheetRequirements =
        SheetRequirements { min_views: 3, max_views: 5, equal_sizes: true };

    fn document(degrees: &[f64]) -> SheetDocument {
        let view = |a: &f64| ViewDocument {
            image: format!("{a}.png"),
            azimuth_deg: *a,
            ..ViewDocument::default()
        };
        SheetDocument { views: degrees.iter().map(view).collect(), ..SheetDocument::default() }
    }

    fn azimuth(degrees: f64) -> Azimuth {
        Azimuth::from_degrees(degrees).unwrap()
    }

    #[test]
    fn views_come_out_by_azimuth_with_the_default_elevation() {
        let mut sheet = document(&[90.0, -45.0, 0.0]);
        sheet.elevation_deg = 10.0;
        sheet.views[1].elevation_deg = Some(-5.0);
        let placed = check_document(&sheet, &THREE).unwrap();
        let found: Vec<_> =
            placed.iter().map(|v| (v.azimuth.degrees(), v.elevation_deg, &*v.image)).collect();
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
            Err(SheetProblem::DuplicateAzimuth { azimuth: azimuth(0.0), first: 0, second: 2 })
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
        sheet.truth =
            Some(TruthDocument { camera_distance: Some(-1.0), ..TruthDocument::default() });
        assert_eq!(place(&sheet), "truth.camera_distance");
        sheet.truth = None;
        sheet.holes.push(HoleDocument { azimuth_deg: f64::INFINITY, x: 0.0, y: 0.0 });
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
        let sizes = [(azimuth(0.0), size(30)), (azimuth(45.0), size(31))];
        let error = check_sizes(&sizes, &THREE).unwrap_err();
        assert!(
            matches!(error, SheetProblem::DifferingSizes { azimuth: a, .. } if a == azimuth(45.0))
        );
        check_sizes(&sizes, &SheetRequirements { equal_sizes: false, ..THREE }).unwrap();
        check_sizes(&sizes[..1], &THREE).unwrap();
        assert!(check_mask_size(azimuth(0.0), size(30), size(31)).is_err());
    }
}
