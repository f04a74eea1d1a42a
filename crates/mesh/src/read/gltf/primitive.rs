//! The triangles of a glTF mesh, placed in the scene.

use ::gltf::mesh::Mode;
use ::gltf::{Primitive, Semantic};
use nalgebra::{Matrix3, Matrix4, Point3, Vector3};

use super::FORMAT;
use super::accessor;
use super::container::Container;
use crate::read::finish::Soup;
use crate::read::{Limits, LinearRgb, ModelError};

/// Where a mesh stands in the scene.
pub(super) struct Place<'a> {
    pub world_from_node: Matrix4<f64>,
    /// World from bind pose for each joint of the mesh's skin; replaces the node's transform.
    pub joints: Option<&'a [Matrix4<f64>]>,
    pub part: u32,
}

/// Adds a primitive's triangles to the soup; points and lines are left out.
pub(super) fn push_primitive(
    soup: &mut Soup,
    primitive: &Primitive<'_>,
    place: &Place<'_>,
    container: &Container<'_>,
    limits: &Limits,
) -> Result<(), ModelError> {
    let Some(positions) = primitive.get(&Semantic::Positions) else {
        return Ok(());
    };
    let corners = match primitive.mode() {
        Mode::Triangles | Mode::TriangleStrip | Mode::TriangleFan => {
            corners(primitive, positions.count(), container, limits)?
        }
        _ => return Ok(()),
    };
    limits.check_vertices(soup.positions.len().saturating_add(positions.count()))?;
    limits.check_triangles(soup.triangles.len().saturating_add(corners.len()))?;
    let positions = accessor::read::<3>(&positions, container, limits)?;
    let transforms = transforms(primitive, positions.len(), place, container, limits)?;
    let normals = match primitive.get(&Semantic::Normals) {
        Some(normals) => {
            let normals = accessor::read::<3>(&normals, container, limits)?;
            Some(placed_normals(&normals, &transforms))
        }
        None => None,
    };
    let colours = colours(primitive, container, limits)?;
    let first = soup.positions.len() as u32;
    let material = primitive.material().index().map_or(0, |index| index as u32 + 1);
    for (index, &position) in positions.iter().enumerate() {
        let point = transforms.of(index).transform_point(&Point3::from(position));
        soup.positions.push(point.coords);
        soup.parts.push(place.part);
    }
    let mirrored = transforms.mirror();
    for triangle in corners {
        if let Some(&vertex) = triangle.iter().find(|&&v| v as usize >= positions.len()) {
            return Err(ModelError::IndexOutOfRange {
                triangle: soup.triangles.len(),
                vertex: i64::from(vertex),
                vertices: positions.len(),
            });
        }
        let [a, b, c] = triangle.map(|v| v + first);
        soup.triangles.push(if mirrored { [a, c, b] } else { [a, b, c] });
        soup.materials.push(material);
        soup.corner_normals.push(normals.as_ref().and_then(|normals| {
            let normal = |v: u32| normals.get(v as usize).copied();
            let [a, b, c] = triangle;
            let (b, c) = if mirrored { (c, b) } else { (b, c) };
            Some([normal(a)?, normal(b)?, normal(c)?])
        }));
        let [a, b, c] = triangle;
        let corners = if mirrored { [a, c, b] } else { [a, b, c] };
        soup.corner_colours.push(colours.at(corners));
    }
    Ok(())
}

/// What a primitive's surface is coloured with; its textures are left out.
struct Colours {
    /// Of the material; `None` for the default one.
    base: Option<LinearRgb>,
    vertices: Option<Vec<LinearRgb>>,
}

impl Colours {
    /// Colours of vertices are multiplied with the material's, as glTF says.
    fn at(&self, corners: [u32; 3]) -> Option<[LinearRgb; 3]> {
        let base = self.base.unwrap_or([1.0; 3]);
        match &self.vertices {
            None => self.base.map(|base| [base; 3]),
            Some(colours) => Some(corners.map(|vertex| {
                let own = colours.get(vertex as usize).copied().unwrap_or([1.0; 3]);
                std::array::from_fn(|channel| own[channel] * base[channel])
            })),
        }
    }
}

fn colours(
    primitive: &Primitive<'_>,
    container: &Container<'_>,
    limits: &Limits,
) -> Result<Colours, ModelError> {
    let material = primitive.material();
    let [r, g, b, _] = material.pbr_metallic_roughness().base_color_factor();
    let base = material.index().map(|_| [r, g, b]);
    let Some(accessor) = primitive.get(&Semantic::Colors(0)) else {
        return Ok(Colours { base, vertices: None });
    };
    let rgb = |[r, g, b]: [f64; 3]| [r as f32, g as f32, b as f32];
    let vertices = if accessor.dimensions().multiplicity() == 3 {
        accessor::read::<3>(&accessor, container, limits)?.into_iter().map(rgb).collect()
    } else {
        let with_alpha = accessor::read::<4>(&accessor, container, limits)?;
        with_alpha.into_iter().map(|[r, g, b, _]| rgb([r, g, b])).collect()
    };
    Ok(Colours { base, vertices: Some(vertices) })
}

