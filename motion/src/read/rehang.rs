//! Feet and hands that steer a rig: they hang on its root, and move with the end of their limb.
//! They are hung where they belong.

use super::survey::{Survey, to_world};
use crate::anatomy::Tree;
use crate::convert::{Source, Transform};

/// Farthest at rest from the end of its limb, by the body's size.
const NEAR_BY_SIZE: f64 = 0.05;
/// How far it may move there, by the body's size: a foot leaves a leg that is too short for its
/// step.
const STILL_BY_SIZE: f64 = 0.2;
/// Most frames that are looked at.
const LOOKED_AT: usize = 128;
const ENDS: [&str; 4] = ["foot", "ankle", "hand", "wrist"];

/// A joint that hangs on another than the file says.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) struct Hung {
    pub(super) joint: usize,
    /// The end of the limb that it moves with.
    pub(super) on: usize,
}

/// Feet and hands that move with the end of a limb but hang on a joint of no side. `size` is that
/// of the body, in the file's units.
pub(super) fn find(source: &dyn Source, survey: &Survey, size: f64) -> Vec<Hung> {
    let tree = &survey.tree;
    let joints = tree.parents.len();
    let is_leaf = {
        let mut is_leaf = vec![true; joints];
        tree.parents
            .iter()
            .flatten()
            .for_each(|&parent| is_leaf[parent] = false);
        is_leaf
    };
    let distance = |a: usize, b: usize| survey.rest[a].distance(survey.rest[b]);
    let ends: Vec<usize> = (0..joints)
        .filter(|&end| is_leaf[end] && !tree.names[end].is_steering())
        .collect();
    let end_of = |joint: usize| -> Option<Hung> {
        let name = &tree.names[joint];
        let side = name.side?;
        let parent = tree.parents[joint]?;
        if !name.has_any(&ENDS) || name.is_steering() || tree.names[parent].side.is_some() {
            return None;
        }
        let below = tree.below(joint);
        let ends = ends.iter().copied();
        let ends = ends.filter(|&end| tree.names[end].side == Some(side) && !below[end]);
        let on = ends.min_by(|&a, &b| distance(a, joint).total_cmp(&distance(b, joint)))?;
        (distance(on, joint) <= NEAR_BY_SIZE * size).then_some(Hung { joint, on })
    };
    let mut found: Vec<Hung> = (0..joints).filter_map(end_of).collect();
    // One foot or hand for an end.
    let mut uses = vec![0; joints];
    found.iter().for_each(|hung| uses[hung.on] += 1);
    found.retain(|hung| uses[hung.on] == 1);
    if !found.is_empty() {
        let stays = stays(source, tree, &found, STILL_BY_SIZE * size);
        found = found
            .into_iter()
            .zip(stays)
            .filter_map(|(hung, stays)| stays.then_some(hung))
            .collect();
        without_rings(tree, &mut found);
    }
    found
}

/// The parents of all joints, with those of the hung ones.
fn parents_with(tree: &Tree, hung: &[Hung]) -> Vec<Option<usize>> {
    let mut parents = tree.parents.clone();
    for of in hung {
        parents[of.joint] = Some(of.on);
    }
    parents
}

/// Drops joints that would hang on themselves: a hand on an end below a foot, and that foot on an
/// end below the hand.
fn without_rings(tree: &Tree, found: &mut Vec<Hung>) {
    let parents = parents_with(tree, found);
    let next = |joint: &usize| parents[*joint];
    found.retain(|hung| {
        let above = std::iter::successors(Some(hung.on), next).take(parents.len());
        !above.into_iter().any(|above| above == hung.joint)
    });
}

/// Whether each joint keeps its place at the end that it moves with.
fn stays(source: &dyn Source, tree: &Tree, hung: &[Hung], far: f64) -> Vec<bool> {
    let mut local = vec![Transform::default(); tree.parents.len()];
    let mut world = local.clone();
    let mut firsts = Vec::new();
    let mut stays = vec![true; hung.len()];
    let step = source.frames().div_ceil(LOOKED_AT).max(1);
    for frame in (0..source.frames()).step_by(step) {
        source.locals(frame, &mut local);
        to_world(tree, &local, &mut world);
        for (nth, of) in hung.iter().enumerate() {
            let place = world[of.on].to_local(&world[of.joint]).place;
            if firsts.len() <= nth {
                firsts.push(place);
            }
            stays[nth] &= place.distance(firsts[nth]) <= far;
        }
    }
    stays
}

/// A file whose feet and hands hang on their limbs.
pub(super) struct Rehung<'a> {
    source: Box<dyn Source + 'a>,
    tree: Tree,
    /// For each joint, its index in the file. Parents come first.
    order: Vec<usize>,
    parents: Vec<Option<usize>>,
    /// Whether the joint hangs on another than the file says.
    changed: Vec<bool>,
}

impl<'a> Rehung<'a> {
    pub(super) fn new(source: Box<dyn Source + 'a>, tree: Tree, hung: &[Hung]) -> Self {
        let joints = tree.parents.len();
        let above = parents_with(&tree, hung);
        let mut children = vec![Vec::new(); joints];
        let mut open = Vec::new();
        for joint in (0..joints).rev() {
            match above[joint] {
                Some(parent) => children[parent].push(joint),
                None => open.push(joint),
            }
        }
        let mut order = Vec::with_capacity(joints);
        let mut place = vec![0; joints];
        while let Some(joint) = open.pop() {
            place[joint] = order.len();
            order.push(joint);
            open.extend(&children[joint]);
        }
        Self {
            parents: order
                .iter()
                .map(|&joint| above[joint].map(|parent| place[parent]))
                .collect(),
            changed: order
                .iter()
                .map(|&joint| above[joint] != tree.parents[joint])
                .collect(),
            source,
            tree,
            order,
        }
    }

    /// Transforms in the new parents out of those in the old ones.
    fn rehang(&self, local: &[Transform], out: &mut [Transform]) {
        let mut world = vec![Transform::default(); local.len()];
        to_world(&self.tree, local, &mut world);
        for (nth, &joint) in self.order.iter().enumerate() {
            out[nth] = match self.parents[nth] {
                Some(parent) if self.changed[nth] => world[self.order[parent]].to_local(&world[joint]),
                _ => local[joint],
            };
        }
    }
}

impl Source for Rehung<'_> {
    fn joint_count(&self) -> usize {
        self.order.len()
    }

    fn name(&self, joint: usize) -> &str {
        self.source.name(self.order[joint])
    }

    fn parent(&self, joint: usize) -> Option<usize> {
        self.parents[joint]
    }

    fn node(&self, joint: usize) -> Option<usize> {
        self.source.node(self.order[joint])
    }

    fn moves(&self, joint: usize) -> bool {
        self.source.moves(self.order[joint])
    }

    fn ever_moves(&self, joint: usize) -> bool {
        self.source.ever_moves(self.order[joint])
    }

    fn is_joint(&self, joint: usize) -> bool {
        self.source.is_joint(self.order[joint])
    }

    fn frames(&self) -> usize {
        self.source.frames()
    }

    fn fps(&self) -> f32 {
        self.source.fps()
    }

    fn rest(&self, out: &mut [Transform]) {
        let mut local = vec![Transform::default(); out.len()];
        self.source.rest(&mut local);
        self.rehang(&local, out);
    }

    fn locals(&self, frame: usize, out: &mut [Transform]) {
        let mut local = vec![Transform::default(); out.len()];
        self.source.locals(frame, &mut local);
        self.rehang(&local, out);
    }
}
