//! Winding numbers as sums of solid angles, far triangles by their dipole.

use std::f64::consts::PI;

use nalgebra::{Point3, Vector3};

use super::frame::{Vertex, position};

const MOST_IN_A_LEAF: usize = 8;

/// A group further away than this many of its radii is taken as a dipole.
const FAR_RADII: f64 = 6.0;

/// The winding number of one triangle seen from `point`: its solid angle over
/// 4π, positive from behind.
///
/// # Source
/// Van Oosterom & Strackee, The solid angle of a plane triangle, 1983.
pub(super) fn winding_of_triangle(corners: &[Point3<f64>; 3], point: &Point3<f64>) -> f64 {
    let [a, b, c] = corners.map(|corner| corner - point);
    let (la, lb, lc) = (a.norm(), b.norm(), c.norm());
    let denominator = la * lb * lc + a.dot(&b) * lc + b.dot(&c) * la + c.dot(&a) * lb;
    a.dot(&b.cross(&c)).atan2(denominator) / (2.0 * PI)
}

/// Sums the winding numbers of many triangles, far groups by their dipole.
///
/// # Source
/// Barill et al., Fast winding numbers for soups and clouds, 2018.
#[derive(Debug)]
pub(super) struct SolidAngleTree {
    triangles: Vec<[Point3<f64>; 3]>,
    nodes: Vec<Node>,
}

#[derive(Debug)]
struct Node {
    /// The area-weighted centre of the triangles.
    centre: Point3<f64>,
    radius: f64,
    /// The sum of the triangles' area vectors.
    area: Vector3<f64>,
    content: Content,
}

#[derive(Debug)]
enum Content {
    Leaf { first: usize, end: usize },
    Halves(usize, usize),
}

impl SolidAngleTree {
    pub(super) fn new(triangles: &[[Vertex; 3]]) -> Self {
        let triangles: Vec<_> = triangles.iter().map(|t| t.map(position)).collect();
        let end = triangles.len();
        let mut tree = Self { triangles, nodes: Vec::new() };
        tree.build(0, end);
        tree
    }

    /// Adds the node over `first..end`, children before it; the root is last.
    fn build(&mut self, first: usize, end: usize) -> usize {
        let content = if end - first <= MOST_IN_A_LEAF {
            Content::Leaf { first, end }
        } else {
            let middle = split(&mut self.triangles[first..end]) + first;
            Content::Halves(self.build(first, middle), self.build(middle, end))
        };
        self.nodes.push(Node::over(&self.triangles[first..end], content));
        self.nodes.len() - 1
    }

    /// The winding number at `point`.
    pub(super) fn at(&self, point: &Point3<f64>) -> f64 {
        self.nodes.len().checked_sub(1).map_or(0.0, |root| self.at_node(root, point))
    }

    /// Whether a ball over some triangles comes within `radius` of `point`.
    pub(super) fn comes_within(&self, point: &Point3<f64>, radius: f64) -> bool {
        let root = self.nodes.len().checked_sub(1);
        root.is_some_and(|root| self.node_comes_within(root, point, radius))
    }

    fn node_comes_within(&self, node: usize, point: &Point3<f64>, radius: f64) -> bool {
        let node = &self.nodes[node];
        let near = (node.centre - point).norm() <= node.radius + radius;
        near && match node.content {
            Content::Leaf { .. } => true,
            Content::Halves(one, other) => {
                self.node_comes_within(one, point, radius)
                    || self.node_comes_within(other, point, radius)
            }
        }
    }

    fn at_node(&self, node: usize, point: &Point3<f64>) -> f64 {
        let node = &self.nodes[node];
        let to_centre = node.centre - point;
        let distance = to_centre.norm();
        if distance > FAR_RADII * node.radius {
            return node.area.dot(&to_centre) / (4.0 * PI * distance.powi(3));
        }
        match node.content {
            Content::Leaf { first, end } => self.triangles[first..end]
                .iter()
                .map(|triangle| winding_of_triangle(triangle, point))
                .sum(),
            Content::Halves(one, other) => self.at_node(one, point) + self.at_node(other, point),
        }
    }
}

fn middle_of(triangle: &[Point3<f64>; 3]) -> Point3<f64> {
    Point3::from((triangle[0].coords + triangle[1].coords + triangle[2].coords) / 3.0)
}

fn area_vector([a, b, c]: &[Point3<f64>; 3]) -> Vector3<f64> {
    (b - a).cross(&(c - a)) / 2.0
}

/// Orders by the longest axis and returns the middle.
fn split(triangles: &mut [[Point3<f64>; 3]]) -> usize {
    let centres = || triangles.iter().map(middle_of);
    let low = centres().fold(Point3::from([f64::INFINITY; 3]), |low, p| low.inf(&p));
    let high = centres().fold(Point3::from([f64::NEG_INFINITY; 3]), |high, p| high.sup(&p));
    let axis = (high - low).imax();
    // A stable sort: equal centres keep their order.
    triangles.sort_by(|one, other| middle_of(one)[axis].total_cmp(&middle_of(other)[axis]));
    triangles.len() / 2
}

impl Node {
    fn over(triangles: &[[Point3<f64>; 3]], content: Content) -> Self {
        let weigh = |triangle| (area_vector(triangle), middle_of(triangle).coords);
        let (mut area, mut total, mut sum) = (Vector3::zeros(), 0.0, Vector3::zeros());
        for (vector, middle) in triangles.iter().map(weigh) {
            area += vector;
            total += vector.norm();
            sum += middle * vector.norm();
        }
        let first = triangles.first().map_or(Vector3::zeros(), |triangle| triangle[0].coords);
        let centre = Point3::from(if total > 0.0 { sum / total } else { first });
        let radius =
            triangles.iter().flatten().map(|corner| (corner - centre).norm()).fold(0.0, f64::max);
        Self { centre, radius, area, content }
    }
}
