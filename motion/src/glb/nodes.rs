//! Nodes of a glTF file: which of them are joints, and where they stand at rest.

use glam::{DQuat, DVec3};

use super::keys::Keys;
use super::{GlbReadError, MAX_NODES};

/// Largest ratio between the axes of a scale. Beyond it, bones would change length as they turn.
const MAX_STRETCH: f64 = 1.01;

/// A node that is a joint, or above one.
pub(super) struct Node {
    /// Its number in the file.
    pub(super) index: usize,
    pub(super) name: String,
    pub(super) parent: Option<usize>,
    pub(super) is_joint: bool,
    /// Whether it is a joint of a skin.
    pub(super) in_skin: bool,
    pub(super) translation: DVec3,
    pub(super) rotation: DQuat,
    pub(super) scale: DVec3,
    pub(super) translations: Option<Keys<DVec3>>,
    pub(super) rotations: Option<Keys<DQuat>>,
    pub(super) scales: Option<Keys<DVec3>>,
    /// Whether any animation of the file moves it in its parent.
    pub(super) ever_moves: bool,
}

/// All nodes in the file's order, at rest.
pub(super) fn rest_nodes(file: &gltf::Document) -> Result<Vec<Node>, GlbReadError> {
    let count = file.nodes().count();
    if count > MAX_NODES {
        return Err(GlbReadError::TooManyNodes(count));
    }
    let mut nodes: Vec<Node> = file.nodes().map(|node| rest_node(&node)).collect();
    for node in file.nodes() {
        for child in node.children() {
            let child = &mut nodes[child.index()];
            if child.parent.replace(node.index()).is_some() {
                return Err(GlbReadError::Hierarchy(child.name.clone()));
            }
        }
    }
    for skin in file.skins() {
        for joint in skin.joints() {
            let joint = &mut nodes[joint.index()];
            (joint.is_joint, joint.in_skin) = (true, true);
        }
    }
    Ok(nodes)
}

fn rest_node(node: &gltf::Node<'_>) -> Node {
    let (translation, rotation, scale) = node.transform().decomposed();
    Node {
        index: node.index(),
        name: match node.name() {
            Some(name) => name.to_owned(),
            None => format!("node_{}", node.index()),
        },
        parent: None,
        is_joint: false,
        in_skin: false,
        translation: DVec3::from(translation.map(f64::from)),
        rotation: DQuat::from_array(rotation.map(f64::from)).normalize(),
        scale: DVec3::from(scale.map(f64::from)),
        translations: None,
        rotations: None,
        scales: None,
        ever_moves: false,
    }
}

/// Nodes that move beside the body are no joints: cameras and props. Only a file with a skin shows
/// which nodes are the body; in others, a mirrored node that has no joint above or below it is a
/// prop. Returns their names.
pub(super) fn leave_props_out(nodes: &mut [Node]) -> Vec<String> {
    let skin: Vec<usize> = (0..nodes.len()).filter(|&node| nodes[node].in_skin).collect();
    if skin.is_empty() {
        return leave_out_alone(nodes);
    }
    let mut carries_skin = vec![false; nodes.len()];
    // The topmost joint above each joint of a skin.
    let mut is_top = vec![false; nodes.len()];
    for joint in skin {
        let mut top = joint;
        for above in line(nodes, joint) {
            carries_skin[above] = true;
            if nodes[above].is_joint {
                top = above;
            }
        }
        is_top[top] = true;
    }
    let is_stretched: Vec<bool> = nodes.iter().map(|node| node.stretch().is_some()).collect();
    let mut props = Vec::new();
    for node in 0..nodes.len() {
        if !nodes[node].is_joint || carries_skin[node] {
            continue;
        }
        let above = || line(nodes, node);
        let is_aside = !above().any(|above| is_top[above]);
        // A prop in a hand may be mirrored; nothing of the body hangs on it.
        let is_mirrored = above().any(|above| !carries_skin[above] && is_stretched[above]);
        if is_aside || is_mirrored {
            nodes[node].is_joint = false;
            props.push(nodes[node].name.clone());
        }
    }
    props
}

