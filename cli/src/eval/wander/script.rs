//! Where characters wander.

use glam::Vec3;
use rand::{RngExt as _, SeedableRng as _};
use rand_chacha::ChaCha8Rng;
use troupe_client::{Locomotion, SessionOptions};
use troupe_proto::v1;

use crate::eval::stage::Role;

/// Frames of a second.
const SECOND: usize = 30;

/// How often characters plan, where not as their styles say.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) struct Replan {
    pub(super) interval_frames: u32,
    pub(super) look_ahead_frames: u32,
}

/// The same characters for the same styles, seed and length: each with its own way, styles in turn.
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
            orders: orders(style.default_speed, frames, seed),
            frames,
        }
    })
    .collect()
}

/// Every second to four of them, something else: mostly to go somewhere, sometimes to stand or to
/// look elsewhere than where it goes.
fn orders(speed_mps: f32, frames: usize, seed: u64) -> Vec<(usize, Locomotion)> {
    let mut random = ChaCha8Rng::seed_from_u64(seed);
    let mut heading = random.random_range(-3.0..3.0f32);
    let mut at = random.random_range(0..2 * SECOND);
    let mut orders = Vec::new();
    while at < frames {
        let order = if random.random_bool(0.15) {
            Locomotion::stand()
        } else {
            heading += random.random_range(-1.5..1.5);
            let way = Vec3::new(heading.sin(), 0.0, heading.cos());
            let order = Locomotion::walk(way * speed_mps * random.random_range(0.7..1.2));
            if random.random_bool(0.1) {
                order.facing(heading + random.random_range(-0.8..0.8))
            } else {
                order
            }
        };
        orders.push((at, order));
        at += random.random_range(SECOND..4 * SECOND);
    }
    orders
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
    fn everybody_wanders_to_the_end() {
        let roles = wanderers(&styles(), 5, 60, 0, None);
        assert_eq!(roles.len(), 5);
        for (nth, role) in roles.iter().enumerate() {
            let speed = [1.2, 2.0][nth % 2];
            let times: Vec<usize> = role.orders.iter().map(|(at, _)| *at).collect();
            assert!(times[0] < 60 && times.windows(2).all(|w| (30..120).contains(&(w[1] - w[0]))));
            assert!(times.last().is_some_and(|&at| at >= 1800 - 120));
            for (_, order) in &role.orders {
                let told = order.velocity.length() / speed;
                assert!(told == 0.0 || (0.69..1.21).contains(&told), "{told}");
            }
        }
        let all = roles.iter().flat_map(|role| &role.orders);
        let stands = all
            .clone()
            .filter(|(_, order)| order.velocity == Vec3::ZERO)
            .count();
        assert!((5..=40).contains(&stands), "{stands} of {}", all.count());
    }

    #[test]
    fn the_same_seed_gives_the_same_ways_whatever_the_interval() {
        let replan = Replan {
            interval_frames: 5,
            look_ahead_frames: 4,
        };
        let (plain, often) = (
            wanderers(&styles(), 4, 20, 7, None),
            wanderers(&styles(), 4, 20, 7, Some(replan)),
        );
        for (a, b) in plain.iter().zip(&often) {
            assert_eq!(a.orders, b.orders);
            assert_ne!(a.options, b.options);
        }
        assert_ne!(
            plain[0].orders, plain[2].orders,
            "of one style, but not on one way"
        );
        assert_ne!(plain[0].orders, wanderers(&styles(), 4, 20, 8, None)[0].orders);
    }
}
