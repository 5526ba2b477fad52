//! Styles as messages: checks a message, and writes one.

use std::sync::Arc;

use troupe_motion::Quat;
use troupe_motion::rotation::{from_wxyz, to_wxyz};
use troupe_proto::v1;

use super::{
    Gait, MAX_GAIT_VELOCITY, MAX_GAITS, MAX_KEY_VELOCITY, MAX_KEYS, MAX_NAME_CHARS, MAX_PERIOD_FRAMES,
    MAX_ROOT_RATIO, MAX_WORDS, REPLAN_INTERVAL_FRAMES, Style, StyleCache, StyleKey, Words,
};
use crate::limits::{MAX_HEIGHT_M, UNIT_TOLERANCE};
use crate::{FieldError, Path};
use troupe_motion::model::{ByPath, Rig};

impl Style {
    /// Checks a message for the pack of `rig`. `path` is the message's place in the request, for
    /// errors. Two fields are not read: `built_in`, which a client cannot set, and the `height` of
    /// a gait, which follows from its keys.
    ///
    /// # Errors
    /// [`FieldError`] for the first value that is not accepted.
    pub fn from_proto(
        path: &Path<'_>,
        style: &v1::Style,
        rig: &Rig,
        built_in: bool,
    ) -> Result<Self, FieldError> {
        check_name(&path.field("name"), &style.name)?;
        let speed = path.field("default_speed");
        number(&speed, style.default_speed, 0.0, MAX_GAIT_VELOCITY)?;
        let interval = style.replan_interval_frames;
        if !REPLAN_INTERVAL_FRAMES.contains(&interval) {
            let (low, high) = (REPLAN_INTERVAL_FRAMES.start(), REPLAN_INTERVAL_FRAMES.end());
            return Err(path
                .field("replan_interval_frames")
                .error(format!("is {interval}"), format!("{low} to {high}")));
        }
        check_counts(path, &style.allowed_token_counts, rig)?;
        number(&path.field("root_ratio"), style.root_ratio, 0.0, MAX_ROOT_RATIO)?;
        if let Some(body) = &rig.by_path {
            let weights = check_words(path, style, body)?;
            return Ok(Self {
                default_speed_mps: style.default_speed,
                replan_interval_frames: interval,
                is_static: style.is_static,
                ..Self::of_words(&style.name, weights, body, built_in)
            });
        }
        if !style.words.is_empty() {
            return Err(path.field("words").error(
                format!("has {} entries, and the pack knows no words", style.words.len()),
                "none; use gaits instead",
            ));
        }
        Ok(Self {
            name: style.name.clone(),
            default_speed_mps: style.default_speed,
            replan_interval_frames: interval,
            allowed_token_counts: style.allowed_token_counts.clone(),
            is_static: style.is_static,
            root_ratio: style.root_ratio,
            gaits: check_gaits(path, &style.gaits, rig)?,
            words: None,
            takes: Arc::default(),
            built_in,
            cache: StyleCache::default(),
        })
    }

    /// The message with all keyframes.
    pub fn to_proto(&self) -> v1::Style {
        self.message(true)
    }

    /// The message for lists, without keyframes.
    pub fn to_proto_summary(&self) -> v1::Style {
        self.message(false)
    }

    fn message(&self, keys: bool) -> v1::Style {
        v1::Style {
            name: self.name.clone(),
            default_speed: self.default_speed_mps,
            replan_interval_frames: self.replan_interval_frames,
            allowed_token_counts: self.allowed_token_counts.clone(),
            is_static: self.is_static,
            root_ratio: self.root_ratio,
            gaits: match &self.words {
                // They follow from the body.
                Some(_) => Vec::new(),
                None => {
                    let own = self.gaits.iter().filter(|gait| !gait.built);
                    own.map(|gait| gait.message(keys)).collect()
                }
            },
            words: self.words.iter().flat_map(Words::message).collect(),
            built_in: self.built_in,
        }
    }
}

impl Words {
    fn message(&self) -> impl Iterator<Item = v1::StyleWord> {
        self.weights.iter().map(|(word, weight)| v1::StyleWord {
            word: word.clone(),
            weight: Some(*weight),
        })
    }
}

impl Gait {
    fn message(&self, keys: bool) -> v1::Gait {
        v1::Gait {
            name: self.name.clone(),
            left: self.left_mps,
            forward: self.forward_mps,
            turn: self.turn_rps,
            period_frames: self.period_frames,
            keys: if keys {
                self.keys.iter().map(StyleKey::message).collect()
            } else {
                Vec::new()
            },
            key_count: self.keys.len() as u32,
            height: self.height_m(),
        }
    }
}

