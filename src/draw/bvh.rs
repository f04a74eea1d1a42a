use nalgebra::Point3;

/// A bounding box in the view frame; of z only the nearest is of interest.
#[derive(Clone, Copy, Debug)]
pub(super) struct ViewBox {
    pub low: [f64; 2],
    pub high: [f64; 2],
    pub nearest: f64,
}

impl ViewBox {
    pub fn of(points: &[Point3<f64>]) -> Self {
        let mut view_box = Self {
            low: [f64::INFINITY; 2],
            high: [f64::NEG_INFINITY; 2],
            nearest: f64::INFINITY,
        };
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
        let pick = |a: [f64; 2], b: [f64; 2], f: fn(f64, f64) -> f64| [f(a[0], b[0]), f(a[1], b[1])];
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

/// A tree of boxes over the triangles of one view: finds those over a place in linear memory,
/// whatever the sizes of the triangles.
pub(super) struct Bvh {
    nodes: Vec<Node>,
    /// Triangle indices, leaf by leaf.
    items: Vec<u32>,
    boxes: Vec<ViewBox>,
}

struct Node {
    view_box: ViewBox,
    /// Of `items`.
    first: u32,
    /// 0 for inner nodes, whose children follow: the left one directly, the right one at `right`.
    count: u32,
    right: u32,
}

const LEAF: usize = 4;

impl Bvh {
    pub fn new(boxes: Vec<ViewBox>) -> Self {
        let mut tree = Self {
            nodes: Vec::with_capacity(boxes.len()),
            items: (0..boxes.len() as u32).collect(),
            boxes,
        };
        if !tree.items.is_empty() {
            tree.split(0, tree.items.len());
        }
        tree
    }

    /// Builds the node over `items[first..end]`; halving keeps the depth at log2(n).
    fn split(&mut self, first: usize, end: usize) {
        let view_box = self.items[first + 1..end]
            .iter()
            .fold(self.boxes[self.items[first] as usize], |sum, &item| {
                sum.union(&self.boxes[item as usize])
            });
        let index = self.nodes.len();
        let leaf = end - first <= LEAF;
        self.nodes.push(Node {
            view_box,
            first: first as u32,
            count: if leaf { (end - first) as u32 } else { 0 },
            right: 0,
        });
        if leaf {
            return;
        }
        let extent = |axis: usize| view_box.high[axis] - view_box.low[axis];
        let axis = usize::from(extent(1) > extent(0));
        let middle = (first + end) / 2;
        let boxes = &self.boxes;
        let centre = |item: &u32| {
            let b = &boxes[*item as usize];
            b.low[axis] + b.high[axis]
        };
        self.items[first..end].select_nth_unstable_by(middle - first, |a, b| {
            centre(a).total_cmp(&centre(b)).then(a.cmp(b))
        });
        self.split(first, middle);
        self.nodes[index].right = self.nodes.len() as u32;
        self.split(middle, end);
    }

    /// Calls `visit` with every triangle whose box meets `place` and begins nearer than `depth`,
    /// until it returns `false`.
    pub fn visit(&self, place: &ViewBox, depth: f64, mut visit: impl FnMut(u32) -> bool) {
        let mut pending: Vec<u32> = Vec::with_capacity(64);
        if !self.nodes.is_empty() {
            pending.push(0);
        }
        while let Some(index) = pending.pop() {
            let node = &self.nodes[index as usize];
            if !node.view_box.may_cover(place, depth) {
                continue;
            }
            if node.count == 0 {
                pending.extend([node.right, index + 1]);
                continue;
            }
            let leaf = node.first as usize..(node.first + node.count) as usize;
            for &item in &self.items[leaf] {
                if self.boxes[item as usize].may_cover(place, depth) && !visit(item) {
                    return;
                }
            }
        }
    }
}
