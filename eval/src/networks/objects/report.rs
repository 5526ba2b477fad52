//! The report of `troupe-eval objects`: tables, JSON.

use std::collections::BTreeMap;
use std::fmt;

use serde::Serialize;
use troupe_engine::pack::Pack;
use troupe_motion::metrics::percentile;

use super::measure::{Outcome, Roughness};
use super::trials::DIRECTIONS;

/// The figures of all objects.
#[derive(Serialize)]
pub struct Report {
    pack: String,
    version: String,
    engine: &'static str,
    seed: u64,
    objects: Vec<Object>,
}

/// Figures of one object. Errors are 95th percentiles over the trials that went through.
#[derive(Serialize)]
struct Object {
    name: String,
    approaches: usize,
    done_percent: f64,
    met_percent: f64,
    joint_cm: f64,
    root_cm: f64,
    heading_deg: f64,
    before_joint_cm: f64,
    before_root_cm: f64,
    seconds: f64,
    /// Mean foot skate over trials, millimetres a frame: from the command to the end, and before
    /// it.
    skate_mm: f64,
    skate_before_mm: f64,
    acceleration_mps2: f64,
    /// Median and 95th percentile, over interactions, of the largest acceleration of a knee.
    knee_acceleration_mps2: [f64; 2],
    variants: BTreeMap<String, usize>,
    /// Mean distance of a joint between trials of different variants at their keyframes,
    /// centimetres.
    variety_cm: f64,
    /// Soft sets that were left early, percent, and by how many frames at most.
    soft_early_percent: f64,
    earliest_frames: u32,
    /// Trials that were run twice, and those of them with the same frames to the last bit.
    twice: usize,
    twice_alike: usize,
    /// How characters move when an interaction is broken off.
    broken_off: BrokenOff,
    /// Why trials did not go through.
    failures: BTreeMap<String, usize>,
    /// Percent met, by direction.
    directions: Vec<f64>,
}

/// Roughness in the second after an interaction was broken off, and of the walk before it. Each
/// trial counts with its worst joint and frame.
#[derive(Serialize)]
struct BrokenOff {
    trials: usize,
    after: Rough,
    walking: Rough,
}

/// Medians and 95th percentiles over trials.
#[derive(Serialize)]
struct Rough {
    way_cm: [f64; 2],
    acceleration_mps2: [f64; 2],
}

impl BrokenOff {
    fn of(trials: &[Outcome]) -> Self {
        let pairs: Vec<_> = trials.iter().filter_map(|outcome| outcome.broken_off).collect();
        let rough = |which: usize| {
            let high = |value: fn(&Roughness) -> f64| {
                [0.5, 0.95].map(|share| {
                    let values = pairs.iter().map(|pair| value(&pair[which])).collect();
                    percentile(values, share).unwrap_or(f64::NAN)
                })
            };
            Rough {
                way_cm: high(|rough| 100.0 * rough.way_m),
                acceleration_mps2: high(|rough| rough.acceleration),
            }
        };
        Self {
            trials: pairs.len(),
            after: rough(0),
            walking: rough(1),
        }
    }
}

impl Report {
    pub fn new(pack: &Pack, engine: &'static str, seed: u64) -> Self {
        Self {
            pack: pack.name().to_owned(),
            version: pack.manifest.version.clone(),
            engine,
            seed,
            objects: Vec::new(),
        }
    }

    /// Adds an object with its varied approaches, the first of them a second time, approaches from
    /// all directions, and those that were broken off.
    pub fn add(
        &mut self,
        name: &str,
        varied: &[Outcome],
        again: &[Outcome],
        around: &[Outcome],
        broken: &[Outcome],
    ) {
        let done: Vec<&Outcome> = varied.iter().filter(|outcome| outcome.done).collect();
        let high = |value: fn(&Outcome) -> f32| {
            percentile(
                done.iter().map(|outcome| f64::from(value(outcome))).collect(),
                0.95,
            )
            .unwrap_or(f64::NAN)
        };
        let mean = |value: fn(&Outcome) -> f64| {
            done.iter().map(|outcome| value(outcome)).sum::<f64>() / done.len().max(1) as f64
        };
        let mut variants = BTreeMap::new();
        for outcome in &done {
            *variants.entry(outcome.variant.clone()).or_insert(0) += 1;
        }
        let mut failures = BTreeMap::new();
        for outcome in varied.iter().filter(|outcome| !outcome.done) {
            *failures
                .entry(outcome.why.clone().unwrap_or_else(|| "not ended".to_owned()))
                .or_insert(0) += 1;
        }
        let directions = (0..DIRECTIONS).filter_map(|direction| {
            let of: Vec<_> = around
                .iter()
                .filter(|outcome| outcome.direction == Some(direction))
                .collect();
            (!of.is_empty()).then(|| percent(of.iter().filter(|outcome| outcome.met).count(), of.len()))
        });
        self.objects.push(Object {
            name: name.to_owned(),
            approaches: varied.len(),
            done_percent: percent(done.len(), varied.len()),
            met_percent: percent(varied.iter().filter(|outcome| outcome.met).count(), varied.len()),
            joint_cm: 100.0 * high(|outcome| outcome.joint_m),
            root_cm: 100.0 * high(|outcome| outcome.root_m),
            heading_deg: high(|outcome| outcome.heading_deg),
            before_joint_cm: 100.0 * high(|outcome| outcome.before_joint_m),
            before_root_cm: 100.0 * high(|outcome| outcome.before_root_m),
            seconds: mean(|outcome| f64::from(outcome.seconds)),
            skate_mm: mean(|outcome| outcome.skate_mm),
            skate_before_mm: mean(|outcome| outcome.skate_before_mm),
            acceleration_mps2: mean(|outcome| outcome.acceleration),
            knee_acceleration_mps2: [0.5, 0.95].map(|share| {
                let largest = done.iter().map(|outcome| outcome.knee_acceleration).collect();
                percentile(largest, share).unwrap_or(f64::NAN)
            }),
            variants,
            variety_cm: variety_cm(&done),
            soft_early_percent: percent(
                done.iter().map(|outcome| outcome.soft_early).sum(),
                done.iter().map(|outcome| outcome.soft).sum(),
            ),
            earliest_frames: done
                .iter()
                .map(|outcome| outcome.earliest_frames)
                .max()
                .unwrap_or(0),
            twice: again.len(),
            twice_alike: varied
                .iter()
                .zip(again)
                .filter(|(a, b)| a.digest == b.digest)
                .count(),
            broken_off: BrokenOff::of(broken),
            failures,
            directions: directions.collect(),
        });
    }
}

