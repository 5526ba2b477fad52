//! A scene and its changes.

use std::collections::HashMap;
use std::sync::Arc;

use parry3d::partitioning::Bvh;

use super::collider::{Colliders, Placed};
use super::error::{self, SceneError};
use super::{Body, Collider, Holder, Instance, MAX_COORDINATE_M, MAX_INSTANCES, State, Transform};

/// Rough memory of a scene, bytes: of its own, and for each instance.
const SCENE_BYTES: usize = 4096;
const INSTANCE_BYTES: usize = 1024;

/// Ground, colliders and objects that characters share. A copy shares everything that does not
/// change later, so it is cheap.
#[derive(Debug, Clone, Default)]
pub struct Scene {
    ground_y_m: f32,
    pub(super) colliders: Arc<Colliders>,
    /// Indices into this list are the leaves of the two trees.
    slots: Vec<Option<Arc<Instance>>>,
    free: Vec<u32>,
    by_id: Arc<HashMap<Arc<str>, u32>>,
    /// Trigger volumes of the placed instances.
    pub(super) triggers: Bvh,
    /// Bodies of the solid placed instances.
    pub(super) solids: Bvh,
    revision: u64,
}

impl Scene {
    /// An empty scene with its ground at height `ground_y_m`.
    ///
    /// # Errors
    /// [`SceneError::Value`] for a height that is not finite, or too far from 0.
    pub fn new(ground_y_m: f32) -> Result<Self, SceneError> {
        let mut scene = Self::default();
        scene.set_ground(ground_y_m)?;
        Ok(scene)
    }

    /// Height of the ground plane, metres.
    pub fn ground_y_m(&self) -> f32 {
        self.ground_y_m
    }

    /// Grows with every change.
    pub fn revision(&self) -> u64 {
        self.revision
    }

    /// Number of instances, held ones too.
    pub fn len(&self) -> usize {
        self.by_id.len()
    }

    /// Whether there are no instances.
    pub fn is_empty(&self) -> bool {
        self.by_id.is_empty()
    }

    /// The static colliders as they were given, in that order.
    pub fn colliders(&self) -> impl ExactSizeIterator<Item = &Arc<Collider>> {
        self.colliders.list.iter().map(|placed| &placed.source)
    }

    /// Total number of samples of all heightfields.
    pub fn height_samples(&self) -> usize {
        self.colliders.samples()
    }

    /// A rough measure of its memory, bytes.
    pub fn bytes(&self) -> usize {
        SCENE_BYTES + self.colliders.bytes() + self.len() * INSTANCE_BYTES
    }

    /// All instances, in no particular order.
    pub fn instances(&self) -> impl Iterator<Item = &Arc<Instance>> {
        self.slots.iter().flatten()
    }

    /// The instance of this id.
    pub fn instance(&self, id: &str) -> Option<&Arc<Instance>> {
        self.at_slot(*self.by_id.get(id)?)
    }

    #[inline]
    pub(super) fn at_slot(&self, slot: u32) -> Option<&Arc<Instance>> {
        self.slots.get(slot as usize)?.as_ref()
    }

    /// Whether it has objects of this definition, held ones included.
    pub fn uses(&self, definition: &str) -> bool {
        self.instances().any(|instance| &*instance.object == definition)
    }

    /// Moves the ground plane.
    ///
    /// # Errors
    /// [`SceneError::Value`] for a height that is not finite, or too far from 0.
    pub fn set_ground(&mut self, ground_y_m: f32) -> Result<(), SceneError> {
        let limit = MAX_COORDINATE_M;
        if !(-limit..=limit).contains(&ground_y_m) {
            let allowed = format!("-{limit} to {limit} m");
            return Err(SceneError::value(
                "the ground height",
                ground_y_m.to_string(),
                allowed,
            ));
        }
        self.ground_y_m = ground_y_m;
        self.revision += 1;
        Ok(())
    }

    /// Replaces all static colliders.
    ///
    /// # Errors
    /// [`SceneError`] for the first that cannot be used; then nothing has changed.
    pub fn set_colliders(&mut self, colliders: &[Collider]) -> Result<(), SceneError> {
        self.set_colliders_each(colliders).map_err(|(_, error)| error)
    }

    /// [`Scene::set_colliders`], whose error comes with the index of the collider at fault, if it
    /// is a single one.
    pub fn set_colliders_each(&mut self, colliders: &[Collider]) -> Result<(), (Option<usize>, SceneError)> {
        self.place_colliders(Colliders::prepare(colliders)?);
        Ok(())
    }

