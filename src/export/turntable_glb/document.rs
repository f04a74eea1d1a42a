//! A glTF document as it grows.

use std::borrow::Cow;

use image::{GrayImage, ImageFormat};
use nalgebra::Point3;
use serde_json::{Value, json};

use super::{Placement, Sheet, TurntableGlbError};
use crate::geometry::Mesh;
use crate::turntable::mesh::shading::ShadedMesh;

pub fn bytes_of(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|value| value.to_le_bytes()).collect()
}

/// The parts that a document refers to by index, and the binary chunk.
#[derive(Default)]
pub struct Document {
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
    pub fn begin(mesh: &Mesh) -> Result<Self, TurntableGlbError> {
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

    pub fn accessor<T>(
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

    pub fn geometry(&mut self, mesh: &ShadedMesh, placement: &Placement) -> Value {
        let positions: Vec<[f32; 3]> =
            mesh.positions.iter().map(|point| placement.gltf_from_turntable(point)).collect();
        let normals: Vec<[f32; 3]> = mesh.normals.iter().map(Placement::normal).collect();
        let position = self.positions(&positions);
        let normal =
            self.accessor(&bytes_of(normals.as_flattened()), &normals, 5126, "VEC3", false);
        json!({"POSITION": position, "NORMAL": normal})
    }

    pub fn indices(&mut self, triangles: &[[u32; 3]]) -> usize {
        let flat = triangles.as_flattened();
        let bytes: Vec<u8> = flat.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(34963));
        let accessor = json!({
            "bufferView": view, "componentType": 5125, "count": flat.len(), "type": "SCALAR",
        });
        push(&mut self.accessors, accessor)
    }

    pub fn material(&mut self, material: Value) -> usize {
        push(&mut self.materials, material)
    }

    /// The unlit, two-sided material that shows a drawing.
    pub fn drawing_material(
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

    pub fn model(&mut self, primitives: Vec<Value>, sheet: &Sheet) {
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

    pub fn finish(mut self, sheet: &Sheet) -> Result<Vec<u8>, TurntableGlbError> {
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
        }
        if self.materials.iter().any(|material| material.get("extensions").is_some()) {
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
