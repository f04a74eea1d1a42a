//! The turntable method's models as binary glTF.

use std::borrow::Cow;

use image::{GrayImage, ImageFormat};
use nalgebra::{Point3, Vector3};
use serde_json::{Value, json};

use crate::geometry::Mesh;
use crate::turntable::mesh::confidence::Support;
use crate::turntable::mesh::shading::{CREASE_ANGLE_DEG, ShadedMesh, shaded};
use crate::turntable::mesh::texture::Rig;

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
/// * `labels`: per triangle, the view whose drawing colours it.
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

fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// A glTF document as it grows.
#[derive(Default)]
struct Document {
    bytes: Vec<u8>,
    views: Vec<Value>,
    accessors: Vec<Value>,
    meshes: Vec<Value>,
    materials: Vec<Value>,
    images: Vec<Value>,
    textures: Vec<Value>,
    nodes: Vec<Value>,
    /// Per drawing, its material once made.
    drawings: Vec<Option<usize>>,
}

fn push(list: &mut Vec<Value>, item: Value) -> usize {
    list.push(item);
    list.len() - 1
}

impl Document {
    fn begin(mesh: &Mesh) -> Result<Self, TurntableGlbError> {
        if mesh.triangles.is_empty() { Err(TurntableGlbError::Empty) } else { Ok(Self::default()) }
    }

    /// Appends `bytes`, aligned to four; `target` as glTF's buffer targets.
    fn view(&mut self, bytes: &[u8], target: Option<u32>) -> usize {
        let mut view = json!({
            "buffer": 0, "byteOffset": self.bytes.len(), "byteLength": bytes.len(),
        });
        if let Some(target) = target {
            view["target"] = json!(target);
        }
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        push(&mut self.views, view)
    }

    fn accessor<T>(
        &mut self,
        bytes: &[u8],
        items: &[T],
        component: u32,
        kind: &str,
        normalized: bool,
    ) -> Value {
        let view = self.view(bytes, Some(34962));
        let mut accessor = json!({
            "bufferView": view, "componentType": component, "count": items.len(), "type": kind,
        });
        if normalized {
            accessor["normalized"] = json!(true);
        }
        json!(push(&mut self.accessors, accessor))
    }

    fn positions(&mut self, positions: &[[f32; 3]]) -> Value {
        let index =
            self.accessor(&bytes_of(positions.as_flattened()), positions, 5126, "VEC3", false);
        let bound = |start: f32, pick: fn(f32, f32) -> f32| -> Vec<f32> {
            let of_axis = |axis| positions.iter().map(|p: &[f32; 3]| p[axis]).fold(start, pick);
            (0..3).map(of_axis).collect()
        };
        if let Some(accessor) = self.accessors.last_mut() {
            accessor["min"] = json!(bound(f32::INFINITY, f32::min));
            accessor["max"] = json!(bound(f32::NEG_INFINITY, f32::max));
        }
        index
    }

    fn geometry(&mut self, mesh: &ShadedMesh, placement: &Placement) -> Value {
        let positions: Vec<[f32; 3]> =
            mesh.positions.iter().map(|point| placement.gltf_from_turntable(point)).collect();
        let normals: Vec<[f32; 3]> = mesh.normals.iter().map(Placement::normal).collect();
        let position = self.positions(&positions);
        let normal =
            self.accessor(&bytes_of(normals.as_flattened()), &normals, 5126, "VEC3", false);
        json!({"POSITION": position, "NORMAL": normal})
    }

    fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let flat = triangles.as_flattened();
        let bytes: Vec<u8> = flat.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(34963));
        let accessor = json!({
            "bufferView": view, "componentType": 5125, "count": flat.len(), "type": "SCALAR",
        });
        push(&mut self.accessors, accessor)
    }

    fn material(&mut self, material: Value) -> usize {
        push(&mut self.materials, material)
    }

    /// The unlit, two-sided material that shows a drawing.
    fn drawing_material(
        &mut self,
        view: usize,
        drawing: &GrayImage,
        sheet: &Sheet,
    ) -> Result<usize, TurntableGlbError> {
        self.drawings.resize(sheet.drawings.len(), None);
        if let Some(material) = self.drawings[view] {
            return Ok(material);
        }
        let mut png = std::io::Cursor::new(Vec::new());
        drawing.write_to(&mut png, ImageFormat::Png)?;
        let bytes = self.view(png.get_ref(), None);
        let name = format!("view_{}", name_of(sheet, view));
        let source = push(
            &mut self.images,
            json!({"name": name, "bufferView": bytes, "mimeType": "image/png"}),
        );
        let texture = push(&mut self.textures, json!({"source": source, "sampler": 0}));
        let material = self.material(json!({
            "name": name,
            "doubleSided": true,
            "pbrMetallicRoughness": {
                "baseColorTexture": {"index": texture}, "metallicFactor": 0.0, "roughnessFactor": 1.0,
            },
            "extensions": {"KHR_materials_unlit": {}},
        }));
        self.drawings[view] = Some(material);
        Ok(material)
    }

    fn model(&mut self, primitives: Vec<Value>, sheet: &Sheet) {
        let mesh = push(&mut self.meshes, json!({"name": "model", "primitives": primitives}));
        let azimuths: Vec<f64> =
            sheet.rig.azimuths.iter().map(|azimuth| azimuth.degrees()).collect();
        self.nodes.push(json!({
            "name": "model",
            "mesh": mesh,
            "extras": {
                "turnaround": {
                    "version": env!("CARGO_PKG_VERSION"),
                    "azimuths_deg": azimuths,
                    "pixels_per_metre": 1.0 / sheet.placement.metres_per_px,
                },
            },
        }));
    }

    /// Adds each drawing as a quad behind the model, seen from its camera.
    fn reference_planes(&mut self, sheet: &Sheet) -> Result<(), TurntableGlbError> {
        let rig = sheet.rig;
        let (width, height) = (f64::from(rig.width), f64::from(rig.height));
        for (view, drawing) in sheet.drawings.iter().enumerate().take(rig.azimuths.len()) {
            let material = self.drawing_material(view, drawing, sheet)?;
            let (sine, cosine) = rig.azimuths[view].radians().sin_cos();
            let corners = [(0.0, height), (width, height), (width, 0.0), (0.0, 0.0)];
            let depth = width.max(height) / 2.0;
            let positions: Vec<[f32; 3]> = corners
                .iter()
                .map(|&(column, row)| {
                    let right = column - rig.axis_px;
                    let point = Point3::new(
                        right * cosine - depth * sine,
                        right * sine + depth * cosine,
                        rig.origin_row_px - row,
                    );
                    sheet.placement.gltf_from_turntable(&point)
                })
                .collect();
            let coordinates: [[f32; 2]; 4] = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
            let position = self.positions(&positions);
            let coordinates = self.accessor(
                &bytes_of(coordinates.as_flattened()),
                &coordinates,
                5126,
                "VEC2",
                false,
            );
            let indices = self.indices(&[[0, 1, 2], [0, 2, 3]]);
            let name = format!("ref_{}", name_of(sheet, view));
            let mesh = push(
                &mut self.meshes,
                json!({"name": name, "primitives": [{
                    "attributes": {"POSITION": position, "TEXCOORD_0": coordinates},
                    "indices": indices,
                    "material": material,
                }]}),
            );
            self.nodes.push(json!({"name": name, "mesh": mesh}));
        }
        Ok(())
    }

    fn finish(mut self, sheet: &Sheet) -> Result<Vec<u8>, TurntableGlbError> {
        if sheet.reference_planes {
            self.reference_planes(sheet)?;
        }
        let mut root = json!({
            "asset": {"version": "2.0", "generator": concat!("turnaround ", env!("CARGO_PKG_VERSION"))},
            "scene": 0,
            "scenes": [{"nodes": (0..self.nodes.len()).collect::<Vec<_>>()}],
            "nodes": self.nodes,
            "meshes": self.meshes,
            "materials": self.materials,
            "accessors": self.accessors,
            "bufferViews": self.views,
            "buffers": [{"byteLength": self.bytes.len()}],
        });
        if !self.images.is_empty() {
            root["images"] = json!(self.images);
            root["textures"] = json!(self.textures);
            root["samplers"] =
                json!([{"magFilter": 9729, "minFilter": 9987, "wrapS": 33071, "wrapT": 33071}]);
            root["extensionsUsed"] = json!(["KHR_materials_unlit"]);
        }
        // Through the typed document, so that what is written is glTF.
        let root: gltf::json::Root = serde_json::from_value(root)?;
        let glb = gltf::binary::Glb {
            header: gltf::binary::Header { magic: *b"glTF", version: 2, length: 0 },
            json: Cow::Owned(gltf::json::serialize::to_vec(&root)?),
            bin: Some(Cow::Owned(self.bytes)),
        };
        Ok(glb.to_vec()?)
    }
}

/// The azimuth as names have it: `045`, `022.5`.
fn name_of(sheet: &Sheet, view: usize) -> String {
    let text = sheet.rig.azimuths[view].to_string();
    let whole = text.split('.').next().map_or(0, str::len);
    format!("{}{text}", "0".repeat(3_usize.saturating_sub(whole)))
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
            textured_glb(&mesh, &[0, 0, 1, 1], &sheet).unwrap()
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