    /// Replaces all static colliders by ones that were checked, singly and together.
    pub(super) fn place_colliders(&mut self, colliders: Vec<Placed>) {
        self.colliders = Arc::new(Colliders::new(colliders));
        self.revision += 1;
    }

    /// Places an object. `id` is its own, `object` the name of its definition, `body` that
    /// definition's.
    ///
    /// # Errors
    /// [`SceneError::Exists`], [`SceneError::Full`], or [`SceneError::Value`] for an id or
    /// transform that is not accepted.
    pub fn add(
        &mut self,
        id: &str,
        object: &str,
        body: Arc<Body>,
        transform: Transform,
    ) -> Result<(), SceneError> {
        error::id("the id of an object", id)?;
        error::id("the name of an object's definition", object)?;
        let transform = transform.checked("the transform of an object")?;
        if self.by_id.contains_key(id) {
            return Err(SceneError::Exists {
                what: "an object",
                id: id.to_owned(),
            });
        }
        if self.len() >= MAX_INSTANCES {
            return Err(SceneError::Full {
                what: "objects",
                limit: MAX_INSTANCES,
            });
        }
        self.revision += 1;
        let instance = Arc::new(Instance {
            id: Arc::from(id),
            object: Arc::from(object),
            body,
            transform,
            state: State::Free,
            revision: self.revision,
        });
        let slot = self.free.pop().unwrap_or_else(|| {
            self.slots.push(None);
            (self.slots.len() - 1) as u32
        });
        Arc::make_mut(&mut self.by_id).insert(Arc::clone(&instance.id), slot);
        self.put(slot, instance);
        Ok(())
    }

    /// Removes an object, even if somebody has it. Returns its last state.
    ///
    /// # Errors
    /// [`SceneError::Unknown`] if it does not exist.
    pub fn remove(&mut self, id: &str) -> Result<Arc<Instance>, SceneError> {
        let (slot, instance) = self.find(id)?;
        Arc::make_mut(&mut self.by_id).remove(id);
        self.slots[slot as usize] = None;
        self.free.push(slot);
        self.triggers.remove(slot);
        self.solids.remove(slot);
        self.revision += 1;
        Ok(instance)
    }

    /// Moves an object with its trigger volume, reserved or not.
    ///
    /// # Errors
    /// [`SceneError::Unknown`], [`SceneError::MoveHeld`], or [`SceneError::Value`] for a transform
    /// that is not accepted.
    pub fn move_to(&mut self, id: &str, transform: Transform) -> Result<(), SceneError> {
        let transform = transform.checked("the transform of an object")?;
        let (slot, instance) = self.find(id)?;
        if let State::Held(by) = &instance.state {
            return Err(SceneError::MoveHeld {
                id: id.to_owned(),
                by: by.clone(),
            });
        }
        self.change(slot, &instance, |changed| changed.transform = transform);
        Ok(())
    }

    /// Gives every instance of definition `object` a new body, after the definition was replaced.
    /// Returns their number.
    pub fn replace_body(&mut self, object: &str, body: &Arc<Body>) -> usize {
        let of_object = |instance: &Arc<Instance>| &*instance.object == object;
        let slots: Vec<u32> = (0..self.slots.len() as u32)
            .filter(|&slot| self.at_slot(slot).is_some_and(of_object))
            .collect();
        for &slot in &slots {
            if let Some(instance) = self.at_slot(slot).cloned() {
                self.change(slot, &instance, |changed| changed.body = Arc::clone(body));
            }
        }
        slots.len()
    }

    /// Reserves an object for `by`. Reserving again changes nothing. A shared object stays free,
    /// and one that `by` holds stays held.
    ///
    /// # Errors
    /// [`SceneError::Unknown`] or [`SceneError::Taken`].
    pub fn reserve(&mut self, id: &str, by: &Holder) -> Result<(), SceneError> {
        let (slot, instance) = self.own(id, by)?;
        if instance.state == State::Free && !instance.body.shared {
            self.set_state(slot, &instance, State::Reserved(by.clone()));
        }
        Ok(())
    }

    /// Puts an object into the hand of `by`: from now on it is not in the scene.
    ///
    /// # Errors
    /// [`SceneError::Unknown`], [`SceneError::Taken`], or [`SceneError::Value`] for a shared
    /// object.
    pub fn hold(&mut self, id: &str, by: &Holder) -> Result<(), SceneError> {
        let (slot, instance) = self.own(id, by)?;
        if instance.body.shared {
            return Err(SceneError::value(
                format!("object {id:?}"),
                "shared",
                "an object that one character uses at a time, to be held",
            ));
        }
        if instance.is_placed() {
            self.set_state(slot, &instance, State::Held(by.clone()));
        }
        Ok(())
    }

