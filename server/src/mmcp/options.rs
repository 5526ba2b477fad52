//! Checks the options of requests.

use std::collections::BTreeMap;

use serde_json::Value;
use troupe_character::take::{Look, Note};

use super::fault::Fault;
use super::limits::{GUIDANCE, MAX_SAMPLES, MAX_TRANSITION_FRAMES, STEPS, TEMPERATURES};
use super::model::Model;
use super::schema::{Guidance, Options};
use troupe_base::echo::cut;

/// Temperature of a request that sets none.
pub(super) const TEMPERATURE: f32 = 1.0;
/// The option that says who plans a path.
pub(super) const PLANNER: &str = "options.model_options.planner";

/// Checks the values of options for a request of `segments` segments.
pub(super) fn check_options(options: &Options, model: &Model, segments: usize) -> Result<(), Fault> {
    let within = |name: &str, value: Option<i64>, low: i64, high: i64| match value {
        Some(value) if !(low..=high).contains(&value) => Err(Fault::schema(
            format!("options.{name}"),
            format!("is {value}"),
            format!("{low} to {high}"),
        )),
        _ => Ok(()),
    };
    within("diffusion_steps", options.diffusion_steps, STEPS[0], STEPS[1])?;
    within("num_samples", options.num_samples, 1, MAX_SAMPLES as i64)?;
    within(
        "transition_frames",
        options.transition_frames,
        0,
        MAX_TRANSITION_FRAMES,
    )?;
    if options.keyframe_budget.is_some() {
        let allowed = "none: every frame is keyed (supports_keyframe_reduction is false)";
        return Err(Fault::option("options.keyframe_budget", "is given", allowed));
    }
    if options.is_loop == Some(true) {
        if !(model.walks() || model.follows()) {
            let allowed = "false: supports_loop is false";
            return Err(Fault::option("options.loop", "is true", allowed));
        }
        if segments != 1 {
            let found = format!("is true, and there are {segments} segments");
            return Err(Fault::option("options.loop", found, "exactly one segment"));
        }
    }
    match &options.guidance {
        Some(guidance) => check_guidance(guidance, model),
        None => Ok(()),
    }
}

fn check_guidance(guidance: &Guidance, model: &Model) -> Result<(), Fault> {
    let weights = match guidance.kind.as_str() {
        "nocfg" => 0,
        "regular" => 1,
        "separated" => 2,
        other => {
            let found = format!("is {:?}", cut(other, 32));
            return Err(Fault::schema(
                "options.guidance.type",
                found,
                "nocfg, regular, separated",
            ));
        }
    };
    if guidance.weight.len() != weights {
        let found = format!("has {} entries", guidance.weight.len());
        return Err(Fault::schema(
            "options.guidance.weight",
            found,
            format!("exactly {weights}"),
        ));
    }
    if !takes(guidance, model) {
        return Ok(());
    }
    let [low, high] = GUIDANCE;
    match guidance
        .weight
        .iter()
        .find(|weight| !(low..=high).contains(*weight))
    {
        Some(weight) => Err(Fault::option(
            "options.guidance.weight",
            format!("has {weight}"),
            format!("{low} to {high}"),
        )),
        None => Ok(()),
    }
}

/// Whether the model takes this type of guidance. Other types are left out with a note, because the
/// protocol's own Blender client sends text guidance to every model.
fn takes(guidance: &Guidance, model: &Model) -> bool {
    model.guidance().contains(&guidance.kind.as_str())
}

/// How to move: the style and the sampler's options.
pub(super) fn look(options: &Options, model: &Model, notes: &mut Vec<Note>) -> Result<Look, Fault> {
    let mut look = Look {
        temperature: TEMPERATURE,
        ..Look::default()
    };
    let empty = BTreeMap::new();
    let own = options.model_options.as_ref().unwrap_or(&empty);
    let names = model.style_names();
    let mut known = Vec::new();
    known.extend((!names.is_empty()).then_some("style"));
    known.extend((model.walks() || model.speaks()).then_some("temperature"));
    known.extend(model.follows().then_some("planner"));
    if let Some(name) = own.keys().find(|name| !known.contains(&name.as_str())) {
        let allowed = match known.is_empty() {
            true => "none: the model has no options".to_owned(),
            false => known.join(", "),
        };
        let field = format!("options.model_options.{}", cut(name, 64));
        return Err(Fault::option(field, "is not an option of the model", allowed).with("options", known));
    }
    if let Some(value) = own.get("temperature") {
        look.temperature = temperature(value)?;
    }
    look.guidance = guidance(options, model, notes);
    let style = own
        .get("style")
        .map(|value| style_name(value, &names))
        .transpose()?;
    if model.follows() {
        look.word = style;
        steps(options, model, &mut look, notes);
    } else {
        look.style = match style {
            Some(name) => model.styles().get(&name),
            None => model.styles().default_style(),
        };
    }
    Ok(look)
}

