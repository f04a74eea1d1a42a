//! In which projection each face is laid out.

use std::collections::HashSet;

use mesh::shading::face_normal;
use mesh::{Mesh, connected};
use nalgebra::{Point2, Point3, Vector3};
use progress::{Cancelled, Observer};

use super::bake::for_texels;
use crate::surface::projection::{Rig, neighbours};

/// Charts: a view's index, or the number of views and one of the directions +x -x +y -y +z -z.
pub(super) struct Projections<'a>(pub &'a Rig);

impl Projections<'_> {
    fn views(&self) -> usize {
        self.0.viewpoints.len()
    }

    /// Where a chart shows a point, px.
    pub(super) fn flat(&self, chart: usize, point: &Point3<f64>) -> Point2<f64> {
        match chart.checked_sub(self.views()).map(|facing| facing / 2) {
            None => self.0.project(chart, point).xy().into(),
            Some(0) => Point2::new(point.y, -point.z),
            Some(1) => Point2::new(point.x, -point.z),
            Some(_) => Point2::new(point.x, point.y),
        }
    }

    /// Where a chart is seen from, a unit vector.
    fn toward(&self, chart: usize) -> Vector3<f64> {
        match chart.checked_sub(self.views()) {
            None => self.0.toward_camera(chart),
            Some(facing) => Vector3::ith(facing / 2, if facing % 2 == 0 { 1.0 } else { -1.0 }),
        }
    }

    /// That of the axis that a face looks along most.
    fn facing(&self, normal: &Vector3<f64>) -> usize {
        let axis = normal.iamax();
        self.views() + 2 * axis + usize::from(normal[axis] < 0.0)
    }
}

/// Parts of fewer triangles join a neighbour where they can.
const SMALL: usize = 64;
/// Rounds of that: what has joined may let others join.
const ROUNDS: usize = 6;
/// A face that joins is stretched at most by the inverse, cosine.
const MIN_FACING: f64 = 0.12;
/// Texels that a part may share with another one in its chart: those of their common edge.
const MAX_SHARED: usize = 4;

/// Per triangle its chart: its label's, or for those that no view shows, that of an axis; small
/// parts then join their neighbours if their faces look that way and cover nothing there.
///
/// * `mesh`: two triangles a quad, which stay together.
/// * `labels`: per triangle a view's index, or the number of views.
///
/// # Errors
/// [`Cancelled`] if `observer` says so.
pub(super) fn charts(
    mesh: &Mesh,
    projections: &Projections<'_>,
    labels: &[usize],
    observer: &dyn Observer,
) -> Result<Vec<usize>, Cancelled> {
    let normals: Vec<Vector3<f64>> =
        (0..labels.len()).map(|face| face_normal(mesh, face)).collect();
    let chart = |face: usize| {
        let halves = [face / 2 * 2, face / 2 * 2 + 1];
        let shows_both = |label: &usize| {
            *label < projections.views() && {
                let toward = projections.toward(*label);
                halves.iter().all(|&half| normals[half].dot(&toward) > MIN_FACING)
            }
        };
        let label = halves.map(|half| labels[half]).into_iter().find(shows_both);
        label.unwrap_or_else(|| projections.facing(&(normals[halves[0]] + normals[halves[1]])))
    };
    let mut charts: Vec<usize> = (0..labels.len()).map(chart).collect();
    let neighbours = neighbours(mesh);
    for _ in 0..ROUNDS {
        if !join_small(mesh, projections, &neighbours, &normals, &mut charts, observer)? {
            break;
        }
    }
    Ok(charts)
}

/// Whether any part has joined another.
fn join_small(
    mesh: &Mesh,
    projections: &Projections<'_>,
    neighbours: &[Vec<usize>],
    normals: &[Vector3<f64>],
    charts: &mut [usize],
    observer: &dyn Observer,
) -> Result<bool, Cancelled> {
    let parts = parts(neighbours, charts);
    let mut part_of = vec![0; charts.len()];
    for (index, part) in parts.iter().enumerate() {
        part.iter().for_each(|&face| part_of[face as usize] = index);
    }
    // What has joined a part in this round is of it.
    let mut members = parts.clone();
    let mut covered: Vec<Option<HashSet<(usize, usize)>>> = vec![None; parts.len()];
    let mut order: Vec<usize> =
        (0..parts.len()).filter(|&part| parts[part].len() < SMALL).collect();
    order.sort_by_key(|&part| (parts[part].len(), part));
    let mut any = false;
    for part in order {
        observer.check()?;
        if members[part].is_empty() {
            continue;
        }
        let mut around: Vec<(usize, usize)> = Vec::new();
        for &face in &members[part] {
            for &other in &neighbours[face as usize] {
                let other = part_of[other];
                match around.iter_mut().find(|(_, found)| *found == other) {
                    _ if other == part => {}
                    Some((edges, _)) => *edges += 1,
                    None => around.push((1, other)),
                }
            }
        }
        around.sort_by_key(|&(edges, other)| (std::cmp::Reverse(edges), other));
        let joins = around.into_iter().map(|(_, other)| other).find(|&other| {
            let chart = charts[members[other][0] as usize];
            let toward = projections.toward(chart);
            let faces_it = |&face: &u32| normals[face as usize].dot(&toward) > MIN_FACING;
            members[part].iter().all(faces_it) && {
                let texels = |faces: &[u32]| covered_by(mesh, projections, chart, faces);
                let there = covered[other].get_or_insert_with(|| texels(&members[other]));
                let own = texels(&members[part]);
                own.iter().filter(|texel| there.contains(texel)).count() <= MAX_SHARED
            }
        });
        let Some(other) = joins else { continue };
        any = true;
        let chart = charts[members[other][0] as usize];
        let moved = std::mem::take(&mut members[part]);
        let texels = covered_by(mesh, projections, chart, &moved);
        if let Some(there) = &mut covered[other] {
            there.extend(texels);
        }
        for &face in &moved {
            charts[face as usize] = chart;
            part_of[face as usize] = other;
        }
        members[other].extend(moved);
        covered[part] = None;
    }
    Ok(any)
}