    /// Puts an object that `by` holds back into the scene at `transform`, free.
    ///
    /// # Errors
    /// [`SceneError::Unknown`], [`SceneError::NotHeld`], or [`SceneError::Value`] for a transform
    /// that is not accepted.
    pub fn release(&mut self, id: &str, by: &Holder, transform: Transform) -> Result<(), SceneError> {
        let transform = transform.checked("the transform of an object")?;
        let (slot, instance) = self.find(id)?;
        if instance.state != State::Held(by.clone()) {
            return Err(SceneError::NotHeld {
                id: id.to_owned(),
                by: by.clone(),
            });
        }
        self.change(slot, &instance, |changed| {
            changed.transform = transform;
            changed.state = State::Free;
        });
        Ok(())
    }

    /// Ends a reservation of `by`. Answers whether there was one.
    pub fn unreserve(&mut self, id: &str, by: &Holder) -> bool {
        match self.find(id) {
            Ok((slot, instance)) if instance.state == State::Reserved(by.clone()) => {
                self.set_state(slot, &instance, State::Free);
                true
            }
            _ => false,
        }
    }

    /// The objects that `by` has reserved or holds.
    pub fn of_holder<'a>(&'a self, by: &'a Holder) -> impl Iterator<Item = &'a Arc<Instance>> {
        self.instances()
            .filter(move |instance| instance.state.holder() == Some(by))
    }

    /// Frees everything of the characters for which `gone` is true. What they held is back where it
    /// was taken. Returns the number of objects.
    pub fn free_all(&mut self, gone: impl Fn(&Holder) -> bool) -> usize {
        let taken = |instance: &Arc<Instance>| instance.state.holder().is_some_and(&gone);
        let slots: Vec<u32> = (0..self.slots.len() as u32)
            .filter(|&slot| self.at_slot(slot).is_some_and(taken))
            .collect();
        for &slot in &slots {
            if let Some(instance) = self.at_slot(slot).cloned() {
                self.set_state(slot, &instance, State::Free);
            }
        }
        slots.len()
    }

    /// Changes place or body of an object, if it exists.
    pub(super) fn change_instance(&mut self, id: &str, change: impl FnOnce(&mut Instance)) {
        if let Ok((slot, instance)) = self.find(id) {
            self.change(slot, &instance, change);
        }
    }

    /// Takes over ground and colliders of another scene.
    pub(super) fn take_ground_and_colliders(&mut self, other: &Self) {
        self.ground_y_m = other.ground_y_m;
        self.colliders = Arc::clone(&other.colliders);
        self.revision += 1;
    }

    fn find(&self, id: &str) -> Result<(u32, Arc<Instance>), SceneError> {
        let unknown = || SceneError::Unknown {
            what: "object",
            id: id.to_owned(),
        };
        let slot = *self.by_id.get(id).ok_or_else(unknown)?;
        let instance = self.at_slot(slot).ok_or_else(unknown)?;
        Ok((slot, Arc::clone(instance)))
    }

    /// As [`Self::find`], for an object that no holder but `by` has.
    fn own(&self, id: &str, by: &Holder) -> Result<(u32, Arc<Instance>), SceneError> {
        let (slot, instance) = self.find(id)?;
        match instance.state.holder() {
            Some(other) if other != by => Err(SceneError::Taken {
                id: id.to_owned(),
                by: other.clone(),
            }),
            _ => Ok((slot, instance)),
        }
    }

    fn set_state(&mut self, slot: u32, instance: &Arc<Instance>, state: State) {
        let mut changed = Instance::clone(instance);
        changed.state = state;
        self.revision += 1;
        self.put(slot, Arc::new(changed));
    }

    /// Changes place or body of an instance.
    fn change(&mut self, slot: u32, instance: &Arc<Instance>, change: impl FnOnce(&mut Instance)) {
        let mut changed = Instance::clone(instance);
        change(&mut changed);
        self.revision += 1;
        changed.revision = self.revision;
        self.put(slot, Arc::new(changed));
    }

    /// Puts an instance into its slot, and updates its leaves in the trees.
    fn put(&mut self, slot: u32, instance: Arc<Instance>) {
        let Instance { body, transform, .. } = &*instance;
        let placed = instance.is_placed();
        for (tree, volume, is_in) in [
            (&mut self.triggers, &body.trigger, placed),
            (&mut self.solids, &body.volume, placed && body.solid),
        ] {
            if is_in {
                tree.reinsert_or_update_with_change_detection(volume.aabb(*transform), slot, 0.0);
            } else {
                tree.remove(slot);
            }
        }
        self.slots[slot as usize] = Some(instance);
    }
}
