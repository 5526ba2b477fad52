//! Options by name, and the advice of errors: which option decides, with which values.

use std::fmt;

use serde::{Serialize, Serializer};

use self::Takes::{Flag, Name, Number, Text};
use super::report::Up;
use super::units;

/// Most values of an option that a text spells out.
const SPELT_OUT: usize = 3;

/// An option of [`Options`](super::Options).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
#[allow(missing_docs, reason = "the fields of Options document them")]
pub enum OptionName {
    Up,
    Unit,
    Fps,
    Animation,
    Root,
    RestPose,
    LeadingPose,
    MaxSlide,
    OtherBones,
    Quaternion,
    Degrees,
    JointOrder,
    /// A program's own way to name a skeleton or robot, such as `--pack` and `--urdf`.
    Skeleton,
}

/// What an option takes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize)]
#[serde(rename_all = "snake_case")]
pub enum Takes {
    /// One of [`OptionName::values`].
    Name,
    /// Any text. Those of [`OptionName::values`] have a meaning of their own.
    Text,
    /// A number above 0.
    Number,
    /// Yes or no.
    Flag,
}

/// Name in JSON and in Python, flag of command lines, and what it takes, in the order of
/// [`OptionName`].
const OPTIONS: [(OptionName, &str, &str, Takes); 13] = [
    (OptionName::Up, "up", "--up", Name),
    (OptionName::Unit, "unit", "--unit", Name),
    (OptionName::Fps, "fps", "--fps", Number),
    (OptionName::Animation, "animation", "--animation", Text),
    (OptionName::Root, "root", "--root", Text),
    (OptionName::RestPose, "rest_pose", "--rest-pose", Name),
    (OptionName::LeadingPose, "leading_pose", "--leading-pose", Name),
    (OptionName::MaxSlide, "max_slide_m", "--max-slide", Number),
    (OptionName::OtherBones, "other_bones", "--other-bones", Flag),
    (OptionName::Quaternion, "quaternion", "--quaternion", Name),
    (OptionName::Degrees, "degrees", "--degrees", Flag),
    (OptionName::JointOrder, "joint_order", "--joint-order", Text),
    (OptionName::Skeleton, "skeleton", "--pack or --urdf", Text),
];

impl OptionName {
    /// All options but the skeleton.
    pub fn all() -> impl Iterator<Item = Self> {
        let options = OPTIONS.into_iter().map(|(option, ..)| option);
        options.filter(|option| *option != Self::Skeleton)
    }

    /// As in JSON and as an argument of Python: `rest_pose`.
    pub fn name(self) -> &'static str {
        OPTIONS[self as usize].1
    }

    /// As on a command line: `--rest-pose`.
    pub fn flag(self) -> &'static str {
        OPTIONS[self as usize].2
    }

    /// What the option takes.
    pub fn takes(self) -> Takes {
        OPTIONS[self as usize].3
    }

    /// Names that the option takes. Empty if it takes numbers, or names that only the file has.
    pub fn values(self) -> Vec<&'static str> {
        match self {
            Self::Up => Up::ALL.map(Up::name).to_vec(),
            Self::Unit => units::UNITS.map(|unit| unit.name).to_vec(),
            Self::RestPose => vec!["t", "a", "standing", "none"],
            Self::LeadingPose => vec!["find", "keep", "drop"],
            Self::Quaternion => vec!["xyzw", "wxyz"],
            Self::JointOrder => vec!["tree", "isaaclab"],
            _ => Vec::new(),
        }
    }

    /// Whether only robots' files leave it open.
    pub fn is_of_robots(self) -> bool {
        matches!(self, Self::Quaternion | Self::Degrees | Self::JointOrder)
    }
}

impl Serialize for OptionName {
    fn serialize<S: Serializer>(&self, serializer: S) -> Result<S::Ok, S::Error> {
        serializer.serialize_str(self.name())
    }
}

/// An option that decides.
#[derive(Clone, Debug, PartialEq, Eq, Serialize)]
pub struct Choice {
    #[allow(missing_docs)]
    pub option: OptionName,
    /// The values that fit the file, as the option takes them: `true` for a flag. Empty if they are
    /// not known.
    pub values: Vec<String>,
}

