//! Binary glTF 2.0, written part by part.

use std::borrow::Cow;
use std::collections::BTreeMap;

use gltf::binary::{Glb, Header};
use gltf::json::accessor::{ComponentType, GenericComponentType, Type};
use gltf::json::buffer::{Target, View};
use gltf::json::material::{PbrMetallicRoughness, StrengthFactor};
use gltf::json::mesh::{Mode, Primitive, Semantic};
use gltf::json::validation::{Checked, USize64};
use gltf::json::{self, Accessor, Index, Material, Root, texture};
use picture::EncodeError;
use serde::Serialize;

/// A glTF document as it grows, with its binary chunk.
///
/// Parts are referred to by the index that adding them returns; nodes become
/// roots of the one scene, in the order they were added.
///
/// # Source
/// Khronos, glTF 2.0 Specification, §3 and §4.
pub struct GlbWriter {
    root: Root,
    bytes: Vec<u8>,
}

/// The vertex attributes of a primitive by their meaning.
pub type Attributes = BTreeMap<Checked<Semantic>, Index<Accessor>>;

const WHAT: &str = "a model";

impl GlbWriter {
    /// * `generator`: who writes, such as `turnaround 1.2.3`.
    pub fn new(generator: String) -> Self {
        let mut root = Root::default();
        root.asset.generator = Some(generator);
        Self { root, bytes: Vec::new() }
    }

    /// Positions in metres, Y up; the accessor has their bounds.
    pub fn positions(&mut self, positions: &[[f32; 3]]) -> Index<Accessor> {
        let bound = |start: f32, pick: fn(f32, f32) -> f32| {
            let of_axis = |axis: usize| positions.iter().map(|p| p[axis]).fold(start, pick);
            Some(serde_json::json!([of_axis(0), of_axis(1), of_axis(2)]))
        };
        let (min, max) = (bound(f32::INFINITY, f32::min), bound(f32::NEG_INFINITY, f32::max));
        let index = self.floats(positions, Type::Vec3);
        let accessor = &mut self.root.accessors[index.value()];
        (accessor.min, accessor.max) = (min, max);
        index
    }

    /// Unit normals.
    pub fn normals(&mut self, normals: &[[f32; 3]]) -> Index<Accessor> {
        self.floats(normals, Type::Vec3)
    }

    /// Unit tangents with the sign of their bitangent: the cross product of normal and tangent
    /// times it is up in the texture.
    pub fn tangents(&mut self, tangents: &[[f32; 4]]) -> Index<Accessor> {
        self.floats(tangents, Type::Vec4)
    }

    /// Texture coordinates, from the texture's top left corner.
    pub fn texture_coordinates(&mut self, coordinates: &[[f32; 2]]) -> Index<Accessor> {
        self.floats(coordinates, Type::Vec2)
    }

    /// Vertex colours, linear, with alpha.
    pub fn colors(&mut self, colors: &[[u8; 4]]) -> Index<Accessor> {
        let view = self.view(colors.as_flattened(), Some(Target::ArrayBuffer));
        let accessor = accessor(view, colors.len(), ComponentType::U8, Type::Vec4);
        self.root.push(Accessor { normalized: true, ..accessor })
    }

    /// The corners of triangles, counter-clockwise seen from outside.
    pub fn triangles(&mut self, triangles: &[[u32; 3]]) -> Index<Accessor> {
        let corners = triangles.as_flattened();
        let bytes: Vec<u8> = corners.iter().flat_map(|index| index.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(Target::ElementArrayBuffer));
        self.root.push(accessor(view, corners.len(), ComponentType::U32, Type::Scalar))
    }

    /// A texture of an embedded PNG; it is clamped at its edges.
    pub fn png_texture(&mut self, name: &str, png: &[u8]) -> Index<json::Texture> {
        let view = self.view(png, None);
        if self.root.samplers.is_empty() {
            self.root.push(texture::Sampler {
                mag_filter: Some(Checked::Valid(texture::MagFilter::Linear)),
                min_filter: Some(Checked::Valid(texture::MinFilter::LinearMipmapLinear)),
                wrap_s: Checked::Valid(texture::WrappingMode::ClampToEdge),
                wrap_t: Checked::Valid(texture::WrappingMode::ClampToEdge),
                ..texture::Sampler::default()
            });
        }
        let source = self.root.push(json::Image {
            buffer_view: Some(view),
            mime_type: Some(json::image::MimeType("image/png".to_owned())),
            name: Some(name.to_owned()),
            uri: None,
            extensions: None,
            extras: None,
        });
        self.root.push(json::Texture {
            name: None,
            sampler: Some(Index::new(0)),
            source,
            extensions: None,
            extras: None,
        })
    }

    /// Adds a material; see [`matte`] and [`unlit`].
    pub fn material(&mut self, material: Material) -> Index<Material> {
        const UNLIT: &str = "KHR_materials_unlit";
        let used = &mut self.root.extensions_used;
        let is_unlit = material.extensions.as_ref().is_some_and(|found| found.unlit.is_some());
        if is_unlit && !used.iter().any(|name| name == UNLIT) {
            used.push(UNLIT.to_owned());
        }
        self.root.push(material)
    }

