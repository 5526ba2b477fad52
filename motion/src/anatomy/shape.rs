//! Finds a body by its shape: pairs of ends at the same height, the lowest of which are feet.

use glam::Vec3;

use super::biped::{Biped, Tree};

/// Two ends are a pair if their heights, and the lengths of their chains, differ by less than this
/// share of the body's extent.
const ALIKE: f32 = 0.03;
/// A pair is at least this far apart, by the body's extent.
const APART: f32 = 0.03;
/// Ends up to this far above the lowest one stand on the ground, by the body's extent.
const GROUND: f32 = 0.08;
/// Fewest bones of a leg.
const LEG_BONES: usize = 3;

/// A body, and whether it stands on four legs.
pub(super) struct Found {
    pub(super) body: Biped,
    pub(super) on_fours: bool,
}

/// Two ends with the joint that they meet in, and their chains from there.
struct Pair {
    meeting: usize,
    chains: [Vec<usize>; 2],
    length: f32,
    lowest: f32,
}

/// The body of joints at places in the world, upright.
pub(super) fn find(tree: &Tree, places: &[Vec3]) -> Option<Found> {
    let pairs = pairs(tree, places);
    let ground = places.iter().map(|place| place.y).fold(f32::INFINITY, f32::min);
    let stands =
        |pair: &&Pair| pair.lowest <= ground + GROUND * extent(places) && pair.chains[0].len() > LEG_BONES;
    let mut legs: Vec<&Pair> = Vec::new();
    for pair in pairs.iter().filter(stands) {
        // The longest of those that meet in a joint: toes, heels and soles end beside each other.
        match legs.iter_mut().find(|leg| leg.meeting == pair.meeting) {
            Some(leg) if pair.length > leg.length => *leg = pair,
            Some(_) => {}
            None => legs.push(pair),
        }
    }
    // Toes of one foot also are a pair, which meets below.
    let all = legs.clone();
    let is_part = |pair: &Pair| {
        all.iter()
            .any(|leg| leg.chains.iter().any(|chain| chain[1..].contains(&pair.meeting)))
    };
    legs.retain(|pair| !is_part(pair));
    // The hind legs meet in the joint with the shortest way to the root.
    legs.sort_by_key(|pair| tree.line(pair.meeting).count());
    let (hind, fore) = match legs[..] {
        [hind] => (hind, None),
        [hind, fore] => (hind, Some(fore)),
        _ => return None,
    };
    let of_leg = |joint: usize| hind.chains.iter().any(|chain| chain.contains(&joint));
    let arms = fore.or_else(|| {
        let free = pairs.iter().filter(|pair| {
            !pair
                .chains
                .iter()
                .flatten()
                .any(|&joint| of_leg(joint) && joint != hind.meeting)
                && pair.chains[0].len() > LEG_BONES
        });
        free.max_by(|a, b| a.length.total_cmp(&b.length))
    });
    let forward = Vec3::Y.cross(across(places, hind)?);
    let sides = |pair: &Pair| sides(places, pair, forward);
    let pelvis = hind.meeting;
    let on_fours = fore.is_some();
    let limb = |chain: &Vec<usize>| match on_fours {
        true => paw(places, chain),
        false => leg(places, chain),
    };
    let [left, right] = sides(hind).map(|chain| limb(&chain));
    let (left, right) = (left?, right?);
    let head = head(tree, places, pelvis, arms, &of_leg)?;
    let arms = arms.and_then(|pair| {
        let [left, right] = sides(pair).map(|chain| limb(&chain));
        Some([left?, right?])
    });
    Some(Found {
        on_fours,
        body: Biped {
            pelvis,
            hips: [left[0], right[0]],
            feet: [left[2], right[2]],
            spine: tree.chain(pelvis, head)?,
            head,
            arms,
        },
    })
}

fn extent(places: &[Vec3]) -> f32 {
    let size = |of: fn(&Vec3) -> f32| {
        let values = || places.iter().map(of);
        values().fold(f32::NEG_INFINITY, f32::max) - values().fold(f32::INFINITY, f32::min)
    };
    size(|place| place.x)
        .max(size(|place| place.y))
        .max(size(|place| place.z))
}

