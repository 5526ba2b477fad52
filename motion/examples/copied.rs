//! The baseline of `scripts/retarget-figures.py`: a clip's rotations copied by name, without
//! retargeting. Each joint turns from its rest pose as the same joint of the clip's body does, in
//! the axes of the world; the root keeps its path. Prints the figures as JSON, one line a clip, with
//! those of the retargeter and its certificate beside them.
//!
//! `cargo run --release -p troupe-motion --features fbx --example copied -- TARGET CLIP...`, and at
//! the end `--urdf FILE` for clips of a robot.

use std::error::Error;
use std::path::{Path, PathBuf};
use std::sync::Arc;

use serde_json::json;
use troupe_motion::anatomy::{Limb, Parts, PartsDoc};
use troupe_motion::fk::world_transforms;
use troupe_motion::read::{Options, Source, Understood, beside, character, read};
use troupe_motion::retarget::{Certificate, Figure, Figures, Retargeter, retarget};
use troupe_motion::robot::description::{self, BuildOptions};
use troupe_motion::{Clip, Quat, Skeleton, Vec3};

type Failure = Box<dyn Error>;

fn main() -> Result<(), Failure> {
    let mut arguments: Vec<PathBuf> = std::env::args_os().skip(1).map(PathBuf::from).collect();
    let urdf = arguments.iter().position(|word| word.as_os_str() == "--urdf");
    let robot = match urdf.map(|at| arguments.drain(at..).nth(1)) {
        Some(Some(file)) => Some(Arc::new(robot(&file)?)),
        Some(None) => return Err("--urdf needs a file".into()),
        None => None,
    };
    let [to, clips @ ..] = &arguments[..] else {
        return Err("a target and clips are needed".into());
    };
    let (target, target_rest) = body(to)?;
    let mut certificate = None;
    for file in clips {
        // fox.glb#Walk names one animation of several.
        let name = file.to_string_lossy();
        let (path, animation) = match name.rsplit_once('#') {
            Some((path, animation)) => (Path::new(path), Some(animation.to_owned())),
            None => (&**file, None),
        };
        let options = Options {
            skeleton: robot.clone(),
            animation,
            ..Options::default()
        };
        let found = open(path, |source| read(source, &options))?;
        let source = found.figure(&PartsDoc::default())?;
        let rest = rest(&found);
        let mut retargeter = Retargeter::new(source.clone(), target.clone())?;
        let certified = certificate.get_or_insert_with(|| Certificate::of(&retargeter).faults());
        let (_, figures) = retarget(&mut retargeter, &found.clip)?;
        let copied = copied(&found.clip, [&source, &target], [&rest, &target_rest])?;
        let copied = Figures::of([&source, &target], [&found.clip, &copied], (0.0, None));
        let line = json!({
            "clip": file, "figures": figures, "faults": figures.faults(), "certificate": certified,
            "copied": copied, "copied_faults": copied.faults(),
        });
        println!("{line}");
    }
    Ok(())
}

/// A robot's skeleton.
fn robot(file: &Path) -> Result<Skeleton, Failure> {
    let text = std::fs::read_to_string(file)?;
    let folder = file.parent().unwrap_or(Path::new(""));
    let described = description::read(&text, &|name| beside::mesh(folder, name))?;
    Ok(description::build(&described, &BuildOptions::default())?.skeleton)
}

/// The body of a target's file, and its rest pose.
fn body(file: &Path) -> Result<(Figure, Vec<Quat>), Failure> {
    if file
        .extension()
        .is_some_and(|ending| ending == "urdf" || ending == "xml")
    {
        let skeleton = Arc::new(robot(file)?);
        let mut rest = vec![Quat::IDENTITY; skeleton.joint_count()];
        if let Some(robot) = &skeleton.robot {
            robot.pose(Quat::IDENTITY, &vec![0.0; robot.hinges().len()], &mut rest);
        }
        return Ok((Figure::of_robot(skeleton, &PartsDoc::default())?, rest));
    }
    let found = open(file, |source| character(source, &Options::default()))?;
    Ok((found.figure(&PartsDoc::default())?, rest(&found)))
}

fn open<E: Error + 'static>(
    file: &Path,
    with: impl FnOnce(&Source<'_>) -> Result<Understood, E>,
) -> Result<Understood, Failure> {
    let bytes = std::fs::read(file)?;
    let name = file.to_string_lossy();
    Ok(with(&Source::new(&name, &bytes)).map_err(|error| format!("{name}: {error}"))?)
}

fn rest(found: &Understood) -> Vec<Quat> {
    let zero = vec![Quat::IDENTITY; found.clip.skeleton.joint_count()];
    found.rest.clone().unwrap_or(zero)
}

/// The clip's rotations on the target's joints.
fn copied(clip: &Clip, figures: [&Figure; 2], rests: [&[Quat]; 2]) -> Result<Clip, Failure> {
    let worlds = [0, 1].map(|which: usize| world(figures[which].skeleton(), rests[which]));
    let pairs = pairs(figures[0].parts(), figures[1].parts());
    let skeleton = figures[1].skeleton();
    let mut rotations = Vec::with_capacity(clip.frames() * skeleton.joint_count());
    for frame in 0..clip.frames() {
        let mut pose = rests[1].to_vec();
        for &(from, to) in &pairs {
            let turn = rests[0][from].conjugate() * clip.rotations_at(frame)[from];
            let axes = worlds[1][to].conjugate() * worlds[0][from];
            pose[to] = (rests[1][to] * (axes * turn * axes.conjugate())).normalize();
        }
        rotations.extend(pose);
    }
    let made = Clip::new(
        Arc::clone(skeleton),
        clip.fps,
        clip.root_positions.clone(),
        rotations,
    )?;
    Ok(made)
}

/// World rotations of a pose.
fn world(skeleton: &Skeleton, pose: &[Quat]) -> Vec<Quat> {
    let (mut places, mut world) = (vec![Vec3::ZERO; pose.len()], pose.to_vec());
    world_transforms(skeleton, Vec3::ZERO, pose, &mut places, &mut world);
    world
}

/// Joints with the same name in two bodies.
fn pairs(from: &Parts, to: &Parts) -> Vec<(usize, usize)> {
    let limb = |limb: &Limb| {
        let bones = [limb.upper[0], limb.lower[0], limb.end];
        bones.into_iter().chain(limb.toe).collect::<Vec<_>>()
    };
    let limbs = |parts: &Parts| -> Vec<Vec<usize>> {
        let all = parts.legs.iter().chain(parts.arms.iter().flatten());
        all.map(limb)
            .chain([parts.trunk.clone(), parts.neck.clone()])
            .collect()
    };
    let chains = limbs(from).into_iter().zip(limbs(to));
    chains.flat_map(|(from, to)| from.into_iter().zip(to)).collect()
}
