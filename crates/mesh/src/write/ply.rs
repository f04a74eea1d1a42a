//! Point clouds as binary PLY.

use nalgebra::Point3;

use frames::Placement;

/// A cloud as binary little-endian PLY, glTF frame, metres.
pub fn cloud_ply(points: impl Iterator<Item = Point3<f64>>, frame: &Placement) -> Vec<u8> {
    let mut body = Vec::new();
    for point in points {
        for coordinate in frame.gltf_from_turntable(&point) {
            body.extend_from_slice(&coordinate.to_le_bytes());
        }
    }
    let count = body.len() / 12;
    let header = format!(
        "ply\nformat binary_little_endian 1.0\ncomment Y up, front faces +Z, metres\n\
         element vertex {count}\nproperty float x\nproperty float y\nproperty float z\nend_header\n"
    );
    [header.as_bytes(), &body].concat()
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{ExportOptions, Origin};

    #[test]
    fn points_come_back_in_the_gltf_frame() {
        let options = ExportOptions {
            pixels_per_metre: Some(1.0),
            origin: Origin::Axis,
            ..ExportOptions::default()
        };
        let points = [Point3::new(1.0, 2.0, 3.0), Point3::new(-4.0, 5.5, 6.0)];
        let frame = Placement::new((points[1], points[0]), &options);
        let bytes = cloud_ply(points.into_iter(), &frame);
        let end = bytes.windows(11).position(|w| w == b"end_header\n").unwrap() + 11;
        let header = std::str::from_utf8(&bytes[..end]).unwrap();
        assert!(header.contains("element vertex 2\n"), "{header}");
        let values: Vec<f32> = bytes[end..]
            .chunks_exact(4)
            .map(|b| f32::from_le_bytes([b[0], b[1], b[2], b[3]]))
            .collect();
        assert_eq!(values, [1.0, 3.0, -2.0, -4.0, 6.0, -5.5]);
    }
}
