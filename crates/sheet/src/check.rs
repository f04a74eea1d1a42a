//! Holds a sheet document and the sizes of its pictures against what a method takes.

use frames::{Azimuth, Elevation, Viewpoint};

use super::{PictureSize, SheetDocument, SheetProblem, TruthDocument, TruthKind, ViewDocument};

const MAX_NAME_BYTES: usize = 200;
const MAX_HOLES: usize = 1000;

/// What a method asks of a sheet.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct SheetRequirements {
    /// The fewest level views it works from.
    pub min_views: usize,
    /// The most views it takes.
    pub max_views: usize,
    /// Whether every view must have the same width and height.
    pub equal_sizes: bool,
    /// Whether it takes views from above and below.
    pub elevated: bool,
}

/// A view of a checked document.
#[derive(Clone, Debug, PartialEq)]
pub struct PlacedView {
    /// Its index in the document.
    pub index: usize,
    /// Where its camera stands on the turntable.
    pub azimuth: Azimuth,
    /// How far above the ground it looks from.
    pub elevation: Elevation,
    /// Name of the drawing.
    pub image: String,
    /// Name of the subject's mask.
    pub mask: Option<String>,
    /// Name of the picture of true values, and what it holds.
    pub truth: Option<(TruthKind, String)>,
}

impl PlacedView {
    /// Where its camera stands.
    pub fn viewpoint(&self) -> Viewpoint {
        Viewpoint { azimuth: self.azimuth, elevation: self.elevation }
    }
}

/// Checks everything that a document says by itself: how many views, their
/// angles and names, and the numbers beside them.
///
/// Returns the views by rising azimuth and elevation.
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
    let mut placed: Vec<PlacedView> = Vec::with_capacity(found);
    for (index, view) in document.views.iter().enumerate() {
        let view = place(index, view, document.elevation_deg)?;
        let own = view.viewpoint();
        if !requirements.elevated && !own.is_level() {
            let (place, elevation_deg) = (format!("views[{index}]"), own.elevation.degrees());
            return Err(SheetProblem::ElevationUnsupported { place, elevation_deg });
        }
        if let Some(earlier) = placed.iter().find(|other| other.viewpoint().looks_like(own)) {
            let (view, first, second) = (earlier.viewpoint(), earlier.index, index);
            return Err(SheetProblem::DuplicateView { view, first, second });
        }
        placed.push(view);
    }
    let required = requirements.min_views;
    let level = placed.iter().filter(|view| view.viewpoint().is_level()).count();
    if level < required && level < found {
        let elevated = found - level;
        return Err(SheetProblem::TooFewLevelViews { found: level, elevated, required });
    }
    if found < required {
        return Err(SheetProblem::TooFewViews { found, required });
    }
    placed.sort_by_key(PlacedView::viewpoint);
    Ok(placed)
}

/// Checks the sizes of the decoded drawings: one size, if the method asks for it.
///
/// # Errors
/// [`SheetProblem::DifferingSizes`] for the first view that differs from the
/// first of `sizes`.
pub fn check_sizes(
    sizes: &[(Viewpoint, PictureSize)],
    requirements: &SheetRequirements,
) -> Result<(), SheetProblem> {
    let Some((first_view, expected)) = sizes.first().copied() else { return Ok(()) };
    let differing = sizes.iter().find(|(_, size)| *size != expected);
    match differing {
        Some((view, found)) if requirements.equal_sizes => {
            Err(SheetProblem::DifferingSizes { view: *view, found: *found, first_view, expected })
        }
        _ => Ok(()),
    }
}

/// Checks that a mask has the size of its drawing.
///
/// # Errors
/// [`SheetProblem::MaskSize`] if it has not.
pub fn check_mask_size(
    view: Viewpoint,
    drawing: PictureSize,
    mask: PictureSize,
) -> Result<(), SheetProblem> {
    if mask == drawing {
        return Ok(());
    }
    Err(SheetProblem::MaskSize { view, found: mask, expected: drawing })
}

/// Checks that a picture of true values has the size of its drawing.
///
/// # Errors
/// [`SheetProblem::TruthSize`] if it has not.
pub fn check_truth_size(
    view: Viewpoint,
    drawing: PictureSize,
    truth: PictureSize,
) -> Result<(), SheetProblem> {
    if truth == drawing {
        return Ok(());
    }
    Err(SheetProblem::TruthSize { view, found: truth, expected: drawing })
}

fn place(index: usize, view: &ViewDocument, default: f64) -> Result<PlacedView, SheetProblem> {
    let azimuth = Azimuth::from_degrees(view.azimuth_deg).map_err(|error| {
        SheetProblem::InvalidAngle { place: format!("views[{index}].azimuth_deg"), value: error.0 }
    })?;
    let elevation_deg = view.elevation_deg.unwrap_or(default);
    let elevation = elevation(|| format!("views[{index}].elevation_deg"), elevation_deg)?;
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
        elevation,
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

fn elevation(place: impl Fn() -> String, value: f64) -> Result<Elevation, SheetProblem> {
    Elevation::from_degrees(value).map_err(|_| {
        if !value.is_finite() {
            return SheetProblem::InvalidAngle { place: place(), value };
        }
        let accepted = "an elevation from -90 to 90 degrees";
        SheetProblem::InvalidNumber { place: place(), value, accepted }
    })
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
    elevation(|| "elevation_deg".to_owned(), document.elevation_deg)?;
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
        if let Some(degrees) = hole.elevation_deg {
            elevation(|| format!("holes[{index}].elevation_deg"), degrees)?;
        }
        if let Some(value) = [hole.x, hole.y].into_iter().find(|v| !v.is_finite()) {
            let place = format!("holes[{index}]");
            return Err(SheetProblem::InvalidNumber { place, value, accepted: "finite pixels" });
        }
    }
    Ok(())
}

#[cfg(test)]
#[path = "check_tests.rs"]
mod tests;
