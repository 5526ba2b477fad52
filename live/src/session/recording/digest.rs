//! Checksums of 32 bits.

use crc32fast::Hasher;
use prost::Message as _;
use serde::{Deserialize, Serialize};
use troupe_character::live::FrameOut;
use troupe_character::style::Style;
use troupe_motion::Vec3;

use super::format::Shown;
use crate::skeleton::Worn;

/// A CRC-32, written as eight hexadecimal digits.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Serialize, Deserialize)]
#[serde(into = "String", try_from = "String")]
pub(super) struct Digest(pub(super) u32);

impl From<Digest> for String {
    fn from(digest: Digest) -> Self {
        format!("{:08x}", digest.0)
    }
}

impl TryFrom<String> for Digest {
    type Error = String;

    fn try_from(text: String) -> Result<Self, String> {
        let digits = text.len() == 8 && text.bytes().all(|digit| digit.is_ascii_hexdigit());
        let value = u32::from_str_radix(&text, 16).ok().filter(|_| digits);
        value.map(Self).ok_or_else(|| {
            let start: String = text.chars().take(16).collect();
            format!("{start:?} is no checksum; allowed: 8 hexadecimal digits")
        })
    }
}

impl Digest {
    /// Of the bits of numbers, in their order.
    pub(super) fn of(numbers: impl IntoIterator<Item = f32>) -> Self {
        let mut hasher = Hasher::new();
        for number in numbers {
            hasher.update(&number.to_le_bytes());
        }
        Self(hasher.finalize())
    }

    /// Of a style as the API shows it.
    pub(super) fn of_style(style: &Style) -> Self {
        Self(crc32fast::hash(&style.to_proto().encode_to_vec()))
    }

    /// Of the joints of a skeleton of the user's own, and its size.
    pub(super) fn of_skeleton(worn: &Worn) -> Self {
        let mut hasher = Hasher::new();
        for joint in &worn.skeleton().joints {
            hasher.update(joint.name.as_bytes());
            hasher.update(
                &joint
                    .parent
                    .map_or(u64::MAX, |parent| parent as u64)
                    .to_le_bytes(),
            );
            let Vec3 { x, y, z } = joint.offset_m;
            for number in [x, y, z] {
                hasher.update(&number.to_le_bytes());
            }
        }
        hasher.update(&worn.scale().to_le_bytes());
        Self(hasher.finalize())
    }
}

/// The checksums of a frame.
pub(super) fn shown(frame: &FrameOut) -> Shown {
    let rate = &frame.hinge_rate;
    let rates = [
        rate.speed_ratio,
        rate.fastest as f32,
        rate.acceleration_rad_per_s2,
    ];
    let fit = [frame.fitted.residual_rad, frame.fitted.clamped as f32];
    let angles = frame.fitted.angles.iter().copied();
    Shown {
        number: frame.frame,
        root: Digest::of(frame.root.to_array()),
        rotations: Digest::of(frame.rotations.iter().flat_map(|rotation| rotation.to_array())),
        contacts: frame.contacts,
        underrun: frame.underrun,
        hinges: (!frame.fitted.angles.is_empty()).then(|| Digest::of(angles.chain(fit).chain(rates))),
    }
}
