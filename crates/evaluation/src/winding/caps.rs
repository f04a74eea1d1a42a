//! Closes a mesh that has open edges.

use std::collections::HashMap;

use super::frame::Vertex;

/// Triangles that close a mesh: a fan over each connected set of open edges.
///
/// An edge is open as often as triangles use it one way more than the other.
/// In- and outgoing open edges balance at every vertex, so the edges between a
/// fan's apex and its rim cancel and mesh and caps together have no boundary.
pub(super) fn caps(triangles: &[[Vertex; 3]]) -> Vec<[Vertex; 3]> {
    let open = open_edges(triangles);
    let groups = connected_groups(&open);
    let apexes = apexes(&open, &groups);
    let mut caps = Vec::new();
    for (&(from, to, times), group) in open.iter().zip(&groups) {
        let apex = apexes[*group];
        let (first, second) = if times > 0 { (to, from) } else { (from, to) };
        if apex != first && apex != second {
            let copies = times.unsigned_abs() as usize;
            caps.extend(std::iter::repeat_n([first, second, apex], copies));
        }
    }
    caps
}

/// Open edges `(low, high, times)` in order; negative when open from high to low.
fn open_edges(triangles: &[[Vertex; 3]]) -> Vec<(Vertex, Vertex, i64)> {
    let mut edges: Vec<(Vertex, Vertex, i64)> = triangles
        .iter()
        .flat_map(|&[a, b, c]| [(a, b), (b, c), (c, a)])
        .map(|(from, to)| if from < to { (from, to, 1) } else { (to, from, -1) })
        .collect();
    edges.sort_unstable();
    edges
        .chunk_by(|one, other| (one.0, one.1) == (other.0, other.1))
        .map(|same| (same[0].0, same[0].1, same.iter().map(|edge| edge.2).sum()))
        .filter(|edge: &(Vertex, Vertex, i64)| edge.2 != 0)
        .collect()
}

/// The group of each edge, numbered from 0: edges that share a vertex are in
/// the same.
fn connected_groups(open: &[(Vertex, Vertex, i64)]) -> Vec<usize> {
    let mut parents: Vec<usize> = (0..open.len()).collect();
    let mut first_at: HashMap<Vertex, usize> = HashMap::new();
    for (edge, &(from, to, _)) in open.iter().enumerate() {
        for vertex in [from, to] {
            let other = *first_at.entry(vertex).or_insert(edge);
            let (one, two) = (root(&mut parents, edge), root(&mut parents, other));
            // The smaller number wins, so that numbering follows the order.
            parents[one.max(two)] = one.min(two);
        }
    }
    let mut numbers = vec![usize::MAX; open.len()];
    let mut count = 0;
    (0..open.len())
        .map(|edge| {
            let root = root(&mut parents, edge);
            if numbers[root] == usize::MAX {
                numbers[root] = count;
                count += 1;
            }
            numbers[root]
        })
        .collect()
}

fn root(parents: &mut [usize], mut edge: usize) -> usize {
    while parents[edge] != edge {
        parents[edge] = parents[parents[edge]];
        edge = parents[edge];
    }
    edge
}

/// The mean of each group's edge ends.
fn apexes(open: &[(Vertex, Vertex, i64)], groups: &[usize]) -> Vec<Vertex> {
    let count = groups.iter().max().map_or(0, |last| last + 1);
    let mut sums = vec![([0_i64; 3], 0_i64); count];
    for (&(from, to, _), &group) in open.iter().zip(groups) {
        let (sum, ends) = &mut sums[group];
        for (value, (one, other)) in sum.iter_mut().zip(from.iter().zip(&to)) {
            *value += i64::from(*one) + i64::from(*other);
        }
        *ends += 2;
    }
    sums.into_iter().map(|(sum, ends)| sum.map(|value| (value / ends) as i32)).collect()
}
