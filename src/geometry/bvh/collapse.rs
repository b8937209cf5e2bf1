//! From a binary hierarchy with one group of primitives per leaf to wide nodes and packets, at the least expected cost.
//!
//! Source: Ylitie, Karras, Laine 2017, "Efficient Incoherent Ray Traversal on GPUs Through Compressed Wide BVHs",
//! section 3.1: dynamic programming over the surface area heuristic, C(n, i) being the least cost of the subtree n as a
//! forest of at most i roots.

use glam::Vec3;
use obvhs::aabb::Aabb;
use obvhs::bvh2::Bvh2;

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
    /// One box per primitive, in local units.
    pub boxes: &'a [Aabb],
    /// What the leaves of the binary hierarchy stand for.
    pub groups: &'a Groups,
    /// The caller's index and the corners in local units.
    pub triangles: &'a [(u32, [Vec3; 3])],
    /// The caller's index.
    pub solids: &'a [u32],
}

impl Primitives<'_> {
    /// True if there is no solid among them.
    fn all_triangles(&self, list: &[u32]) -> bool {
        list.iter().all(|i| (*i as usize) < self.triangles.len())
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

/// Collapses `tree`.
pub fn collapse(tree: &Bvh2, primitives: &Primitives<'_>) -> Wide {
    let mut emitter = Emitter { tree, primitives, plans: plan(tree, primitives), wide: Wide::default() };
    if !primitives.boxes.is_empty() {
        let roots = emitter.forest(0);
        emitter.node(&roots, 1);
    }
    emitter.wide
}

/// The best way to represent one subtree.
#[derive(Clone, Default)]
struct Plan {
    /// Least cost with at most i + 1 roots.
    cost: [f32; 7],
    /// For at most i + 1 roots: how many of them go to the first child, or 0 if i roots are as good. The first entry
    /// is 1 for a node, 0 for a leaf.
    split: [u8; 8],
    /// Triangles below, or too many for a packet as soon as there is a solid.
    triangles: u32,
}

/// Children first; an explicit stack, since a chain may be as deep as the scene is large.
fn plan(tree: &Bvh2, primitives: &Primitives<'_>) -> Vec<Plan> {
    let mut plans = vec![Plan::default(); tree.nodes.len()];
    let mut order = Vec::with_capacity(tree.nodes.len());
    let mut stack = vec![0];
    while let Some(index) = stack.pop().filter(|i| *i < tree.nodes.len()) {
        order.push(index);
        if !tree.nodes[index].is_leaf() {
            let first = tree.nodes[index].first_index as usize;
            stack.extend([first, first + 1]);
        }
    }
    for index in order.into_iter().rev() {
        let node = &tree.nodes[index];
        let leaf_cost = LEAF_COST * node.aabb().half_area();
        plans[index] = if node.is_leaf() {
            let group = primitives.groups.members(tree.primitive_indices[node.first_index as usize]);
            let triangles = if primitives.all_triangles(group) { group.len() as u32 } else { 9 };
            Plan { cost: [leaf_cost; 7], split: [0; 8], triangles }
        } else {
            let first = node.first_index as usize;
            join(&plans[first], &plans[first + 1], node.aabb().half_area(), leaf_cost)
        };
    }
    plans
}

/// The plan of a node from those of its two children.
fn join(left: &Plan, right: &Plan, node_cost: f32, leaf_cost: f32) -> Plan {
    let triangles = left.triangles.saturating_add(right.triangles);
    let mut plan = Plan { triangles, ..Plan::default() };
    let mut distributed = [f32::INFINITY; 8];
    for roots in 2..=8 {
        for first in 1..roots {
            let cost = left.cost[first - 1] + right.cost[roots - first - 1];
            if cost < distributed[roots - 1] {
                distributed[roots - 1] = cost;
                plan.split[roots - 1] = first as u8;
            }
        }
    }
    let as_node = node_cost + distributed[7];
    let as_leaf = if triangles <= 8 { leaf_cost } else { f32::INFINITY };
    plan.split[0] = u8::from(as_node < as_leaf || triangles > 8);
    plan.cost[0] = as_node.min(as_leaf);
    for roots in 2..=7 {
        if plan.cost[roots - 2] <= distributed[roots - 1] {
            plan.cost[roots - 1] = plan.cost[roots - 2];
            plan.split[roots - 1] = 0;
        } else {
            plan.cost[roots - 1] = distributed[roots - 1];
        }
    }
    plan
}

/// Writes nodes and packets in the order of a depth-first walk.
struct Emitter<'a> {
    tree: &'a Bvh2,
    primitives: &'a Primitives<'a>,
    plans: Vec<Plan>,
    wide: Wide,
}

/// A child of a wide node to be.
enum Root {
    /// A subtree of the binary hierarchy.
    Subtree(usize),
    /// Primitives, to be spread evenly.
    List(Vec<u32>),
}

impl Emitter<'_> {
    /// The up to eight children that the plan gives a subtree; a leaf is its own only child.
    fn forest(&self, index: usize) -> Vec<Root> {
        if self.plans[index].split[0] == 0 {
            return vec![Root::Subtree(index)];
        }
        let mut roots = Vec::with_capacity(8);
        let mut open = Vec::with_capacity(16);
        let split = |open: &mut Vec<_>, index: usize, count: usize, first: u8| {
            let child = self.tree.nodes[index].first_index as usize;
            open.extend([(child + 1, count - usize::from(first)), (child, usize::from(first))]);
        };
        split(&mut open, index, 8, self.plans[index].split[7]);
        while let Some((index, count)) = open.pop() {
            match self.plans[index].split[count - 1] {
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
                let child = if self.plans[*index].split[0] == 1 && level < PLANNED_DEPTH {
                    self.node(&self.forest(*index), level + 1)
                } else {
                    self.spread(&self.below(*index), level)
                };
                (child, bounds)
            }
            Root::List(list) => {
                let boxes = list.iter().map(|i| self.primitives.boxes[*i as usize]);
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
                found.extend(self.primitives.groups.members(self.tree.primitive_indices[first]));
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
        let triangles: Vec<_> = list.iter().map(|i| self.primitives.triangles[*i as usize]).collect();
        self.wide.packets.push(Packet::new(&triangles));
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
    use glam::Vec3A;
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
        let triangles: Vec<(u32, [Vec3; 3])> = (0..3000u16)
            .map(|i| (u32::from(i), [Vec3::ZERO, Vec3::X, Vec3::ONE].map(|v| v * 1.01f32.powi(-i32::from(i)))))
            .collect();
        let boxes: Vec<Aabb> = triangles.iter().map(|(_, t)| Aabb::new(Vec3A::ZERO, Vec3A::from(t[2]))).collect();
        let groups = Groups::of_equal(&boxes);
        let ordered: Vec<Aabb> = groups.firsts().map(|i| boxes[i as usize]).collect();
        let primitives = Primitives { boxes: &boxes, groups: &groups, triangles: &triangles, solids: &[] };
        let wide = collapse(&chain(&ordered), &primitives);
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