/// Who plans the path of a request.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub(super) enum Planner {
    /// Another pack if one can, otherwise the model's.
    Auto,
    /// The model's pack.
    Own,
    /// Another pack.
    Carried,
}

impl Planner {
    /// The option's values.
    pub(super) const NAMES: [&str; 3] = ["auto", "own", "carried"];

    /// Who plans the path of a request with these options.
    pub(super) fn of(options: &Options) -> Result<Self, Fault> {
        let own = options.model_options.as_ref();
        let Some(value) = own.and_then(|own| own.get("planner")) else {
            return Ok(Self::Auto);
        };
        match value.as_str() {
            Some("auto") => Ok(Self::Auto),
            Some("own") => Ok(Self::Own),
            Some("carried") => Ok(Self::Carried),
            _ => {
                let found = format!("is {}", cut(&value.to_string(), 64));
                Err(Fault::option(PLANNER, found, Self::NAMES.join(", ")))
            }
        }
    }
}

fn style_name(value: &Value, names: &[String]) -> Result<String, Fault> {
    let found = value
        .as_str()
        .filter(|name| names.iter().any(|other| other == name));
    found.map(str::to_owned).ok_or_else(|| {
        let field = "options.model_options.style";
        Fault::option(
            field,
            format!("is {}", cut(&value.to_string(), 64)),
            names.join(", "),
        )
    })
}

fn temperature(value: &Value) -> Result<f32, Fault> {
    let [low, high] = TEMPERATURES;
    let number = value.as_f64().map(|number| number as f32);
    number
        .filter(|number| (low..=high).contains(number))
        .ok_or_else(|| {
            let field = "options.model_options.temperature";
            Fault::option(
                field,
                format!("is {}", cut(&value.to_string(), 64)),
                format!("{low} to {high}"),
            )
        })
}

/// Sets the steps of the sampler.
fn steps(options: &Options, model: &Model, look: &mut Look, notes: &mut Vec<Note>) {
    let most = model
        .loaded
        .pack
        .sampler()
        .map_or(1, |steps| i64::from(steps.max));
    look.steps = options.diffusion_steps.map(|steps| {
        if steps > most {
            let message = format!("the model has {most} diffusion steps: {steps} were asked for");
            notes.push(Note::info("diffusion_steps", message));
        }
        steps.min(most) as u32
    });
}

/// Weight of the style.
fn guidance(options: &Options, model: &Model, notes: &mut Vec<Note>) -> Option<f32> {
    let guidance = options.guidance.as_ref()?;
    if takes(guidance, model) {
        return guidance.weight.first().map(|weight| *weight as f32);
    }
    let supported = model.guidance().join(", ");
    let message = format!("{:?} is left out: the model takes {supported}", guidance.kind);
    notes.push(Note::info("guidance", message));
    None
}

/// The seed of a request. If it gives none, a seed is drawn and reported in a note.
pub(super) fn seed(given: Option<i64>, notes: &mut Vec<Note>) -> u64 {
    match given {
        Some(seed) => seed as u64,
        None => {
            // 32 bits fit into the numbers of every language.
            let drawn = rand::random::<u32>();
            notes.push(Note::info("seed", format!("the seed is {drawn}")));
            u64::from(drawn)
        }
    }
}

#[cfg(test)]
mod tests {
    use serde_json::json;

    use super::*;

    #[test]
    fn the_planner_is_automatic_unless_another_is_named() {
        let planner = |value: Option<Value>| {
            let own = value.map(|value| BTreeMap::from([("planner".to_owned(), value)]));
            Planner::of(&Options {
                model_options: own,
                ..Options::default()
            })
        };
        assert_eq!(planner(None).unwrap(), Planner::Auto);
        for (name, wanted) in Planner::NAMES
            .into_iter()
            .zip([Planner::Auto, Planner::Own, Planner::Carried])
        {
            assert_eq!(planner(Some(json!(name))).unwrap(), wanted);
        }
        let fault = planner(Some(json!("both"))).unwrap_err();
        assert_eq!(
            fault.place.to_string(),
            "options.model_options.planner: is \"both\"; allowed: auto, own, carried"
        );
    }
}
