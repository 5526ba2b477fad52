//! glTF, binary or text.

use super::choices::{Advice, Choice, OptionName};
use super::error::ReadErrorKind;
use super::joints::Parsed;
use super::options::Options;
use super::producer;
use super::report::{Basis, Finding, Format, Note, Topic, Up, listed};
use super::stance::Stated;
use super::units::METRIC_UNITS;
use crate::convert::Source as _;
use crate::glb::{Beside, GlbOptions, GlbReadError, parse_beside};

pub(super) fn parse(
    bytes: &[u8],
    beside: Beside<'_>,
    format: Finding<Format>,
    options: &Options,
) -> Result<Parsed<'static>, ReadErrorKind> {
    let glb = GlbOptions {
        // Sampled once: keys are at any times.
        fps: options.fps.or(options.resample_fps),
        animation: options.animation.clone(),
        at_rest: options.at_rest,
        ..GlbOptions::default()
    };
    let animation = parse_beside(bytes, beside, &glb).map_err(|error| {
        let option = match error {
            GlbReadError::SeveralAnimations(names) => return ReadErrorKind::SeveralAnimations(names),
            GlbReadError::UnknownAnimation { wanted, names } => {
                return ReadErrorKind::UnknownAnimation { wanted, names };
            }
            GlbReadError::Rate(_) => Some(Advice::decides(Choice::any(OptionName::Fps))),
            _ => None,
        };
        ReadErrorKind::Glb { error, option }
    })?;
    let origin = animation.origin().clone();
    let mut repairs = Vec::new();
    if origin.ignored_channels > 0 {
        repairs.push(Note {
            topic: Topic::Bystanders,
            text: format!(
                "{} channels move no node, and are ignored",
                origin.ignored_channels
            ),
        });
    }
    if !origin.props.is_empty() {
        repairs.push(Note {
            topic: Topic::Bystanders,
            text: format!(
                "moving nodes beside the body are left out: {}",
                listed(&origin.props)
            ),
        });
    }
    let fps = match options.fps {
        Some(fps) => Finding::new(fps, Basis::Given, "--fps"),
        None => Finding::new(
            animation.keys_fps(),
            Basis::Found,
            "the time between the closest keys",
        ),
    };
    let names: Vec<&str> = (0..animation.joint_count())
        .map(|joint| animation.name(joint))
        .collect();
    let stated = origin
        .generator
        .map(|generator| Finding::new(generator, Basis::Stated, "asset.generator"));
    Ok(Parsed {
        producer: producer::of_names(&names).or(stated),
        source: Box::new(animation),
        format,
        skeleton: None,
        stated: Stated {
            up: Some(Up::Y),
            unit_m: Some(1.0),
            units: &METRIC_UNITS,
            may_be_y_up: false,
            by: "glTF is Y up and in metres",
        },
        fps,
        repairs,
        oddities: Vec::new(),
    })
}

#[cfg(test)]
mod tests {
    use crate::glb::write_glb;
    use crate::read::tests::people::Person;
    use crate::read::{Options, RestPose, Source, read};

    #[test]
    fn keys_are_sampled_once_at_the_wanted_rate() {
        let person = Person {
            words: 0,
            size: 1.0,
            spine: 2,
            rest: RestPose::T,
        };
        let bytes = write_glb(&person.walk(60, 30.0, &[0.3, 0.8, 0.1, 0.6])).unwrap();
        let with = |options: Options| read(&Source::new("walk.glb", &bytes), &options).unwrap();
        let resampled = with(Options {
            resample_fps: Some(24.0),
            ..Options::default()
        });
        let sampled = with(Options {
            fps: Some(24.0),
            ..Options::default()
        });
        assert_eq!(resampled.clip, sampled.clip);
        assert_eq!((resampled.report.fps.value, resampled.report.frames), (30.0, 60));
    }
}