fn percent(part: usize, whole: usize) -> f64 {
    100.0 * part as f64 / whole.max(1) as f64
}

/// Mean joint distance over the pairs of neighbouring trials of different variants.
fn variety_cm(done: &[&Outcome]) -> f64 {
    let pairs = done.windows(2).filter(|pair| pair[0].variant != pair[1].variant);
    let distances: Vec<f64> = pairs
        .map(|pair| {
            let joints = pair[0].poses.iter().zip(&pair[1].poses);
            let (count, sum) = joints.fold((0, 0.0), |(count, sum), (a, b)| {
                (count + 1, sum + f64::from(a.distance(*b)))
            });
            sum / f64::from(count.max(1))
        })
        .collect();
    match distances.is_empty() {
        true => 0.0,
        false => 100.0 * distances.iter().sum::<f64>() / distances.len() as f64,
    }
}

impl fmt::Display for Report {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(
            f,
            "pack {} {}, engine {}, seed {}\n",
            self.pack, self.version, self.engine, self.seed
        )?;
        writeln!(
            f,
            "| object | approaches | went through | keyframes met | joints, root (cm), heading (°): 95 % below | before they were drawn to it (cm) | soft sets left early, frames at most |"
        )?;
        writeln!(f, "|---|---:|---:|---:|---|---|---|")?;
        for o in &self.objects {
            writeln!(
                f,
                "| {} | {} | {:.1} % | {:.1} % | {:.2}, {:.2}, {:.1} | {:.1}, {:.1} | {:.0} %, {} |",
                o.name,
                o.approaches,
                o.done_percent,
                o.met_percent,
                o.joint_cm,
                o.root_cm,
                o.heading_deg,
                o.before_joint_cm,
                o.before_root_cm,
                o.soft_early_percent,
                o.earliest_frames,
            )?;
        }
        writeln!(
            f,
            "\n| object | seconds | skate before, during (mm/frame) | acceleration, 99.5 % below (m/s²) | sharpest of a knee: median, 95 % below | variants | variety (cm) | the same twice |"
        )?;
        writeln!(f, "|---|---:|---|---:|---|---|---:|---|")?;
        for o in &self.objects {
            let variants: Vec<String> = o
                .variants
                .iter()
                .map(|(name, count)| format!("{name} {count}"))
                .collect();
            writeln!(
                f,
                "| {} | {:.1} | {:.1}, {:.1} | {:.0} | {:.0}, {:.0} | {} | {:.1} | {} of {} |",
                o.name,
                o.seconds,
                o.skate_before_mm,
                o.skate_mm,
                o.acceleration_mps2,
                o.knee_acceleration_mps2[0],
                o.knee_acceleration_mps2[1],
                variants.join(", "),
                o.variety_cm,
                o.twice_alike,
                o.twice,
            )?;
        }
        writeln!(
            f,
            "\n| object | broken off | way of a joint in a frame (cm): median, 95 % below | as it walked before \
             | acceleration (m/s²): median, 95 % below | as it walked before |"
        )?;
        writeln!(f, "|---|---:|---|---|---|---|")?;
        for o in self.objects.iter().filter(|o| o.broken_off.trials > 0) {
            let BrokenOff {
                trials,
                after,
                walking,
            } = &o.broken_off;
            let way = |rough: &Rough| format!("{:.1}, {:.1}", rough.way_cm[0], rough.way_cm[1]);
            let acceleration = |rough: &Rough| {
                format!(
                    "{:.0}, {:.0}",
                    rough.acceleration_mps2[0], rough.acceleration_mps2[1]
                )
            };
            writeln!(
                f,
                "| {} | {trials} | {} | {} | {} | {} |",
                o.name,
                way(after),
                way(walking),
                acceleration(after),
                acceleration(walking)
            )?;
        }
        for o in self.objects.iter().filter(|o| !o.failures.is_empty()) {
            writeln!(f, "\n{}: did not go through: {:?}", o.name, o.failures)?;
        }
        writeln!(f, "\nKeyframes met by direction of approach, %:\n")?;
        for o in self.objects.iter().filter(|o| !o.directions.is_empty()) {
            let each: Vec<String> = o
                .directions
                .iter()
                .map(|percent| format!("{percent:.0}"))
                .collect();
            writeln!(f, "- {}: {}", o.name, each.join(" "))?;
        }
        Ok(())
    }
}