impl StyleKey {
    fn message(&self) -> v1::GaitKey {
        v1::GaitKey {
            rotations: self.rotations.iter().copied().flat_map(to_wxyz).collect(),
            height: self.height_m,
            left: self.left_mps,
            forward: self.forward_mps,
            turn: self.turn_rps,
        }
    }
}

/// Checks the name of a style or gait.
fn check_name(path: &Path<'_>, name: &str) -> Result<(), FieldError> {
    let allowed = || format!("1 to {MAX_NAME_CHARS} letters, digits, '-', '_' or '.'");
    if name.is_empty() {
        return Err(path.error("is empty", allowed()));
    }
    if name.chars().count() > MAX_NAME_CHARS {
        return Err(path.error(format!("has {} characters", name.chars().count()), allowed()));
    }
    let fits = |c: char| c.is_ascii_alphanumeric() || matches!(c, '-' | '_' | '.');
    match name.chars().find(|&c| !fits(c)) {
        Some(c) => Err(path.error(format!("has the character {c:?}"), allowed())),
        None => Ok(()),
    }
}

/// The words of a style, for a body that is planned for by paths.
fn check_words(path: &Path<'_>, style: &v1::Style, body: &ByPath) -> Result<Vec<(String, f32)>, FieldError> {
    if !style.gaits.is_empty() {
        return Err(path.field("gaits").error(
            format!("has {} entries, and the pack plans by paths", style.gaits.len()),
            "none; use words instead",
        ));
    }
    if !style.allowed_token_counts.is_empty() {
        return Err(path.field("allowed_token_counts").error(
            format!(
                "has {} entries, and the pack plans by paths",
                style.allowed_token_counts.len()
            ),
            "none",
        ));
    }
    if style.words.len() > MAX_WORDS {
        return Err(path.field("words").error(
            format!("has {} entries", style.words.len()),
            format!("0 to {MAX_WORDS}"),
        ));
    }
    let mut weights: Vec<(String, f32)> = Vec::with_capacity(style.words.len());
    for (index, given) in style.words.iter().enumerate() {
        let path = path.element("words", index);
        let word = path.field("word");
        if !body.words.contains(&given.word) {
            let start: String = given.word.chars().take(MAX_NAME_CHARS).collect();
            return Err(word.error(format!("is {start:?}"), body.words.join(", ")));
        }
        if weights.iter().any(|(before, _)| *before == given.word) {
            return Err(word.error(
                format!("is {:?}, which is there already", given.word),
                "each word once",
            ));
        }
        let weight = given.weight.unwrap_or(1.0);
        number(&path.field("weight"), weight, 0.0, 1.0)?;
        weights.push((given.word.clone(), weight));
    }
    Ok(weights)
}

fn check_counts(path: &Path<'_>, counts: &[u32], rig: &Rig) -> Result<(), FieldError> {
    let dims = &rig.dims;
    // The context and the targets take some of the frames.
    let low = dims
        .min_tokens
        .max(dims.tokens_for(dims.context_frames + dims.max_targets));
    let high = dims.max_tokens;
    if counts.len() > dims.counts() {
        return Err(path.field("allowed_token_counts").error(
            format!("has {} entries", counts.len()),
            format!("at most {}", dims.counts()),
        ));
    }
    for (index, &count) in counts.iter().enumerate() {
        if !(low..=high).contains(&(count as usize)) {
            return Err(path
                .element("allowed_token_counts", index)
                .error(format!("is {count}"), format!("{low} to {high}")));
        }
    }
    Ok(())
}

fn check_gaits(path: &Path<'_>, gaits: &[v1::Gait], rig: &Rig) -> Result<Vec<Gait>, FieldError> {
    if !(1..=MAX_GAITS).contains(&gaits.len()) {
        return Err(path.field("gaits").error(
            format!("has {} entries", gaits.len()),
            format!("1 to {MAX_GAITS}"),
        ));
    }
    let mut checked: Vec<Gait> = Vec::with_capacity(gaits.len());
    for (index, gait) in gaits.iter().enumerate() {
        let path = path.element("gaits", index);
        if checked.iter().any(|before| before.name == gait.name) {
            return Err(path.field("name").error(
                format!("is {:?}, which another gait has", gait.name),
                "a name for each gait",
            ));
        }
        checked.push(check_gait(&path, gait, rig)?);
    }
    Ok(checked)
}

