//! Vertices of one lattice point become one.

use std::cmp::Reverse;
use std::collections::BinaryHeap;

use mesh::Mesh;
use nalgebra::{Point3, Vector3};

use super::lattice::{Meeting, Site, meeting};
use super::orientation::{matching, tangent};
use super::vertices::Level;

/// What holds a vertex.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(crate) enum Hold {
    /// Nothing but the surface.
    Surface,
    /// It lies on a crease.
    Crease,
    /// Creases end, meet or turn there.
    Corner,
}

/// The mesh of lattice points.
pub(crate) struct Collapsed {
    pub mesh: Mesh,
    /// One a vertex.
    pub holds: Vec<Hold>,
}

/// A vertex that stands for several.
struct Cluster {
    site: Site,
    weight: f64,
    hold: Hold,
    /// Where it ends up.
    place: Point3<f64>,
    /// How many vertices `place` is the mean of.
    placed: f64,
    triangles: Vec<u32>,
}

/// Edges shorter than this share of a cell are collapsed wherever the fields leave them.
const SHORT: f64 = 0.45;
/// An edge that is longer by this factor than the other diagonal of its two triangles is flipped.
const LONG: f64 = 1.1;
/// How much of the queue is worked off until it is asked whether to stop.
const POPS_BETWEEN_QUESTIONS: usize = 4096;
/// Rounds of flips.
const FLIPS: usize = 3;
/// Triangles that turn more against each other keep their edge: cosine.
const FLIP_TURN: f64 = 0.5;

/// `None` if `stopped` says so.
pub(crate) fn collapsed(
    fine: &Mesh,
    level: &Level,
    side: f64,
    stopped: &dyn Fn() -> bool,
) -> Option<Collapsed> {
    let mut surface = Surface::new(fine, level);
    surface.collapse(side, stopped, |met, _| met.steps == [0, 0])?;
    surface.collapse(side, stopped, |_, length| length < SHORT * side)?;
    for _ in 0..FLIPS {
        surface.flip();
    }
    Some(surface.finished())
}

struct Surface {
    clusters: Vec<Cluster>,
    /// `None` for those that are gone.
    triangles: Vec<Option<[u32; 3]>>,
}

impl Surface {
    fn new(fine: &Mesh, level: &Level) -> Self {
        let hold = |vertex: usize| match (level.corners[vertex], level.creases[vertex]) {
            (true, _) => Hold::Corner,
            (false, Some(_)) => Hold::Crease,
            (false, None) => Hold::Surface,
        };
        let cluster = |vertex: usize| Cluster {
            site: Site::of(level, vertex),
            weight: 1.0,
            hold: hold(vertex),
            place: if level.corners[vertex] { level.points[vertex] } else { level.lattice[vertex] },
            placed: 1.0,
            triangles: Vec::new(),
        };
        let mut clusters: Vec<Cluster> = (0..fine.positions.len()).map(cluster).collect();
        for (index, triangle) in fine.triangles.iter().enumerate() {
            triangle.iter().for_each(|&v| clusters[v as usize].triangles.push(index as u32));
        }
        Self { clusters, triangles: fine.triangles.iter().copied().map(Some).collect() }
    }

    /// The neighbours of a vertex, ascending.
    fn around(&self, vertex: u32) -> Vec<u32> {
        let triangles = self.clusters[vertex as usize].triangles.iter();
        let corners = triangles.filter_map(|&index| self.triangles[index as usize]).flatten();
        let mut around: Vec<u32> = corners.filter(|&corner| corner != vertex).collect();
        around.sort_unstable();
        around.dedup();
        around
    }

    fn meeting(&self, a: u32, b: u32, side: f64) -> Meeting {
        meeting(&self.clusters[a as usize].site, &self.clusters[b as usize].site, side)
    }

    fn length(&self, a: u32, b: u32) -> f64 {
        (self.clusters[a as usize].place - self.clusters[b as usize].place).norm()
    }

    /// Collapses edges that `merges` wants, those whose lattices agree best first.
    fn collapse(
        &mut self,
        side: f64,
        stopped: &dyn Fn() -> bool,
        merges: impl Fn(&Meeting, f64) -> bool,
    ) -> Option<()> {
        let mut queue = BinaryHeap::new();
        let asked = |surface: &Self, a: u32, b: u32| {
            let met = surface.meeting(a, b, side);
            // Lengths are not negative: their bits are in their order.
            merges(&met, surface.length(a, b))
                .then(|| Reverse((met.error.to_bits(), a.min(b), a.max(b))))
        };
        for vertex in 0..self.clusters.len() as u32 {
            let later = self.around(vertex).into_iter().filter(|&other| other > vertex);
            queue.extend(later.filter_map(|other| asked(self, vertex, other)));
        }
        let mut popped = 0;
        while let Some(entry) = queue.pop() {
            popped += 1;
            if popped % POPS_BETWEEN_QUESTIONS == 0 && stopped() {
                return None;
            }
            let Reverse((_, kept, gone)) = entry;
            let [kept_around, gone_around] = [kept, gone].map(|vertex| self.around(vertex));
            if !gone_around.contains(&kept) {
                continue;
            }
            match asked(self, kept, gone) {
                None => continue,
                // Changed since: in its new turn.
                Some(now) if now < entry => {
                    queue.push(now);
                    continue;
                }
                Some(_) => {}
            }
            if self.stays_manifold(&kept_around, &gone_around) {
                self.merge(kept, gone, side);
                let around = self.around(kept);
                queue.extend(around.into_iter().filter_map(|other| asked(self, kept, other)));
            }
        }
        Some(())
    }

