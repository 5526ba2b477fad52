//! Options and repairs of files that are read onto a given skeleton.

use super::kinds::{person, plain, sliding, with, with_leading_pose};
use super::people::Dialect;
use crate::read::{LeadingPose, OptionName, Options, Topic, Understood};

fn onto() -> Options {
    Options {
        skeleton: Some(person().skeleton()),
        other_bones: true,
        ..Options::default()
    }
}

#[test]
fn slides_are_checked_on_a_skeleton_too() {
    let bytes = sliding("LowerLeg_L", -0.9);
    let error = with("walk.bvh", &bytes, &onto()).unwrap_err();
    let text = error.to_string();
    assert!(
        text.contains("\"LowerLeg_L\" moves 0.") && text.contains("Foot_L hangs on it"),
        "{text}"
    );
    assert_eq!(error.options()[0].option, OptionName::MaxSlide);
    let options = Options {
        max_slide_m: Some(1.0),
        ..onto()
    };
    let found = with("walk.bvh", &bytes, &options).unwrap();
    let odd = &found.report.oddities[0];
    assert!(
        odd.topic == Topic::Sliding && odd.text.contains("each is held in its place on the skeleton"),
        "{odd:?}"
    );
    // The option may also allow less than a fifth of the height.
    let options = Options {
        max_slide_m: Some(0.05),
        ..onto()
    };
    assert!(with("walk.bvh", &sliding("LowerLeg_L", -0.12), &onto()).is_ok());
    assert!(with("walk.bvh", &sliding("LowerLeg_L", -0.12), &options).is_err());
    // Small slides are noted, and toes that slide carry nothing of the body.
    let found = with("walk.bvh", &sliding("Chest", 0.002), &onto()).unwrap();
    let repair = &found.report.repairs[0];
    assert!(
        repair.text.contains("held in their places on the skeleton"),
        "{repair:?}"
    );
    let options = Options {
        max_slide_m: Some(0.01),
        ..onto()
    };
    let found = with("walk.bvh", &sliding("Toes_L", 0.04), &options).unwrap();
    assert_eq!(found.report.oddities[0].topic, Topic::Sliding);
}

#[test]
fn a_leading_pose_is_kept_and_noted() {
    let bytes = Dialect::plain().bytes(&with_leading_pose());
    let on = |leading_pose| {
        let options = Options {
            leading_pose,
            ..onto()
        };
        with("walk.bvh", &bytes, &options).unwrap()
    };
    let found = on(LeadingPose::Find);
    assert_eq!((found.clip.frames(), &found.rest), (60, &None));
    let is_noted = |found: &Understood| {
        let oddities = found.report.oddities.iter();
        let mut noted = oddities.filter(|note| note.topic == Topic::LeadingPose);
        noted.any(|note| note.text.contains("--leading-pose drop leaves it out"))
    };
    assert!(is_noted(&found), "{:?}", found.report.oddities);
    let kept = on(LeadingPose::Keep);
    assert!(kept.clip.frames() == 60 && !is_noted(&kept));
    let dropped = on(LeadingPose::Drop);
    assert!(dropped.clip.frames() == 59 && !is_noted(&dropped));
}

#[test]
fn only_the_root_of_the_skeleton_may_be_named() {
    let bytes = Dialect::plain().bytes(&with_leading_pose());
    let with_root = |root: &str| {
        let options = Options {
            root: Some(root.to_owned()),
            ..onto()
        };
        with("walk.bvh", &bytes, &options)
    };
    assert!(with_root("Hips").is_ok());
    let error = with_root("Chest").unwrap_err();
    assert!(
        error
            .to_string()
            .contains("--root is \"Chest\"; allowed: \"Hips\", the root of the skeleton"),
        "{error}"
    );
    assert_eq!(error.options()[0].option, OptionName::Root);
    assert!(plain("walk.bvh", &bytes).report.joints > 1);
}
