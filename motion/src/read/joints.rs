//! Turns a file of joints into a clip: axes, unit, root, sliding joints, names, rest pose.

use std::sync::Arc;

use glam::{DVec3, Quat, Vec3};

use super::adapted::{Adapted, Turn};
use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::options::Options;
use super::rehang::{self, Rehung};
use super::report::{Basis, Finding, Format, Note, Report, RestPose, Topic, Up, listed};
use super::slides::{hold_slides, hold_slides_on};
use super::stance::{Stated, height_m, is_of_skeleton, lies, may_be_small, unit_of, up_of};
use super::survey::{Stance, Survey, to_world};
use super::units::name_of;
use super::{Understood, leading, oddities, rest, root, unique::unique};
use crate::anatomy::{Name, PartsDoc, Tree, without_namespace};
use crate::clip::Clip;
use crate::convert::{
    OnSkeleton, Rules, Selection, Source, Transform, check_length, to_clip_of, to_clip_on_of,
};
use crate::glb::MAX_NODES;
use crate::skeleton::{Joint, MAX_NAME_BYTES, Skeleton};

/// Farthest place of a root along an axis, metres: that of the server's interface.
const MAX_ROOT_M: f32 = 10_000.0;
/// How much of a longer name an error shows, characters.
const SHOWN_CHARS: usize = 32;
/// Shorter bones have no length, metres.
const MIN_BONE_M: f32 = 1e-6;
/// Largest angle between bones that point alike, degrees, and how many bones must.
const MAX_ALIKE_DEG: f64 = 2.0;
const MIN_ALIKE: usize = 4;
/// A bone that points farther from the skeleton's is noted, degrees.
const MAX_ASLANT_DEG: f32 = 3.0;
/// Share at rest along an axis from which a skeleton stands along it.
const MIN_RESTING: f64 = 0.9;

/// A file of joints, as read.
pub(super) struct Parsed<'a> {
    pub(super) source: Box<dyn Source + 'a>,
    pub(super) format: Finding<Format>,
    pub(super) producer: Option<Finding<String>>,
    pub(super) skeleton: Option<Finding<String>>,
    pub(super) stated: Stated,
    pub(super) fps: Finding<f32>,
    /// What was put right while reading.
    pub(super) repairs: Vec<Note>,
    pub(super) oddities: Vec<Note>,
}

/// Turns a file of joints into a clip.
pub(super) fn understand(
    file: &str,
    mut parsed: Parsed<'_>,
    options: &Options,
) -> Result<Understood, ReadErrorKind> {
    if parsed.source.frames() == 0 {
        return Err(crate::clip::ClipError::Empty.into());
    }
    check_size(&*parsed.source)?;
    check_root(options)?;
    let mut survey = Survey::of(&*parsed.source);
    let hung = rehang::find(&*parsed.source, &survey, size_m(&survey, 1.0));
    if !hung.is_empty() {
        let name = |joint: usize| parsed.source.name(joint);
        let names = hung
            .iter()
            .map(|hung| format!("{} on {}", name(hung.joint), name(hung.on)));
        let names: Vec<String> = names.collect();
        parsed.repairs.push(Note {
            topic: Topic::Rig,
            text: format!("hung on the limbs that they move with: {}", listed(&names)),
        });
        parsed.source = Box::new(Rehung::new(parsed.source, survey.tree, &hung));
        survey = Survey::of(&*parsed.source);
    }
    let source = &*parsed.source;
    let stance = survey.stance.as_ref();
    let to = options.skeleton.as_deref();
    let bones = to.map_or_else(Vec::new, |to| shared_bones(source, &survey, to));
    let (fit_m, are_alike) = (fit_m(&bones), point_alike(&bones));
    let up = up_of(stance, parsed.stated, are_alike, options)?;
    let unit_m = unit_of(stance, parsed.stated, fit_m, options)?;
    let resting = stance
        .map(|stance| Up::nearest(stance.resting))
        .and_then(|(up, share)| (share >= MIN_RESTING).then_some(up));
    let rest_pose = rest::rest_pose(&survey, resting, options);
    let mut report = Report {
        file: file.to_owned(),
        format: parsed.format,
        producer: parsed.producer,
        skeleton: parsed.skeleton.unwrap_or_else(|| skeleton_of(&survey)),
        up,
        unit_m,
        fps: parsed.fps,
        rest_pose,
        frames: source.frames(),
        joints: 0,
        nodes: Vec::new(),
        contacts: Finding::new(Vec::new(), Basis::Found, ""),
        repairs: parsed.repairs,
        oddities: parsed.oddities,
    };
    note_axes_and_unit(&mut report, parsed.stated, stance);
    if let Some(text) = stance
        .filter(|_| !is_of_skeleton(fit_m))
        .and_then(|stance| may_be_small(stance, parsed.stated, &report.unit_m))
    {
        report.odd(Topic::Unit, text);
    }
    let names = joint_names(source, options, &mut report);
    let adapted = Adapted {
        source,
        names: &names,
        turn: Turn::of(
            report.up.value,
            resting.filter(|_| report.rest_pose.value != RestPose::None && !are_alike),
        ),
    };
    let rules = Rules {
        scale_to_metres: report.unit_m.value as f32,
        fold_root: true,
        left_axis: None,
        max_offset_variation_m: f32::INFINITY,
        max_offset_error_m: match options.other_bones {
            true => f32::INFINITY,
            false => 0.02,
        },
    };
    let size_m = size_m(&survey, report.unit_m.value);
    let (clip, (rest, root_y)) = match &options.skeleton {
        Some(skeleton) => {
            let OnSkeleton {
                clip,
                taken,
                farthest,
            } = to_clip_on_of(&adapted, skeleton, &rules).map_err(ReadErrorKind::convert)?;
            let parents: Vec<_> = skeleton.joints.iter().map(|joint| joint.parent).collect();
            hold_slides_on(&survey, &names, (&taken, &parents), size_m, options, &mut report)?;
            if options.other_bones {
                note_other_directions(skeleton, farthest, &mut report);
            }
            let rest = rest_of(&adapted, &survey.tree, &taken, &clip);
            report.nodes = nodes_of(source, &taken);
            (clip, rest)
        }
        None => {
            let root = root::root_of(&adapted, &survey, !hung.is_empty(), size_m, options, &mut report)?;
            let left_out = hold_slides(&survey, &names, root, size_m, options, &mut report)?;
            let selection = Selection {
                root: Some(root),
                left_out: &left_out,
            };
            let (clip, taken) = to_clip_of(&adapted, &rules, selection).map_err(ReadErrorKind::convert)?;
            let rest = rest_of(&adapted, &survey.tree, &taken, &clip);
            note_zero_bones(&clip, &mut report);
            report.nodes = nodes_of(source, &taken);
            (clip, rest)
        }
    };
    let clip = leading::without_pose(clip, &rest, options, &mut report)?;
    let rest = to.is_none().then_some(rest);
    let rest_root_y_m = Some((root_y * report.unit_m.value) as f32);
    let found = finish(clip, rest, report, options)?;
    Ok(Understood {
        rest_root_y_m,
        ..found
    })
}

