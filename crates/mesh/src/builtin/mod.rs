//! Models made by code, so that samples, tests and benchmarks need no files.
//!
//! All are in the model frame (Z up, front towards -Y) and sized to fit the dissertation's frame,
//! 7.3 units wide.

mod figures;
mod primitives;
mod teapot;

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::read::Model;

pub use figures::{caped_figure, dude, objects};
pub use primitives::{cone, cuboid, cylinder, frustum, torus, uv_sphere};
pub use teapot::teapot;

/// The models that the project carries.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum ProceduralModel {
    /// A cube of side 2.6.
    Cube,
    /// An upright cone.
    Cone,
    /// A sphere.
    Sphere,
    /// A torus lying on the ground.
    TorusFlat,
    /// A torus standing upright, its hole towards the front.
    TorusSide,
    /// A body of boxes with a round head, a pointed hat and a stick.
    Dude,
    /// A cone, a box and a sphere apart from each other.
    Objects,
    /// A humanoid of rounded limbs with a cape.
    CapedFigure,
    /// The Utah teapot.
    Teapot,
}

impl ProceduralModel {
    /// Every built-in model.
    pub const ALL: [Self; 9] = [
        Self::Cube,
        Self::Cone,
        Self::Sphere,
        Self::TorusFlat,
        Self::TorusSide,
        Self::Dude,
        Self::Objects,
        Self::CapedFigure,
        Self::Teapot,
    ];

    /// The name that [`Self::from_name`] takes.
    pub fn name(self) -> &'static str {
        match self {
            Self::Cube => "cube",
            Self::Cone => "cone",
            Self::Sphere => "sphere",
            Self::TorusFlat => "torus_flat",
            Self::TorusSide => "torus_side",
            Self::Dude => "dude",
            Self::Objects => "objects",
            Self::CapedFigure => "caped_figure",
            Self::Teapot => "teapot",
        }
    }

    /// The model of this [`name`](Self::name); `None` if there is none.
    pub fn from_name(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|model| model.name() == name)
    }

    /// Makes the model; it fits the frame of the default options at every azimuth.
    pub fn build(self) -> Model {
        match self {
            Self::Cube => cuboid([2.6, 2.6, 2.6]),
            Self::Cone => cone(1.3, 2.8, 64).translated([0.0, 0.0, -1.4]),
            Self::Sphere => uv_sphere(1.6, 48, 64),
            Self::TorusFlat => torus(1.8, 0.7, 96, 48),
            Self::TorusSide => torus(1.2, 0.45, 96, 48).rotated_about_x(90.0),
            Self::Dude => dude(),
            Self::Objects => objects(),
            Self::CapedFigure => caped_figure(),
            Self::Teapot => teapot(10),
        }
    }
}

#[cfg(test)]
mod tests;
