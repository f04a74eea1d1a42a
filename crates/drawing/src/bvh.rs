//! A bounding volume tree that finds the triangles over a place of a view.

use nalgebra::Point3;

/// A bounding box in the view frame; of z only the nearest is of interest.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewBox {
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub nearest: f64,
}

impl ViewBox {
    pub(crate) fn of(points: &[Point3<f64>]) -> Self {
        let mut view_box =
            Self { low: [f64::INFINITY; 2], high: [f64::NEG_INFINITY; 2], nearest: f64::INFINITY };
        for p in points {
            for axis in 0..2 {
                view_box.low[axis] = view_box.low[axis].min(p[axis]);
                view_box.high[axis] = view_box.high[axis].max(p[axis]);
            }
            view_box.nearest = view_box.nearest.min(p.z);
        }
        view_box
    }

    fn union(&self, other: &Self) -> Self {
        let pick =
            |a: [f64; 2], b: [f64; 2], f: fn(f64, f64) -> f64| [f(a[0], b[0]), f(a[1], b[1])];
        Self {
            low: pick(self.low, other.low, f64::min),
            high: pick(self.high, other.high, f64::max),
            nearest: self.nearest.min(other.nearest),
        }
    }

    /// Whether something in this box may lie over something in `other` and nearer than `depth`.
    fn may_cover(&self, other: &Self, depth: f64) -> bool {
        self.nearest < depth
            && (0..2).all(|axis| {
                self.low[axis] <= other.high[axis] && other.low[axis] <= self.high[axis]
            })
    }
}

/// A tree over the triangles of a model, the same for all views: finds those over a place in
/// linear memory, whatever the sizes of the triangles.
pub(super) struct TriangleTree {
    nodes: Vec<Node>,
    /// Triangle indices, leaf by leaf.
    items: Vec<u32>,
}

struct Node {
    /// Of `items`.
    first: u32,
    /// 0 for inner nodes, whose children follow: the left one directly, the right one at `right`.
    count: u32,
    right: u32,
}

const LEAF: usize = 4;
/// Levels of a tree over as many triangles as an index can tell apart, each level half the last.
const MAX_DEPTH: usize = 32;

impl TriangleTree {
    /// * `centres`: one for each triangle.
    pub(crate) fn new(centres: &[Point3<f64>]) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(centres.len()),
            items: (0..centres.len() as u32).collect(),
        };
        if !centres.is_empty() {
            tree.split(centres, 0, centres.len());
        }
        tree
    }

    /// Builds the node over `items[first..end]`; halving keeps the depth at log2(n).
    fn split(&mut self, centres: &[Point3<f64>], first: usize, end: usize) {
        let index = self.nodes.len();
        let leaf = end - first <= LEAF;
        self.nodes.push(Node {
            first: first as u32,
            count: if leaf { (end - first) as u32 } else { 0 },
            right: 0,
        });
        if leaf {
            return;
        }
        let items = &mut self.items[first..end];
        let start = centres[items[0] as usize];
        let (low, high) = items.iter().fold((start, start), |(low, high), &item| {
            let centre = centres[item as usize];
            (low.inf(&centre), high.sup(&centre))
        });
        let axis = (high - low).imax();
        let middle = items.len() / 2;
        items.select_nth_unstable_by(middle, |&a, &b| {
            let order = centres[a as usize][axis].total_cmp(&centres[b as usize][axis]);
            order.then(a.cmp(&b))
        });
        self.split(centres, first, first + middle);
        self.nodes[index].right = self.nodes.len() as u32;
        self.split(centres, first + middle, end);
    }

    /// The tree with the boxes that its triangles have in a view.
    pub(crate) fn over(&self, boxes: Vec<ViewBox>) -> Bvh<'_> {
        let mut node_boxes = vec![ViewBox::of(&[]); self.nodes.len()];
        // Children come after their parents.
        for (index, node) in self.nodes.iter().enumerate().rev() {
            node_boxes[index] = if node.count == 0 {
                node_boxes[index + 1].union(&node_boxes[node.right as usize])
            } else {
                let items = self.leaf(node).iter().map(|&item| boxes[item as usize]);
                items.fold(ViewBox::of(&[]), |sum, item| sum.union(&item))
            };
        }
        Bvh { tree: self, node_boxes, boxes }
    }

    fn leaf(&self, node: &Node) -> &[u32] {
        &self.items[node.first as usize..(node.first + node.count) as usize]
    }
}

/// A triangle tree in one view.
pub(super) struct Bvh<'a> {
    tree: &'a TriangleTree,
    node_boxes: Vec<ViewBox>,
    /// Of the triangles.
    boxes: Vec<ViewBox>,
}

impl Bvh<'_> {
    /// Calls `visit` with every triangle whose box meets `place` and begins nearer than `depth`,
    /// until it returns `false`.
    pub(crate) fn visit(&self, place: &ViewBox, depth: f64, mut visit: impl FnMut(u32) -> bool) {
        // On the stack, for this runs for every line; inner nodes wait at one node a level.
        let mut pending = [0_u32; MAX_DEPTH + 1];
        let mut waiting = usize::from(!self.node_boxes.is_empty());
        while waiting > 0 {
            waiting -= 1;
            let index = pending[waiting];
            if !self.node_boxes[index as usize].may_cover(place, depth) {
                continue;
            }
            let node = &self.tree.nodes[index as usize];
            if node.count == 0 {
                pending[waiting..waiting + 2].copy_from_slice(&[node.right, index + 1]);
                waiting += 2;
                continue;
            }
            for &item in self.tree.leaf(node) {
                if self.boxes[item as usize].may_cover(place, depth) && !visit(item) {
                    return;
                }
            }
        }
    }
}
