//! Whether a pair of bodies goes together: a small set of motions, carried over and measured.

use serde::Serialize;

use super::build;
use super::dolls::doll;
use super::figures::Figures;
use super::motions::{Motion, ON_FOUR, ON_TWO, clip};
use super::{Retargeter, retarget};

/// What a retargeter makes of walks, turns, a crouch and reaches: whether its two bodies, with the
/// parts that are found, go together.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Certificate {
    /// One for each motion.
    pub trials: Vec<Trial>,
    /// What of the target's build no body has: each as a sentence with the joint, the length and
    /// what is allowed.
    pub build: Vec<String>,
}

/// A motion of the source, carried over.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Trial {
    /// What the body does.
    pub name: &'static str,
    /// What the target keeps of it.
    pub figures: Figures,
}

impl Certificate {
    /// The certificate of a retargeter, which itself is not changed. The motions are made on a
    /// plain body, and reach the source by the same means as the target. So the certificate needs
    /// no file and is always the same.
    pub fn of(retargeter: &Retargeter) -> Self {
        let source = retargeter.source.clone();
        let doll = doll(source.parts.on_fours);
        let motions: &[_] = match source.parts.on_fours {
            true => &ON_FOUR,
            false => &ON_TWO,
        };
        // The doll stands on as many legs as the source, so that this is always one.
        let mut dresser = Retargeter::new(doll.clone(), source).ok();
        let target = retargeter.target.clone();
        let mut retargeter = retargeter.clone();
        let mut carried = |motion: &Motion| {
            let clip = clip(&doll, motion).ok()?;
            let of_source = retarget(dresser.as_mut()?, &clip).ok()?.0;
            Some(retarget(&mut retargeter, &of_source).ok()?.1)
        };
        let trial = |motion: &Motion| Trial {
            name: motion.name,
            figures: carried(motion).unwrap_or_else(Figures::nothing_kept),
        };
        Self {
            trials: motions.iter().map(trial).collect(),
            build: build::faults(&target),
        }
    }

    /// What is beyond the bar: what of the target's build no body has, then each figure as a
    /// sentence with the motion, the joint of the target that is worst, and the bar. Empty if all
    /// is well.
    pub fn faults(&self) -> Vec<String> {
        let of = |trial: &Trial| {
            let faults = trial.figures.faults().into_iter();
            faults
                .map(|fault| format!("{}: {fault}", trial.name))
                .collect::<Vec<_>>()
        };
        let build = self.build.iter().cloned();
        build.chain(self.trials.iter().flat_map(of)).collect()
    }

    /// Whether every figure is within the bar.
    pub fn passes(&self) -> bool {
        self.build.is_empty() && self.trials.iter().all(|trial| trial.figures.faults().is_empty())
    }
}
