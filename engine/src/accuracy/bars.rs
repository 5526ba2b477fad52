//! What an engine may differ by, and still serve.
//!
//! The bars lie well above what rounding to bf16 does (about half a millimetre in the mean of joints and roots, 3 % of the tokens,
//! on the default pack) and well below what the pack itself gets wrong (7 cm of L2P in the shortest gaps that it is
//! evaluated on) and what an eye sees. What keyframes fix is exact with any engine: it is pinned after the networks.

use super::Accuracy;

/// Token counts are chosen by the largest of a few probabilities, and another one of nearly the same probability is as
/// good an answer: 2 of the probe's 48 may be that near.
const COUNTS_DIFFER: f64 = 0.05;
/// The root's path between keyframes: in the mean, a tenth of a walker's step in a frame (4 cm at 1.2 m/s).
const ROOT_MEAN_M: f64 = 0.004;
/// Anywhere: less than a walker goes in a frame.
const ROOT_MAX_M: f64 = 0.03;
/// A heading that is 3 degrees off.
const ROOT_MAX_RAD: f64 = 0.05;
/// Among 256 codes many are near ties; the next bar says whether the others are.
const TOKENS_DIFFER: f64 = 0.10;
/// Chosen codes are together 1 % less likely than the best: far less than sampling at any temperature does.
const TOKEN_LOSS_NATS: f64 = 0.01;
/// Joints, with equal tokens: about what feet slip by in a frame of recorded motion (2.5 mm) in the mean ...
const JOINT_MEAN_M: f64 = 0.002;
/// ... and the width of a finger anywhere.
const JOINT_MAX_M: f64 = 0.02;
/// A foot's contact is a threshold on a probability: one in a hundred may fall on the other side.
const CONTACTS_DIFFER: f64 = 0.01;

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
    /// All figures beside their bars.
    pub fn bars(&self) -> [Bar; 9] {
        [
            ("counts_differ", self.counts_differ, COUNTS_DIFFER),
            ("root_mean_m", self.root_mean_m, ROOT_MEAN_M),
            ("root_max_m", self.root_max_m, ROOT_MAX_M),
            ("root_max_rad", self.root_max_rad, ROOT_MAX_RAD),
            ("tokens_differ", self.tokens_differ, TOKENS_DIFFER),
            ("token_loss_nats", self.token_loss_nats, TOKEN_LOSS_NATS),
            ("joint_mean_m", self.joint_mean_m, JOINT_MEAN_M),
            ("joint_max_m", self.joint_max_m, JOINT_MAX_M),
            ("contacts_differ", self.contacts_differ, CONTACTS_DIFFER),
        ]
        .map(|(figure, found, most)| Bar { figure, found, most })
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
