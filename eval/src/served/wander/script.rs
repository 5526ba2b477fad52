//! Where characters wander.

use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_client::{Locomotion, SessionOptions};
use troupe_proto::v1;

use crate::served::crowd::Role;

/// Frames of a second.
const SECOND: usize = 30;

/// Intervals of plans, instead of those of the styles.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Replan {
    pub(super) interval_frames: u32,
    pub(super) look_ahead_frames: u32,
}

/// Characters with a way of their own each, styles in turn. The same styles, seed and length give
/// the same characters.
pub(super) fn wanderers(
    styles: &[v1::Style],
    count: usize,
    seconds: u32,
    seed: u64,
    replan: Option<Replan>,
) -> Vec<Role> {
    let each = styles.iter().cycle().take(count).enumerate();
    each.map(|(nth, style)| {
        let seed = seed.wrapping_mul(1_000_003).wrapping_add(nth as u64);
        let frames = seconds as usize * SECOND;
        let options = SessionOptions::new().style(&style.name).seed(seed);
        Role {
            options: match replan {
                Some(replan) => options
                    .replan_interval_frames(replan.interval_frames)
                    .look_ahead_frames(replan.look_ahead_frames),
                None => options,
            },
            commands: commands(style.default_speed, frames, seed),
            frames,
        }
    })
    .collect()
}

/// A new command every second to four of them: mostly to go somewhere, sometimes to stand, or to
/// face aside on the way.
fn commands(speed_mps: f32, frames: usize, seed: u64) -> Vec<(usize, Locomotion)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut heading = random.random_range(-3.0..3.0f32);
    let mut at = random.random_range(0..2 * SECOND);
    let mut commands = Vec::new();
    while at < frames {
        let command = if random.random_bool(0.15) {
            Locomotion::stand()
        } else {
            heading += random.random_range(-1.5..1.5);
            let way = Vec3::new(heading.sin(), 0.0, heading.cos());
            let command = Locomotion::walk(way * speed_mps * random.random_range(0.7..1.2));
            if random.random_bool(0.1) {
                command.facing(heading + random.random_range(-0.8..0.8))
            } else {
                command
            }
        };
        commands.push((at, command));
        at += random.random_range(SECOND..4 * SECOND);
    }
    commands
}

#[cfg(test)]
mod tests {
    use super::*;

    fn styles() -> Vec<v1::Style> {
        let style = |name: &str, default_speed| v1::Style {
            name: name.to_owned(),
            default_speed,
            ..v1::Style::default()
        };
        vec![style("calm", 1.2), style("brisk", 2.0)]
    }

    #[test]
    fn all_wander_to_the_end() {
        let roles = wanderers(&styles(), 5, 60, 0, None);
        assert_eq!(roles.len(), 5);
        for (nth, role) in roles.iter().enumerate() {
            let speed = [1.2, 2.0][nth % 2];
            let times: Vec<usize> = role.commands.iter().map(|(at, _)| *at).collect();
            assert!(times[0] < 60 && times.windows(2).all(|w| (30..120).contains(&(w[1] - w[0]))));
            assert!(times.last().is_some_and(|&at| at >= 1800 - 120));
            for (_, command) in &role.commands {
                let share = command.velocity.length() / speed;
                assert!(share == 0.0 || (0.69..1.21).contains(&share), "{share}");
            }
        }
        let all = roles.iter().flat_map(|role| &role.commands);
        let stands = all
            .clone()
            .filter(|(_, command)| command.velocity == Vec3::ZERO)
            .count();
        assert!((5..=40).contains(&stands), "{stands} of {}", all.count());
    }

    #[test]
    fn the_same_seed_gives_the_same_ways_at_any_interval() {
        let replan = Replan {
            interval_frames: 5,
            look_ahead_frames: 4,
        };
        let (plain, often) = (
            wanderers(&styles(), 4, 20, 7, None),
            wanderers(&styles(), 4, 20, 7, Some(replan)),
        );
        for (a, b) in plain.iter().zip(&often) {
            assert_eq!(a.commands, b.commands);
            assert_ne!(a.options, b.options);
        }
        assert_ne!(
            plain[0].commands, plain[2].commands,
            "characters of one style have different ways"
        );
        assert_ne!(
            plain[0].commands,
            wanderers(&styles(), 4, 20, 8, None)[0].commands
        );
    }
}
