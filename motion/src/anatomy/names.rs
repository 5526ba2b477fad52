//! Joints' names as programs write them: namespaces, sides, and the words in them.

/// The side of the body that a name says.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash)]
pub enum Side {
    /// Left.
    Left,
    /// Right.
    Right,
}

impl Side {
    /// Left first.
    pub const BOTH: [Self; 2] = [Self::Left, Self::Right];
}

/// A name taken apart.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Name {
    /// None for the middle, and for names that say no side.
    pub side: Option<Side>,
    /// Words in small letters, without the side and numbers.
    pub words: Vec<String>,
    /// Whether it ends with a number of three digits, as Blender names a further joint:
    /// `thigh.L.001`.
    pub is_numbered: bool,
}

/// Words for parts of a body, which may follow a side without a gap: `lfemur`.
const PARTS: [&str; 17] = [
    "foot", "toe", "toes", "toebase", "ankle", "leg", "upleg", "thigh", "femur", "shin", "tibia", "calf",
    "hand", "wrist", "arm", "humerus", "radius",
];
/// Words of joints that steer a rig and are not of the body.
const STEERING: [&str; 5] = ["ik", "target", "pole", "ctrl", "control"];
/// Words of joints that steer or help a limb, and are no joint of it.
const HELPERS: [&str; 9] = [
    "ik", "fk", "target", "pole", "ctrl", "control", "helper", "twist", "roll",
];

impl Name {
    /// Takes a name apart. A namespace is left out.
    pub fn of(name: &str) -> Self {
        let number = name.rsplit_once(['.', '_']).map(|(_, number)| number);
        let mut parsed = Self {
            is_numbered: number.is_some_and(|n| n.len() == 3 && n.bytes().all(|b| b.is_ascii_digit())),
            ..Self::default()
        };
        for word in words(without_namespace(name)) {
            let side = match &*word {
                "left" | "l" | "lft" => Some(Side::Left),
                "right" | "r" | "rgt" => Some(Side::Right),
                _ => None,
            };
            let glued = || match word.split_at_checked(1) {
                Some(("l", part)) if PARTS.contains(&part) => Some((Side::Left, part.to_owned())),
                Some(("r", part)) if PARTS.contains(&part) => Some((Side::Right, part.to_owned())),
                _ => None,
            };
            match (side, glued()) {
                (Some(side), _) => parsed.side = parsed.side.or(Some(side)),
                (None, Some((side, part))) => {
                    parsed.side = parsed.side.or(Some(side));
                    parsed.words.push(part);
                }
                (None, None) => parsed.words.push(word),
            }
        }
        parsed
    }

    /// Whether one of its words is this, in small letters.
    pub fn has(&self, word: &str) -> bool {
        self.words.iter().any(|w| w == word)
    }

    /// Whether it has one of these words.
    pub fn has_any(&self, words: &[&str]) -> bool {
        words.iter().any(|word| self.has(word))
    }

    /// Whether it steers a rig and is not of the body.
    pub fn is_steering(&self) -> bool {
        self.has_any(&STEERING)
    }

    /// Whether it steers or helps a limb, and is no joint of it.
    pub fn is_helper(&self) -> bool {
        self.has_any(&HELPERS)
    }
}

/// The name after the last `:` or `|`: `mixamorig:Hips` is `Hips`.
pub fn without_namespace(name: &str) -> &str {
    match name.rsplit([':', '|']).next() {
        Some(rest) if !rest.is_empty() => rest,
        _ => name,
    }
}

/// Words in small letters: `LeftUpLeg` is left, up, leg; `thigh.L` is thigh, l.
fn words(name: &str) -> Vec<String> {
    let mut words = Vec::new();
    let mut word = String::new();
    let letters: Vec<char> = name.chars().collect();
    for (nth, &letter) in letters.iter().enumerate() {
        let before = nth.checked_sub(1).map(|before| letters[before]);
        let after = letters.get(nth + 1);
        let begins = letter.is_uppercase()
            && (before.is_some_and(char::is_lowercase)
                // The last capital of several begins the next word: LHip.
                || (before.is_some_and(char::is_uppercase) && after.is_some_and(|c| c.is_lowercase())));
        if (begins || !letter.is_alphabetic()) && !word.is_empty() {
            words.push(std::mem::take(&mut word));
        }
        if letter.is_alphabetic() {
            word.extend(letter.to_lowercase());
        }
    }
    words.extend((!word.is_empty()).then_some(word));
    words
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn names_of_many_programs_say_side_and_part() {
        for (name, side, words) in [
            ("mixamorig:LeftUpLeg", Some(Side::Left), &["up", "leg"][..]),
            ("LHipJoint", Some(Side::Left), &["hip", "joint"]),
            ("thigh.R", Some(Side::Right), &["thigh"]),
            ("lfoot", Some(Side::Left), &["foot"]),
            ("right_foot", Some(Side::Right), &["foot"]),
            ("Bip01 L Thigh", Some(Side::Left), &["bip", "thigh"]),
            (
                "J_Bip_R_UpperLeg",
                Some(Side::Right),
                &["j", "bip", "upper", "leg"],
            ),
            ("UpperLeg_L", Some(Side::Left), &["upper", "leg"]),
            ("LeftHandIndex1", Some(Side::Left), &["hand", "index"]),
            ("Pelvis", None, &["pelvis"]),
            ("Armature|Spine", None, &["spine"]),
            ("root", None, &["root"]),
        ] {
            let found = Name::of(name);
            assert_eq!(
                (found.side, found.words),
                (side, words.iter().map(|w| (*w).to_owned()).collect()),
                "{name}"
            );
        }
        assert!(Name::of("foot_ik.L").is_helper());
        assert!(Name::of("thigh.L.001").is_numbered && Name::of("thigh_L_001").is_numbered);
        assert!(!Name::of("thigh.L").is_numbered && !Name::of("leg_01").is_numbered);
        assert_eq!(without_namespace("a:"), "a:");
    }
}
