//! The clock of characters in this process: it advances them frame by frame, and has their plans
//! made in batches.

use anyhow::{Context as _, ensure};
use troupe_character::live::{
    Advance, Character, Clock, LivePlan, PlanFailed, PlanRequest, SUB_FRAMES, finish_live, hold_plan,
};
use troupe_engine::Pipeline;
use troupe_motion::model::Rig;

/// What became of a request for a plan.
pub(super) type Planned = Result<LivePlan, PlanFailed>;

/// Makes plans.
pub(super) trait Planner {
    /// One plan for each request, in their order.
    fn plan(&mut self, asked: &[PlanRequest]) -> anyhow::Result<Vec<Planned>>;
}

/// What the clock needs of the owner of a character.
pub(super) trait HasCharacter {
    /// The character that advances.
    fn character(&mut self) -> &mut Character;

    /// Sees each plan before the character gets it.
    fn planned(&mut self, _request: &PlanRequest, _plan: &Planned) {}
}

/// Advances every character by a frame, and makes the plans that they wait for.
pub(super) fn tick<O: HasCharacter>(owners: &mut [O], planner: &mut impl Planner) -> anyhow::Result<()> {
    let mut behind: Vec<usize> = Vec::new();
    for (index, owner) in owners.iter_mut().enumerate() {
        if owner.character().advance(SUB_FRAMES, Clock::Waits) == Advance::NeedsPlan {
            behind.push(index);
        }
    }
    loop {
        let mut whose = Vec::new();
        let mut asked = Vec::new();
        for (index, owner) in owners.iter_mut().enumerate() {
            if let Some(request) = owner.character().take_request() {
                whose.push(index);
                asked.push(request);
            }
        }
        if asked.is_empty() {
            ensure!(
                behind.is_empty(),
                "a character waits for a plan but has not requested one"
            );
            return Ok(());
        }
        let plans = planner.plan(&asked)?;
        for ((index, request), plan) in whose.into_iter().zip(asked).zip(plans) {
            let owner = &mut owners[index];
            owner.planned(&request, &plan);
            owner.character().plan_arrived(request.number, plan);
        }
        behind.retain(|&index| owners[index].character().advance(0, Clock::Waits) == Advance::NeedsPlan);
    }
}

/// Plans by keyframes, made by the networks of MotionBricks.
pub(super) struct KeyframePlanner<'a> {
    pub(super) pipeline: &'a mut Pipeline,
    pub(super) rig: &'a Rig,
    /// Whether feet that stand are held in plans without targets, as a server does.
    pub(super) holds_feet: bool,
}

impl Planner for KeyframePlanner<'_> {
    fn plan(&mut self, asked: &[PlanRequest]) -> anyhow::Result<Vec<Planned>> {
        let mut plans = Vec::with_capacity(asked.len());
        for some in asked.chunks(self.pipeline.max_batch()) {
            let items: Vec<_> = some
                .iter()
                .filter_map(|request| request.item.keyframes().cloned())
                .collect();
            ensure!(items.len() == some.len(), "the pack plans by paths");
            let (answers, _) = self.pipeline.run(&items).context("the networks failed")?;
            for (request, answer) in some.iter().zip(answers) {
                let plan = answer
                    .map_err(|_| PlanFailed)
                    .and_then(|raw| finish_live(&raw, &request.shape, self.rig).map_err(|_| PlanFailed));
                plans.push(plan.map(|plan| self.finish(request, plan)));
            }
        }
        Ok(plans)
    }
}

impl KeyframePlanner<'_> {
    fn finish(&self, request: &PlanRequest, mut plan: LivePlan) -> LivePlan {
        match &request.pins {
            Some(pins) => pins.pin_to_targets(&mut plan, &self.rig.skeleton),
            None if self.holds_feet => hold_plan(self.rig, &mut plan),
            None => {}
        }
        plan
    }
}
