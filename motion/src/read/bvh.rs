//! BVH texts.

use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::joints::Parsed;
use super::options::Options;
use super::report::{Basis, Finding, Format, Note, Topic};
use super::stance::Stated;
use super::units::UNITS;
use super::{producer, text};
use crate::bvh::{BvhErrorKind, BvhFile, Channel, parse_tolerant};

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
    let (file, moved) = with_offsets(file);
    if moved > 0 {
        repairs.push(Note {
            topic: Topic::Sliding,
            text: format!(
                "the position channels of {moved} joints are always 0: taken from their OFFSET, where they stay"
            ),
        });
    }
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
            units: &UNITS,
            may_be_y_up: false,
            by: "a BVH file",
        },
        fps,
        repairs,
        oddities: Vec::new(),
    })
}

/// Some programs give every joint positions relative to its OFFSET, which are 0. As the format has
/// them, all bones would lose their length. Then joints below the root lose these channels. Returns
/// how many did.
fn with_offsets(file: BvhFile) -> (BvhFile, usize) {
    let below = |joint: usize| file.joints()[joint].parent.is_some();
    // Joint and channel of each column.
    let columns = file.joints().iter().enumerate();
    let columns: Vec<(usize, Channel)> = columns
        .flat_map(|(joint, of)| of.channels.iter().map(move |&channel| (joint, channel)))
        .collect();
    let goes = |&(joint, channel): &(usize, Channel)| below(joint) && !channel.is_rotation();
    let is_still = |frame: usize| {
        let row = file.row(frame).iter().zip(&columns);
        row.filter(|(_, column)| goes(column))
            .all(|(&value, _)| value == 0.0)
    };
    let moved: Vec<usize> = (0..file.joints().len())
        .filter(|&joint| file.joints()[joint].offset.length() > 0.0)
        .filter(|&joint| columns.iter().any(|column| column.0 == joint && goes(column)))
        .collect();
    if moved.is_empty() || !(0..file.frames()).all(is_still) {
        return (file, 0);
    }
    let mut joints = file.joints().to_vec();
    for joint in joints.iter_mut().filter(|joint| joint.parent.is_some()) {
        joint.channels.retain(|channel| channel.is_rotation());
    }
    let row = |frame: usize| file.row(frame).iter().zip(&columns);
    let values = (0..file.frames()).flat_map(|frame| row(frame).filter(|(_, column)| !goes(column)));
    let values = values.map(|(&value, _)| value).collect();
    match BvhFile::new(joints, file.frame_time_s(), values) {
        Ok(changed) => (changed, moved.len()),
        Err(_) => (file, 0),
    }
}
