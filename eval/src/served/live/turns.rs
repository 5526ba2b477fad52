//! Turns and stops: how often limbs pass through each other, and the acceleration of the root.

use std::fmt;

use serde::Serialize;
use troupe_motion::metrics::{LimbDistances, percentile};

use super::measure::Outcome;
use super::reference::References;
use super::report::{Against, Bar};
use super::scenario::{Course, Scenario};

/// Turns of less than this are not measured, degrees: in turns of 45° people step as they do when
/// they go straight on.
const LEAST_TURN_DEG: f32 = 80.0;
/// Limbs whose axes are nearer than this pass through each other, metres.
const SHINS_M: f32 = 0.05;
const FEET_M: f32 = 0.04;
const ARMS_M: f32 = 0.08;
/// Share of turns in which shins may come nearer than [`SHINS_M`]. In clips it is 4 %.
const SHINS_SHARE: f64 = 0.06;
/// Feet or arms may be too near in this many times the share of clips, plus this share.
const OTHERS: (f64, f64) = (1.5, 0.02);
/// Most acceleration of the root ÷ the clips' 95th percentile.
const ROOT_RATIO: f64 = 1.2;
/// The percentile of the clips, as a share.
const P95: f64 = 0.95;

/// The turns of all styles together, and their stops.
#[derive(Debug, Clone, Default, Serialize)]
pub(super) struct Turning {
    /// Turns that were measured.
    turns: usize,
    /// Clips that turn.
    clips: usize,
    /// Share of turns in which shins, feet, or a forearm and the trunk come too near.
    shins: Option<Against>,
    feet: Option<Against>,
    arms: Option<Against>,
    /// The largest acceleration of the root over the ground in each turn, by name, m/s².
    root_mps2: Vec<(String, f64)>,
    /// The same of stops.
    stop_root_mps2: Vec<(String, f64)>,
    /// 95th percentile of the clips that turn, m/s², and of clips that go straight on, for stops.
    root_clips_mps2: Option<f64>,
    stop_clips_mps2: Option<f64>,
}

impl Turning {
    /// Compares the turns among the outcomes with the clips that turn.
    pub(super) fn new(scenarios: &[Scenario], outcomes: &[Outcome], references: &References) -> Self {
        let mut all = Self::default();
        let mut nearest: Vec<LimbDistances> = Vec::new();
        for (scenario, outcome) in scenarios.iter().zip(outcomes) {
            match scenario.course {
                Course::Turn { angle, .. } if angle.to_degrees().abs() >= LEAST_TURN_DEG => {
                    let name = format!("{} {:+.0}°", scenario.style, angle.to_degrees());
                    all.root_mps2.push((name, outcome.root_mps2));
                    nearest.push(outcome.nearest);
                }
                Course::Stop { .. } => {
                    let name = format!("{} {}", scenario.style, scenario.gait);
                    all.stop_root_mps2.push((name, outcome.root_mps2));
                }
                Course::Turn { .. } => {}
            }
        }
        let of = |turns: bool| {
            let some = references
                .iter()
                .filter(move |((_, gait), _)| gait.contains("turn") == turns);
            some.map(|(_, reference)| reference)
        };
        let clips: Vec<LimbDistances> = of(true).flat_map(|r| r.nearest.iter().copied()).collect();
        let most = |turns| percentile(of(turns).flat_map(|r| r.root_mps2.iter().copied()).collect(), P95);
        let share = |near: fn(&LimbDistances) -> bool| {
            let of = |all: &[LimbDistances]| {
                let count = all.iter().filter(|nearest| near(nearest)).count();
                (!all.is_empty()).then(|| count as f64 / all.len() as f64)
            };
            of(&nearest).map(|figure| Against::new(figure, of(&clips)))
        };
        Self {
            turns: nearest.len(),
            clips: clips.len(),
            shins: share(|near| near.shins_m < SHINS_M),
            feet: share(|near| near.feet_m < FEET_M),
            arms: share(|near| near.arms_m < ARMS_M),
            root_clips_mps2: most(true),
            stop_clips_mps2: most(false),
            ..all
        }
    }
}

/// The bars for turns and stops.
pub(super) fn turning_bars(turning: &Turning) -> Vec<Bar> {
    let all = |share: Option<Against>| share.map(|share| ("all turns".to_owned(), share.figure));
    let most = |share: Option<Against>| {
        let clips = share.and_then(|share| share.clips).unwrap_or_default();
        clips * OTHERS.0 + OTHERS.1
    };
    let against = |runs: &[(String, f64)], clips: Option<f64>| {
        let ratios = runs
            .iter()
            .filter_map(|(name, figure)| Some((name.clone(), figure / clips?)));
        ratios.collect::<Vec<_>>()
    };
    vec![
        Bar::new(
            "shins within 5 cm in at most 6 % of turns",
            SHINS_SHARE,
            all(turning.shins),
        ),
        Bar::new(
            "feet within 4 cm in at most 2 % more of turns than of 1.5 times the clips",
            most(turning.feet),
            all(turning.feet),
        ),
        Bar::new(
            "a forearm within 8 cm of the trunk in at most 2 % more of turns than of 1.5 times the clips",
            most(turning.arms),
            all(turning.arms),
        ),
        Bar::new(
            "root acceleration in a turn at most 1.2 times that of the clips that turn (95 %)",
            ROOT_RATIO,
            against(&turning.root_mps2, turning.root_clips_mps2),
        ),
        Bar::new(
            "root acceleration in a stop at most 1.2 times that of the clips that go straight on (95 %)",
            ROOT_RATIO,
            against(&turning.stop_root_mps2, turning.stop_clips_mps2),
        ),
    ]
}