/// Refuses a file that would take too long to look at.
pub(super) fn check_size(source: &dyn Source) -> Result<(), ReadErrorKind> {
    let joints = source.joint_count();
    if joints > MAX_NODES {
        return Err(ReadErrorKind::Range {
            field: "the number of joints".to_owned(),
            found: joints.to_string(),
            allowed: format!("up to {MAX_NODES}"),
            option: None,
        });
    }
    check_names((0..joints).map(|joint| source.name(joint)))?;
    check_length(source).map_err(ReadErrorKind::convert)
}

/// Refuses names that no table and no message can hold.
fn check_names<'a>(mut names: impl Iterator<Item = &'a str>) -> Result<(), ReadErrorKind> {
    let Some(name) = names.find(|name| name.len() > MAX_NAME_BYTES) else {
        return Ok(());
    };
    let start: String = name.chars().take(SHOWN_CHARS).collect();
    Err(ReadErrorKind::Range {
        field: format!("the name of joint \"{}…\"", start.escape_debug()),
        found: format!("{} bytes long", name.len()),
        allowed: format!("up to {MAX_NAME_BYTES} bytes"),
        option: None,
    })
}

/// Refuses a root that is not the skeleton's: on a skeleton, the joints' names decide.
fn check_root(options: &Options) -> Result<(), ReadErrorKind> {
    let (Some(root), Some(skeleton)) = (&options.root, &options.skeleton) else {
        return Ok(());
    };
    let name = &skeleton.joints[0].name;
    match without_namespace(root) == without_namespace(name) {
        true => Ok(()),
        false => Err(ReadErrorKind::Range {
            field: OptionName::Root.flag().to_owned(),
            found: format!("{root:?}"),
            allowed: format!("{name:?}, the root of the skeleton that the file is read onto"),
            option: None,
        }),
    }
}

/// What is the same for every format: contacts, oddities, rate.
pub(super) fn finish(
    clip: Clip,
    rest: Option<Vec<Quat>>,
    mut report: Report,
    options: &Options,
) -> Result<Understood, ReadErrorKind> {
    check_places(&clip)?;
    check_names(clip.skeleton.joints.iter().map(|joint| &*joint.name))?;
    // At the file's own rate: glTF may be sampled at another.
    report.frames = (clip.duration_s() * report.fps.value).round() as usize + 1;
    report.joints = clip.skeleton.joint_count();
    report.contacts = oddities::contacts(&clip);
    oddities::note(&clip, &mut report);
    let clip = match options.resample_fps {
        Some(fps) => clip.resample(fps)?,
        None => clip,
    };
    Ok(Understood {
        clip,
        rest,
        rest_root_y_m: None,
        parts: PartsDoc::default(),
        report,
    })
}

