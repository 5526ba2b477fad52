//! What an engine may differ by, and still serve.
//!
//! The bars lie well above what rounding to bf16 does (about half a millimetre in the mean of
//! joints and roots, 3 % of the tokens, on the default pack) and well below what the pack itself
//! gets wrong (7 cm of L2P in the shortest gaps that it is evaluated on) and what an eye sees. What
//! keyframes fix is exact with any engine: it is pinned after the networks.

use super::{Accuracy, Kind};

/// Token counts are chosen by the largest of a few probabilities, and another one of nearly the
/// same probability is as good an answer: 2 of the probe's 48 may be that near.
const COUNTS_DIFFER: f64 = 0.05;
/// The root's path between keyframes: in the mean, a tenth of a walker's step in a frame (4 cm at
/// 1.2 m/s).
const ROOT_MEAN_M: f64 = 0.004;
/// Anywhere: less than a walker goes in a frame.
const ROOT_MAX_M: f64 = 0.03;
/// A heading that is 3 degrees off.
const ROOT_MAX_RAD: f64 = 0.05;
/// Among 256 codes many are near ties; the next bar says whether the others are.
const TOKENS_DIFFER: f64 = 0.10;
/// Chosen codes are together 1 % less likely than the best: far less than sampling at any
/// temperature does.
const TOKEN_LOSS_NATS: f64 = 0.01;
/// Joints, with equal tokens: about what feet slip by in a frame of recorded motion (2.5 mm) in the
/// mean ...
const JOINT_MEAN_M: f64 = 0.002;
/// ... and the width of a finger anywhere.
const JOINT_MAX_M: f64 = 0.02;
/// A foot's contact is a threshold on a probability: one in a hundred may fall on the other side.
const CONTACTS_DIFFER: f64 = 0.01;

// Whole motions, of bodies that are scaled to a size of 1 m: three times what rounding to bf16 does
// with the pack in `models/unimogen`, and well below what that pack gets wrong itself.
/// The root: half of how far the network strays from its path (4 mm, people).
const PATHS_ROOT_MEAN_M: f64 = 0.002;
/// Anywhere: a third of a walker's step in a frame.
const PATHS_ROOT_MAX_M: f64 = 0.015;
/// A heading that is half as far off as the network's own error (0.4 degrees, people).
const PATHS_ROOT_MAX_RAD: f64 = 0.005;
/// Joints: a ninth of how far the network is from captures (45 mm, people).
const PATHS_JOINT_MEAN_M: f64 = 0.005;
/// Anywhere: the width of a hand.
const PATHS_JOINT_MAX_M: f64 = 0.09;
/// Contacts are thresholds on the height and speed of joints, and a step in bf16 moves both.
const PATHS_CONTACTS_DIFFER: f64 = 0.07;

/// A figure of the accuracy check, and the most that it may be.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Bar {
    /// The figure's name: the field of [`Accuracy`].
    pub figure: &'static str,
    /// What was found.
    pub found: f64,
    /// The most that it may be.
    pub most: f64,
}

impl Bar {
    /// Whether the figure is within the bar; one that is not a number is not.
    pub fn holds(&self) -> bool {
        self.found <= self.most
    }
}

impl std::fmt::Display for Bar {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        let Self { figure, found, most } = self;
        write!(f, "{figure} is {found:.5}, at most {most} is allowed")
    }
}

impl Accuracy {
    /// The figures of what was compared, beside their bars.
    pub fn bars(&self) -> Vec<Bar> {
        // A figure, what was found, and its bar for stages and for paths.
        let figures = [
            ("counts_differ", self.counts_differ, Some(COUNTS_DIFFER), None),
            (
                "root_mean_m",
                self.root_mean_m,
                Some(ROOT_MEAN_M),
                Some(PATHS_ROOT_MEAN_M),
            ),
            (
                "root_max_m",
                self.root_max_m,
                Some(ROOT_MAX_M),
                Some(PATHS_ROOT_MAX_M),
            ),
            (
                "root_max_rad",
                self.root_max_rad,
                Some(ROOT_MAX_RAD),
                Some(PATHS_ROOT_MAX_RAD),
            ),
            ("tokens_differ", self.tokens_differ, Some(TOKENS_DIFFER), None),
            (
                "token_loss_nats",
                self.token_loss_nats,
                Some(TOKEN_LOSS_NATS),
                None,
            ),
            (
                "joint_mean_m",
                self.joint_mean_m,
                Some(JOINT_MEAN_M),
                Some(PATHS_JOINT_MEAN_M),
            ),
            (
                "joint_max_m",
                self.joint_max_m,
                Some(JOINT_MAX_M),
                Some(PATHS_JOINT_MAX_M),
            ),
            (
                "contacts_differ",
                self.contacts_differ,
                Some(CONTACTS_DIFFER),
                Some(PATHS_CONTACTS_DIFFER),
            ),
        ];
        let bar = |(figure, found, stages, paths): (_, _, Option<f64>, Option<f64>)| {
            let most = match self.kind {
                Kind::Stages => stages,
                Kind::Paths => paths,
            };
            most.map(|most| Bar { figure, found, most })
        };
        figures.into_iter().filter_map(bar).collect()
    }

    /// Whether every bar holds.
    pub fn passes(&self) -> bool {
        self.bars().iter().all(Bar::holds)
    }

    /// The bars that do not hold, in words.
    pub fn failures(&self) -> String {
        let failed: Vec<String> = self
            .bars()
            .iter()
            .filter(|bar| !bar.holds())
            .map(Bar::to_string)
            .collect();
        failed.join("; ")
    }
}
