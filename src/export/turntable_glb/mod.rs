//! The turntable method's models as binary glTF.

mod document;

use image::GrayImage;
use nalgebra::{Point3, Vector3};
use serde_json::json;

use crate::geometry::Mesh;
use crate::turntable::mesh::confidence::Support;
use crate::turntable::mesh::shading::{CREASE_ANGLE_DEG, ShadedMesh, shaded};
use crate::turntable::mesh::texture::Rig;
use document::{Document, bytes_of};

/// Where the turntable frame goes in glTF's: Y up, front to +Z, metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Placement {
    pub metres_per_px: f64,
    /// The height in the turntable frame that becomes Y = 0, px.
    pub ground_z_px: f64,
}

impl Placement {
    /// Feet at Y = 0 and the axis at X = Z = 0, `height_m` tall. `None` for a
    /// mesh without height.
    pub fn standing(mesh: &Mesh, height_m: f64) -> Option<Self> {
        let (low, high) = mesh.bounds()?;
        let height_px = high.z - low.z;
        (height_px > 0.0).then(|| Self { metres_per_px: height_m / height_px, ground_z_px: low.z })
    }

    /// (X, Y, Z) -> (X, Z, -Y), scaled.
    pub fn gltf_from_turntable(&self, point: &Point3<f64>) -> [f32; 3] {
        let metres =
            Vector3::new(point.x, point.z - self.ground_z_px, -point.y) * self.metres_per_px;
        [metres.x as f32, metres.y as f32, metres.z as f32]
    }

    fn normal(normal: &Vector3<f64>) -> [f32; 3] {
        [normal.x as f32, normal.z as f32, -normal.y as f32]
    }
}

