//! How much an engine may differ and still serve.
//!
//! The bars are well above the effect of rounding to bf16: about half a millimetre in the mean of
//! joints and roots, and 3 % of the tokens, on the default pack. They are well below the pack's own
//! error (7 cm of L2P in the shortest gaps that it is evaluated on), and below what is visible.
//! Keyframes are exact with every engine, because they are pinned after the networks.

use super::{Accuracy, Kind};

/// The token count is the largest of a few probabilities. Another count with nearly the same
/// probability is as good an answer: 2 of the probe's 48 may be so near.
const COUNTS_DIFFER: f64 = 0.05;
/// The root's path between keyframes, mean: a tenth of a walker's step in a frame (4 cm at 1.2
/// m/s).
const ROOT_MEAN_M: f64 = 0.004;
/// The same, largest: less than a walker travels in a frame.
const ROOT_MAX_M: f64 = 0.03;
/// Largest difference of a heading: 3 degrees.
const ROOT_MAX_RAD: f64 = 0.05;
/// Among 256 codes many are near ties; the next bar checks the others.
const TOKENS_DIFFER: f64 = 0.10;
/// Chosen codes are together 1 % less likely than the best: far less than sampling at any
/// temperature.
const TOKEN_LOSS_NATS: f64 = 0.01;
/// Mean distance of joints with equal tokens: about as far as feet slip in a frame of recorded
/// motion (2.5 mm).
const JOINT_MEAN_M: f64 = 0.002;
/// Largest distance of joints with equal tokens: the width of a finger.
const JOINT_MAX_M: f64 = 0.02;
/// A foot's contact is a threshold on a probability: one in a hundred may be on the other side.
const CONTACTS_DIFFER: f64 = 0.01;

// Whole motions, of bodies scaled to a size of 1 m: three times the effect of rounding to bf16 with
// the pack in `models/unimogen`, and well below that pack's own error.
/// Mean distance of the root: half of how far the network strays from its path (4 mm, people).
const PATHS_ROOT_MEAN_M: f64 = 0.002;
/// Largest distance of the root: a third of a walker's step in a frame.
const PATHS_ROOT_MAX_M: f64 = 0.015;
/// Largest difference of a heading: half of the network's own error (0.4 degrees, people).
const PATHS_ROOT_MAX_RAD: f64 = 0.005;
/// Mean distance of joints: a ninth of the network's distance from captures (45 mm, people).
const PATHS_JOINT_MEAN_M: f64 = 0.005;
/// Largest distance of joints: the width of a hand.
const PATHS_JOINT_MAX_M: f64 = 0.09;
/// Contacts are thresholds on the height and speed of joints, and a step in bf16 moves both.
const PATHS_CONTACTS_DIFFER: f64 = 0.07;

/// A figure of the accuracy check, with its limit.
#[derive(Debug, Clone, Copy, PartialEq, serde::Serialize)]
pub struct Bar {
    /// Name of the figure: the field of [`Accuracy`].
    pub figure: &'static str,
    /// The measured value.
    pub found: f64,
    /// The largest allowed value.
    pub most: f64,
}

impl Bar {
    /// Whether the value is within the limit. A value that is not a number is not.
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
    /// All figures of the comparison, with their limits.
    pub fn bars(&self) -> Vec<Bar> {
        // A figure, its value, and its limits for stages and for paths.
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

    /// Whether every limit holds.
    pub fn passes(&self) -> bool {
        self.bars().iter().all(Bar::holds)
    }

    /// The limits that do not hold, as text.
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