    /// A node of its own mesh, at the origin.
    ///
    /// # Errors
    /// [`EncodeError`] if `extras` cannot be written as JSON.
    pub fn node(
        &mut self,
        name: &str,
        primitives: Vec<Primitive>,
        extras: Option<&impl Serialize>,
    ) -> Result<(), EncodeError> {
        let mesh = self.root.push(json::Mesh {
            name: Some(name.to_owned()),
            primitives,
            weights: None,
            extensions: None,
            extras: None,
        });
        let extras = extras.map(serde_json::value::to_raw_value).transpose();
        self.root.push(json::Node {
            mesh: Some(mesh),
            name: Some(name.to_owned()),
            extras: extras.map_err(|error| EncodeError::new(WHAT, error))?,
            ..json::Node::default()
        });
        Ok(())
    }

    /// The finished file.
    ///
    /// # Errors
    /// [`EncodeError`] if it is too large for the format.
    pub fn finish(mut self) -> Result<Vec<u8>, EncodeError> {
        let nodes = (0..self.root.nodes.len() as u32).map(Index::new).collect();
        let scene = json::Scene { extensions: None, extras: None, name: None, nodes };
        self.root.scene = Some(self.root.push(scene));
        self.root.push(json::Buffer {
            byte_length: USize64::from(self.bytes.len()),
            extensions: None,
            extras: None,
            name: None,
            uri: None,
        });
        let json = self.root.to_vec().map_err(|error| EncodeError::new(WHAT, error))?;
        // 64 bytes cover all headers and padding.
        let length = u32::try_from(json.len() + self.bytes.len() + 64)
            .map_err(|error| EncodeError::new(WHAT, error))?;
        let header = Header { magic: *b"glTF", version: 2, length };
        Glb { header, json: Cow::Owned(json), bin: Some(Cow::Owned(self.bytes)) }
            .to_vec()
            .map_err(|error| EncodeError::new(WHAT, error))
    }

    fn floats<const N: usize>(&mut self, values: &[[f32; N]], shape: Type) -> Index<Accessor> {
        let bytes: Vec<u8> =
            values.as_flattened().iter().flat_map(|value| value.to_le_bytes()).collect();
        let view = self.view(&bytes, Some(Target::ArrayBuffer));
        self.root.push(accessor(view, values.len(), ComponentType::F32, shape))
    }

    /// Appends `bytes`, aligned to four.
    fn view(&mut self, bytes: &[u8], target: Option<Target>) -> Index<View> {
        let byte_offset = Some(USize64::from(self.bytes.len()));
        self.bytes.extend_from_slice(bytes);
        self.bytes.resize(self.bytes.len().next_multiple_of(4), 0);
        self.root.push(View {
            buffer: Index::new(0),
            byte_length: USize64::from(bytes.len()),
            byte_offset,
            byte_stride: None,
            name: None,
            target: target.map(Checked::Valid),
            extensions: None,
            extras: None,
        })
    }
}

fn accessor(view: Index<View>, count: usize, component: ComponentType, shape: Type) -> Accessor {
    Accessor {
        buffer_view: Some(view),
        byte_offset: None,
        count: USize64::from(count),
        component_type: Checked::Valid(GenericComponentType(component)),
        extensions: None,
        extras: None,
        type_: Checked::Valid(shape),
        min: None,
        max: None,
        name: None,
        normalized: false,
        sparse: None,
    }
}

/// A primitive of triangles.
pub fn triangle_primitive(
    attributes: impl IntoIterator<Item = (Semantic, Index<Accessor>)>,
    triangles: Index<Accessor>,
    material: Index<Material>,
) -> Primitive {
    let attributes = attributes.into_iter().map(|(meaning, of)| (Checked::Valid(meaning), of));
    Primitive {
        attributes: attributes.collect::<Attributes>(),
        extensions: None,
        extras: None,
        indices: Some(triangles),
        material: Some(material),
        mode: Checked::Valid(Mode::Triangles),
        targets: None,
    }
}

/// Neither metallic nor shining.
pub fn matte(name: &str, base_color: [f32; 4]) -> Material {
    Material {
        name: Some(name.to_owned()),
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_factor: json::material::PbrBaseColorFactor(base_color),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(0.9),
            ..PbrMetallicRoughness::default()
        },
        ..Material::default()
    }
}

/// As [`matte`], bent by a texture of normals.
pub fn carved(name: &str, base_color: [f32; 4], normals: Index<json::Texture>) -> Material {
    Material {
        normal_texture: Some(json::material::NormalTexture {
            index: normals,
            scale: 1.0,
            tex_coord: 0,
            extensions: None,
            extras: None,
        }),
        ..matte(name, base_color)
    }
}

/// Shown as it is, without light, from both sides (`KHR_materials_unlit`).
pub fn unlit(name: &str, texture: Option<Index<json::Texture>>) -> Material {
    Material {
        name: Some(name.to_owned()),
        double_sided: true,
        pbr_metallic_roughness: PbrMetallicRoughness {
            base_color_texture: texture.map(|index| texture::Info {
                index,
                tex_coord: 0,
                extensions: None,
                extras: None,
            }),
            metallic_factor: StrengthFactor(0.0),
            roughness_factor: StrengthFactor(1.0),
            ..PbrMetallicRoughness::default()
        },
        extensions: Some(json::extensions::material::Material {
            unlit: Some(json::extensions::material::Unlit {}),
        }),
        ..Material::default()
    }
}
