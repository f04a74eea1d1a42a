//! The convex hull of a point cloud.

use nalgebra::{Matrix3, Point3, Vector3};
use qhull::Qh;
use serde::Serialize;

use super::cloud::ViewCloud;
use mesh::Mesh;

/// Clouds this much thinner than long are flat.
const FLAT_RATIO: f64 = 1e-9;
/// Coordinates beyond this are measuring accidents and lose precision.
const MAX_COORDINATE: f64 = 1e12;

/// Why points have no hull.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, thiserror::Error)]
#[serde(tag = "code", rename_all = "snake_case")]
pub enum HullError {
    /// Too few points are finite and near enough.
    #[error("{found} usable points; a hull takes at least {required}")]
    TooFewPoints {
        /// How many are.
        found: usize,
        /// The fewest that span a volume.
        required: usize,
    },
    /// The points span no volume.
    #[error("all {found} points lie in one plane, within {thickness:.3e}")]
    Flat {
        /// How many there are.
        found: usize,
        /// Standard deviation across their best plane, in their own unit.
        thickness: f64,
    },
    /// Qhull failed.
    #[error("the hull of {found} points failed (Qhull code {qhull_code})")]
    Failed {
        /// How many points it was given.
        found: usize,
        /// Qhull's exit code.
        qhull_code: i32,
    },
}

/// The convex hull as a closed mesh, triangles counter-clockwise seen from
/// outside, vertices in the order of `points`.
///
/// Points that are not finite, or absurdly far, are left out.
///
/// # Errors
/// [`HullError::TooFewPoints`] below four, [`HullError::Flat`] if they span no
/// volume.
///
/// # Source
/// Barber, Dobkin & Huhdanpaa, The Quickhull algorithm for convex hulls, 1996;
/// Arys 2020, §3.7.
pub fn convex_hull(points: &[Point3<f64>]) -> Result<Mesh, HullError> {
    let usable: Vec<_> = points
        .iter()
        .copied()
        .filter(|p| p.iter().all(|value| value.abs() <= MAX_COORDINATE))
        .collect();
    let found = usable.len();
    if found < 4 {
        return Err(HullError::TooFewPoints { found, required: 4 });
    }
    let (thickness, length) = thickness_and_length(&usable);
    if thickness <= FLAT_RATIO * length {
        return Err(HullError::Flat { found, thickness });
    }
    let facets = quickhull(&usable).map_err(|code| match code {
        SINGULAR => HullError::Flat { found, thickness },
        code => HullError::Failed { found, qhull_code: code },
    })?;
    let mut mesh = compact(&usable, &facets);
    if mesh.signed_volume() < 0.0 {
        mesh.triangles.iter_mut().for_each(|triangle| triangle.swap(1, 2));
    }
    Ok(mesh)
}

/// Qhull's code for input that spans no volume.
const SINGULAR: i32 = 2;

/// Indices of each facet's corners, alike oriented.
fn quickhull(points: &[Point3<f64>]) -> Result<Vec<[usize; 3]>, i32> {
    let mut coordinates: Vec<f64> = points.iter().flat_map(|p| [p.x, p.y, p.z]).collect();
    // Messages go to stderr: catching them takes temporary files, which panic
    // where none can be made.
    let hull = Qh::builder()
        .capture_stderr(false)
        .triangulate(true)
        .build(3, &mut coordinates)
        .map_err(|error| error.kind.error_code())?;
    Ok(hull
        .facets()
        .filter_map(|facet| {
            let corners: Vec<_> =
                facet.vertices()?.iter().filter_map(|vertex| vertex.index(&hull)).collect();
            let &[a, b, c] = corners.as_slice() else { return None };
            Some(if facet.top_orient() { [a, c, b] } else { [a, b, c] })
        })
        .collect())
}

