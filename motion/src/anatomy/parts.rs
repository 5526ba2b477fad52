//! The parts of a body: trunk, head, limbs and tail, as chains of joints.

use glam::{Quat, Vec3};

use super::biped::{Biped, Tree};
use super::doc::PartsDoc;
use super::shape;
use crate::ik;
use crate::skeleton::Skeleton;

/// Limbs of a robot that end this near to the lowest one are legs, by its height.
const LEG_SHARE: f32 = 0.15;

/// A leg whose joints are nearer to the line between its ends than this share of its length is
/// straight.
const STRAIGHT: f32 = 0.05;

const NO_BODY: &str = "no body is found among the joints: two legs of a hip, a knee and a foot each, and a head, \
                       by their names or as they stand at rest";

/// A limb: the joints from the trunk to the hand, foot or paw.
#[derive(Clone, Debug, PartialEq)]
pub struct Limb {
    /// Joints between the trunk and the limb: clavicles, shoulder blades. Often empty.
    pub girdle: Vec<usize>,
    /// Where the limb begins: shoulder or hip. The first hinge of a robot's.
    pub top: usize,
    /// The joint that turns the upper bone, and the joints along it: twists. The first is `top`,
    /// but for robots, whose hips and shoulders have several hinges: the last of them.
    pub upper: Vec<usize>,
    /// Elbow or knee, and the joints along the lower bone.
    pub lower: Vec<usize>,
    /// Wrist or ankle.
    pub end: usize,
    /// The joint that the toes turn about, or the tip of the foot. None for hands.
    pub toe: Option<usize>,
}

impl Limb {
    /// Shoulder, elbow, wrist; or hip, knee, ankle.
    pub fn chain(&self) -> [usize; 3] {
        [self.top, self.lower[0], self.end]
    }
}

/// The parts of a body. Pairs are left, right.
#[derive(Clone, Debug, PartialEq)]
pub struct Parts {
    /// From the pelvis, which the legs hang on, to the joint that the arms hang on, both included.
    /// Without arms: to the one below the neck.
    pub trunk: Vec<usize>,
    /// The joints above the trunk up to the head, which is the last. It may be empty.
    pub neck: Vec<usize>,
    /// Legs; the hind legs of a body on four.
    pub legs: [Limb; 2],
    /// Arms, or the fore legs.
    pub arms: Option<[Limb; 2]>,
    /// From its first joint to its tip. Often empty.
    pub tail: Vec<usize>,
    /// Whether it stands on four legs.
    pub on_fours: bool,
}

impl Parts {
    /// The parts of a skeleton that is upright in a pose of world rotations, one a joint: by names
    /// and otherwise by shape. None if it has no two legs and no head.
    pub fn find(skeleton: &Skeleton, pose: &[Quat]) -> Option<Self> {
        let tree = Tree::of(skeleton);
        let places = places(skeleton, pose);
        if skeleton.robot.is_some() {
            return Self::of_robot(skeleton, &tree, &places);
        }
        match Biped::find(&tree) {
            Some(body) => Some(Self::of(&tree, &places, &body, false)),
            None => {
                let found = shape::find(&tree, &places)?;
                Some(Self::of(&tree, &places, &found.body, found.on_fours))
            }
        }
    }

    /// As [`Parts::find`], with corrections.
    ///
    /// # Errors
    /// A sentence with the field of `doc` and what is allowed; or without corrections that no body
    /// is found.
    pub fn with(skeleton: &Skeleton, pose: &[Quat], doc: &PartsDoc) -> Result<Self, String> {
        let found = Self::find(skeleton, pose);
        match (doc.is_empty(), found) {
            (true, Some(found)) => Ok(found),
            (true, None) => Err(NO_BODY.to_owned()),
            (false, found) => doc.corrected(found, skeleton),
        }
    }

