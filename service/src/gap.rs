//! The way through a gap that words fill. A model of words knows no places, so the root is that of
//! a pack that fills gaps.

use std::sync::Arc;

use troupe_character::take::Ending;
use troupe_motion::model::{Capability, Rig};
use troupe_motion::root::heading_of;
use troupe_motion::rotation::from_wxyz;
use troupe_motion::{GlobalRoot, Vec3};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use crate::{Service, ServiceError};
use troupe_live::packs::LoadedPack;
use troupe_live::skeleton::is_same_body;

impl Service {
    /// Has the motion of a gap of `frames` frames follow the root that a pack of the same skeleton
    /// makes for it.
    /// Returns a note if there is no such pack, or if the gap is too long or too short for it.
    ///
    /// # Errors
    /// [`ServiceError`] of that pack.
    pub(crate) async fn know_way(
        &self,
        request: &v1::GenerateRequest,
        (words, frames): (&LoadedPack, usize),
        ending: &mut Ending,
    ) -> Result<Option<String>, ServiceError> {
        let Some(Goal::Prompt(prompt)) = &request.goal else {
            return Ok(None);
        };
        let Some(loaded) = self.filler(words)? else {
            return Ok(Some(unknown(
                "no pack of the same skeleton that fills gaps is loaded",
            )));
        };
        let (dims, name) = (&loaded.pack.rig.dims, loaded.pack.name());
        let count = dims.context_frames + frames + 1;
        if !(dims.min_frames()..=dims.max_frames()).contains(&count) {
            let [least, most] = [dims.min_frames(), dims.max_frames()]
                .map(|frames| frames.saturating_sub(dims.context_frames + 1));
            return Ok(Some(unknown(&format!(
                "the pack {name} fills gaps of {least} to {most} frames"
            ))));
        }
        let past = request.past.len().saturating_sub(dims.context_frames);
        let asked = v1::InBetweenRequest {
            pack: name.to_owned(),
            characters: vec![v1::Character {
                context: request.past[past..].to_vec(),
                targets: prompt.targets[..1].to_vec(),
                frame_count: Some(count as u32),
                hold_feet: Some(false),
                ..v1::Character::default()
            }],
            ..v1::InBetweenRequest::default()
        };
        let first = dims.context_frames;
        let answer = self.in_between(asked).await?;
        let made = answer.characters.into_iter().next();
        if let Some(made) = made.and_then(|made| made.frames) {
            ending.follow(roots(&made, &loaded.pack.rig, first, frames));
        }
        Ok(None)
    }

    /// The first pack with the body of `words` that fills gaps. The default pack goes first.
    fn filler(&self, words: &LoadedPack) -> Result<Option<Arc<LoadedPack>>, ServiceError> {
        let table = self.table()?;
        let fills = |loaded: &&Arc<LoadedPack>| {
            loaded.pack.manifest.capabilities.has(Capability::Inbetween)
                && is_same_body(&words.pack.rig, &loaded.pack.rig)
        };
        let default = table
            .all()
            .find(|loaded| table.is_default(loaded) && fills(loaded));
        Ok(default.or_else(|| table.all().find(fills)).cloned())
    }
}

fn unknown(why: &str) -> String {
    format!("the way through the gap is that of the words, led to its end: {why}")
}

/// The roots of `count` frames from `first` on, with the headings of their poses.
fn roots(frames: &v1::Frames, rig: &Rig, first: usize, count: usize) -> Vec<GlobalRoot> {
    let joints = rig.skeleton.joint_count();
    let places = frames.root_positions.as_chunks::<3>().0.iter();
    let poses = frames.rotations.chunks_exact(4 * joints);
    let roots = places.zip(poses).map(|(place, pose)| {
        let pelvis = from_wxyz([pose[0], pose[1], pose[2], pose[3]]);
        let heading = heading_of(pelvis, rig.skeleton.left_axis);
        GlobalRoot::new(Vec3::from_array(*place), heading)
    });
    roots.skip(first).take(count).collect()
}