/// Keeps the points that facets use.
fn compact(points: &[Point3<f64>], facets: &[[usize; 3]]) -> Mesh {
    let mut used: Vec<_> = facets.iter().flatten().copied().collect();
    used.sort_unstable();
    used.dedup();
    let new_index = |old: &usize| used.binary_search(old).unwrap_or_default() as u32;
    Mesh {
        positions: used.iter().map(|&index| points[index]).collect(),
        triangles: facets.iter().map(|facet| facet.each_ref().map(new_index)).collect(),
    }
}

/// Extent of the points across and along, as standard deviations.
fn thickness_and_length(points: &[Point3<f64>]) -> (f64, f64) {
    let count = points.len() as f64;
    let mean = points.iter().map(|p| p.coords).sum::<Vector3<f64>>() / count;
    let scatter: Matrix3<f64> = points
        .iter()
        .map(|p| (p.coords - mean) * (p.coords - mean).transpose())
        .sum::<Matrix3<f64>>()
        / count;
    // The smallest eigenvalue alone would be rounding noise of the squares.
    let axes = scatter.symmetric_eigen();
    let deviation = |axis: Vector3<f64>| {
        let squares: f64 = points.iter().map(|p| axis.dot(&(p.coords - mean)).powi(2)).sum();
        (squares / count).sqrt()
    };
    let extents: Vec<_> =
        axes.eigenvectors.column_iter().map(|axis| deviation(axis.into_owned())).collect();
    extents.iter().fold((f64::INFINITY, 0.0), |(low, high), &e| (low.min(e), high.max(e)))
}

/// The points of a view's cloud that can be corners of a convex hull: per
/// picture row, the corners of the row's own hull. Exact, as the others are
/// convex combinations of these.
pub fn row_extremes(cloud: &ViewCloud<'_>) -> Vec<Point3<f64>> {
    let mut extremes = Vec::new();
    let mut row_points = Vec::new();
    for row in 0..cloud.rows() {
        row_points.clear();
        row_points.extend(cloud.row(row).filter(|p| p.y.abs() <= MAX_COORDINATE));
        chain(row_points.iter(), &mut extremes);
        let nearest = extremes.len();
        chain(row_points.iter().rev(), &mut extremes);
        // Both chains have both ends.
        if extremes.len() > nearest + 1 {
            extremes.pop();
            extremes.remove(nearest);
        } else {
            extremes.truncate(nearest);
        }
    }
    extremes
}

