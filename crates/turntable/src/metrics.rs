//! The draft in numbers, and what they warn of.

use mesh::Mesh;
use mesh::topology::check_manifold;
use picture::ValueRange;
use serde::Serialize;

use crate::depth::{DepthSource, Fallback};
use crate::draft::{Draft, DraftView};
use crate::export::DISPARITY_ANGLE_DEG;
use crate::fit::{Redrawn, ViewFit};
use crate::options::TurntableOptions;
use crate::registration::ViewRegistration;
use crate::silhouette::{OppositePair, SilhouetteSource};
use crate::solid::SolidReport;

/// A view that fits its neighbours in fewer rows contradicts them.
const MIN_CONSISTENCY: f64 = 0.8;

/// What is measured of the whole.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Metrics {
    views: Vec<ViewMetrics>,
    opposite_views: Vec<OppositePair>,
    /// How well the draft, drawn again, matches each drawing.
    fit: Vec<ViewFit>,
    solid: SolidReport,
    mesh: MeshMetrics,
    /// Angle of the pair that disparity maps stand for, degrees.
    disparity_angle_deg: f64,
    /// What a person should look at, in sentences.
    pub warnings: Vec<String>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct ViewMetrics {
    azimuth_deg: f64,
    elevation_deg: f64,
    /// How files and messages call it.
    #[serde(skip)]
    name: String,
    silhouette: SilhouetteMetrics,
    registration: ViewRegistration,
    /// Whether the drawing was moved as `registration` says.
    corrected: bool,
    depth: DepthMetrics,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct SilhouetteMetrics {
    source: SilhouetteSource,
    area_px: usize,
    half_line_px: f64,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct DepthMetrics {
    range_px: Option<ValueRange>,
    /// Share of the crossings of lines with rows whose depth is known.
    matched_share: f64,
    /// What the depth was read from.
    source: DepthSource,
    /// Why the view's own lines tell nothing.
    fallback: Option<Fallback>,
}

#[derive(Clone, Debug, PartialEq, Serialize)]
struct MeshMetrics {
    vertices: usize,
    triangles: usize,
    /// Whether it is closed and a 2-manifold.
    watertight: bool,
    /// What is wrong with it.
    defect: Option<String>,
    height_px: f64,
}

/// Puts together what each stage says.
pub fn measure(draft: &Draft<'_>, redrawn: &[Redrawn], options: &TurntableOptions) -> Metrics {
    let views: Vec<_> = draft
        .all_views()
        .into_iter()
        .map(|DraftView { view, silhouette, registration, depth }| ViewMetrics {
            azimuth_deg: view.azimuth.degrees(),
            elevation_deg: view.elevation.degrees(),
            name: view.viewpoint().to_string(),
            silhouette: SilhouetteMetrics {
                source: silhouette.source(),
                area_px: silhouette.area_px(),
                half_line_px: silhouette.half_line_px(),
            },
            registration: *registration,
            corrected: options.register && registration.corrects(),
            depth: DepthMetrics {
                range_px: ValueRange::of(&depth.map.depth_px),
                matched_share: depth.matched_share,
                source: depth.source,
                fallback: depth.fallback,
            },
        })
        .collect();
    let mesh = mesh_metrics(&draft.solid.mesh);
    let fit: Vec<ViewFit> = redrawn.iter().map(|view| view.fit.clone()).collect();
    Metrics {
        warnings: warnings(&views, &fit, &draft.solid.report, &mesh),
        views,
        opposite_views: draft.silhouettes.opposites.clone(),
        fit,
        solid: draft.solid.report.clone(),
        mesh,
        disparity_angle_deg: DISPARITY_ANGLE_DEG,
    }
}

fn mesh_metrics(mesh: &Mesh) -> MeshMetrics {
    let defect = check_manifold(mesh).err();
    MeshMetrics {
        vertices: mesh.positions.len(),
        triangles: mesh.triangles.len(),
        watertight: defect.is_none(),
        defect: defect.map(|defect| defect.to_string()),
        height_px: mesh.bounds().map_or(0.0, |(low, high)| high.z - low.z),
    }
}

fn warnings(
    views: &[ViewMetrics],
    fit: &[ViewFit],
    solid: &SolidReport,
    mesh: &MeshMetrics,
) -> Vec<String> {
    let mut warnings: Vec<String> = Vec::new();
    if solid.depth_guessed {
        let level = views.iter().filter(|view| view.elevation_deg == 0.0);
        let named: Vec<&str> = level.map(|view| view.name.as_str()).collect();
        warnings.push(format!(
            "views {} look along one line: how deep the subject is there is a guess; add a view from another side, such as 90 or 45, or correct the angles",
            named.join(" and ")
        ));
        if named.len() < views.len() {
            warnings.push(
                "views from above and below are left out of the solid: they cut what drawings from two sides leave"
                    .to_owned(),
            );
        }
    }
    warnings.extend(fit.iter().filter_map(ViewFit::warning));
    for view in views {
        let (name, share) = (&view.name, view.registration.consistency);
        if view.registration.contradicts {
            warnings.push(format!(
                "view {name} contradicts the others, which agree better without it; it is left out of the solid; check its angle and drawing"
            ));
        } else if share < MIN_CONSISTENCY {
            warnings.push(format!(
                "view {name} fits its neighbours in {:.0} % of its rows; check its angle and drawing",
                share * 100.0
            ));
        }
        if let Some(Fallback::TooFewLines { matched, required }) = view.depth.fallback {
            warnings.push(format!(
                "view {name}: {matched} line points matched to neighbours, {required} are required; its depth is the solid's"
            ));
        }
    }
    let without =
        |view: &&ViewMetrics| matches!(view.depth.fallback, Some(Fallback::NoNeighbours { .. }));
    let count = views.iter().filter(without).count();
    if count > 0 {
        warnings.push(format!(
            "{count} of {} views have too few neighbours near; their depth is the solid's alone",
            views.len()
        ));
    }
    warnings.extend(mesh.defect.as_ref().map(|defect| format!("the mesh is not closed: {defect}")));
    warnings
}
