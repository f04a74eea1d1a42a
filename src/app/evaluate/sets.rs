//! The view sets and option variants that `evaluate` tries.

use std::str::FromStr;

use frames::{Elevation, Viewpoint, ViewpointList};
use serde_json::{Value, json};

/// Views that a studio might draw.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct ViewSet {
    pub name: String,
    pub views: ViewpointList,
    /// Whether the views see enough of the subject to judge the solid.
    pub judges_solid: bool,
    /// The view shown in the contact sheet of depth, degrees.
    pub shown_deg: Option<f64>,
}

/// Front, three-quarter, side and back, a turn, the dissertation's sheets, and
/// the three views from which depth was first measured.
pub(super) fn usual_sets() -> Vec<ViewSet> {
    let named = [
        ("FS", "0,90"),
        ("FQS", "0,45,90"),
        ("FQSB", "0,45,90,180"),
        ("8-turn", "0:315:45"),
        ("0:90:15", "0:90:15"),
        ("0:90:5", "0:90:5"),
        ("40:50:5", "40:50:5"),
    ];
    let set = |(name, azimuths): (&str, &str)| ViewSet {
        name: name.to_owned(),
        views: azimuths.parse().expect("the list is valid"),
        judges_solid: name != "40:50:5",
        shown_deg: (name == "0:90:5").then_some(45.0),
    };
    named.map(set).into()
}

impl ViewSet {
    /// Level but for views that say otherwise.
    pub(super) fn viewpoints(&self) -> Vec<Viewpoint> {
        self.views.at(Elevation::LEVEL)
    }
}

/// A set of one's own: `NAME=AZIMUTHS`.
impl FromStr for ViewSet {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, Self::Err> {
        let (name, azimuths) =
            text.split_once('=').ok_or_else(|| format!("{text} is not NAME=AZIMUTHS"))?;
        let (name, views) = (name.trim().to_owned(), azimuths.parse()?);
        Ok(Self { name, views, judges_solid: true, shown_deg: None })
    }
}

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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sets_of_ones_own_are_read() {
        let set: ViewSet = "T5=0,45:180:45".parse().unwrap();
        assert_eq!((set.name.as_str(), set.viewpoints().len()), ("T5", 5));
        assert!("T5".parse::<ViewSet>().unwrap_err().contains("NAME=AZIMUTHS"));
        assert!("T5=north".parse::<ViewSet>().is_err());
        assert_eq!(usual_sets().iter().map(|set| set.viewpoints().len()).sum::<usize>(), 46);
    }
}
