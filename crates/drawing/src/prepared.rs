//! A model's edges and normals, found once for all views.

use std::borrow::Cow;

use nalgebra::{Point3, Vector3};

use super::bvh::TriangleTree;
use super::paint::material_colour;
use super::{DrawError, DrawOptions};
use frames::{Elevation, Viewpoint};
use mesh::Mesh;
use mesh::read::{LinearRgb, Model};

/// A model with what all its views share: edges and normals.
#[derive(Clone, Debug)]
pub struct PreparedModel {
    /// Triangles without area are left out.
    pub(super) mesh: Mesh,
    pub(super) materials: Vec<u32>,
    /// Unit normals of the triangles.
    pub(super) face_normals: Vec<Vector3<f64>>,
    pub(super) corner_normals: Option<Vec<[Vector3<f64>; 3]>>,
    /// At the triangles' corners.
    pub(super) corner_colours: Vec<[LinearRgb; 3]>,
    pub(super) edges: Vec<Edge>,
    /// The triangles at each edge, as `Edge::faces` counts them.
    edge_faces: Vec<EdgeFace>,
    /// The largest distance of a vertex from the origin.
    pub(super) radius: f64,
}

/// An undirected edge of the mesh.
#[derive(Clone, Debug)]
pub(super) struct Edge {
    /// The smaller index first.
    pub vertices: [u32; 2],
    first: u32,
    count: u32,
}

/// A triangle at an edge.
#[derive(Clone, Copy, Debug)]
pub(super) struct EdgeFace {
    pub face: u32,
    /// Whether the triangle runs along the edge from its smaller to its larger vertex.
    pub forward: bool,
}

impl PreparedModel {
    /// Finds the edges: triangles are neighbours if they share two vertices.
    ///
    /// # Errors
    /// [`DrawError::NoTriangles`] if no triangle has an area, [`DrawError::InvalidModel`] if an
    /// index or a coordinate cannot be used.
    pub fn new(model: &Model) -> Result<Self, DrawError> {
        check(model)?;
        let mut prepared = Self {
            mesh: Mesh { positions: model.mesh.positions.clone(), triangles: Vec::new() },
            materials: Vec::new(),
            face_normals: Vec::new(),
            corner_normals: model.corner_normals.as_ref().map(|_| Vec::new()),
            corner_colours: Vec::new(),
            edges: Vec::new(),
            edge_faces: Vec::new(),
            radius: 0.0,
        };
        for (index, triangle) in model.mesh.triangles.iter().enumerate() {
            prepared.push_triangle(model, index, *triangle);
        }
        if prepared.mesh.triangles.is_empty() {
            return Err(DrawError::NoTriangles);
        }
        prepared.find_edges();
        let used = prepared.mesh.triangles.iter().flatten();
        prepared.radius =
            used.map(|&v| prepared.mesh.positions[v as usize].coords.norm()).fold(0.0, f64::max);
        Ok(prepared)
    }

    fn push_triangle(&mut self, model: &Model, index: usize, triangle: [u32; 3]) {
        let [a, b, c] = triangle.map(|v| self.mesh.positions[v as usize]);
        let scale = (b - a).amax().max((c - a).amax());
        let normal = ((b - a) / scale).cross(&((c - a) / scale));
        // NaN for a scale of 0: no normal either.
        let Some(normal) = normal.try_normalize(1e-12).filter(|n| n.x.is_finite()) else {
            return;
        };
        self.mesh.triangles.push(triangle);
        let material = model.materials.get(index).copied().unwrap_or(0);
        self.materials.push(material);
        let colours = model.corner_colours.as_ref().and_then(|colours| colours.get(index));
        self.corner_colours.push(colours.copied().unwrap_or([material_colour(material); 3]));
        self.face_normals.push(normal);
        if let (Some(kept), Some(given)) = (&mut self.corner_normals, &model.corner_normals) {
            kept.push(given.get(index).copied().unwrap_or([normal; 3]));
        }
    }

    /// Groups the triangles' sides by their vertices, in the order of the vertex indices.
    fn find_edges(&mut self) {
        let mut sides: Vec<([u32; 2], EdgeFace)> =
            Vec::with_capacity(3 * self.mesh.triangles.len());
        for (face, &[a, b, c]) in self.mesh.triangles.iter().enumerate() {
            for [from, to] in [[a, b], [b, c], [c, a]] {
                let side = EdgeFace { face: face as u32, forward: from < to };
                sides.push(([from.min(to), from.max(to)], side));
            }
        }
        sides.sort_unstable_by_key(|(vertices, side)| (*vertices, side.face));
        for group in sides.chunk_by(|a, b| a.0 == b.0) {
            self.edges.push(Edge {
                vertices: group[0].0,
                first: self.edge_faces.len() as u32,
                count: group.len() as u32,
            });
            self.edge_faces.extend(group.iter().map(|(_, side)| *side));
        }
    }

