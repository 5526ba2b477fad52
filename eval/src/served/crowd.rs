//! Plays live characters side by side, frame by frame.

use glam::{Quat, Vec3};
use indicatif::ProgressBar;
use troupe_cli::Failure;
use troupe_client::{Client, Crowd, CrowdOptions, Locomotion, Pack, SessionOptions};
use troupe_motion::clip::Clip;
use troupe_proto::v1;

/// One character and its commands.
#[derive(Debug, Clone)]
pub(super) struct Role {
    pub(super) options: SessionOptions,
    /// Commands, each with the frame before which it is given.
    pub(super) commands: Vec<(usize, Locomotion)>,
    pub(super) frames: usize,
}

/// Plays characters side by side, a frame at a time, and returns what each did. The bar advances
/// by a step for each frame of a character.
pub(super) async fn play(
    (client, pack): (&Client, &Pack),
    roles: &[Role],
    bar: &ProgressBar,
) -> Result<(Vec<Clip>, v1::SessionStats), Failure> {
    let mut crowd = Crowd::new(client, pack, CrowdOptions::default());
    let options: Vec<SessionOptions> = roles.iter().map(|role| role.options.clone()).collect();
    let members = crowd.add(&options).await?;
    let mut takes: Vec<(Vec<Vec3>, Vec<Quat>)> = vec![Default::default(); roles.len()];
    let longest = roles.iter().map(|role| role.frames).max().unwrap_or(0);
    for frame in 0..longest {
        for (role, member) in roles.iter().zip(&members) {
            for (_, command) in role.commands.iter().filter(|(at, _)| *at == frame) {
                if let Some(intent) = crowd.intent_mut(*member) {
                    *intent = command.clone();
                }
            }
        }
        let step = crowd.step(1).await?;
        if let Some(fault) = step.faults().first() {
            let text = format!("session {}: {}", fault.session, fault.problem);
            return Err(Failure::Other(text));
        }
        for ((role, member), (roots, rotations)) in roles.iter().zip(&members).zip(&mut takes) {
            if frame >= role.frames {
                continue;
            }
            let frames = step.get(*member).and_then(|f| f.last());
            let now = frames.ok_or_else(|| Failure::Other("a character has no frame".to_owned()))?;
            roots.push(now.root);
            rotations.extend_from_slice(now.rotations);
            bar.inc(1);
        }
    }
    let stats = crowd.stats().await?;
    crowd.close().await?;
    let clips = takes.into_iter().map(|(roots, rotations)| {
        Clip::new(pack.skeleton().clone(), pack.fps(), roots, rotations)
            .map_err(|e| Failure::Other(format!("a character's frames are no clip: {e}")))
    });
    Ok((clips.collect::<Result<_, _>>()?, stats))
}

/// The styles of a pack, or those of the names in `only`, with all that the server says of them.
pub(super) async fn styles(client: &Client, pack: &Pack, only: &[String]) -> Result<Vec<v1::Style>, Failure> {
    let listed = client.styles(pack).await?.styles;
    if let Some(unknown) = only.iter().find(|name| listed.iter().all(|s| s.name != **name)) {
        let names: Vec<&str> = listed.iter().map(|s| s.name.as_str()).collect();
        return Err(Failure::Input(format!(
            "--styles: pack `{}` has no style `{unknown}`; it has {}",
            pack.name(),
            names.join(", ")
        )));
    }
    Ok(listed
        .into_iter()
        .filter(|style| only.is_empty() || only.contains(&style.name))
        .collect())
}
