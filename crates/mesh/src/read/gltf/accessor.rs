//! Numbers out of glTF accessors, sparse ones too, every range checked.

use ::gltf::Accessor;
use ::gltf::accessor::DataType;
use ::gltf::accessor::sparse::IndexType;

use super::FORMAT;
use super::container::Container;
use crate::read::{Limits, ModelError};

/// Reads an accessor's elements of `N` components as numbers, normalised integers as fractions.
///
/// Every range is checked before it is read and the count before memory is taken.
pub(super) fn read<const N: usize>(
    accessor: &Accessor<'_>,
    container: &Container<'_>,
    limits: &Limits,
) -> Result<Vec<[f64; N]>, ModelError> {
    let found = accessor.dimensions().multiplicity();
    if found != N {
        return Err(invalid(accessor, format!("{found} components instead of {N}")));
    }
    if N == 1 {
        limits.check_triangles(accessor.count() / 3)?;
    } else {
        limits.check_vertices(accessor.count().saturating_mul(N.div_ceil(4)))?;
    }
    let mut elements = match accessor.view() {
        Some(view) => {
            let layout = Layout {
                offset: accessor.offset(),
                stride: view.stride().unwrap_or(accessor.size()),
                count: accessor.count(),
            };
            decoded(accessor, container.view(&view)?, &layout)?
        }
        None => vec![[0.0; N]; accessor.count()],
    };
    if accessor.sparse().is_some() {
        substitute(&mut elements, accessor, container)?;
    }
    Ok(elements)
}

struct Layout {
    offset: usize,
    stride: usize,
    count: usize,
}

fn decoded<const N: usize>(
    accessor: &Accessor<'_>,
    bytes: &[u8],
    layout: &Layout,
) -> Result<Vec<[f64; N]>, ModelError> {
    let size = component_size(accessor.data_type());
    let end = layout
        .count
        .saturating_sub(1)
        .checked_mul(layout.stride)
        .and_then(|last| last.checked_add(layout.offset)?.checked_add(N * size))
        .filter(|&end| end <= bytes.len());
    if end.is_none() && layout.count > 0 {
        let reason = format!("its {} elements do not fit {} bytes", layout.count, bytes.len());
        return Err(invalid(accessor, reason));
    }
    let element = |index: usize| {
        let first = layout.offset + index * layout.stride;
        std::array::from_fn(|component| {
            let start = first + component * size;
            component_value(
                &bytes[start..start + size],
                accessor.data_type(),
                accessor.normalized(),
            )
        })
    };
    Ok((0..layout.count).map(element).collect())
}

fn substitute<const N: usize>(
    elements: &mut [[f64; N]],
    accessor: &Accessor<'_>,
    container: &Container<'_>,
) -> Result<(), ModelError> {
    let Some(sparse) = accessor.sparse() else {
        return Ok(());
    };
    let indices = sparse.indices();
    let index_type = match indices.index_type() {
        IndexType::U8 => DataType::U8,
        IndexType::U16 => DataType::U16,
        IndexType::U32 => DataType::U32,
    };
    let index_size = component_size(index_type);
    let count = sparse.count();
    let positions = container.view(&indices.view())?;
    let positions = indices
        .offset()
        .checked_add(count.saturating_mul(index_size))
        .and_then(|end| positions.get(indices.offset()..end))
        .ok_or_else(|| invalid(accessor, "its sparse indices end beyond their view".to_owned()))?;
    let layout = Layout { offset: sparse.values().offset(), stride: accessor.size(), count };
    let values: Vec<[f64; N]> =
        decoded(accessor, container.view(&sparse.values().view())?, &layout)?;
    for (position, value) in positions.chunks_exact(index_size).zip(values) {
        let index = component_value(position, index_type, false) as usize;
        let count = elements.len();
        *elements.get_mut(index).ok_or_else(|| {
            invalid(accessor, format!("sparse index {index} of {count} elements"))
        })? = value;
    }
    Ok(())
}

fn component_size(data_type: DataType) -> usize {
    match data_type {
        DataType::I8 | DataType::U8 => 1,
        DataType::I16 | DataType::U16 => 2,
        DataType::U32 | DataType::F32 => 4,
    }
}

/// * `bytes`: as many as the type has.
fn component_value(bytes: &[u8], data_type: DataType, normalized: bool) -> f64 {
    let byte = |index: usize| bytes.get(index).copied().unwrap_or_default();
    let two = [byte(0), byte(1)];
    let four = [byte(0), byte(1), byte(2), byte(3)];
    let (value, largest) = match data_type {
        DataType::I8 => (f64::from(byte(0) as i8), f64::from(i8::MAX)),
        DataType::U8 => (f64::from(byte(0)), f64::from(u8::MAX)),
        DataType::I16 => (f64::from(i16::from_le_bytes(two)), f64::from(i16::MAX)),
        DataType::U16 => (f64::from(u16::from_le_bytes(two)), f64::from(u16::MAX)),
        DataType::U32 => (f64::from(u32::from_le_bytes(four)), f64::from(u32::MAX)),
        DataType::F32 => return f64::from(f32::from_le_bytes(four)),
    };
    if normalized { (value / largest).max(-1.0) } else { value }
}

fn invalid(accessor: &Accessor<'_>, reason: String) -> ModelError {
    ModelError::malformed(FORMAT, format!("accessor {}: {reason}", accessor.index()))
}
