//! BVH texts.

use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::joints::Parsed;
use super::options::Options;
use super::report::{Basis, Finding, Format, Note, Topic};
use super::stance::Stated;
use super::{producer, text};
use crate::bvh::{BvhErrorKind, parse_tolerant};

/// Rates that are believed, Hz.
const RATES: std::ops::RangeInclusive<f32> = 1.0..=1000.0;

pub(super) fn parse(bytes: &[u8], options: &Options) -> Result<Parsed<'static>, ReadErrorKind> {
    let mut repairs = Vec::new();
    let text = text::decode(bytes);
    repairs.extend(text.note.map(|text| Note {
        topic: Topic::Encoding,
        text,
    }));
    let (file, miscounted) = parse_tolerant(&text.text, options.fps).map_err(|error| {
        let option = match &error.kind {
            BvhErrorKind::FrameTime(_) => Some(Advice::decides(Choice::any(OptionName::Fps))),
            BvhErrorKind::FrameCount { .. } => Some(Advice::new(
                "correct the number after Frames:, if no rows are missing",
                [],
            )),
            _ => None,
        };
        ReadErrorKind::Bvh { error, option }
    })?;
    repairs.extend(miscounted.map(|counts| Note {
        topic: Topic::Frames,
        text: format!(
            "Frames: says {}, and {} rows follow",
            counts.declared, counts.found
        ),
    }));
    let fps = file.fps();
    if !RATES.contains(&fps) {
        return Err(ReadErrorKind::Range {
            field: "Frame Time".to_owned(),
            found: format!("{} s", file.frame_time_s()),
            allowed: "0.001 to 1 s".to_owned(),
            option: Some(Advice::decides(Choice::any(OptionName::Fps))),
        });
    }
    let fps = match options.fps {
        Some(fps) => Finding::new(fps, Basis::Given, "--fps"),
        None => Finding::new(
            fps,
            Basis::Stated,
            format!("Frame Time: {} s", file.frame_time_s()),
        ),
    };
    let names: Vec<&str> = file.joints().iter().map(|joint| &*joint.name).collect();
    Ok(Parsed {
        producer: producer::of_names(&names),
        source: Box::new(file),
        format: Finding::new(Format::Bvh, Basis::Found, "it begins with HIERARCHY"),
        skeleton: None,
        stated: Stated {
            up: None,
            unit_m: None,
            by: "a BVH file",
        },
        fps,
        repairs,
        oddities: Vec::new(),
    })
}
