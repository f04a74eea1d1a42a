//! The container of glTF and GLB: the JSON, its buffers and the extensions it needs.

use std::borrow::Cow;

use ::gltf::binary::Glb;
use ::gltf::buffer::Source;
use ::gltf::{Document, json};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;

use super::FORMAT;
use crate::read::ModelError;
use crate::read::error::shortened;

/// A parsed document with the bytes of its buffers.
pub(super) struct Container<'a> {
    pub document: Document,
    buffers: Vec<Cow<'a, [u8]>>,
}

const GLB_MAGIC: &[u8] = b"glTF";
const GLB_HEADER_BYTES: usize = 12;

/// Required extensions that say nothing about where the surface is.
const IRRELEVANT_EXTENSIONS: [&str; 5] =
    ["KHR_materials_", "KHR_texture_", "KHR_mesh_quantization", "EXT_texture_", "KHR_lights_"];

impl<'a> Container<'a> {
    pub(super) fn open(bytes: &'a [u8]) -> Result<Self, ModelError> {
        let malformed = |error: &dyn std::fmt::Display| ModelError::malformed(FORMAT, error);
        let (json, blob) = split(bytes)?;
        let mut root: json::Root =
            json::deserialize::from_slice(&json).map_err(|e| malformed(&e))?;
        // The parser refuses required extensions that it does not know, so they are sorted first.
        let required = std::mem::take(&mut root.extensions_required);
        let irrelevant = |name: &str| IRRELEVANT_EXTENSIONS.iter().any(|i| name.starts_with(i));
        if let Some(needed) = required.iter().find(|name| !irrelevant(name)) {
            return Err(ModelError::unsupported(FORMAT, format!("extension {needed}")));
        }
        check_attributes(&root)?;
        let document = Document::from_json(root).map_err(|e| malformed(&e))?;
        let buffers = document
            .buffers()
            .map(|buffer| resolved(&buffer, blob.as_ref()))
            .collect::<Result<_, _>>()?;
        Ok(Self { document, buffers })
    }

    /// The bytes of a buffer view.
    pub(super) fn view(&self, view: &::gltf::buffer::View<'_>) -> Result<&[u8], ModelError> {
        let buffer = &self.buffers[view.buffer().index()];
        let end = view.offset().checked_add(view.length());
        end.and_then(|end| buffer.get(view.offset()..end)).ok_or_else(|| {
            let reason = format!(
                "buffer view {} ends beyond its buffer of {} bytes",
                view.index(),
                buffer.len()
            );
            ModelError::malformed(FORMAT, reason)
        })
    }
}

/// The parser's validation looks attributes up before it has checked their indices.
fn check_attributes(root: &json::Root) -> Result<(), ModelError> {
    let accessors = root.accessors.len();
    let primitives = root.meshes.iter().flat_map(|mesh| &mesh.primitives);
    let mut indices = primitives.flat_map(|primitive| primitive.attributes.values());
    match indices.find(|index| index.value() >= accessors) {
        Some(index) => {
            let reason = format!("a primitive uses accessor {} of {accessors}", index.value());
            Err(ModelError::malformed(FORMAT, reason))
        }
        None => Ok(()),
    }
}

type Chunks<'a> = (Cow<'a, [u8]>, Option<Cow<'a, [u8]>>);

/// The JSON and, of binary files, the binary chunk.
fn split(bytes: &[u8]) -> Result<Chunks<'_>, ModelError> {
    if !bytes.starts_with(GLB_MAGIC) {
        return Ok((Cow::Borrowed(bytes), None));
    }
    // The parser subtracts the header's length without a look.
    let length = bytes.get(8..GLB_HEADER_BYTES).and_then(|b| b.try_into().ok());
    let length = length.map_or(0, u32::from_le_bytes) as usize;
    if length < GLB_HEADER_BYTES {
        let reason = format!("a binary file of {length} bytes by its header");
        return Err(ModelError::malformed(FORMAT, reason));
    }
    let glb = Glb::from_slice(bytes).map_err(|e| ModelError::malformed(FORMAT, e))?;
    Ok((glb.json, glb.bin))
}

fn resolved<'a>(
    buffer: &::gltf::Buffer<'_>,
    blob: Option<&Cow<'a, [u8]>>,
) -> Result<Cow<'a, [u8]>, ModelError> {
    match buffer.source() {
        Source::Bin => blob.cloned().ok_or_else(|| {
            ModelError::malformed(FORMAT, "a buffer refers to a binary chunk that is missing")
        }),
        Source::Uri(uri) => embedded(uri).map(Cow::Owned),
    }
}

fn embedded(uri: &str) -> Result<Vec<u8>, ModelError> {
    let encoded = uri
        .strip_prefix("data:")
        .and_then(|data| data.split_once(";base64,"))
        .ok_or_else(|| ModelError::ExternalReference { format: FORMAT, uri: shortened(uri) })?;
    STANDARD.decode(encoded.1).map_err(|error| ModelError::malformed(FORMAT, error))
}
