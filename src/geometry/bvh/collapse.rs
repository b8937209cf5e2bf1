//! From a binary hierarchy with one group of primitives per leaf to wide nodes and packets, at the least expected cost.
//!
//! Source: Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
//! section 3.1: dynamic programming over the surface area heuristic, C(n, i) being the least cost of the subtree n as a
//! forest of at most i roots.

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

use super::frame::Frame;
use super::groups::Groups;
use super::packet::Packet;
use super::traverse::MAX_DEPTH;
use super::wide::{Child, Node};

/// Cost of testing a packet of triangles or a solid, relative to a wide node.
const LEAF_COST: f32 = 1.8;
/// Below this level chains (many equal boxes) are cut and their primitives spread evenly: eleven more levels of eight
/// children hold more primitives than a `u32` can name.
const PLANNED_DEPTH: usize = MAX_DEPTH - 11;

/// What is in the hierarchy. Primitives are numbered with the triangles first.
pub struct Primitives<'a> {
    /// From the caller's coordinates to local ones.
    pub frame: Frame,
    /// The caller's vertices.
    pub vertices: &'a [Vec3],
    /// The vertices of all of the caller's triangles.
    pub indices: &'a [[u32; 3]],
    /// The caller's index.
    pub triangles: &'a [u32],
    /// The caller's index.
    pub solids: &'a [u32],
}

impl Primitives<'_> {
    /// True if there is no solid among them.
    fn all_triangles(&self, list: &[u32]) -> bool {
        list.iter().all(|i| (*i as usize) < self.triangles.len())
    }

    /// The corners of a triangle in local units: exact, by the choice of the frame.
    pub fn corners(&self, triangle: usize) -> [Vec3; 3] {
        let corners = self.indices[self.triangles[triangle] as usize].map(|index| self.vertices[index as usize]);
        corners.map(|corner| self.frame.to_local(corner.as_dvec3()).as_vec3())
    }

    /// A packet of triangles.
    pub fn packet(&self, list: &[u32]) -> Packet {
        let triangle = |i: &u32| (self.triangles[*i as usize], self.corners(*i as usize));
        Packet::new(&list.iter().map(triangle).collect::<Vec<_>>())
    }
}

/// The result; the root is the first node.
#[derive(Default)]
pub struct Wide {
    pub nodes: Vec<Node>,
    pub packets: Vec<Packet>,
    /// Levels of nodes.
    pub depth: usize,
}

/// Collapses `tree`, whose leaves stand for the `groups` of `primitives` with boxes `bounds`.
pub fn collapse(tree: &Bvh2, groups: &Groups, primitives: &Primitives<'_>, bounds: impl Fn(usize) -> Aabb) -> Wide {
    let splits = plan(tree, groups, primitives);
    let mut emitter = Emitter { tree, groups, primitives, bounds, splits, wide: Wide::default() };
    if !tree.nodes.is_empty() {
        let roots = emitter.forest(0);
        emitter.node(&roots, 1);
    }
    emitter.wide
}

/// The best way to represent one subtree. For at most i + 1 roots: how many of them go to the first child, or 0 if i
/// roots are as good. The first entry is 1 for a node, 0 for a leaf.
type Split = [u8; 8];

/// What the best way costs.
struct Plan {
    /// Least cost with at most i + 1 roots.
    cost: [f32; 7],
    /// Triangles below, or too many for a packet as soon as there is a solid.
    triangles: u32,
}

/// Children first; with explicit stacks, since a chain may be as deep as the scene is large.
fn plan(tree: &Bvh2, groups: &Groups, primitives: &Primitives<'_>) -> Vec<Split> {
    let mut splits = vec![[0; 8]; tree.nodes.len()];
    // Those of finished subtrees whose parents are not finished.
    let mut plans = Vec::new();
    let mut open = vec![(0, false)];
    while let Some((index, entered)) = open.pop().filter(|(index, _)| *index < tree.nodes.len()) {
        let node = &tree.nodes[index];
        let (area, first) = (node.aabb().half_area(), node.first_index as usize);
        if node.is_leaf() {
            let group = groups.members(tree.primitive_indices[first]);
            let triangles = if primitives.all_triangles(group) { group.len() as u32 } else { 9 };
            plans.push(Plan { cost: [LEAF_COST * area; 7], triangles });
        } else if !entered {
            open.extend([(index, true), (first + 1, false), (first, false)]);
        } else if let (Some(right), Some(left)) = (plans.pop(), plans.pop()) {
            let (plan, split) = join(&left, &right, area);
            splits[index] = split;
            plans.push(plan);
        }
    }
    splits
}

