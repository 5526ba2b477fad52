//! Standing up from a low pose that an interaction left, before anything else happens.

use troupe_motion::Vec3;
use troupe_motion::fk::joint_transform;
use troupe_motion::ik::Posed;
use troupe_motion::rotation::yaw;
use troupe_motion::stance::stance_transition;

use super::super::buffer::Frames;
use super::{Behaviour, CharacterParts, Doing};
use crate::primitives::object::recipe::LOW_STANCE;
use crate::scene::ScaledScene;

impl Behaviour {
    /// Whether the character is standing up or must stand up. After that its locomotion goes on.
    pub(super) fn settle_rise(
        &mut self,
        scene: &ScaledScene,
        frame: i64,
        parts: &mut CharacterParts<'_>,
    ) -> bool {
        let splice = frame + parts.timeline.look_ahead();
        if let Some(until) = self.gets_up_until {
            if splice < until {
                return true;
            }
            self.gets_up_until = None;
            let command = parts.locomotion.command().clone();
            parts.move_on(frame, command, false);
            return false;
        }
        let on_foot = match &self.doing {
            Doing::Locomotion => true,
            Doing::Using(using) => using.approaches(),
            Doing::Falling(_) => false,
        };
        // Locomotion would go on from there.
        let next = parts.timeline.soonest(frame);
        if !on_foot || !std::mem::take(&mut self.left_off) || !(parts.is_low(splice) || parts.is_low(next)) {
            return false;
        }
        parts.timeline.forget_flight();
        parts.post.carry.due(splice);
        let upright = parts.get_up(splice);
        parts.renew_footing(splice, scene);
        self.gets_up_until = Some(upright);
        true
    }
}

impl CharacterParts<'_> {
    /// Whether the hips are lower than the networks know and than the style has them.
    fn is_low(&self, frame: i64) -> bool {
        let style = &self.locomotion.command().style;
        let (hips, low) = (self.timeline.buffer().root(frame).y, self.rig.low_hips_m);
        hips < low && style.idle().height_m > low
    }

    /// Writes the way up from frame `splice` on. Returns the frame at which the character is
    /// upright.
    fn get_up(&mut self, splice: i64) -> i64 {
        let skeleton = &self.rig.skeleton;
        let idle = self.locomotion.command().style.idle();
        let root = self.root(splice);
        let mut rotations = idle.rotations.clone();
        if let Some(pelvis) = rotations.first_mut() {
            *pelvis = (yaw(root.heading) * *pelvis).normalize();
        }
        let legs = self.post.footing.legs();
        let feet = |posed: Posed<'_>| {
            let places = legs
                .iter()
                .map(|leg| joint_transform(skeleton, posed.root, posed.rotations, leg.foot).0);
            places.sum::<Vec3>() / legs.len().max(1) as f32
        };
        let from = self.flat(splice);
        // It stands where its feet are.
        let place = root.position.with_y(idle.height_m);
        let over = Posed {
            root: place,
            rotations: &rotations,
        };
        let to = Posed {
            root: place + (feet(from) - feet(over)).with_y(0.0),
            rotations: &rotations,
        };
        let (count, lean) = LOW_STANCE;
        let motion = stance_transition(skeleton, legs, from, to, count as usize, lean);
        let frames = Frames {
            roots: &motion.roots,
            rotations: &motion.rotations,
            contacts: &motion.contacts,
        };
        self.timeline.put(splice, frames, true);
        let upright = self.timeline.buffer().last();
        self.hold(upright);
        upright
    }
}
