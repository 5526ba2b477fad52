//! Paths that another pack plans, for models on two legs whose network takes paths.

use std::sync::Arc;

use troupe_character::style::Style;
use troupe_character::take::{Note, Wanted, falls_behind};
use troupe_live::session::Space;
use troupe_live::skeleton::{Among, NoCarrier, Worn};

use super::fault::Fault;
use super::model::Model;
use super::options::{PLANNER, Planner};
use super::skeleton::{Joints, worn};

/// A request, as far as the choice of its planner goes by it.
pub(super) struct Asking<'a> {
    /// The model that the request names.
    pub model: &'a Model,
    /// The body of the answer.
    pub joints: &'a Joints,
    /// What the answer must meet.
    pub wanted: &'a Wanted,
    /// Style of the model. None: the default.
    pub word: Option<&'a str>,
}

/// Another pack that plans the path.
pub(super) struct Carried {
    /// Its model.
    pub by: Model,
    /// How it walks.
    pub style: Arc<Style>,
    /// The way to the body of the answer. None: it is the same body.
    pub worn: Option<Arc<Worn>>,
}

/// The other pack that plans the path of a request. None: the model plans itself what is asked for.
/// Notes say who plans.
///
/// # Errors
/// [`Fault`] if another pack must plan, and none can.
pub(super) fn carried(
    planner: Planner,
    asking: &Asking<'_>,
    space: &Space,
    notes: &mut Vec<Note>,
) -> Result<Option<Carried>, Fault> {
    let must = planner == Planner::Carried;
    let has_path = !asking.wanted.path.is_empty();
    if must && !has_path {
        let allowed = "own, auto; or a root_path";
        return Err(Fault::option(PLANNER, "is carried, without a root_path", allowed));
    }
    if planner == Planner::Own || !has_path || !asking.model.follows() {
        return Ok(None);
    }
    let found = find(asking, space, if must { Among::All } else { Among::Better });
    let (carried, scale) = match found {
        Ok(found) => found,
        Err(NotCarried::Fault(fault)) if must => return Err(fault),
        Err(NotCarried::None(error)) if must => return Err(refused(&error)),
        // Nothing could have been asked for otherwise.
        Err(NotCarried::None(NoCarrier::NoPack | NoCarrier::Apart { .. })) => return Ok(None),
        Err(NotCarried::None(error)) => {
            notes.push(itself(&error));
            return Ok(None);
        }
        Err(NotCarried::Fault(fault)) => {
            notes.push(itself(&fault));
            return Ok(None);
        }
    };
    let (name, style) = (carried.by.loaded.pack.name(), &carried.style.name);
    if !must && falls_behind(&carried.style, &asking.wanted.path, carried.by.rig().fps, scale) {
        notes.push(itself(&format_args!(
            "{name} in the style {style} is slower than the path"
        )));
        return Ok(None);
    }
    let message = format!("the path is planned by {name} in its style {style}");
    notes.push(Note::info("planner", message));
    Ok(Some(carried))
}

/// Why no pack plans a path that another pack must plan.
fn refused(error: &NoCarrier) -> Fault {
    let allowed = match error {
        NoCarrier::NoStyle { pack, styles, .. } => {
            format!("own, auto; or a style of {pack}: {}", styles.join(", "))
        }
        NoCarrier::NoPack | NoCarrier::Apart { .. } => "own, auto".to_owned(),
    };
    Fault::option(PLANNER, format!("is carried, and {error}"), allowed)
}

fn itself(why: &dyn std::fmt::Display) -> Note {
    Note::info("planner", format!("the model plans the path itself: {why}"))
}

/// Why no other pack plans.
enum NotCarried {
    /// None can for the model's body.
    None(NoCarrier),
    /// None can for the body of the request.
    Fault(Fault),
}

/// The other pack, and the size of the answer's body by that of the pack's.
fn find(asking: &Asking<'_>, space: &Space, among: Among) -> Result<(Carried, f32), NotCarried> {
    let model = asking.model;
    let of = (&*model.loaded, model.place);
    let skeletons = space.store.skeletons();
    let carrier = skeletons.carrier(of, asking.word, &space.packs.table(), among);
    let carrier = carrier.map_err(NotCarried::None)?;
    let by = Model {
        id: carrier.loaded.pack.name().to_owned(),
        loaded: carrier.loaded,
        place: 0,
    };
    let worn = match &asking.joints.worn {
        None => carrier.worn,
        // A body of the caller's own.
        Some(_) => Some(worn(&asking.joints.rest, &by, space).map_err(NotCarried::Fault)?),
    };
    let scale = worn.as_ref().map_or(1.0, |worn| worn.scale());
    let style = carrier.style;
    Ok((Carried { by, style, worn }, scale))
}