/// Ends that mirror each other.
fn pairs(tree: &Tree, places: &[Vec3]) -> Vec<Pair> {
    let size = extent(places);
    let leaves: Vec<usize> = (0..places.len())
        .filter(|&joint| !tree.parents.contains(&Some(joint)))
        .collect();
    let length = |chain: &[usize]| -> f32 {
        chain
            .windows(2)
            .map(|bone| places[bone[0]].distance(places[bone[1]]))
            .sum()
    };
    let mut pairs = Vec::new();
    for (nth, &a) in leaves.iter().enumerate() {
        for &b in &leaves[nth + 1..] {
            let level = (places[a].y - places[b].y).abs() <= ALIKE * size;
            if !level || places[a].distance(places[b]) < APART * size {
                continue;
            }
            let Some(meeting) = tree.meeting(a, b) else {
                continue;
            };
            let (Some(left), Some(right)) = (tree.chain(meeting, a), tree.chain(meeting, b)) else {
                continue;
            };
            let lengths = [length(&left), length(&right)];
            if left.len() == right.len() && (lengths[0] - lengths[1]).abs() <= ALIKE * size {
                pairs.push(Pair {
                    meeting,
                    length: 0.5 * (lengths[0] + lengths[1]),
                    lowest: places[a].y.min(places[b].y),
                    chains: [left, right],
                });
            }
        }
    }
    pairs
}

/// The body's left on the ground, from the feet and where they point.
fn across(places: &[Vec3], feet: &Pair) -> Option<Vec3> {
    let [a, b] = &feet.chains;
    let tips = [a, b].map(|chain| places[chain[chain.len() - 1]]);
    let across = (tips[0] - tips[1]).with_y(0.0).try_normalize()?;
    // From the ankle to the tip: the lowest bone that is longer over the ground than it is high.
    let ahead: Vec3 = [a, b]
        .into_iter()
        .filter_map(|chain| {
            let [_, _, ankle] = leg(places, chain)?;
            Some(places[chain[chain.len() - 1]] - places[ankle])
        })
        .sum();
    let forward = Vec3::Y.cross(across);
    Some(if forward.dot(ahead) < 0.0 { -across } else { across })
}

/// A pair's chains, left and right of a body that faces `forward`.
fn sides(places: &[Vec3], pair: &Pair, forward: Vec3) -> [Vec<usize>; 2] {
    let left = Vec3::Y.cross(forward);
    let [a, b] = &pair.chains;
    let [to_a, to_b] = [a, b].map(|chain| places[chain[chain.len() - 1]].dot(left));
    match to_a >= to_b {
        true => [a.clone(), b.clone()],
        false => [b.clone(), a.clone()],
    }
}

/// Hip, knee and ankle of a chain from the trunk to the tip: the two bones in a row whose shorter
/// one is longest. The first bone is the girdle.
fn leg(places: &[Vec3], chain: &[usize]) -> Option<[usize; 3]> {
    let bone = |a: usize, b: usize| places[a].distance(places[b]);
    let shorter = |of: &&[usize]| bone(of[0], of[1]).min(bone(of[1], of[2]));
    let best = chain[1..]
        .windows(3)
        .max_by(|a, b| shorter(a).total_cmp(&shorter(b)))?;
    Some([best[0], best[1], best[2]])
}

/// Shoulder or hip, elbow or knee, and the joint above the tip of the foot: the two spans whose
/// shorter one is longest.
fn paw(places: &[Vec3], chain: &[usize]) -> Option<[usize; 3]> {
    let span = |a: usize, b: usize| places[a].distance(places[b]);
    let end = *chain.get(chain.len().checked_sub(2)?)?;
    let above = chain.get(1..chain.len() - 2)?;
    let pairs = above.iter().enumerate().flat_map(|(nth, &top)| {
        let below = above[nth + 1..].iter();
        below.map(move |&middle| [top, middle, end])
    });
    let shorter = |of: &[usize; 3]| span(of[0], of[1]).min(span(of[1], of[2]));
    pairs.max_by(|a, b| shorter(a).total_cmp(&shorter(b)))
}

/// The end of the chain that leads farthest from the pelvis in the middle of the body, beyond where
/// the arms meet.
fn head(
    tree: &Tree,
    places: &[Vec3],
    pelvis: usize,
    arms: Option<&Pair>,
    of_leg: &dyn Fn(usize) -> bool,
) -> Option<usize> {
    let chest = arms.map_or(pelvis, |pair| pair.meeting);
    let of_arm =
        |joint: usize| arms.is_some_and(|pair| pair.chains.iter().any(|chain| chain[1..].contains(&joint)));
    let ends = (0..places.len()).filter(|&joint| {
        !tree.parents.contains(&Some(joint))
            && tree.chain(chest, joint).is_some()
            && !tree
                .line(joint)
                .any(|above| above != pelvis && (of_leg(above) || of_arm(above)))
    });
    let far = |&joint: &usize| {
        let place = places[joint] - places[pelvis];
        place.y + 0.25 * place.with_y(0.0).length()
    };
    let end = ends.max_by(|a, b| far(a).total_cmp(&far(b)))?;
    let named = tree.line(end).find(|&joint| tree.names[joint].has("head"));
    if let Some(head) = named.filter(|&head| tree.chain(chest, head).is_some() && head != chest) {
        return Some(head);
    }
    // A tip is no joint that turns: the head is the last with a bone below it.
    match tree.parents[end] {
        Some(parent) if parent != chest => Some(parent),
        _ => Some(end),
    }
}