/// Refuses roots that are farther away than the server takes them.
fn check_places(clip: &Clip) -> Result<(), ReadErrorKind> {
    let far = |root: &Vec3| root.abs().max_element() > MAX_ROOT_M;
    let Some(frame) = clip.root_positions.iter().position(far) else {
        return Ok(());
    };
    let [x, y, z] = clip.root_positions[frame].to_array();
    let metres = |m: f32| match m.abs() < 1e9 {
        true => format!("{m:.0}"),
        false => format!("{m:e}"),
    };
    Err(ReadErrorKind::Range {
        field: format!("the root's place in frame {frame}"),
        found: format!("({}, {}, {}) m", metres(x), metres(y), metres(z)),
        allowed: format!("-{MAX_ROOT_M} to {MAX_ROOT_M} m along each axis"),
        option: Some(Advice::new("is {} right?", [Choice::any(OptionName::Unit)])),
    })
}

fn note_axes_and_unit(report: &mut Report, stated: Stated, stance: Option<&Stance>) {
    let (up, unit_m) = (report.up.clone(), report.unit_m.clone());
    if up.basis == Basis::Stated
        && let Some(text) = stance.and_then(|stance| lies(stance, up.value, stated))
    {
        report.odd(Topic::Up, text);
    }
    if let Some(stated) = stated
        .up
        .filter(|stated| up.basis == Basis::Found && *stated != up.value)
    {
        let text = format!("{} is up, not {stated}: {}", up.value, up.evidence);
        report.repaired(Topic::Up, text);
    }
    if up.value != Up::Y {
        report.repaired(Topic::Up, format!("{} is up: turned so that Y is", up.value));
    }
    let usual = stated.unit_m.unwrap_or(super::units::CENTIMETRE_M);
    if unit_m.basis == Basis::Found && (unit_m.value / usual - 1.0).abs() > 1e-6 {
        let (found, usual) = (name_of(unit_m.value), name_of(usual));
        report.repaired(
            Topic::Unit,
            format!("lengths are in {found}, not in {usual}: {}", unit_m.evidence),
        );
    }
    if up.basis == Basis::Assumed {
        report.odd(Topic::Up, up.evidence);
    }
    if unit_m.basis == Basis::Assumed {
        report.odd(Topic::Unit, unit_m.evidence);
    }
}

fn skeleton_of(survey: &Survey) -> Finding<String> {
    match &survey.body {
        Some(body) => {
            let names = &survey.tree.names;
            let word = |joint: usize| names[joint].words.join(" ");
            let evidence = format!(
                "legs from {:?} to {:?}, spine to {:?}",
                word(body.pelvis),
                word(body.feet[0]),
                word(body.head)
            );
            Finding::new("body on two legs".to_owned(), Basis::Found, evidence)
        }
        None => {
            let why = "two feet and a head are not found by their joints' names";
            Finding::new("of its own".to_owned(), Basis::Found, why)
        }
    }
}

/// Names that are unique, without namespaces if an option or the skeleton asks for it.
fn joint_names(source: &dyn Source, options: &Options, report: &mut Report) -> Vec<String> {
    let given: Vec<&str> = (0..source.joint_count())
        .map(|joint| source.name(joint))
        .collect();
    let is_there =
        |skeleton: &Arc<Skeleton>, name: &str| skeleton.joints.iter().any(|joint| joint.name == name);
    let mut stripped = 0;
    let mut made: Vec<String> = given
        .iter()
        .map(|&name| {
            let bare = without_namespace(name);
            let strips = match &options.skeleton {
                Some(skeleton) => !is_there(skeleton, name) && is_there(skeleton, bare),
                None => options.strip_namespaces,
            };
            stripped += usize::from(strips && bare != name);
            if strips { bare } else { name }.to_owned()
        })
        .collect();
    if stripped > 0 {
        let first = given.iter().find(|name| without_namespace(name) != **name);
        let first = first.copied().unwrap_or_default();
        let bare = without_namespace(first);
        report.repaired(
            Topic::Names,
            format!("{stripped} names lost their namespace: {first:?} is {bare:?}"),
        );
    }
    let renamed = unique(&mut made);
    if let Some((old, new)) = renamed.first() {
        let count = renamed.len();
        report.repaired(
            Topic::Names,
            format!("{count} joints have a name that another has: the second {old:?} is {new:?}"),
        );
    }
    made
}