/// The plan of a node from those of its two children.
fn join(left: &Plan, right: &Plan, area: f32) -> (Plan, Split) {
    let triangles = left.triangles.saturating_add(right.triangles);
    let (mut plan, mut split) = (Plan { cost: [0.0; 7], triangles }, [0; 8]);
    let mut distributed = [f32::INFINITY; 8];
    for roots in 2..=8 {
        for first in 1..roots {
            let cost = left.cost[first - 1] + right.cost[roots - first - 1];
            if cost < distributed[roots - 1] {
                distributed[roots - 1] = cost;
                split[roots - 1] = first as u8;
            }
        }
    }
    let as_node = area + distributed[7];
    let as_leaf = if triangles <= 8 { LEAF_COST * area } else { f32::INFINITY };
    split[0] = u8::from(as_node < as_leaf || triangles > 8);
    plan.cost[0] = as_node.min(as_leaf);
    for roots in 2..=7 {
        if plan.cost[roots - 2] <= distributed[roots - 1] {
            plan.cost[roots - 1] = plan.cost[roots - 2];
            split[roots - 1] = 0;
        } else {
            plan.cost[roots - 1] = distributed[roots - 1];
        }
    }
    (plan, split)
}

/// Writes nodes and packets in the order of a depth-first walk.
struct Emitter<'a, B> {
    tree: &'a Bvh2,
    groups: &'a Groups,
    primitives: &'a Primitives<'a>,
    bounds: B,
    splits: Vec<Split>,
    wide: Wide,
}

/// A child of a wide node to be.
enum Root {
    /// A subtree of the binary hierarchy.
    Subtree(usize),
    /// Primitives, to be spread evenly.
    List(Vec<u32>),
}

