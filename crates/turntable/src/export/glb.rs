//! The draft as binary glTF: with its support as colours, and with a texture of
//! the drawings' colours.

use frames::Placement;
use gltf::json::mesh::{Primitive, Semantic};
use gltf::json::{Accessor, Index};
use mesh::Mesh;
use mesh::shading::{CREASE_ANGLE_DEG, ShadedMesh, shaded};
use mesh::write::glb::{GlbWriter, carved, matte, triangle_primitive, unlit};
use nalgebra::Vector3;
use picture::{EncodeError, png};
use serde_json::json;
use sheet::View;

use crate::surface::projection::Rig;
use crate::surface::support::Support;
use crate::texture::Textured;

/// Linear RGBA.
const CLAY: [f32; 4] = [0.6, 0.58, 0.55, 1.0];

/// What the model and its reference planes are drawn from.
pub(super) struct Drawn<'a> {
    pub rig: &'a Rig,
    /// Of the rig's views, in their order.
    pub drawings: Vec<&'a View>,
    pub placement: &'a Placement,
}

/// The model with its support as vertex colours: white what lines or depths
/// show, blue what outlines bound, orange what is guessed.
///
/// # Errors
/// [`EncodeError`] for a mesh without triangles and supports that are not its own.
pub(super) fn solid_glb(
    mesh: &Mesh,
    support: &[Support],
    drawn: &Drawn<'_>,
) -> Result<Vec<u8>, EncodeError> {
    check(mesh, support.len(), mesh.positions.len())?;
    let mut file = writer();
    let shaded = shaded(mesh, CREASE_ANGLE_DEG);
    let material = file.material(matte("solid", [1.0; 4]));
    let colours: Vec<[u8; 4]> =
        shaded.sources.iter().map(|&source| colour(support[source as usize])).collect();
    let mut attributes = geometry(&mut file, &shaded, drawn.placement);
    attributes.push((Semantic::Colors(0), file.colors(&colours)));
    let triangles = file.triangles(&shaded.triangles);
    model_node(&mut file, vec![triangle_primitive(attributes, triangles, material)], drawn)?;
    file.finish()
}

/// The model as grey triangles.
///
/// # Errors
/// [`EncodeError`] for a mesh without triangles.
pub(super) fn low_poly_glb(mesh: &Mesh, drawn: &Drawn<'_>) -> Result<Vec<u8>, EncodeError> {
    check(mesh, 0, 0)?;
    let mut file = writer();
    let shaded = shaded(mesh, CREASE_ANGLE_DEG);
    let material = file.material(matte("solid", CLAY));
    let attributes = geometry(&mut file, &shaded, drawn.placement);
    let triangles = file.triangles(&shaded.triangles);
    model_node(&mut file, vec![triangle_primitive(attributes, triangles, material)], drawn)?;
    file.finish()
}

/// The model with its texture, unlit: a drawing's colours are lit already.
///
/// * `texture_png`: the texture, encoded.
/// * `reference_planes`: whether each drawing is added as a plane behind the
///   model.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub(super) fn textured_glb(
    textured: &Textured,
    texture_png: &[u8],
    drawn: &Drawn<'_>,
    reference_planes: bool,
) -> Result<Vec<u8>, EncodeError> {
    let mut file = writer();
    let texture = file.png_texture("model", texture_png);
    let material = file.material(unlit("model", Some(texture)));
    let mut attributes = geometry(&mut file, &textured.mesh, drawn.placement);
    let coordinates = file.texture_coordinates(&textured.coordinates);
    attributes.push((Semantic::TexCoords(0), coordinates));
    let triangles = file.triangles(&textured.mesh.triangles);
    model_node(&mut file, vec![triangle_primitive(attributes, triangles, material)], drawn)?;
    for view in (0..drawn.rig.viewpoints.len()).filter(|_| reference_planes) {
        reference_plane(&mut file, view, drawn)?;
    }
    file.finish()
}