impl Choice {
    pub(super) fn new(option: OptionName, values: &[impl ToString]) -> Self {
        Self {
            option,
            values: values.iter().map(ToString::to_string).collect(),
        }
    }

    /// An option whose value the user must know.
    pub(super) fn any(option: OptionName) -> Self {
        let values = match option.takes() {
            Flag => vec!["true".to_owned()],
            _ => Vec::new(),
        };
        Self { option, values }
    }
}

/// As on a command line: `--unit mm or --unit cm`.
impl fmt::Display for Choice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let flag = self.option.flag();
        if self.values.is_empty() || self.values.len() > SPELT_OUT || self.option.takes() == Flag {
            return f.write_str(flag);
        }
        for (nth, value) in self.values.iter().enumerate() {
            let or = if nth > 0 { " or " } else { "" };
            write!(f, "{or}{flag} {value}")?;
        }
        Ok(())
    }
}

/// The end of an error: which options decide. Its text names options by [`Choice`] alone.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct Advice(Box<Said>);

/// In a box, so that errors stay small.
#[derive(Clone, Debug, PartialEq, Eq)]
struct Said {
    /// Has `{}` in place of each option.
    text: String,
    choices: Vec<Choice>,
}

impl Advice {
    pub(super) fn new(text: impl Into<String>, choices: impl Into<Vec<Choice>>) -> Self {
        let (text, choices) = (text.into(), choices.into());
        debug_assert_eq!(text.matches("{}").count(), choices.len(), "{text}");
        Self(Box::new(Said { text, choices }))
    }

    /// One option decides.
    pub(super) fn decides(choice: Choice) -> Self {
        Self::new("{} decides", [choice])
    }

    /// The options that decide.
    pub fn choices(&self) -> &[Choice] {
        &self.0.choices
    }
}

impl fmt::Display for Advice {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mut parts = self.0.text.split("{}");
        f.write_str(parts.next().unwrap_or_default())?;
        for (choice, part) in self.0.choices.iter().zip(parts) {
            write!(f, "{choice}{part}")?;
        }
        Ok(())
    }
}

#[cfg(test)]
mod tests {
    use super::super::{LeadingPose, QuaternionOrder, RestPose};
    use super::*;

    #[test]
    fn options_take_the_values_that_they_list() {
        for (nth, (option, ..)) in OPTIONS.into_iter().enumerate() {
            assert_eq!(option as usize, nth);
            for value in option.values() {
                let is_taken = match option {
                    OptionName::Up => Up::of_name(value).is_some(),
                    OptionName::Unit => units::metres_of(value).is_some(),
                    OptionName::RestPose => RestPose::of_name(value).is_some(),
                    OptionName::LeadingPose => LeadingPose::of_name(value).is_some(),
                    OptionName::Quaternion => QuaternionOrder::of_name(value).is_some(),
                    _ => true,
                };
                assert!(is_taken, "{option:?} {value}");
            }
        }
    }

    #[test]
    fn advice_writes_options_as_a_command_line_has_them() {
        let written = |choice: Choice| Advice::decides(choice).to_string();
        let units = Choice::new(OptionName::Unit, &["mm", "cm"]);
        assert_eq!(written(units), "--unit mm or --unit cm decides");
        assert_eq!(written(Choice::any(OptionName::Degrees)), "--degrees decides");
        let many = Choice::new(OptionName::Root, &["a", "b", "c", "d"]);
        assert_eq!(written(many), "--root decides");
        let both = [Choice::any(OptionName::Degrees), Choice::any(OptionName::Root)];
        assert_eq!(
            Advice::new("with {} and {}!", both).to_string(),
            "with --degrees and --root!"
        );
        let choice = serde_json::to_string(&Choice::new(OptionName::MaxSlide, &[0.5])).unwrap();
        assert_eq!(choice, r#"{"option":"max_slide_m","values":["0.5"]}"#);
    }
}