/// A model could not be written.
#[derive(Debug, thiserror::Error)]
pub enum TurntableGlbError {
    #[error("the model has no triangles")]
    Empty,
    #[error("{found} labels were given for {expected} items")]
    LabelsDiffer { found: usize, expected: usize },
    #[error("a drawing cannot be encoded: {0}")]
    Image(#[from] image::ImageError),
    #[error("the model cannot be serialised: {0}")]
    Json(#[from] serde_json::Error),
    #[error("the model cannot be written: {0}")]
    Glb(#[from] gltf::Error),
}

/// What the model and its reference planes are drawn from.
pub struct Sheet<'a> {
    pub rig: &'a Rig,
    /// Of the rig's views, in their order.
    pub drawings: &'a [GrayImage],
    pub placement: Placement,
    /// Whether each drawing is added as a plane behind the model.
    pub reference_planes: bool,
}

/// The model with its support as vertex colours: white what lines or depths
/// show, blue what outlines bound, orange what is guessed.
///
/// # Errors
/// [`TurntableGlbError`] for a mesh without triangles and supports that are not its own.
pub fn solid_glb(
    mesh: &Mesh,
    support: &[Support],
    sheet: &Sheet,
) -> Result<Vec<u8>, TurntableGlbError> {
    check_labels(support.len(), mesh.positions.len())?;
    let mut document = Document::begin(mesh)?;
    let shaded = shaded(mesh, CREASE_ANGLE_DEG);
    let material = document.material(json!({
        "name": "solid",
        "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 0.9},
    }));
    let colours: Vec<[u8; 4]> =
        shaded.sources.iter().map(|&source| colour(support[source as usize])).collect();
    let mut attributes = document.geometry(&shaded, &sheet.placement);
    attributes["COLOR_0"] = document.accessor(colours.as_flattened(), &colours, 5121, "VEC4", true);
    let indices = document.indices(&shaded.triangles);
    let primitive = json!({"attributes": attributes, "indices": indices, "material": material});
    document.model(vec![primitive], sheet);
    document.finish(sheet)
}

/// The model with the drawings projected on it, unlit.
///
/// * `labels`: per triangle, the view whose drawing colours it; the number of
///   views for paper without lines.
///
/// # Errors
/// [`TurntableGlbError`] for a mesh without triangles and labels that are not its own.
pub fn textured_glb(
    mesh: &Mesh,
    labels: &[usize],
    sheet: &Sheet,
) -> Result<Vec<u8>, TurntableGlbError> {
    check_labels(labels.len(), mesh.triangles.len())?;
    let mut document = Document::begin(mesh)?;
    let shaded = shaded(mesh, CREASE_ANGLE_DEG);
    let mut primitives = Vec::new();
    for (view, drawing) in sheet.drawings.iter().enumerate().take(sheet.rig.azimuths.len()) {
        let part = part_of(&shaded, labels, view);
        if part.triangles.is_empty() {
            continue;
        }
        let material = document.drawing_material(view, drawing, sheet)?;
        let mut attributes = document.geometry(&part, &sheet.placement);
        let coordinates: Vec<[f32; 2]> =
            part.positions.iter().map(|point| sheet.rig.texture_coordinates(view, point)).collect();
        attributes["TEXCOORD_0"] = document.accessor(
            &bytes_of(coordinates.as_flattened()),
            &coordinates,
            5126,
            "VEC2",
            false,
        );
        let indices = document.indices(&part.triangles);
        primitives
            .push(json!({"attributes": attributes, "indices": indices, "material": material}));
    }
    let unseen = part_of(&shaded, labels, sheet.rig.azimuths.len());
    if !unseen.triangles.is_empty() {
        let material = document.material(json!({
            "name": "unseen",
            "doubleSided": true,
            "pbrMetallicRoughness": {"metallicFactor": 0.0, "roughnessFactor": 1.0},
            "extensions": {"KHR_materials_unlit": {}},
        }));
        let attributes = document.geometry(&unseen, &sheet.placement);
        let indices = document.indices(&unseen.triangles);
        primitives
            .push(json!({"attributes": attributes, "indices": indices, "material": material}));
    }
    document.model(primitives, sheet);
    document.finish(sheet)
}

fn check_labels(found: usize, expected: usize) -> Result<(), TurntableGlbError> {
    if found == expected {
        Ok(())
    } else {
        Err(TurntableGlbError::LabelsDiffer { found, expected })
    }
}

fn colour(support: Support) -> [u8; 4] {
    match support {
        Support::Seen => [255, 255, 255, 255],
        Support::Hull => [190, 214, 255, 255],
        Support::Guessed => [255, 205, 160, 255],
    }
}

/// The triangles labelled `view`, with the vertices they use.
fn part_of(mesh: &ShadedMesh, labels: &[usize], view: usize) -> ShadedMesh {
    let mut part = ShadedMesh::default();
    let mut new_index = vec![u32::MAX; mesh.positions.len()];
    for (triangle, _) in mesh.triangles.iter().zip(labels).filter(|(_, label)| **label == view) {
        part.triangles.push(triangle.map(|old| {
            let index = &mut new_index[old as usize];
            if *index == u32::MAX {
                *index = part.positions.len() as u32;
                part.positions.push(mesh.positions[old as usize]);
                part.normals.push(mesh.normals[old as usize]);
                part.sources.push(mesh.sources[old as usize]);
            }
            *index
        }));
    }
    part
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sheet::Azimuth;

    fn pyramid() -> Mesh {
        let positions = [(0.0, -8.0, -5.0), (6.0, 4.0, -5.0), (-6.0, 4.0, -5.0), (0.0, 0.0, 13.0)];
        Mesh {
            positions: positions.map(|(x, y, z)| Point3::new(x, y, z)).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        }
    }

    fn rig() -> Rig {
        Rig {
            azimuths: [0.0, 22.5].map(|degrees| Azimuth::from_degrees(degrees).unwrap()).to_vec(),
            width: 40,
            height: 32,
            axis_px: 20.0,
            origin_row_px: 16.0,
        }
    }

    fn written(textured: bool) -> (gltf::Document, Vec<u8>) {
        let (mesh, rig) = (pyramid(), rig());
        let drawings = vec![GrayImage::from_pixel(40, 32, image::Luma([200])); 2];
        let sheet = Sheet {
            rig: &rig,
            drawings: &drawings,
            placement: Placement::standing(&mesh, 1.8).unwrap(),
            reference_planes: true,
        };
        let glb = if textured {
            textured_glb(&mesh, &[0, 0, 1, 2], &sheet).unwrap()
        } else {
            solid_glb(&mesh, &[Support::Seen; 4], &sheet).unwrap()
        };
        let parsed = gltf::Gltf::from_slice(&glb).unwrap();
        (parsed.document, parsed.blob.unwrap())
    }

    #[test]
    fn stands_on_the_ground_facing_the_viewer() {
        let (document, blob) = written(false);
        let mesh = document.meshes().next().unwrap();
        let primitive = mesh.primitives().next().unwrap();
        let bounds = primitive.bounding_box();
        assert_eq!(bounds.min[1], 0.0);
        assert!((bounds.max[1] - 1.8).abs() < 1e-6);
        // The corner nearest to the viewer at azimuth 0 faces +Z.
        assert!((bounds.max[2] - 0.8).abs() < 1e-6);
        let reader = primitive.reader(|_| Some(&blob));
        assert_eq!(reader.read_indices().unwrap().into_u32().count(), 12);
        assert_eq!(reader.read_normals().unwrap().len(), 12);
    }

    #[test]
    fn planes_are_named_by_azimuth() {
        let (document, _) = written(true);
        let names: Vec<_> =
            document.nodes().filter_map(|node| node.name().map(str::to_owned)).collect();
        assert_eq!(names, ["model", "ref_000", "ref_022.5"]);
        assert_eq!(document.images().count(), 2);
        let model = document.meshes().next().unwrap();
        let textured = |primitive: gltf::Primitive| {
            primitive.material().pbr_metallic_roughness().base_color_texture().is_some()
        };
        assert_eq!(model.primitives().map(textured).collect::<Vec<_>>(), [true, true, false]);
        assert!(document.materials().all(|material| material.unlit()));
    }

    #[test]
    fn labels_must_fit() {
        let (mesh, rig) = (pyramid(), rig());
        let sheet = Sheet {
            rig: &rig,
            drawings: &[],
            placement: Placement::standing(&mesh, 1.8).unwrap(),
            reference_planes: false,
        };
        assert!(matches!(
            textured_glb(&mesh, &[0], &sheet),
            Err(TurntableGlbError::LabelsDiffer { found: 1, expected: 4 })
        ));
    }
}
