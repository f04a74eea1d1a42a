//! Which way models point in files whose format leaves it open.

use schemars::JsonSchema;
use serde::{Deserialize, Serialize};

use crate::UpAxis;

/// Which axis points up in the files whose format leaves it open.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
pub enum FileUp {
    /// Z in STL and 3MF, which are for printers, Y in OBJ.
    #[default]
    Auto,
    /// Y, as in glTF, Maya and Unity.
    Y,
    /// Z, as in Blender, CAD and Unreal.
    Z,
}

/// Which way the subject looks in those files.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Serialize, Deserialize, JsonSchema)]
pub enum Forward {
    /// +Z if Y is up, -Y if Z is.
    #[default]
    #[serde(rename = "auto")]
    Auto,
    #[serde(rename = "x")]
    #[expect(missing_docs, reason = "it is its name")]
    X,
    #[serde(rename = "-x")]
    #[expect(missing_docs, reason = "it is its name")]
    MinusX,
    #[serde(rename = "y")]
    #[expect(missing_docs, reason = "it is its name")]
    Y,
    #[serde(rename = "-y")]
    #[expect(missing_docs, reason = "it is its name")]
    MinusY,
    #[serde(rename = "z")]
    #[expect(missing_docs, reason = "it is its name")]
    Z,
    #[serde(rename = "-z")]
    #[expect(missing_docs, reason = "it is its name")]
    MinusZ,
}

impl Forward {
    fn vector(self, up: UpAxis) -> [i8; 3] {
        match (self, up) {
            (Self::Auto, UpAxis::Y) | (Self::Z, _) => [0, 0, 1],
            (Self::Auto, UpAxis::Z) | (Self::MinusY, _) => [0, -1, 0],
            (Self::X, _) => [1, 0, 0],
            (Self::MinusX, _) => [-1, 0, 0],
            (Self::Y, _) => [0, 1, 0],
            (Self::MinusZ, _) => [0, 0, -1],
        }
    }
}

/// A turn from glTF's frame (Y up, front +Z) to that of a file. A rotation:
/// faces keep the side that they show.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct FileAxes {
    left: [i8; 3],
    up: [i8; 3],
    forward: [i8; 3],
}

impl FileAxes {
    /// * `auto`: which axis is up if `up` does not say it.
    ///
    /// `None` if the subject would look up or down.
    pub fn new(up: FileUp, forward: Forward, auto: UpAxis) -> Option<Self> {
        let axis = match up {
            FileUp::Auto => auto,
            FileUp::Y => UpAxis::Y,
            FileUp::Z => UpAxis::Z,
        };
        let (up, forward) = match axis {
            UpAxis::Y => ([0, 1, 0], forward.vector(axis)),
            UpAxis::Z => ([0, 0, 1], forward.vector(axis)),
        };
        let cross = |a: [i8; 3], b: [i8; 3]| {
            [a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]]
        };
        let left = cross(up, forward);
        (left != [0; 3]).then_some(Self { left, up, forward })
    }

    /// A point or direction of glTF's frame in the file's.
    pub fn file_from_gltf(&self, [x, y, z]: [f32; 3]) -> [f32; 3] {
        let Self { left, up, forward } = self;
        [0, 1, 2].map(|axis| {
            let part = |vector: &[i8; 3], along: f32| f32::from(vector[axis]) * along;
            // Adding zero turns -0 into 0.
            part(left, x) + part(up, y) + part(forward, z) + 0.0
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const ALL: [Forward; 7] = [
        Forward::Auto,
        Forward::X,
        Forward::MinusX,
        Forward::Y,
        Forward::MinusY,
        Forward::Z,
        Forward::MinusZ,
    ];

    #[test]
    fn the_subject_stands_up_and_looks_where_it_should() {
        let axes = |up, forward| FileAxes::new(up, forward, UpAxis::Z);
        let gltf = axes(FileUp::Y, Forward::Auto).unwrap();
        assert_eq!(gltf.file_from_gltf([1.0, 2.0, 3.0]), [1.0, 2.0, 3.0]);
        // Blender: its left is +X, its front -Y, its head +Z.
        let blender = axes(FileUp::Auto, Forward::Auto).unwrap();
        assert_eq!(blender.file_from_gltf([1.0, 2.0, 3.0]), [1.0, -3.0, 2.0]);
        // Unreal: X forward, Z up.
        let unreal = axes(FileUp::Z, Forward::X).unwrap();
        assert_eq!(unreal.file_from_gltf([1.0, 2.0, 3.0]), [3.0, 1.0, 2.0]);
        assert_eq!(axes(FileUp::Z, Forward::Z), None);
        assert_eq!(axes(FileUp::Y, Forward::MinusY), None);
    }

    #[test]
    fn every_turn_is_a_rotation() {
        let possible = ALL.iter().flat_map(|forward| {
            [FileUp::Y, FileUp::Z]
                .into_iter()
                .filter_map(|up| FileAxes::new(up, *forward, UpAxis::Y))
        });
        let mut count = 0;
        for axes in possible {
            let [a, b, c] = [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]]
                .map(|axis| axes.file_from_gltf(axis));
            let determinant = a[0] * (b[1] * c[2] - b[2] * c[1])
                - a[1] * (b[0] * c[2] - b[2] * c[0])
                + a[2] * (b[0] * c[1] - b[1] * c[0]);
            assert_eq!(determinant, 1.0, "{axes:?}");
            count += 1;
        }
        assert_eq!(count, 10);
    }
}
