//! Parts that hang together.

/// The connected parts of a graph: a number below the count per node.
pub fn components(nodes: usize, links: impl Iterator<Item = (u32, u32)>) -> (Vec<u32>, usize) {
    let mut parent: Vec<u32> = (0..nodes as u32).collect();
    fn root(parent: &mut [u32], mut node: u32) -> u32 {
        while parent[node as usize] != node {
            parent[node as usize] = parent[parent[node as usize] as usize];
            node = parent[node as usize];
        }
        node
    }
    for (a, b) in links {
        let (a, b) = (root(&mut parent, a), root(&mut parent, b));
        parent[a.max(b) as usize] = a.min(b);
    }
    let mut labels = vec![0; nodes];
    let mut count = 0;
    for node in 0..nodes as u32 {
        let top = root(&mut parent, node);
        if top == node {
            labels[node as usize] = count;
            count += 1;
        } else {
            labels[node as usize] = labels[top as usize];
        }
    }
    (labels, count as usize)
}