    /// The parts of a robot, whose limbs are chains of hinges: the upper bone of a limb is the last
    /// hinge before the knee or elbow, which has all turns of the hip or shoulder.
    fn of_robot(skeleton: &Skeleton, tree: &Tree, places: &[Vec3]) -> Option<Self> {
        let limb = |[top, middle, end]: [usize; 3], toe: Option<usize>| {
            let chain = tree.chain(top, end)?;
            let at = chain.iter().position(|&joint| joint == middle)?;
            Some(Limb {
                girdle: Vec::new(),
                top,
                upper: vec![chain[at.checked_sub(1)?]],
                lower: chain[at..chain.len() - 1].to_vec(),
                end,
                toe,
            })
        };
        let pair = |limbs: Vec<Limb>| -> Option<[Limb; 2]> {
            let mut limbs: [Limb; 2] = limbs.try_into().ok()?;
            let left = |limb: &Limb| (places[limb.end] - places[0]).dot(skeleton.left_axis);
            if left(&limbs[0]) < left(&limbs[1]) {
                limbs.reverse();
            }
            Some(limbs)
        };
        let legs = ik::legs(skeleton);
        let known: Vec<Limb> = legs.iter().filter_map(|leg| limb(leg.chain(), leg.toe)).collect();
        let arms = ik::arms(skeleton);
        let mut found: Vec<Limb> = arms
            .iter()
            .filter_map(|&arm| limb(with_hand(tree, places, arm), toe(tree, places, arm[2])))
            .collect();
        // Without contact joints, legs are among the limbs: those that end lowest.
        let lowest = found
            .iter()
            .map(|limb| places[limb.end].y)
            .fold(f32::INFINITY, f32::min);
        let highest = places
            .iter()
            .map(|place| place.y)
            .fold(f32::NEG_INFINITY, f32::max);
        let is_leg = |limb: &Limb| places[limb.end].y <= lowest + LEG_SHARE * (highest - lowest);
        let (mut hind, mut fore): (Vec<Limb>, Vec<Limb>) = match known.is_empty() {
            true => found.drain(..).partition(is_leg),
            false => (known, found),
        };
        fore.iter_mut().for_each(|arm| arm.toe = None);
        let on_fours = hind.len() == 4;
        let ahead = |limb: &Limb| (places[limb.end] - places[0]).dot(skeleton.left_axis.cross(Vec3::Y));
        if on_fours {
            hind.sort_by(|a, b| ahead(a).total_cmp(&ahead(b)));
            fore = hind.split_off(2);
        }
        let trunk = match on_fours {
            true => vec![0],
            false => trunk(tree, &fore),
        };
        Some(Self {
            trunk,
            neck: Vec::new(),
            legs: pair(hind)?,
            arms: pair(fore),
            tail: Vec::new(),
            on_fours,
        })
    }

    /// Its main joints.
    pub fn body(&self) -> Biped {
        let spine: Vec<usize> = self.trunk.iter().chain(&self.neck).copied().collect();
        Biped {
            pelvis: self.trunk[0],
            hips: self.legs.each_ref().map(|leg| leg.top),
            feet: self.legs.each_ref().map(|leg| leg.end),
            head: *spine.last().unwrap_or(&self.trunk[0]),
            arms: self.arms.as_ref().map(|arms| arms.each_ref().map(Limb::chain)),
            spine,
        }
    }

    fn of(tree: &Tree, places: &[Vec3], body: &Biped, on_fours: bool) -> Self {
        let chest = body
            .arms
            .and_then(|[left, right]| tree.meeting(left[0], right[0]));
        let within = chest.and_then(|chest| body.spine.iter().position(|&joint| joint == chest));
        // Without arms the trunk ends below the neck.
        let last = within.unwrap_or(body.spine.len().saturating_sub(2));
        let (trunk, neck) = body.spine.split_at(last + 1);
        let top = |limb: usize, below: usize| tree.chain(below, limb).unwrap_or_default();
        let legs = [0, 1].map(|side| {
            let hip = body.hips[side];
            let chain = top(body.feet[side], hip);
            let knee = knee(places, &chain, on_fours);
            let girdle = top(hip, body.pelvis);
            Limb {
                toe: toe(tree, places, body.feet[side]),
                ..limb(&girdle, &chain, knee)
            }
        });
        let arms = body.arms.map(|arms| {
            arms.map(|[shoulder, elbow, wrist]| {
                let chain = top(wrist, shoulder);
                let at = match on_fours {
                    true => knee(places, &chain, on_fours),
                    false => chain.iter().position(|&joint| joint == elbow).unwrap_or(1),
                };
                let girdle = top(shoulder, chest.unwrap_or(body.pelvis));
                Limb {
                    toe: toe(tree, places, wrist).filter(|_| on_fours),
                    ..limb(&girdle, &chain, at)
                }
            })
        });
        Self {
            trunk: trunk.to_vec(),
            neck: neck.to_vec(),
            tail: tail(tree, places, body),
            legs,
            arms,
            on_fours,
        }
    }
}

