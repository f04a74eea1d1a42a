//! The view sets and option variants that `evaluate` tries.

use serde_json::{Value, json};

/// Views that a studio might draw.
#[derive(Debug)]
pub(super) struct ViewSet {
    pub name: &'static str,
    pub azimuths_deg: &'static [f64],
    /// Whether the views see enough of the subject to judge the solid.
    pub judges_solid: bool,
    /// The view shown in the contact sheet.
    pub shown_deg: Option<f64>,
}

/// Front, three-quarter, side and back, a turn, the dissertation's sheets, and
/// the three views from which depth was first measured.
pub(super) const SETS: &[ViewSet] = &[
    ViewSet { name: "FS", azimuths_deg: &[0.0, 90.0], judges_solid: true, shown_deg: None },
    ViewSet { name: "FQS", azimuths_deg: &[0.0, 45.0, 90.0], judges_solid: true, shown_deg: None },
    ViewSet {
        name: "FQSB",
        azimuths_deg: &[0.0, 45.0, 90.0, 180.0],
        judges_solid: true,
        shown_deg: None,
    },
    ViewSet {
        name: "8-turn",
        azimuths_deg: &[0.0, 45.0, 90.0, 135.0, 180.0, 225.0, 270.0, 315.0],
        judges_solid: true,
        shown_deg: None,
    },
    ViewSet {
        name: "0:90:15",
        azimuths_deg: &[0.0, 15.0, 30.0, 45.0, 60.0, 75.0, 90.0],
        judges_solid: true,
        shown_deg: None,
    },
    ViewSet {
        name: "0:90:5",
        azimuths_deg: &[
            0.0, 5.0, 10.0, 15.0, 20.0, 25.0, 30.0, 35.0, 40.0, 45.0, 50.0, 55.0, 60.0, 65.0, 70.0,
            75.0, 80.0, 85.0, 90.0,
        ],
        judges_solid: true,
        shown_deg: Some(45.0),
    },
    ViewSet {
        name: "40:50:5",
        azimuths_deg: &[40.0, 45.0, 50.0],
        judges_solid: false,
        shown_deg: None,
    },
];

/// Options laid over the chosen ones.
#[derive(Debug)]
pub(super) struct Variant {
    pub name: &'static str,
    pub options: Value,
}

/// The chosen options alone, or also the ingredients of the solid added one by
/// one to the plain hull.
pub(super) fn variants(ablation: bool) -> Vec<Variant> {
    let chosen = Variant { name: "as chosen", options: json!({}) };
    if !ablation {
        return vec![chosen];
    }
    // Without fusion depth is of no use to the solid: no neighbour is near enough.
    let without_depth = |name, solid: Value| Variant {
        name,
        options: json!({"turntable": {"depth": {"max_neighbour_deg": 1.0}, "solid": solid}}),
    };
    let solid = |creases: bool, symmetry: &str, holes: &str| {
        json!({
            "kind": "creased", "creases": creases, "symmetry": symmetry, "holes": holes,
            "fusion": false,
        })
    };
    let hull = json!({"kind": "hull", "symmetry": "off", "holes": "off", "fusion": false});
    let voxel = json!({"kind": "voxel", "symmetry": "off", "holes": "off", "fusion": false});
    vec![
        without_depth("voxel carving", voxel),
        without_depth("hull", hull),
        without_depth("+ rounding", solid(false, "off", "off")),
        without_depth("+ creases", solid(true, "off", "off")),
        without_depth("+ symmetry", solid(true, "auto", "off")),
        without_depth("+ holes", solid(true, "auto", "auto")),
        Variant { name: "+ fusion", options: json!({"turntable": {"solid": {"fusion": true}}}) },
        without_depth("+ holes, eager", solid(true, "auto", "eager")),
        chosen,
    ]
}