impl fmt::Display for Turning {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let share = |share: Option<Against>| {
            let percent = |part: Option<f64>| {
                part.map_or_else(|| "n/a".to_owned(), |part| format!("{:.1} %", part * 100.0))
            };
            let clips = percent(share.and_then(|share| share.clips));
            format!("{} (clips {clips})", percent(share.map(|share| share.figure)))
        };
        let middle = |runs: &[(String, f64)]| {
            let all = runs.iter().map(|(_, figure)| *figure).collect();
            percentile(all, 0.5).unwrap_or(f64::NAN)
        };
        writeln!(
            f,
            "{} turns of 90° and more, {} clips that turn: shins within 5 cm in {}, feet within 4 cm in {}, a forearm within \
             8 cm of the trunk in {}",
            self.turns,
            self.clips,
            share(self.shins),
            share(self.feet),
            share(self.arms),
        )?;
        write!(
            f,
            "largest acceleration of the root, median: {:.1} m/s² in turns, {:.1} in stops; 95 % of clips below {:.1}, and {:.1} \
             of those that go straight on",
            middle(&self.root_mps2),
            middle(&self.stop_root_mps2),
            self.root_clips_mps2.unwrap_or(f64::NAN),
            self.stop_clips_mps2.unwrap_or(f64::NAN),
        )
    }
}

#[cfg(test)]
mod tests {
    use glam::Vec3;

    use super::super::measure::Then;
    use super::super::reference::Reference;
    use super::*;

    fn near(shins_m: f32) -> LimbDistances {
        LimbDistances {
            shins_m,
            feet_m: 0.2,
            arms_m: 0.2,
        }
    }

    fn run(angle: f32, shins_m: f32, root_mps2: f64) -> (Scenario, Outcome) {
        let scenario = Scenario {
            style: "calm".to_owned(),
            gait: "walk".to_owned(),
            period: 30,
            velocity: Vec3::Z,
            facing: 0.0,
            course: Course::Turn {
                at: 100,
                angle: angle.to_radians(),
            },
            commands: Vec::new(),
            frames: 175,
        };
        let outcome = Outcome {
            speed_1s: 1.0,
            speed_steady: 1.0,
            skate_m: 0.0,
            jitter: 0.0,
            accelerations: Vec::new(),
            facing_error: 0.0,
            nearest: near(shins_m),
            root_mps2,
            then: Then::Stopped { speed_1s: 0.0 },
        };
        (scenario, outcome)
    }

    #[test]
    fn turns_are_compared_with_clips_that_turn() {
        let runs = [
            run(45.0, 0.01, 20.0),
            run(90.0, 0.02, 4.0),
            run(-120.0, 0.2, 5.0),
            run(180.0, 0.2, 9.0),
            run(-180.0, 0.2, 6.0),
        ];
        let (scenarios, outcomes): (Vec<_>, Vec<_>) = runs.into_iter().unzip();
        let mut references = References::new();
        let mut add = |gait: &str, shins_m, root_mps2| {
            let reference = Reference {
                nearest: vec![near(shins_m), near(0.2)],
                root_mps2: vec![root_mps2; 2],
                ..Reference::default()
            };
            references.insert(("calm".to_owned(), gait.to_owned()), reference);
        };
        add("walk-turn-left", 0.01, 5.0);
        add("walk", 0.2, 3.0);
        let turning = Turning::new(&scenarios, &outcomes, &references);
        assert_eq!(
            (turning.turns, turning.clips),
            (4, 2),
            "one of 45° does not count"
        );
        assert_eq!(turning.shins, Some(Against::new(0.25, Some(0.5))));
        assert_eq!(turning.root_clips_mps2, Some(5.0));
        let texts: Vec<String> = turning_bars(&turning).iter().map(ToString::to_string).collect();
        assert!(
            texts[0].starts_with("missed") && texts[1].starts_with("holds"),
            "{texts:?}"
        );
        assert!(
            texts[3].contains("3 of 4") && texts[3].ends_with("not calm +180° 1.80"),
            "{texts:?}"
        );
        assert!(texts[4].starts_with("not measured"));
    }
}