    /// Whether the edge between two vertices with these neighbours can go: exactly two neighbours
    /// are of both, and they and the merged vertex keep three.
    fn stays_manifold(&self, around: &[u32], other_around: &[u32]) -> bool {
        let shared: Vec<u32> = around
            .iter()
            .copied()
            .filter(|vertex| other_around.binary_search(vertex).is_ok())
            .collect();
        let merged = around.len() + other_around.len() - 4;
        shared.len() == 2
            && merged >= 3
            && shared.iter().all(|&vertex| self.around(vertex).len() > 3)
    }

    fn merge(&mut self, kept: u32, gone: u32, side: f64) {
        let met = self.meeting(kept, gone, side);
        let triangles = std::mem::take(&mut self.clusters[gone as usize].triangles);
        for index in triangles {
            let Some(triangle) = self.triangles[index as usize] else { continue };
            if triangle.contains(&kept) {
                self.triangles[index as usize] = None;
                continue;
            }
            self.triangles[index as usize] =
                Some(triangle.map(|vertex| if vertex == gone { kept } else { vertex }));
            self.clusters[kept as usize].triangles.push(index);
        }
        let alive = &self.triangles;
        self.clusters[kept as usize].triangles.retain(|&index| alive[index as usize].is_some());
        let other = &self.clusters[gone as usize];
        let (site, weight) = (other.site, other.weight);
        let (hold, place, placed) = (other.hold, other.place, other.placed);
        let own = &mut self.clusters[kept as usize];
        let share = weight / (own.weight + weight);
        let mean = |a: Point3<f64>, b: Point3<f64>, share: f64| a + (b - a) * share;
        let (axis, other_axis) =
            matching(&own.site.axis, &own.site.normal, &site.axis, &site.normal);
        let blended: Vector3<f64> = own.site.normal * (1.0 - share) + site.normal * share;
        let normal = blended.try_normalize(1e-6).unwrap_or(own.site.normal);
        own.site = Site {
            point: mean(own.site.point, site.point, share),
            normal,
            axis: tangent(&(axis * (1.0 - share) + other_axis * share), &normal),
            lattice: own.site.lattice + (met.points[1] - met.points[0]) * share,
        };
        own.weight += weight;
        if hold > own.hold {
            (own.hold, own.place, own.placed) = (hold, place, placed);
        } else if hold == own.hold {
            own.place = mean(own.place, place, placed / (own.placed + placed));
            own.placed += placed;
        }
    }

    /// Flips edges that are longer than the other diagonal of their two triangles.
    fn flip(&mut self) {
        for index in 0..self.triangles.len() {
            for turn in 0..3 {
                self.flip_side(index as u32, turn);
            }
        }
    }

    fn flip_side(&mut self, index: u32, turn: usize) {
        let Some(triangle) = self.triangles[index as usize] else { return };
        let [a, b, c] = [0, 1, 2].map(|corner| triangle[(corner + turn) % 3]);
        let held = |vertex: u32| self.clusters[vertex as usize].hold != Hold::Surface;
        if held(a) && held(b) {
            return;
        }
        let across = self.clusters[a as usize].triangles.iter().find_map(|&other| {
            let corners = self.triangles[other as usize]?;
            let side = (0..3).find(|&i| corners[i] == b && corners[(i + 1) % 3] == a)?;
            Some((other, corners[(side + 2) % 3]))
        });
        let Some((other, d)) = across.filter(|&(_, d)| d != c) else { return };
        if self.length(a, b) < LONG * self.length(c, d) || self.around(c).contains(&d) {
            return;
        }
        let normal = |triangle: [u32; 3]| {
            let [p, q, r] = triangle.map(|vertex| self.clusters[vertex as usize].place);
            (q - p).cross(&(r - p)).try_normalize(0.0).unwrap_or_else(Vector3::zeros)
        };
        let new = [[a, d, c], [d, b, c]];
        let old = [normal([a, b, c]), normal([b, a, d])];
        let flat = new.iter().all(|&triangle| {
            let normal = normal(triangle);
            old.iter().all(|old| old.dot(&normal) > FLIP_TURN)
        });
        // Each vertex keeps three neighbours.
        if !flat || [a, b].iter().any(|&vertex| self.around(vertex).len() <= 3) {
            return;
        }
        self.triangles[index as usize] = Some(new[0]);
        self.triangles[other as usize] = Some(new[1]);
        self.clusters[b as usize].triangles.retain(|&triangle| triangle != index);
        self.clusters[a as usize].triangles.retain(|&triangle| triangle != other);
        self.clusters[d as usize].triangles.push(index);
        self.clusters[c as usize].triangles.push(other);
    }

    fn finished(self) -> Collapsed {
        let mut new_index = vec![u32::MAX; self.clusters.len()];
        let mut collapsed = Collapsed { mesh: Mesh::default(), holds: Vec::new() };
        for triangle in self.triangles.into_iter().flatten() {
            let new = triangle.map(|vertex| {
                let index = &mut new_index[vertex as usize];
                if *index == u32::MAX {
                    *index = collapsed.mesh.positions.len() as u32;
                    let cluster = &self.clusters[vertex as usize];
                    collapsed.mesh.positions.push(cluster.place);
                    collapsed.holds.push(cluster.hold);
                }
                *index
            });
            collapsed.mesh.triangles.push(new);
        }
        collapsed
    }
}