fn check_gait(path: &Path<'_>, gait: &v1::Gait, rig: &Rig) -> Result<Gait, FieldError> {
    check_name(&path.field("name"), &gait.name)?;
    for (name, value) in [
        ("left", gait.left),
        ("forward", gait.forward),
        ("turn", gait.turn),
    ] {
        number(&path.field(name), value, -MAX_GAIT_VELOCITY, MAX_GAIT_VELOCITY)?;
    }
    number(
        &path.field("period_frames"),
        gait.period_frames,
        0.0,
        MAX_PERIOD_FRAMES,
    )?;
    let count = gait.keys.len();
    if !(1..=MAX_KEYS).contains(&count) {
        return Err(path
            .field("keys")
            .error(format!("has {count} entries"), format!("1 to {MAX_KEYS}")));
    }
    if gait.key_count != 0 && gait.key_count as usize != count {
        return Err(path.field("key_count").error(
            format!("is {}", gait.key_count),
            format!("{count}, as many as there are keys, or 0"),
        ));
    }
    let keys = gait
        .keys
        .iter()
        .enumerate()
        .map(|(index, key)| check_key(&path.element("keys", index), key, rig))
        .collect::<Result<_, _>>()?;
    let gait = Gait {
        name: gait.name.clone(),
        left_mps: gait.left,
        forward_mps: gait.forward,
        turn_rps: gait.turn,
        period_frames: gait.period_frames,
        keys,
        built: false,
    };
    // The keys of a moving gait are equal steps of its cycle, so the cycle must have a length.
    if count > 1 && !gait.stands() && gait.period_frames < 1.0 {
        return Err(path.field("period_frames").error(
            format!("is {} for a gait of {count} keys that moves", gait.period_frames),
            format!("1 to {MAX_PERIOD_FRAMES}"),
        ));
    }
    Ok(gait)
}

fn check_key(path: &Path<'_>, key: &v1::GaitKey, rig: &Rig) -> Result<StyleKey, FieldError> {
    for (name, value) in [("left", key.left), ("forward", key.forward), ("turn", key.turn)] {
        number(&path.field(name), value, -MAX_KEY_VELOCITY, MAX_KEY_VELOCITY)?;
    }
    let ground = rig.skeleton.ground_y_m;
    number(
        &path.field("height"),
        key.height,
        ground - MAX_HEIGHT_M,
        ground + MAX_HEIGHT_M,
    )?;
    Ok(StyleKey {
        rotations: check_rotations(path, &key.rotations, rig)?,
        height_m: key.height,
        left_mps: key.left,
        forward_mps: key.forward,
        turn_rps: key.turn,
    })
}

fn check_rotations(path: &Path<'_>, rotations: &[f32], rig: &Rig) -> Result<Vec<Quat>, FieldError> {
    let joints = &rig.skeleton.joints;
    if rotations.len() != joints.len() * 4 {
        return Err(path.field("rotations").error(
            format!("has {} numbers", rotations.len()),
            format!(
                "exactly {}: 4 (w, x, y, z) for each of the pack's {} joints",
                joints.len() * 4,
                joints.len()
            ),
        ));
    }
    let quaternions = rotations.as_chunks::<4>().0;
    quaternions
        .iter()
        .zip(joints)
        .enumerate()
        .map(|(index, (&wxyz, joint))| {
            let rotation = from_wxyz(wxyz);
            let length = rotation.length();
            let (low, high) = (1.0 - UNIT_TOLERANCE, 1.0 + UNIT_TOLERANCE);
            // Rejects NaN and infinity too.
            if (low..=high).contains(&length) {
                return Ok(rotation / length);
            }
            Err(path.element("rotations", index * 4).error(
                format!("the rotation of joint {} has length {length}", joint.name),
                format!("unit length, {low} to {high}"),
            ))
        })
        .collect()
}

/// Checks a number against its range. NaN is outside every range.
fn number(path: &Path<'_>, value: f32, low: f32, high: f32) -> Result<(), FieldError> {
    if (low..=high).contains(&value) {
        Ok(())
    } else {
        Err(path.error(format!("is {value}"), format!("{low} to {high}")))
    }
}

#[cfg(test)]
#[path = "proto_tests.rs"]
mod tests;