/// The model as of clay, the lines of its drawings cut into it by a normal map.
///
/// # Errors
/// [`EncodeError`] for a picture that cannot be written.
pub(super) fn relief_glb(textured: &Textured, drawn: &Drawn<'_>) -> Result<Vec<u8>, EncodeError> {
    let mut file = writer();
    let normals = file.png_texture("normals", &png(&textured.normal_map())?);
    let material = file.material(carved("relief", CLAY, normals));
    let mut attributes = geometry(&mut file, &textured.mesh, drawn.placement);
    let tangents: Vec<[f32; 4]> = textured
        .tangents()
        .iter()
        .map(|(tangent, sign)| {
            let [x, y, z] = Placement::gltf_direction(tangent);
            [x, y, z, *sign]
        })
        .collect();
    attributes.push((Semantic::Tangents, file.tangents(&tangents)));
    let coordinates = file.texture_coordinates(&textured.coordinates);
    attributes.push((Semantic::TexCoords(0), coordinates));
    let triangles = file.triangles(&textured.mesh.triangles);
    model_node(&mut file, vec![triangle_primitive(attributes, triangles, material)], drawn)?;
    file.finish()
}

/// Why a mesh without triangles is not written.
pub(super) fn no_triangles() -> EncodeError {
    EncodeError::new("the model", "it has no triangles")
}

fn check(mesh: &Mesh, found: usize, expected: usize) -> Result<(), EncodeError> {
    if mesh.triangles.is_empty() {
        Err(no_triangles())
    } else if found != expected {
        let reason = format!("{found} labels were given for {expected} items");
        Err(EncodeError::new("the model", reason))
    } else {
        Ok(())
    }
}

fn writer() -> GlbWriter {
    GlbWriter::new(concat!("turnaround ", env!("CARGO_PKG_VERSION")).to_owned())
}

type Attributes = Vec<(Semantic, Index<Accessor>)>;

fn geometry(file: &mut GlbWriter, mesh: &ShadedMesh, placement: &Placement) -> Attributes {
    let positions: Vec<[f32; 3]> =
        mesh.positions.iter().map(|point| placement.gltf_from_turntable(point)).collect();
    let normals: Vec<[f32; 3]> = mesh.normals.iter().map(Placement::gltf_direction).collect();
    vec![
        (Semantic::Positions, file.positions(&positions)),
        (Semantic::Normals, file.normals(&normals)),
    ]
}

fn model_node(
    file: &mut GlbWriter,
    primitives: Vec<Primitive>,
    drawn: &Drawn<'_>,
) -> Result<(), EncodeError> {
    let viewpoints = || drawn.rig.viewpoints.iter();
    let azimuths: Vec<f64> = viewpoints().map(|view| view.azimuth.degrees()).collect();
    let elevations: Vec<f64> = viewpoints().map(|view| view.elevation.degrees()).collect();
    let extras = json!({
        "turnaround": {
            "version": env!("CARGO_PKG_VERSION"),
            "azimuths_deg": azimuths,
            "elevations_deg": elevations,
            "pixels_per_metre": drawn.placement.pixels_per_metre(),
        },
    });
    file.node("model", primitives, Some(&extras))
}

/// In the drawing's colours, where it has any.
fn drawing_png(view: &View) -> Result<Vec<u8>, EncodeError> {
    match &view.color {
        Some(color) => png(color),
        None => png(&view.image),
    }
}