    pub(super) fn faces_of(&self, edge: &Edge) -> &[EdgeFace] {
        &self.edge_faces[edge.first as usize..(edge.first + edge.count) as usize]
    }

    pub(super) fn triangle_tree(&self) -> TriangleTree {
        let faces = 0..self.mesh.triangles.len();
        let centres = faces.map(|face| {
            let [a, b, c] = self.mesh.corners(face);
            Point3::from((a.coords + b.coords + c.coords) / 3.0)
        });
        TriangleTree::new(&centres.collect::<Vec<_>>())
    }

    /// The mesh that is drawn.
    pub fn mesh(&self) -> &Mesh {
        &self.mesh
    }

    /// As [`Self::placed_for`] views that have no elevation of their own.
    pub fn placed(&self, options: &DrawOptions) -> Cow<'_, Self> {
        self.placed_for(options, &[])
    }

    /// The model as it is drawn: with the option `fit`, its bounding box is centred on the origin
    /// and scaled so that no view leaves the frame, whatever the azimuth.
    ///
    /// * `viewpoints`: from where else than the options' elevation it is drawn.
    pub fn placed_for(&self, options: &DrawOptions, viewpoints: &[Viewpoint]) -> Cow<'_, Self> {
        let Some((centre, scale)) = self.fit(options, viewpoints) else {
            return Cow::Borrowed(self);
        };
        let mut placed = self.clone();
        for p in &mut placed.mesh.positions {
            *p = Point3::from((p.coords - centre) * scale);
        }
        placed.radius = self.placed_radius(options, viewpoints);
        Cow::Owned(placed)
    }

    /// The largest distance of a vertex of [`Self::placed_for`] from the origin.
    pub(super) fn placed_radius(&self, options: &DrawOptions, viewpoints: &[Viewpoint]) -> f64 {
        let Some((centre, scale)) = self.fit(options, viewpoints) else {
            return self.radius;
        };
        let used = self.mesh.triangles.iter().flatten();
        let radii =
            used.map(|&v| ((self.mesh.positions[v as usize].coords - centre) * scale).norm());
        radii.fold(0.0, f64::max)
    }

    /// The point that is moved to the origin, and the factor; `None` if the model stays as it is.
    fn fit(&self, options: &DrawOptions, viewpoints: &[Viewpoint]) -> Option<(Vector3<f64>, f64)> {
        let (low, high) = self.used_bounds().filter(|_| options.fit)?;
        let centre = nalgebra::center(&low, &high).coords;
        let (mut reach, mut rise) = (0.0_f64, 0.0_f64);
        let own = viewpoints.iter().map(|viewpoint| viewpoint.elevation);
        let mut elevations: Vec<Elevation> = own.chain([options.elevation()]).collect();
        elevations.sort();
        elevations.dedup();
        let turns: Vec<(f64, f64)> = elevations.into_iter().map(Elevation::sin_cos).collect();
        for &vertex in self.mesh.triangles.iter().flatten() {
            let p = self.mesh.positions[vertex as usize].coords - centre;
            reach = reach.max(p.xy().norm());
            for (sin, cos) in &turns {
                rise = rise.max(p.z.abs() * cos + p.xy().norm() * sin.abs());
            }
        }
        let height = f64::from(options.height_px) / options.pixels_per_unit();
        let scale = (options.scale / (2.0 * reach)).min(height / (2.0 * rise));
        Some((centre, FITTED_SHARE * scale))
    }

    fn used_bounds(&self) -> Option<(Point3<f64>, Point3<f64>)> {
        let mut used = self.mesh.triangles.iter().flatten();
        let first = self.mesh.positions[*used.next()? as usize];
        Some(used.fold((first, first), |(low, high), &vertex| {
            let p = self.mesh.positions[vertex as usize];
            (low.inf(&p), high.sup(&p))
        }))
    }
}

fn check(model: &Model) -> Result<(), DrawError> {
    let positions = &model.mesh.positions;
    for (triangle, corners) in model.mesh.triangles.iter().enumerate() {
        let usable = |&vertex: &u32| {
            positions
                .get(vertex as usize)
                .is_some_and(|p| p.iter().all(|c| c.is_finite() && c.abs() < MAX_COORDINATE))
        };
        if !corners.iter().all(usable) {
            return Err(DrawError::InvalidModel { triangle });
        }
    }
    Ok(())
}

/// Share of the frame that a fitted model takes.
const FITTED_SHARE: f64 = 0.94;
/// Products of three coordinates must stay in the range of f64.
const MAX_COORDINATE: f64 = 1e60;
