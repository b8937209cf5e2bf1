//! Primitives with the same box, as one: thousands of them would cost obvhs quadratic time, and give a chain.

use obvhs::aabb::Aabb;
use rayon::prelude::*;

/// A partition of the primitives.
pub struct Groups {
    /// All primitives, group after group.
    members: Vec<u32>,
    /// Where each group starts in `members`, and the end of the last one.
    starts: Vec<u32>,
}

impl Groups {
    /// Groups the primitives whose boxes are equal; the groups are in the order of their first members.
    pub fn of_equal(boxes: &[Aabb]) -> Self {
        let mut keys: Vec<(u64, u32)> = boxes.par_iter().map(hash).zip(0..boxes.len() as u32).collect();
        keys.par_sort_unstable();
        // Different boxes of one hash only make groups smaller than they could be.
        let same = |a: &(u64, u32), b: &(u64, u32)| a.0 == b.0 && boxes[a.1 as usize] == boxes[b.1 as usize];
        if keys.is_sorted_by(|a, b| !same(a, b)) {
            return Self { members: (0..boxes.len() as u32).collect(), starts: (0..=boxes.len() as u32).collect() };
        }
        let mut groups: Vec<&[(u64, u32)]> = keys.chunk_by(same).collect();
        groups.sort_unstable_by_key(|group| group[0].1);
        let mut starts = Vec::with_capacity(groups.len() + 1);
        let mut members = Vec::with_capacity(boxes.len());
        for group in groups {
            starts.push(members.len() as u32);
            members.extend(group.iter().map(|(_, primitive)| *primitive));
        }
        starts.push(members.len() as u32);
        Self { members, starts }
    }

    /// Number of groups.
    pub fn len(&self) -> usize {
        self.starts.len() - 1
    }

    /// The primitives of one group.
    pub fn members(&self, group: u32) -> &[u32] {
        &self.members[self.starts[group as usize] as usize..self.starts[group as usize + 1] as usize]
    }

    /// The first primitive of each group.
    pub fn firsts(&self) -> impl Iterator<Item = u32> {
        self.starts[..self.starts.len() - 1].iter().map(|start| self.members[*start as usize])
    }
}

/// Multiply and fold, one coordinate after the other.
fn hash(bounds: &Aabb) -> u64 {
    let coordinates = bounds.min.to_array().into_iter().chain(bounds.max.to_array());
    coordinates.fold(0x9e37_79b9_7f4a_7c15, |hash: u64, coordinate| {
        // Adding zero makes the two zeros, which compare equal, one.
        let product = u128::from(hash ^ u64::from((coordinate + 0.0).to_bits())) * 0xd6e8_feb8_6659_fd93;
        (product ^ (product >> 64)) as u64
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, clippy::expect_used, clippy::panic)]
    use super::*;
    use glam::Vec3A;

    #[test]
    fn groups_are_a_partition_by_equality() {
        let boxes: Vec<Aabb> = (0..1000u32)
            .map(|i| Aabb::new(Vec3A::splat((i * 7 % 13) as f32), Vec3A::splat(20.0 + (i % 3) as f32)))
            .collect();
        let groups = Groups::of_equal(&boxes);
        let firsts: Vec<u32> = groups.firsts().collect();
        assert_eq!(firsts.len(), 39);
        let mut seen = vec![false; boxes.len()];
        for group in 0..39 {
            for member in groups.members(group) {
                assert_eq!(boxes[*member as usize], boxes[firsts[group as usize] as usize]);
                assert!(!std::mem::replace(&mut seen[*member as usize], true));
            }
        }
        assert!(seen.iter().all(|s| *s));
    }
}
