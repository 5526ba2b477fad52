//! Paths that another pack plans: for bodies on two legs of packs whose network takes paths.

use std::sync::Arc;

use troupe_base::offload::offload;
use troupe_character::{FieldError, Path};
use troupe_live::packs::LoadedPack;
use troupe_live::skeleton::{Among, Carrier, NoCarrier};
use troupe_motion::model::{Capability, Rig};
use troupe_proto::v1;
use troupe_proto::v1::generate_request::Goal;

use crate::generate::Planned;
use crate::{Service, ServiceError};

/// The way on if no other pack plans a path.
const WAY_ON: &str = "or planner PATH_PLANNER_OWN";

/// Who plans what a request asks for.
pub(crate) enum Planning {
    /// The pack itself, with a note if it is not the pack that was to plan.
    Own(Option<String>),
    /// Another pack.
    Carried(Box<Planned>),
}

impl Service {
    /// Has another pack plan the path of a request, as far as its planner asks for that.
    ///
    /// # Errors
    /// [`ServiceError`] for a planner that the pack does not take; for PATH_PLANNER_CARRIED if no
    /// pack can do it; and for strict requests whose path the other pack finds not feasible.
    pub(crate) async fn carried(
        &self,
        request: &v1::GenerateRequest,
        loaded: &LoadedPack,
    ) -> Result<Planning, ServiceError> {
        let Some(Goal::Path(goal)) = &request.goal else {
            return Ok(Planning::Own(None));
        };
        let follows = loaded.pack.manifest.capabilities.has(Capability::Path);
        let must = match planner(goal)? {
            v1::PathPlanner::Carried if follows => true,
            v1::PathPlanner::Carried => return Err(plans_itself(loaded).into()),
            v1::PathPlanner::Auto if follows && goal.skeleton.is_none() => false,
            v1::PathPlanner::Auto | v1::PathPlanner::Own => return Ok(Planning::Own(None)),
        };
        let itself = |why: &dyn std::fmt::Display| {
            let pack = &loaded.pack;
            let note = format!(
                "planned by {} {} itself: {why}",
                pack.name(),
                pack.manifest.version
            );
            Ok(Planning::Own(Some(note)))
        };
        let Ok(place) = loaded.place_of("path.body", &goal.body) else {
            // The pack itself refuses it.
            return Ok(Planning::Own(None));
        };
        let among = if must { Among::All } else { Among::Better };
        let carrier = match self.carrier(goal, (loaded, place), among).await? {
            Ok(carrier) => carrier,
            Err(error) if must => return Err(refused(&error).into()),
            Err(error @ NoCarrier::NoStyle { .. }) => return itself(&error),
            // Nothing could have been asked for otherwise.
            Err(NoCarrier::NoPack | NoCarrier::Apart { .. }) => return Ok(Planning::Own(None)),
        };
        match self.carry(request, goal, &carrier, loaded.rig(place)).await {
            Ok(planned) if must || !planned.falls_behind() => Ok(Planning::Carried(Box::new(planned))),
            Ok(_) => itself(&format_args!(
                "{} in the style {} is slower than the path",
                carrier.loaded.pack.name(),
                carrier.style.name
            )),
            Err(ServiceError::Field(error)) if must => Err(with_way_on(error).into()),
            Err(error @ (ServiceError::Field(_) | ServiceError::Skeleton(_))) if !must => itself(&error),
            Err(error) => Err(error),
        }
    }

    /// The pack that plans for the body of a path. The first call for a body takes milliseconds, in
    /// the pool for blocking work.
    async fn carrier(
        &self,
        goal: &v1::PathGoal,
        (loaded, place): (&LoadedPack, usize),
        among: Among,
    ) -> Result<Result<Carrier, NoCarrier>, ServiceError> {
        let word = goal.style.first().map(|style| style.word.clone());
        let (space, pack) = (self.space()?.clone(), loaded.pack.name().to_owned());
        let found = offload(usize::MAX, 0, move || {
            let table = space.packs.table();
            let loaded = table.find("pack", &pack)?;
            let of = (&**loaded, place);
            let skeletons = space.store.skeletons();
            Ok::<_, ServiceError>(skeletons.carrier(of, word.as_deref(), &table, among))
        });
        found.await?
    }