/// The vertex indices of the triangles.
fn corners(
    primitive: &Primitive<'_>,
    vertices: usize,
    container: &Container<'_>,
    limits: &Limits,
) -> Result<Vec<[u32; 3]>, ModelError> {
    limits.check_vertices(vertices)?;
    let indices: Vec<u32> = match primitive.indices() {
        Some(indices) => {
            let indices = accessor::read::<1>(&indices, container, limits)?;
            // Whole numbers of at most 32 bits; who they point at is checked below.
            indices.into_iter().map(|[index]| index as u32).collect()
        }
        None => (0..vertices as u32).collect(),
    };
    Ok(match primitive.mode() {
        Mode::TriangleStrip => {
            let windows = indices.windows(3).enumerate();
            // Every other triangle of a strip runs the other way round.
            let turned = |(index, w): (usize, &[u32])| {
                if index % 2 == 0 { [w[0], w[1], w[2]] } else { [w[1], w[0], w[2]] }
            };
            windows.map(turned).collect()
        }
        Mode::TriangleFan => {
            let centre = indices.first().copied().unwrap_or_default();
            let rim = indices.get(1..).unwrap_or_default();
            rim.windows(2).map(|w| [centre, w[0], w[1]]).collect()
        }
        _ => indices.as_chunks::<3>().0.to_vec(),
    })
}

/// World from mesh, one for all vertices or one each.
enum Transforms {
    Same(Matrix4<f64>),
    Each(Vec<Matrix4<f64>>),
}

impl Transforms {
    /// Whether triangles come out the other way round.
    fn mirror(&self) -> bool {
        matches!(self, Self::Same(transform) if transform.determinant() < 0.0)
    }

    fn of(&self, vertex: usize) -> Matrix4<f64> {
        match self {
            Self::Same(transform) => *transform,
            Self::Each(transforms) => {
                transforms.get(vertex).copied().unwrap_or_else(Matrix4::identity)
            }
        }
    }
}

fn transforms(
    primitive: &Primitive<'_>,
    vertices: usize,
    place: &Place<'_>,
    container: &Container<'_>,
    limits: &Limits,
) -> Result<Transforms, ModelError> {
    let influences =
        (place.joints, primitive.get(&Semantic::Joints(0)), primitive.get(&Semantic::Weights(0)));
    let (Some(joints), Some(indices), Some(weights)) = influences else {
        return Ok(Transforms::Same(place.world_from_node));
    };
    let indices = accessor::read::<4>(&indices, container, limits)?;
    let weights = accessor::read::<4>(&weights, container, limits)?;
    if indices.len() < vertices || weights.len() < vertices {
        return Err(ModelError::malformed(FORMAT, "a skin with too few joints or weights"));
    }
    let blended = |(indices, weights): (&[f64; 4], &[f64; 4])| {
        let total: f64 = weights.iter().sum();
        if !(total.is_finite() && total > 0.0) {
            return Ok(place.world_from_node);
        }
        let mut sum = Matrix4::zeros();
        for (index, weight) in indices.iter().zip(weights) {
            let joint = joints.get(*index as usize).ok_or_else(|| {
                let reason = format!("joint {index} of a skin with {}", joints.len());
                ModelError::malformed(FORMAT, reason)
            })?;
            sum += joint * (weight / total);
        }
        Ok(sum)
    };
    let each = indices.iter().zip(&weights).take(vertices).map(blended);
    Ok(Transforms::Each(each.collect::<Result<_, _>>()?))
}

/// Normals turn by the inverse transpose of what points do.
fn placed_normals(normals: &[[f64; 3]], transforms: &Transforms) -> Vec<Vector3<f64>> {
    let normal_matrix = |transform: Matrix4<f64>| -> Matrix3<f64> {
        let linear = transform.fixed_view::<3, 3>(0, 0).into_owned();
        linear.try_inverse().map_or(linear, |inverse| inverse.transpose())
    };
    if let Transforms::Same(transform) = transforms {
        let matrix = normal_matrix(*transform);
        return normals.iter().map(|&n| matrix * Vector3::from(n)).collect();
    }
    let each = normals.iter().enumerate();
    each.map(|(index, &n)| normal_matrix(transforms.of(index)) * Vector3::from(n)).collect()
}
