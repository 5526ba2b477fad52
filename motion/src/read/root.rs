//! Which joint of a file is the character's root.

use super::adapted::Adapted;
use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::options::Options;
use super::report::{Report, Topic, listed};
use super::slides::still_m;
use super::survey::Survey;
use crate::anatomy::Tree;
use crate::convert::{Rules, Source};

/// A joint that slides farther in a moving parent is a root of its own, metres.
const FREE_M: f64 = 0.001;
/// A joint that has this share of what hangs on its parent carries the body.
const NEARLY_ALL: f64 = 0.9;

/// The joint that an option names, or the one that carries the body.
pub(super) fn root_of(
    source: &Adapted<'_>,
    survey: &Survey,
    is_rehung: bool,
    size_m: f64,
    options: &Options,
    report: &mut Report,
) -> Result<usize, ReadErrorKind> {
    let tree = &survey.tree;
    if let Some(wanted) = &options.root {
        let found = (0..source.names.len()).find(|&joint| source.names[joint] == *wanted);
        return found.ok_or_else(|| ReadErrorKind::Range {
            field: OptionName::Root.flag().to_owned(),
            found: format!("{wanted:?}"),
            allowed: "a joint of the file".to_owned(),
            option: None,
        });
    }
    // Nodes above the pelvis carry a character through a world, and do not turn with it.
    if let (true, Some(body)) = (options.at_rest, &survey.body) {
        return Ok(body.pelvis);
    }
    let unit_m = report.unit_m.value;
    let top = match top_of_body(source, survey, report)? {
        Some(top) => descend(source, tree, top),
        None => {
            let rules = Rules {
                scale_to_metres: unit_m as f32,
                fold_root: true,
                left_axis: None,
                max_offset_variation_m: FREE_M as f32,
                max_offset_error_m: f32::INFINITY,
            };
            let root = crate::convert::character_root(source, &rules);
            match is_rehung {
                true => below_steering(survey, root),
                false => root,
            }
        }
    };
    let root = carrier(source, survey, top, still_m(size_m) / unit_m, FREE_M / unit_m);
    note_left_out(source, survey, root, top, report);
    Ok(root)
}

/// The root of the file that the body hangs on, if there are several.
fn top_of_body(
    source: &Adapted<'_>,
    survey: &Survey,
    report: &mut Report,
) -> Result<Option<usize>, ReadErrorKind> {
    let tree = &survey.tree;
    let roots: Vec<usize> = (0..tree.parents.len())
        .filter(|&joint| tree.parents[joint].is_none())
        .collect();
    if roots.len() == 1 {
        return Ok(None);
    }
    let names =
        |joints: &[usize]| -> Vec<&str> { joints.iter().map(|&joint| &*source.names[joint]).collect() };
    match &survey.body {
        Some(body) => {
            let body = tree.line(body.pelvis).last().unwrap_or(body.pelvis);
            let others: Vec<usize> = roots.into_iter().filter(|&root| root != body).collect();
            let text = format!("not of the body, left out: {}", listed(&names(&others)));
            report.repaired(Topic::Bystanders, text);
            Ok(Some(body))
        }
        None => Err(ReadErrorKind::Open {
            topic: Topic::Body,
            what: "which joint is the character's root",
            evidence: format!("the file has {} roots: {}", roots.len(), listed(&names(&roots))),
            options: Advice::decides(Choice::new(OptionName::Root, &names(&roots))),
        }),
    }
}

/// From a root down to the first joint.
fn descend(source: &Adapted<'_>, tree: &Tree, root: usize) -> usize {
    let children = tree.children();
    let mut at = root;
    while let [child] = children[at][..]
        && !source.is_joint(at)
    {
        at = child;
    }
    at
}

/// In a rig whose feet were hung on their limbs: down from a root to the first joint that carries
/// more than another one and what steers the rig.
fn below_steering(survey: &Survey, root: usize) -> usize {
    let tree = &survey.tree;
    let children = tree.children();
    let mut at = root;
    loop {
        let children = children[at].iter();
        let mut carried = children.filter(|&&joint| !tree.names[joint].is_steering());
        match (carried.next(), carried.next()) {
            (Some(&child), None) => at = child,
            _ => return at,
        }
    }
}

/// The joint that carries the whole body and moves in what is above it: the lowest from `top` on.
/// What stands beside it steers the rig or is no part of the body. Joints that move less than
/// `still` are still, and a joint that slides more than `free` does not hang on its parent. Both
/// are in the file's units.
fn carrier(source: &Adapted<'_>, survey: &Survey, top: usize, still: f64, free: f64) -> usize {
    let slide = |joint: usize| survey.slides[joint].0;
    let line = match &survey.body {
        Some(body) => survey.tree.chain(top, body.pelvis).unwrap_or_default(),
        None => carrying_line(&survey.tree, top),
    };
    let has_names = survey.body.is_some();
    let children = survey.tree.children();
    // The first that ever moves: below it, joints of a chain do too.
    let first = line[1.min(line.len())..]
        .iter()
        .find(|&&joint| source.ever_moves(joint));
    let first = first.copied().unwrap_or(top);
    let (mut root, mut moves) = (top, false);
    let mut is_below_still = true;
    for pair in line.windows(2) {
        let (above, joint) = (pair[0], pair[1]);
        is_below_still &= slide(above) <= still && survey.keeps_turn[above];
        // Without names, a joint that moves below a moving one may be any part of a chain.
        let is_free = slide(joint) > free && (has_names || (root == above && children[above].len() == 1));
        if source.moves(joint) && (is_free || (is_below_still && slide(joint) > still)) {
            (root, moves) = (joint, true);
        } else if !moves && is_below_still && source.ever_moves(joint) && (has_names || joint == first) {
            root = joint;
        }
    }
    root
}

/// From a joint down, as long as one joint carries nearly all others.
fn carrying_line(tree: &Tree, top: usize) -> Vec<usize> {
    let mut loads = vec![0; tree.parents.len()];
    for joint in (0..loads.len()).rev() {
        loads[joint] += usize::from(!tree.names[joint].is_steering());
        if let Some(parent) = tree.parents[joint] {
            loads[parent] += loads[joint];
        }
    }
    let children = tree.children();
    let next = |&at: &usize| {
        let carried: usize = children[at].iter().map(|&child| loads[child]).sum();
        let mut carries = children[at].iter().copied();
        carries.find(|&child| loads[child] > 0 && loads[child] as f64 >= NEARLY_ALL * carried as f64)
    };
    std::iter::successors(Some(top), next).collect()
}

/// Notes joints beside the body that hang below `top` but not below the root.
fn note_left_out(source: &Adapted<'_>, survey: &Survey, root: usize, top: usize, report: &mut Report) {
    let tree = &survey.tree;
    let line = tree.chain(top, root).unwrap_or_default();
    let is_beside = |&joint: &usize| {
        let parent = tree.parents[joint];
        !line.contains(&joint) && joint != root && parent.is_some_and(|p| p != root && line.contains(&p))
    };
    let beside = (0..source.names.len()).filter(is_beside);
    let beside: Vec<&str> = beside.map(|joint| &*source.names[joint]).collect();
    if !beside.is_empty() {
        let text = format!("not of the body, left out: {}", listed(&beside));
        report.repaired(Topic::Bystanders, text);
    }
}
