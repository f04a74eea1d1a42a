//! glTF 2.0, binary or as JSON with embedded buffers.

mod accessor;
mod container;
mod primitive;
mod skin;

use ::gltf::{Document, Node};
use nalgebra::Matrix4;

use super::finish::Soup;
use super::{Limits, ModelError};
use container::Container;
use primitive::push_primitive;

const FORMAT: &str = "glTF";

/// Deeper scene graphs are refused: they are walked recursively.
const MAX_DEPTH: usize = 256;

/// Reads the default scene, or the first one, or without scenes all nodes that have no parent.
pub(super) fn read(bytes: &[u8], limits: &Limits) -> Result<Soup, ModelError> {
    let container = Container::open(bytes)?;
    let document = &container.document;
    let mut walk =
        Walk { container: &container, limits, world_from_node: vec![None; document.nodes().len()] };
    for root in roots(document) {
        walk.place(&root, Matrix4::identity(), 0)?;
    }
    walk.meshes()
}

fn roots(document: &Document) -> Vec<Node<'_>> {
    let scene = document.default_scene().or_else(|| document.scenes().next());
    match scene {
        Some(scene) => scene.nodes().collect(),
        None => {
            let mut is_child = vec![false; document.nodes().len()];
            let children = document.nodes().flat_map(|node| node.children());
            children.for_each(|child| is_child[child.index()] = true);
            document.nodes().filter(|node| !is_child[node.index()]).collect()
        }
    }
}

struct Walk<'a> {
    container: &'a Container<'a>,
    limits: &'a Limits,
    /// Of the nodes that are in the scene.
    world_from_node: Vec<Option<Matrix4<f64>>>,
}

impl Walk<'_> {
    /// Finds the transforms of a node and all below it. Nodes form trees: one that is reached
    /// twice has two parents or is its own ancestor.
    fn place(
        &mut self,
        node: &Node<'_>,
        world_from_parent: Matrix4<f64>,
        depth: usize,
    ) -> Result<(), ModelError> {
        if depth > MAX_DEPTH {
            let reason = format!("nodes are nested deeper than {MAX_DEPTH}");
            return Err(ModelError::malformed(FORMAT, reason));
        }
        let parent_from_node = Matrix4::from(node.transform().matrix()).map(f64::from);
        let world_from_node = world_from_parent * parent_from_node;
        if self.world_from_node[node.index()].replace(world_from_node).is_some() {
            let reason = format!("node {} has more than one parent", node.index());
            return Err(ModelError::malformed(FORMAT, reason));
        }
        for child in node.children() {
            self.place(&child, world_from_node, depth + 1)?;
        }
        Ok(())
    }

    fn meshes(&self) -> Result<Soup, ModelError> {
        let mut soup = Soup::default();
        let skins = self.container.document.skins();
        let joints: Vec<_> = skins
            .map(|skin| {
                skin::world_from_bind(&skin, self.container, &self.world_from_node, self.limits)
            })
            .collect::<Result<_, _>>()?;
        for node in self.container.document.nodes() {
            let (Some(world_from_node), Some(mesh)) =
                (self.world_from_node[node.index()], node.mesh())
            else {
                continue;
            };
            let part = node.index() as u32;
            for primitive in mesh.primitives() {
                let place = primitive::Place {
                    world_from_node,
                    joints: node.skin().map(|skin| joints[skin.index()].as_slice()),
                    part,
                };
                push_primitive(&mut soup, &primitive, &place, self.container, self.limits)?;
            }
        }
        Ok(soup)
    }
}
