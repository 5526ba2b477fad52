//! Steps and records crowds for other tests.

use troupe_client::{Crowd, Locomotion, Pack, Rate, Recording, SessionOptions};
use troupe_motion::clip::Clip;
use troupe_motion::conventions::Convention;

/// Adds characters to a crowd, steps them together, records each and closes the crowd. `parts` has
/// the frames of each step; `intent` gives the intent for the index of a part and of a character.
pub async fn perform(
    mut crowd: Crowd,
    pack: &Pack,
    options: &[SessionOptions],
    parts: &[u32],
    intent: impl Fn(usize, usize) -> Locomotion,
) -> Vec<Clip> {
    let members = crowd.add(options).await.unwrap();
    let recording = || Recording::new(pack, Convention::Native, Rate::Hz30);
    let mut recordings: Vec<Recording> = members.iter().map(|_| recording()).collect();
    for (part, &frames) in parts.iter().enumerate() {
        for (nth, &member) in members.iter().enumerate() {
            *crowd.intent_mut(member).unwrap() = intent(part, nth);
        }
        let step = crowd.step(frames).await.unwrap();
        assert!(step.faults().is_empty());
        for (member, frames) in step.characters() {
            let recording = &mut recordings[member.index()];
            frames.iter().for_each(|frame| recording.push(frame));
        }
    }
    crowd.close().await.unwrap();
    let clips = recordings.into_iter().map(Recording::into_clip);
    clips.collect::<Result<_, _>>().unwrap()
}