/// Leaves out mirrored joints that have no other joint above or below them.
fn leave_out_alone(nodes: &mut [Node]) -> Vec<String> {
    let joints: Vec<usize> = (0..nodes.len()).filter(|&node| nodes[node].is_joint).collect();
    let tops: Vec<usize> = joints
        .iter()
        .filter_map(|&joint| line(nodes, joint).last())
        .collect();
    let mut below = vec![0; nodes.len()];
    tops.iter().for_each(|&top| below[top] += 1);
    let is_mirrored = |joint: usize| line(nodes, joint).any(|above| nodes[above].stretch().is_some());
    let alone = joints.iter().zip(&tops).filter(|(_, top)| below[**top] == 1);
    let props: Vec<usize> = alone
        .map(|(&joint, _)| joint)
        .filter(|&joint| is_mirrored(joint))
        .collect();
    if props.len() == joints.len() {
        return Vec::new();
    }
    let leave_out = |node: usize| {
        nodes[node].is_joint = false;
        nodes[node].name.clone()
    };
    props.into_iter().map(leave_out).collect()
}

/// A node and all above it. In a circle, no node comes more often than there are nodes.
fn line(nodes: &[Node], node: usize) -> impl Iterator<Item = usize> {
    std::iter::successors(Some(node), |&node| nodes[node].parent).take(nodes.len())
}

/// The joints and what is above them, depth first, children in the file's order.
pub(super) fn joints(nodes: Vec<Node>) -> Result<Vec<Node>, GlbReadError> {
    let mut wanted = vec![false; nodes.len()];
    for node in 0..nodes.len() {
        let mut at = nodes[node].is_joint.then_some(node);
        // As many steps as there are nodes lead to a root, or round a circle.
        for _ in 0..=nodes.len() {
            match at {
                Some(above) if !wanted[above] => {
                    wanted[above] = true;
                    at = nodes[above].parent;
                }
                _ => break,
            }
        }
    }
    let mut children: Vec<Vec<usize>> = vec![Vec::new(); nodes.len()];
    let mut open = Vec::new();
    for node in (0..nodes.len()).rev().filter(|&node| wanted[node]) {
        match nodes[node].parent {
            Some(parent) => children[parent].push(node),
            None => open.push(node),
        }
    }
    let mut order = Vec::new();
    let mut place = vec![None; nodes.len()];
    while let Some(node) = open.pop() {
        place[node] = Some(order.len());
        order.push(node);
        open.extend_from_slice(&children[node]);
    }
    let mut nodes: Vec<Option<Node>> = nodes.into_iter().map(Some).collect();
    // Nodes that no root leads to are in a circle.
    let lost = (0..nodes.len()).find(|&node| wanted[node] && place[node].is_none());
    if let Some(node) = lost.and_then(|node| nodes[node].take()) {
        return Err(GlbReadError::Hierarchy(node.name));
    }
    let sorted = order
        .iter()
        .filter_map(|&node| nodes[node].take())
        .map(|node| Node {
            parent: node.parent.and_then(|parent| place[parent]),
            ..node
        });
    Ok(sorted.collect())
}

impl Node {
    /// Times of its keys, one list a property.
    pub(super) fn times(&self) -> impl Iterator<Item = &[f32]> {
        let moves = [&self.translations, &self.scales];
        let moves = moves.into_iter().flatten().map(Keys::times);
        moves.chain(self.rotations.iter().map(Keys::times))
    }

    /// Refuses a node that stretches what is below it.
    pub(super) fn check(&self, animation: &str) -> Result<(), GlbReadError> {
        let wrong = |reason: String| GlbReadError::Channel {
            animation: animation.to_owned(),
            node: self.name.clone(),
            reason,
        };
        if !(self.translation.is_finite() && self.rotation.is_finite() && self.scale.is_finite()) {
            return Err(wrong("its transform is not finite".to_owned()));
        }
        match self.stretch() {
            None => Ok(()),
            Some(scale) => Err(wrong(format!(
                "scale {scale}: it must be positive and the same in all directions within 1 %; apply the scale in \
                 your tool (Blender: Ctrl+A, Scale)"
            ))),
        }
    }

    /// A scale of the node that is negative or differs between directions.
    fn stretch(&self) -> Option<DVec3> {
        let keys = self.scales.iter().flat_map(Keys::all);
        keys.chain([self.scale]).find(|scale| {
            scale.min_element() <= 0.0 || scale.max_element() > MAX_STRETCH * scale.min_element()
        })
    }
}