    /// A request as `carrier` plans it, whose answer is on the body that was asked for.
    async fn carry(
        &self,
        request: &v1::GenerateRequest,
        goal: &v1::PathGoal,
        carrier: &Carrier,
        body: &Arc<Rig>,
    ) -> Result<Planned, ServiceError> {
        if goal.skeleton.is_some() {
            return Err(inline_skeleton().into());
        }
        let request = v1::GenerateRequest {
            pack: carrier.loaded.pack.name().to_owned(),
            goal: Some(Goal::Path(for_carrier(goal, &carrier.style.name))),
            ..request.clone()
        };
        let on = match request.skeleton.is_empty() {
            true => carrier.worn.clone().map(|worn| (worn, Some(body.clone()))),
            false => {
                let worn = self.worn(&request.skeleton, (&carrier.loaded, 0)).await?;
                worn.map(|worn| (worn, None))
            }
        };
        let pack = &carrier.loaded.pack;
        let mut note = format!(
            "planned by {} {} in its style {}",
            pack.name(),
            pack.manifest.version,
            carrier.style.name
        );
        if let Some((worn, _)) = &on {
            note.push_str(", and carried over to ");
            note.push_str(worn.name());
        }
        let mut planned = self.planned(request, (&carrier.loaded, 0), on).await?;
        planned.add_note(note);
        Ok(planned)
    }
}

/// The path as a pack of one skeleton takes it.
fn for_carrier(goal: &v1::PathGoal, style: &str) -> v1::PathGoal {
    let mut goal = v1::PathGoal {
        body: String::new(),
        planner: v1::PathPlanner::Auto.into(),
        ..goal.clone()
    };
    if let Some(first) = goal.style.first_mut() {
        style.clone_into(&mut first.word);
    }
    goal
}

fn planner(goal: &v1::PathGoal) -> Result<v1::PathPlanner, FieldError> {
    v1::PathPlanner::try_from(goal.planner).map_err(|_| {
        Path::root().field("path").field("planner").error(
            format!("is {}", goal.planner),
            "PATH_PLANNER_AUTO (0), PATH_PLANNER_OWN (1) or PATH_PLANNER_CARRIED (2)",
        )
    })
}

fn plans_itself(loaded: &LoadedPack) -> FieldError {
    Path::root().field("path").field("planner").error(
        "is PATH_PLANNER_CARRIED",
        format!(
            "PATH_PLANNER_AUTO or PATH_PLANNER_OWN: the pack {} plans its paths itself",
            loaded.pack.name()
        ),
    )
}

fn inline_skeleton() -> FieldError {
    Path::root().field("path").field("skeleton").error(
        "is given, and no other pack plans for it",
        "a body of the pack, or the name of an uploaded skeleton in the request's `skeleton`",
    )
}

/// Why no pack can plan a path that another pack must plan.
fn refused(error: &NoCarrier) -> FieldError {
    let path = Path::root();
    let path = path.field("path");
    match error {
        NoCarrier::NoStyle { word, pack, styles } => path.element("style", 0).field("word").error(
            format!("is {word:?}, and no pack that walks has this style"),
            format!("a style of {pack}: {}; {WAY_ON}", styles.join(", ")),
        ),
        NoCarrier::NoPack => path.field("planner").error(
            format!("is PATH_PLANNER_CARRIED, and {error}"),
            "PATH_PLANNER_OWN; or a server with a pack that walks, such as human",
        ),
        NoCarrier::Apart { .. } => path.field("planner").error(
            format!("is PATH_PLANNER_CARRIED, and {error}"),
            "PATH_PLANNER_OWN; or a body on two legs",
        ),
    }
}

fn with_way_on(error: FieldError) -> FieldError {
    FieldError {
        allowed: format!("{}; {WAY_ON}", error.allowed),
        ..error
    }
}

#[cfg(test)]
#[path = "carried_tests.rs"]
mod tests;