/// A drawing as a quad behind the model, seen from its camera.
fn reference_plane(
    file: &mut GlbWriter,
    view: usize,
    drawn: &Drawn<'_>,
) -> Result<(), EncodeError> {
    let rig = drawn.rig;
    let name = format!("view_{}", rig.viewpoints[view].padded());
    let texture = file.png_texture(&name, &drawing_png(drawn.drawings[view])?);
    let material = file.material(unlit(&name, Some(texture)));
    let (width, height) = (f64::from(rig.width), f64::from(rig.height));
    let depth = width.max(height) / 2.0;
    let corners = [(0.0, height), (width, height), (width, 0.0), (0.0, 0.0)];
    let positions = corners.map(|(column, row)| {
        let point = rig.unproject(view, &Vector3::new(column, row, depth));
        drawn.placement.gltf_from_turntable(&point)
    });
    let coordinates = [[0.0, 1.0], [1.0, 1.0], [1.0, 0.0], [0.0, 0.0]];
    let attributes = [
        (Semantic::Positions, file.positions(&positions)),
        (Semantic::TexCoords(0), file.texture_coordinates(&coordinates)),
    ];
    let triangles = file.triangles(&[[0, 1, 2], [0, 2, 3]]);
    let name = format!("ref_{}", rig.viewpoints[view].padded());
    file.node(&name, vec![triangle_primitive(attributes, triangles, material)], NO_EXTRAS)
}

const NO_EXTRAS: Option<&()> = None;

fn colour(support: Support) -> [u8; 4] {
    match support {
        Support::Seen => [255, 255, 255, 255],
        Support::Hull => [190, 214, 255, 255],
        Support::Guessed => [255, 205, 160, 255],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use frames::{Azimuth, ExportOptions};
    use nalgebra::Point3;

    fn pyramid() -> Mesh {
        let positions = [(0.0, -8.0, -5.0), (6.0, 4.0, -5.0), (-6.0, 4.0, -5.0), (0.0, 0.0, 13.0)];
        Mesh {
            positions: positions.map(|(x, y, z)| Point3::new(x, y, z)).to_vec(),
            triangles: vec![[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]],
        }
    }

    fn rig() -> Rig {
        Rig {
            viewpoints: [0.0, 22.5]
                .map(|degrees| Azimuth::from_degrees(degrees).unwrap().into())
                .to_vec(),
            width: 40,
            height: 32,
            axis_px: 20.0,
            origin_row_px: 16.0,
        }
    }

    fn written(textured: bool) -> (gltf::Document, Vec<u8>) {
        let (mesh, rig) = (pyramid(), rig());
        let image = image::GrayImage::from_pixel(40, 32, image::Luma([200]));
        let drawing = View::level(Azimuth::from_degrees(0.0).unwrap(), image, None);
        let placement = Placement::new(mesh.bounds().unwrap(), &ExportOptions::default());
        let drawn = Drawn { rig: &rig, drawings: vec![&drawing; 2], placement: &placement };
        let glb = if textured {
            let textured = Textured {
                mesh: shaded(&mesh, CREASE_ANGLE_DEG),
                coordinates: vec![[0.5; 2]; 12],
                quads: vec![],
                texture: image::RgbImage::new(8, 8),
            };
            let texture = png(&textured.texture).unwrap();
            textured_glb(&textured, &texture, &drawn, true).unwrap()
        } else {
            solid_glb(&mesh, &[Support::Seen; 4], &drawn).unwrap()
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
        assert_eq!(document.images().count(), 3);
        let model = document.meshes().next().unwrap();
        let textured = |primitive: gltf::Primitive| {
            primitive.material().pbr_metallic_roughness().base_color_texture().is_some()
        };
        assert_eq!(model.primitives().map(textured).collect::<Vec<_>>(), [true]);
        assert!(document.materials().all(|material| material.unlit()));
    }

    #[test]
    fn labels_must_fit() {
        let (mesh, rig) = (pyramid(), rig());
        let placement = Placement::new(mesh.bounds().unwrap(), &ExportOptions::default());
        let drawn = Drawn { rig: &rig, drawings: vec![], placement: &placement };
        let error = solid_glb(&mesh, &[Support::Seen], &drawn).unwrap_err();
        assert!(error.to_string().contains("1 labels were given for 4"), "{error}");
    }
}