impl<B: Fn(usize) -> Aabb> Emitter<'_, B> {
    /// The up to eight children that the plan gives a subtree; a leaf is its own only child.
    fn forest(&self, index: usize) -> Vec<Root> {
        if self.splits[index][0] == 0 {
            return vec![Root::Subtree(index)];
        }
        let mut roots = Vec::with_capacity(8);
        let mut open = Vec::with_capacity(16);
        let split = |open: &mut Vec<_>, index: usize, count: usize, first: u8| {
            let child = self.tree.nodes[index].first_index as usize;
            open.extend([(child + 1, count - usize::from(first)), (child, usize::from(first))]);
        };
        split(&mut open, index, 8, self.splits[index][7]);
        while let Some((index, count)) = open.pop() {
            match self.splits[index][count - 1] {
                _ if count == 1 => roots.push(Root::Subtree(index)),
                0 => open.push((index, count - 1)),
                first => split(&mut open, index, count, first),
            }
        }
        roots
    }

    /// A node with the given children.
    fn node(&mut self, roots: &[Root], level: usize) -> Child {
        let index = self.wide.nodes.len();
        self.wide.nodes.push(Node::new(&[]));
        self.wide.depth = self.wide.depth.max(level);
        let children: Vec<_> = roots.iter().map(|root| self.child(root, level)).collect();
        self.wide.nodes[index] = Node::new(&children);
        Child::node(index)
    }

    /// A child and its box.
    fn child(&mut self, root: &Root, level: usize) -> (Child, [f32; 3], [f32; 3]) {
        let (child, bounds) = match root {
            Root::Subtree(index) => {
                let bounds = *self.tree.nodes[*index].aabb();
                let child = if self.splits[*index][0] == 1 && level < PLANNED_DEPTH {
                    self.node(&self.forest(*index), level + 1)
                } else {
                    self.spread(&self.below(*index), level)
                };
                (child, bounds)
            }
            Root::List(list) => {
                let boxes = list.iter().map(|i| (self.bounds)(*i as usize));
                let bounds = boxes.reduce(|a, b| a.union(&b)).unwrap_or(Aabb::INVALID);
                (self.spread(list, level), bounds)
            }
        };
        (child, bounds.min.to_array(), bounds.max.to_array())
    }

    /// The primitives below a node of the binary hierarchy.
    fn below(&self, index: usize) -> Vec<u32> {
        let (mut found, mut open) = (Vec::new(), vec![index]);
        while let Some(node) = open.pop().map(|i| &self.tree.nodes[i]) {
            let first = node.first_index as usize;
            if node.is_leaf() {
                found.extend(self.groups.members(self.tree.primitive_indices[first]));
            } else {
                open.extend([first + 1, first]);
            }
        }
        found
    }

    /// One solid, or up to eight triangles.
    fn leaf(&mut self, list: &[u32]) -> Child {
        let count = self.primitives.triangles.len();
        if let Some(solid) = list.first().and_then(|i| (*i as usize).checked_sub(count)) {
            return Child::solid(self.primitives.solids[solid]);
        }
        self.wide.packets.push(self.primitives.packet(list));
        Child::packet(self.wide.packets.len() - 1)
    }

    /// A leaf if it fits into one; else a balanced subtree, whatever the boxes.
    fn spread(&mut self, list: &[u32], level: usize) -> Child {
        if list.len() == 1 || (list.len() <= 8 && self.primitives.all_triangles(list)) {
            return self.leaf(list);
        }
        let parts: Vec<Root> = list.chunks(list.len().div_ceil(8)).map(|part| Root::List(part.to_vec())).collect();
        self.node(&parts, level + 1)
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::super::wide::ChildKind;
    use super::*;
    use glam::{DVec3, Vec3A};
    use obvhs::bvh2::node::Bvh2Node;

    /// Nested boxes in a chain as deep as there are primitives: every inner node is a leaf and the rest.
    fn chain(boxes: &[Aabb]) -> Bvh2 {
        let around = |i: usize| boxes[i..].iter().fold(Aabb::INVALID, |a, b| a.union(b));
        let mut nodes = vec![Bvh2Node::new(around(0), 0, 1)];
        for (i, leaf) in boxes.iter().enumerate().take(boxes.len() - 2) {
            let next = nodes.len() as u32 + 2;
            nodes.extend([Bvh2Node::new(*leaf, 1, i as u32), Bvh2Node::new(around(i + 1), 0, next)]);
        }
        nodes.extend([boxes.len() - 2, boxes.len() - 1].map(|i| Bvh2Node::new(boxes[i], 1, i as u32)));
        let mut tree = Bvh2::zeroed(0);
        (tree.nodes, tree.primitive_indices) = (nodes, (0..boxes.len() as u32).collect());
        tree
    }

    fn depth(wide: &Wide, node: usize, packets: &mut [u32]) -> usize {
        let deeper = wide.nodes[node].children.iter().map(|child| match child.kind() {
            // Lanes without a child name the root.
            ChildKind::Node(0) | ChildKind::Solid(_) => 0,
            ChildKind::Node(index) => depth(wide, index, packets),
            ChildKind::Packet(index) => {
                packets[index] += 1;
                0
            }
        });
        1 + deeper.max().unwrap()
    }

    #[test]
    fn a_deep_chain_stays_within_the_stack() {
        let size = |i: u16| 1.01f32.powi(-i32::from(i));
        let vertices: Vec<Vec3> =
            (0..3000).flat_map(|i| [Vec3::ZERO, Vec3::X, Vec3::ONE].map(|v| v * size(i))).collect();
        let (triangles, indices): (Vec<u32>, Vec<_>) = (0..3000).map(|i| (i, [3 * i, 3 * i + 1, 3 * i + 2])).unzip();
        let boxes: Vec<Aabb> = (0..3000).map(|i| Aabb::new(Vec3A::ZERO, Vec3A::splat(size(i)))).collect();
        let groups = Groups::of_equal(&boxes);
        let ordered: Vec<Aabb> = groups.firsts().map(|i| boxes[i as usize]).collect();
        let frame = Frame { centre: DVec3::ZERO, scale: 1.0, inverse: 1.0 };
        let primitives =
            Primitives { frame, vertices: &vertices, indices: &indices, triangles: &triangles, solids: &[] };
        let wide = collapse(&chain(&ordered), &groups, &primitives, |i| boxes[i]);
        let mut uses = vec![0; wide.packets.len()];
        assert_eq!(depth(&wide, 0, &mut uses), wide.depth);
        assert!(wide.depth > PLANNED_DEPTH && wide.depth <= MAX_DEPTH, "{}", wide.depth);
        assert!(uses.iter().all(|n| *n == 1));
        let mut ids: Vec<u32> = wide.packets.iter().flat_map(|p| p.ids).collect();
        ids.sort_unstable();
        ids.dedup();
        assert_eq!(ids.len(), 3000);
    }
}
