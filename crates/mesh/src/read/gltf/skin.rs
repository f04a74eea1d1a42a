//! The transforms of skinned vertices, in the pose that the file has.

use ::gltf::Skin;
use nalgebra::Matrix4;

use super::container::Container;
use super::{FORMAT, accessor};
use crate::read::{Limits, ModelError};

/// For each joint the transform of vertices bound to it, in the pose that the nodes have.
///
/// * `world_from_node`: `None` for nodes outside the scene, whose joints then do not move.
pub(super) fn world_from_bind(
    skin: &Skin<'_>,
    container: &Container<'_>,
    world_from_node: &[Option<Matrix4<f64>>],
    limits: &Limits,
) -> Result<Vec<Matrix4<f64>>, ModelError> {
    let node_from_bind = match skin.inverse_bind_matrices() {
        Some(matrices) if matrices.count() < skin.joints().len() => {
            let reason =
                format!("{} bind matrices of {} joints", matrices.count(), skin.joints().len());
            return Err(ModelError::malformed(FORMAT, reason));
        }
        Some(matrices) => accessor::read::<16>(&matrices, container, limits)?,
        None => Vec::new(),
    };
    let joints = skin.joints().enumerate().map(|(index, joint)| {
        let world_from_joint = world_from_node[joint.index()].unwrap_or_else(Matrix4::identity);
        let joint_from_bind = node_from_bind
            .get(index)
            .map_or_else(Matrix4::identity, |m| Matrix4::from_column_slice(m));
        world_from_joint * joint_from_bind
    });
    Ok(joints.collect())
}