/// Appends one side of the hull of points sorted along a line (Andrew's
/// monotone chain).
fn chain<'a>(points: impl Iterator<Item = &'a Point3<f64>>, side: &mut Vec<Point3<f64>>) {
    let start = side.len();
    for point in points {
        while side.len() >= start + 2 {
            let (a, b) = (side[side.len() - 2], side[side.len() - 1]);
            let turn = (b.x - a.x) * (point.y - a.y) - (b.y - a.y) * (point.x - a.x);
            if turn > 0.0 {
                break;
            }
            side.pop();
        }
        side.push(*point);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use picture::FloatImage;
    use std::collections::BTreeMap;

    fn grid_cube(steps: u32) -> Vec<Point3<f64>> {
        let at = |i: u32| f64::from(i) / f64::from(steps - 1) * 2.0 - 1.0;
        (0..steps.pow(3))
            .map(|i| Point3::new(at(i % steps), at(i / steps % steps), at(i / steps / steps)))
            .collect()
    }

    /// Every edge is used once in each direction.
    fn is_closed(mesh: &Mesh) -> bool {
        let mut edges = BTreeMap::new();
        for t in &mesh.triangles {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                *edges.entry((a, b)).or_insert(0) += 1;
            }
        }
        edges.iter().all(|(&(a, b), &count)| count == 1 && edges.get(&(b, a)) == Some(&1))
    }

    #[test]
    fn the_hull_of_a_gridded_cube_is_the_cube() {
        let mesh = convex_hull(&grid_cube(9)).unwrap();
        assert!(is_closed(&mesh));
        assert!((mesh.signed_volume() - 8.0).abs() < 1e-9);
        assert_eq!(
            mesh.bounds(),
            Some((Point3::new(-1.0, -1.0, -1.0), Point3::new(1.0, 1.0, 1.0)))
        );
    }

    #[test]
    fn stray_values_and_duplicates_change_nothing() {
        let clean = convex_hull(&grid_cube(4)).unwrap();
        let mut points = grid_cube(4);
        points.extend(grid_cube(4));
        points.push(Point3::new(f64::NAN, 0.0, 0.0));
        points.push(Point3::new(0.0, f64::INFINITY, 0.0));
        points.push(Point3::new(0.0, 0.0, -1e300));
        let mesh = convex_hull(&points).unwrap();
        assert!(is_closed(&mesh));
        assert!((mesh.signed_volume() - clean.signed_volume()).abs() < 1e-9);
    }

    /// Half a million points, each twice, with strays among them.
    #[test]
    fn a_huge_cloud_has_its_hull() {
        let mut points: Vec<_> = (0..250_000_u32)
            .flat_map(|i| {
                let (sin, cos) = (f64::from(i) * 2.4).sin_cos();
                let height = f64::from(i) / 125_000.0 - 1.0;
                let radius = (1.0 - height * height).max(0.0).sqrt();
                // Far inside but every thousandth, on the sphere.
                let size = if i % 1000 == 0 { 100.0 } else { f64::from(i % 97) / 2.0 };
                let point = Point3::new(size * radius * cos, size * radius * sin, size * height);
                [point, point]
            })
            .collect();
        points.extend([f64::NAN, f64::INFINITY, -1e200].map(|bad| Point3::new(bad, 1.0, bad)));
        let mesh = convex_hull(&points).unwrap();
        assert!(is_closed(&mesh));
        let sphere = 4.0 / 3.0 * std::f64::consts::PI * 1e6;
        let share = mesh.signed_volume() / sphere;
        assert!((0.9..1.0).contains(&share), "{share}");
    }

    #[test]
    fn names_clouds_without_volume() {
        let plane: Vec<_> = (0..100)
            .map(|i| Point3::new(f64::from(i % 10), f64::from(i / 10), 0.1 * f64::from(i % 10)))
            .collect();
        assert!(matches!(convex_hull(&plane), Err(HullError::Flat { found: 100, .. })));
        let same = [Point3::new(3.0, 4.0, 5.0); 50];
        assert!(matches!(convex_hull(&same), Err(HullError::Flat { found: 50, .. })));
        assert_eq!(
            convex_hull(&plane[..3]),
            Err(HullError::TooFewPoints { found: 3, required: 4 })
        );
    }

    #[test]
    fn row_extremes_have_the_hull_of_the_whole_cloud() {
        let depth = FloatImage::from_fn(40, 30, |x, y| {
            let value = (x * 7919 + y * 104_729) % 97;
            image::Luma([if value % 5 == 0 { f32::NAN } else { value as f32 / 3.0 }])
        });
        let cloud = ViewCloud::new(&depth);
        let all: Vec<_> = cloud.points(1).collect();
        let reduced = row_extremes(&cloud);
        assert!(reduced.len() < all.len() / 2, "{} of {}", reduced.len(), all.len());
        let (whole, part) = (convex_hull(&all).unwrap(), convex_hull(&reduced).unwrap());
        assert!((whole.signed_volume() - part.signed_volume()).abs() < 1e-6);
        assert_eq!(whole.positions.len(), part.positions.len());
    }

    #[test]
    fn rows_of_one_or_two_points_are_kept_as_they_are() {
        let mut depth = FloatImage::from_pixel(5, 3, image::Luma([f32::NAN]));
        depth.put_pixel(2, 0, image::Luma([7.0]));
        depth.put_pixel(0, 2, image::Luma([1.0]));
        depth.put_pixel(4, 2, image::Luma([2.0]));
        let cloud = ViewCloud::new(&depth);
        assert_eq!(row_extremes(&cloud), cloud.points(1).collect::<Vec<_>>());
    }
}
