//! Orders of a robot's hinges.

use super::Robot;

impl Robot {
    /// For each hinge of Isaac Lab's order, its index in the robot's own: those nearest to the root
    /// come first, each level in the robot's order. BeyondMimic and SONIC have this order, and call
    /// it breadth-first.
    pub fn breadth_first(&self) -> Vec<usize> {
        let mut depths = vec![0_usize; self.links.len()];
        for (joint, link) in self.links.iter().enumerate() {
            let above = link.parent.map_or(0, |parent| depths[parent]);
            depths[joint] = above + usize::from(link.hinge.is_some());
        }
        let mut order: Vec<usize> = (0..self.hinges.len()).collect();
        // Stable: hinges of one depth keep their order.
        order.sort_by_key(|&hinge| depths[self.hinges[hinge].joint]);
        order
    }
}

#[cfg(test)]
mod tests {
    use crate::robot::testing::g1;

    #[test]
    fn a_g1_has_isaac_labs_order() {
        // As GR00T-WholeBodyControl publishes it: isaac[i] = mujoco[M[i]].
        let published = [
            0, 6, 12, 1, 7, 13, 2, 8, 14, 3, 9, 15, 22, 4, 10, 16, 23, 5, 11, 17, 24, 18, 25, 19, 26, 20, 27,
            21, 28,
        ];
        assert_eq!(g1().robot.as_ref().unwrap().breadth_first(), published);
    }
}
