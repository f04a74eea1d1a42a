//! Where exported models stand: from the turntable frame to glTF's.

use nalgebra::{Point3, Vector3};
use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::{FileAxes, FileUp, Forward, UpAxis};

/// Where the exported mesh stands.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "snake_case")]
pub enum Origin {
    /// Lowest point at height 0, turntable axis at the origin.
    #[default]
    Feet,
    /// The turntable's origin: on the axis, at the picture centre's row.
    Axis,
}

/// Scale and place of exported meshes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize, JsonSchema)]
#[serde(default, deny_unknown_fields)]
#[expect(missing_docs, reason = "the schema describes it")]
pub struct ExportOptions {
    /// Height of the subject, metres; `pixels_per_metre` takes precedence.
    #[schemars(range(min = 0.001, max = 10000.0))]
    pub height_m: f64,
    /// Sheet pixels a metre; null scales to `height_m`.
    #[schemars(range(min = 0.001, max = 1000000.0))]
    pub pixels_per_metre: Option<f64>,
    pub origin: Origin,
    /// Which axis points up in OBJ, STL and 3MF; glTF says it itself.
    pub up_axis: FileUp,
    /// Which way the subject looks in OBJ, STL and 3MF: along another axis than
    /// the one that points up.
    pub forward: Forward,
}

impl ExportOptions {
    /// The turn to a file whose format leaves open which axis is up; `auto` says
    /// which, unless the options do. `None` if the subject would look up or down.
    pub fn file_axes(&self, auto: UpAxis) -> Option<FileAxes> {
        FileAxes::new(self.up_axis, self.forward, auto)
    }
}

impl Default for ExportOptions {
    fn default() -> Self {
        Self {
            height_m: 1.8,
            pixels_per_metre: None,
            origin: Origin::default(),
            up_axis: FileUp::default(),
            forward: Forward::default(),
        }
    }
}

/// From the turntable frame (Z up, sheet pixels) to the glTF frame (Y up, front
/// facing +Z, metres).
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    /// Metres a sheet pixel.
    pub metres_per_px: f64,
    /// Height of the turntable frame's origin above the glTF frame's, px.
    lift_px: f64,
}

impl Placement {
    /// * `bounds`: the subject's lowest and highest corner, turntable frame, px.
    ///
    /// A subject without height is not scaled to one: it keeps a pixel a
    /// millimetre.
    pub fn new(bounds: (Point3<f64>, Point3<f64>), options: &ExportOptions) -> Self {
        let (low, high) = bounds;
        let height_px = high.z - low.z;
        let metres_per_px = match options.pixels_per_metre {
            Some(pixels) => 1.0 / pixels,
            None if height_px > 0.0 => options.height_m / height_px,
            None => 1e-3,
        };
        let lift_px = match options.origin {
            Origin::Feet => -low.z,
            Origin::Axis => 0.0,
        };
        Self { metres_per_px, lift_px }
    }

    /// Sheet pixels a metre.
    pub fn pixels_per_metre(&self) -> f64 {
        1.0 / self.metres_per_px
    }

    /// The same for directions: (X, Y, Z) to (X, Z, -Y).
    pub fn gltf_direction(direction: &Vector3<f64>) -> [f32; 3] {
        [direction.x as f32, direction.z as f32, -direction.y as f32]
    }

    /// (X, Y, Z) to (X, Z, -Y), lifted and scaled.
    pub fn gltf_from_turntable(&self, point: &Point3<f64>) -> [f32; 3] {
        let lifted = point + Vector3::z() * self.lift_px;
        // Adding zero turns -0 into 0.
        [lifted.x, lifted.z, -lifted.y].map(|value| (value * self.metres_per_px + 0.0) as f32)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn bounds() -> (Point3<f64>, Point3<f64>) {
        (Point3::new(-50.0, -20.0, -100.0), Point3::new(50.0, 20.0, 260.0))
    }

    #[test]
    fn feet_stand_on_the_ground_and_the_front_faces_z() {
        let frame = Placement::new(bounds(), &ExportOptions::default());
        assert_eq!(frame.gltf_from_turntable(&Point3::new(0.0, 0.0, -100.0)), [0.0, 0.0, 0.0]);
        assert_eq!(frame.gltf_from_turntable(&Point3::new(0.0, -20.0, 260.0)), [0.0, 1.8, 0.1]);
        assert_eq!(frame.pixels_per_metre(), 200.0);
    }

    #[test]
    fn the_axis_stays_the_origin_when_asked() {
        let options = ExportOptions {
            pixels_per_metre: Some(100.0),
            origin: Origin::Axis,
            ..ExportOptions::default()
        };
        let frame = Placement::new(bounds(), &options);
        assert_eq!(frame.gltf_from_turntable(&Point3::new(50.0, 0.0, -100.0)), [0.5, -1.0, 0.0]);
    }

    #[test]
    fn a_flat_subject_has_a_finite_scale() {
        let flat = (Point3::origin(), Point3::new(1.0, 1.0, 0.0));
        assert_eq!(Placement::new(flat, &ExportOptions::default()).metres_per_px, 1e-3);
    }
}