/// An arm of hinges whose last one is the elbow ends in the hand below it.
fn with_hand(tree: &Tree, places: &[Vec3], [top, middle, end]: [usize; 3]) -> [usize; 3] {
    let bone = |a: usize, b: usize| places[a].distance(places[b]);
    match toe(tree, places, end) {
        Some(hand) if bone(top, middle).min(bone(middle, end)) < bone(top, end).min(bone(end, hand)) => {
            [top, end, hand]
        }
        _ => [top, middle, end],
    }
}

/// The joints from the root to where the arms meet.
fn trunk(tree: &Tree, arms: &[Limb]) -> Vec<usize> {
    let chest = match arms {
        [left, right] => tree.meeting(left.top, right.top),
        _ => None,
    };
    tree.chain(0, chest.unwrap_or(0)).unwrap_or_else(|| vec![0])
}

/// A limb of the joints from shoulder to wrist, whose elbow is at an index. `girdle` begins at the
/// trunk and ends with the shoulder.
fn limb(girdle: &[usize], chain: &[usize], elbow: usize) -> Limb {
    let last = chain.len() - 1;
    Limb {
        girdle: girdle
            .iter()
            .copied()
            .skip(1)
            .filter(|&joint| joint != chain[0])
            .collect(),
        top: chain[0],
        upper: chain[..elbow].to_vec(),
        lower: chain[elbow..last].to_vec(),
        end: chain[last],
        toe: None,
    }
}

/// Index of the joint at which a leg bends. A leg on four has more joints than a knee, and folds
/// most by the one that is farthest beside the line between its ends.
fn knee(places: &[Vec3], chain: &[usize], on_fours: bool) -> usize {
    let last = chain.len() - 1;
    let [top, end] = [chain[0], chain[last]].map(|joint| places[joint]);
    let line = end - top;
    let beside = |&at: &usize| (places[chain[at]] - top).reject_from(line).length();
    let farthest = (1..last).max_by(|a, b| beside(a).total_cmp(&beside(b)));
    match farthest.filter(|at| on_fours && beside(at) > STRAIGHT * line.length()) {
        Some(at) => at,
        None => middle(places, chain),
    }
}

/// Index of the joint between the two ends of a chain that leaves the longest shorter bone.
fn middle(places: &[Vec3], chain: &[usize]) -> usize {
    let bone = |a: usize, b: usize| places[chain[a]].distance(places[chain[b]]);
    let last = chain.len() - 1;
    let shorter = |&at: &usize| bone(0, at).min(bone(at, last));
    (1..last)
        .max_by(|a, b| shorter(a).total_cmp(&shorter(b)))
        .unwrap_or(1)
}

/// The child of a foot by its name; otherwise the one that is farthest.
fn toe(tree: &Tree, places: &[Vec3], end: usize) -> Option<usize> {
    let children = || (end + 1..places.len()).filter(|&joint| tree.parents[joint] == Some(end));
    let named = children().find(|&joint| tree.names[joint].has_any(&["toe", "toes", "toebase", "ball"]));
    let far = |&joint: &usize| places[joint].distance(places[end]);
    named.or_else(|| children().max_by(|a, b| far(a).total_cmp(&far(b))))
}

/// The longest chain below the pelvis that is no limb, no trunk, and leads backwards or down.
fn tail(tree: &Tree, places: &[Vec3], body: &Biped) -> Vec<usize> {
    let own = |joint: usize| {
        body.spine
            .get(1)
            .is_some_and(|&first| tree.line(joint).any(|above| above == first))
            || body
                .hips
                .iter()
                .any(|&hip| tree.line(joint).any(|above| above == hip))
    };
    let leaves = (0..places.len()).filter(|&joint| {
        !tree.parents.contains(&Some(joint)) && !own(joint) && tree.chain(body.pelvis, joint).is_some()
    });
    let chains = leaves.filter_map(|leaf| {
        let named = tree.line(leaf).any(|joint| tree.names[joint].has("tail"));
        let chain = tree.chain(body.pelvis, leaf)?;
        (named && chain.len() > 2).then(|| chain[1..].to_vec())
    });
    chains.max_by_key(Vec::len).unwrap_or_default()
}

/// Places of the joints in a pose of world rotations, with joint 0 in the origin.
pub(crate) fn places(skeleton: &Skeleton, pose: &[Quat]) -> Vec<Vec3> {
    let mut places = vec![Vec3::ZERO; pose.len()];
    for (joint, described) in skeleton.joints.iter().enumerate() {
        if let Some(parent) = described.parent {
            places[joint] = places[parent] + pose[parent] * described.offset_m;
        }
    }
    places
}