/// The pixels of a chart whose centres lie on faces.
fn covered_by(
    mesh: &Mesh,
    projections: &Projections<'_>,
    chart: usize,
    faces: &[u32],
) -> HashSet<(usize, usize)> {
    // Axes' charts have negative coordinates too.
    const OFFSET: f64 = 65_536.0;
    let mut found = HashSet::new();
    for &face in faces {
        let corners = mesh.corners(face as usize).map(|point| projections.flat(chart, &point));
        let low = corners.iter().fold(corners[0], |low, corner| low.inf(corner));
        let high = corners.iter().fold(corners[0], |high, corner| high.sup(corner));
        let from = low.map(f64::floor);
        let placed = corners.map(|corner| corner - from.coords);
        let size = (high - from).map(|side| side.ceil() as usize + 1);
        for_texels(&placed, (size.x, size.y), |index, _| {
            let origin = from.map(|side| (side + OFFSET).max(0.0) as usize);
            found.insert((origin.x + index % size.x, origin.y + index / size.x));
        });
    }
    found
}

/// Triangles of one chart that share edges, ascending.
pub(super) fn parts(neighbours: &[Vec<usize>], charts: &[usize]) -> Vec<Vec<u32>> {
    let links = neighbours.iter().enumerate().flat_map(|(face, around)| {
        let same = around.iter().filter(move |&&other| charts[other] == charts[face]);
        same.map(move |&other| (face as u32, other as u32))
    });
    let (labels, count) = connected::components(charts.len(), links);
    let mut parts = vec![Vec::new(); count];
    for (face, &label) in labels.iter().enumerate() {
        parts[label as usize].push(face as u32);
    }
    parts
}

#[cfg(test)]
mod tests {
    use std::sync::atomic::{AtomicUsize, Ordering};

    use frames::Azimuth;
    use progress::{Progress, Silent};

    use super::*;

    /// A torus and its labels: every ninth quad is torn out of its neighbourhood.
    fn torn_torus() -> (Mesh, Rig, Vec<usize>) {
        let mesh = mesh::builtin::torus(30.0, 12.0, 24, 12).mesh;
        let views = [0.0, 90.0].map(|degrees| Azimuth::from_degrees(degrees).unwrap().into());
        let rig = Rig {
            viewpoints: views.to_vec(),
            width: 100,
            height: 80,
            axis_px: 50.0,
            origin_row_px: 40.0,
        };
        let unseen = rig.viewpoints.len();
        let label = |face: usize| if (face / 2).is_multiple_of(9) { 0 } else { unseen };
        let labels = (0..mesh.triangles.len()).map(label).collect();
        (mesh, rig, labels)
    }

    #[test]
    fn small_parts_join_without_covering_and_quads_stay_whole() {
        let (mesh, rig, labels) = torn_torus();
        let projections = Projections(&rig);
        let neighbours = neighbours(&mesh);
        let charts = charts(&mesh, &projections, &labels, &Silent).unwrap();
        assert!(charts.as_chunks::<2>().0.iter().all(|[a, b]| a == b));
        let found = parts(&neighbours, &charts);
        let torn = labels.as_chunks::<2>().0.iter().filter(|halves| halves[0] == 0).count();
        assert!(found.len() < torn, "{} parts of {torn} torn quads", found.len());
        for part in &found {
            let chart = charts[part[0] as usize];
            let area = |faces: &[u32]| covered_by(&mesh, &projections, chart, faces).len();
            let apart: usize = part.iter().map(|&face| area(&[face])).sum();
            // Texels on edges are of two faces.
            assert!(20 * (apart - area(part)) <= apart + 40, "{apart} {}", area(part));
        }
    }

    /// Lets so many questions pass before it says stop.
    struct StopAfter(AtomicUsize);

    impl Observer for StopAfter {
        fn progress(&self, _: Progress) {}

        fn is_cancelled(&self) -> bool {
            let left = |left: usize| left.checked_sub(1);
            self.0.fetch_update(Ordering::Relaxed, Ordering::Relaxed, left).is_err()
        }
    }

    #[test]
    fn joining_stops_between_parts() {
        let (mesh, rig, labels) = torn_torus();
        let with = |observer: &dyn Observer| charts(&mesh, &Projections(&rig), &labels, observer);
        for questions in [0, 1, 5] {
            assert_eq!(with(&StopAfter(questions.into())), Err(Cancelled), "{questions}");
        }
        // There are more parts than those, and an end.
        assert_eq!(with(&StopAfter(100_000.into())), with(&Silent));
    }
}