/// Numbers of the nodes of a clip's joints. Empty if the format has none.
fn nodes_of(source: &dyn Source, taken: &[usize]) -> Vec<usize> {
    let nodes = taken.iter().map(|&joint| source.node(joint));
    nodes.collect::<Option<Vec<_>>>().unwrap_or_default()
}

/// The bones that a file shares with a skeleton: theirs in the file's unit, ours in metres.
fn shared_bones(source: &dyn Source, survey: &Survey, skeleton: &Skeleton) -> Vec<[DVec3; 2]> {
    let bone = |joint: usize| {
        let bare = without_namespace(source.name(joint));
        let to = skeleton
            .joint_index(source.name(joint))
            .or_else(|| skeleton.joint_index(bare))?;
        let parent = &skeleton.joints[skeleton.joints[to].parent?].name;
        let above = source.name(source.parent(joint)?);
        let same_parent = parent == above || parent == without_namespace(above);
        let bones = [survey.places[joint], skeleton.joints[to].offset_m.as_dvec3()];
        (same_parent && bones[0].length() > 0.0 && bones[1].length() > 0.01).then_some(bones)
    };
    (0..source.joint_count()).filter_map(bone).collect()
}

/// The unit in metres with which the bones have the skeleton's lengths: the middle of all bones.
fn fit_m(bones: &[[DVec3; 2]]) -> Option<f64> {
    let ratio = |[theirs, ours]: &[DVec3; 2]| ours.length() / theirs.length();
    let mut ratios: Vec<f64> = bones.iter().map(ratio).collect();
    ratios.sort_by(f64::total_cmp);
    ratios.get(ratios.len() / 2).copied()
}

/// Whether the bones point as the skeleton's in their parents. Then the rest pose does not show
/// which axis points up: it is the skeleton's.
fn point_alike(bones: &[[DVec3; 2]]) -> bool {
    let alike = |[theirs, ours]: &[DVec3; 2]| theirs.angle_between(*ours).to_degrees() < MAX_ALIKE_DEG;
    bones.len() >= MIN_ALIKE && bones.iter().all(alike)
}

/// Extent of the body, metres: its height, or the length of its longest line of bones.
fn size_m(survey: &Survey, unit_m: f64) -> f64 {
    match &survey.stance {
        Some(stance) => height_m(stance, unit_m),
        None => {
            let mut reach = vec![0.0_f64; survey.places.len()];
            let mut most = 0.0_f64;
            for (joint, place) in survey.places.iter().enumerate() {
                if let Some(parent) = survey.tree.parents[joint] {
                    reach[joint] = reach[parent] + place.length();
                    most = most.max(reach[joint]);
                }
            }
            most * unit_m
        }
    }
}

/// Notes bones that point otherwise than the skeleton's: the motion is off by that angle.
fn note_other_directions(skeleton: &Skeleton, farthest: Option<(usize, f32)>, report: &mut Report) {
    let Some((joint, angle_deg)) = farthest.filter(|&(_, angle_deg)| angle_deg > MAX_ASLANT_DEG) else {
        return;
    };
    let joint = &skeleton.joints[joint];
    let parent = joint.parent.map_or("", |parent| &*skeleton.joints[parent].name);
    let text = format!(
        "bones point otherwise than the skeleton's at rest, most of all that from {parent} to {}: it is played \
         {angle_deg:.0}° off",
        joint.name
    );
    report.odd(Topic::Body, text);
}

/// Notes hips and shoulders without length, which say nothing of left and right.
fn note_zero_bones(clip: &Clip, report: &mut Report) {
    let is_zero = |joint: &&Joint| {
        let sided = Name::of(&joint.name).side.is_some();
        sided && joint.parent.is_some() && joint.offset_m.length() < MIN_BONE_M
    };
    let zero = clip.skeleton.joints.iter().filter(is_zero);
    let zero: Vec<&str> = zero.map(|joint| &*joint.name).collect();
    if !zero.is_empty() {
        let text = format!("bones without length are kept: {}", listed(&zero));
        report.repaired(Topic::ZeroLength, text);
    }
}

/// Rotations of the clip's joints at rest: joint 0 in the world, others relative to their parents.
/// And the height of joint 0 in the file's unit.
fn rest_of(source: &Adapted<'_>, tree: &Tree, taken: &[usize], clip: &Clip) -> (Vec<Quat>, f64) {
    let mut local = vec![Transform::default(); source.joint_count()];
    source.rest(&mut local);
    let mut world = local.clone();
    to_world(tree, &local, &mut world);
    let joints = clip.skeleton.joints.iter().zip(taken);
    let turns = joints.map(|(joint, &index)| {
        let turn = world[index].turn;
        match joint.parent {
            None => turn,
            Some(parent) => world[taken[parent]].turn.conjugate() * turn,
        }
    });
    let turns = turns.map(|turn| turn.normalize().as_quat()).collect();
    (turns, world[taken[0]].place.y)
}
