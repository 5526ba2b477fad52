//! The commands of a character.

use godot::prelude::*;
use troupe_client::{Act, LivePath, Locomotion, Performance};

use super::character::{TroupeCharacter, heading};
use crate::axes;
use crate::convert::vec3;
use crate::link::Order;

/// A text, if there is one.
fn given(text: &GString) -> Option<String> {
    Some(text.to_string()).filter(|text| !text.is_empty())
}

#[godot_api(secondary)]
impl TroupeCharacter {
    /// Moves over the ground with this velocity in metres a second, and faces a direction. Without
    /// one the character faces where it goes. A velocity of zero: it stands.
    #[func]
    fn walk(&mut self, velocity: Vector3, #[opt(default = Vector3::ZERO)] facing: Vector3) {
        let locomotion = Locomotion {
            velocity: axes::position(vec3(velocity)),
            facing: heading(facing),
            style: given(&self.style),
            ..Locomotion::default()
        };
        self.order(Order::Move(locomotion));
    }

    /// Stands.
    #[func]
    fn stand(&mut self) {
        self.walk(Vector3::ZERO, Vector3::ZERO);
    }

    /// Goes to a place, and stands there. A speed of zero is the style's. `arrived` follows.
    #[func]
    fn walk_to(&mut self, place: Vector3, #[opt(default = 0.0)] speed: f32) {
        let path = LivePath::through([self.place(), self.to_server(place)]);
        self.follow(path, speed);
    }

    /// Goes along a path of 2 to 1024 points, and stands at its end. A speed of zero is the
    /// style's. A path that is looped goes on from its last point to the first, for ever.
    #[func]
    fn follow_path(
        &mut self,
        points: PackedVector3Array,
        #[opt(default = 0.0)] speed: f32,
        #[opt(default = false)] looped: bool,
    ) {
        let places = points.as_slice().iter().map(|&point| self.to_server(point));
        let path = LivePath {
            is_loop: looped,
            ..LivePath::through(places)
        };
        self.follow(path, speed);
    }

    /// Acts out a sentence, and goes on as before. Zero seconds: the model decides. `performing`
    /// and `performed` follow.
    #[func]
    fn perform(&mut self, sentence: GString, #[opt(default = 0.0)] seconds: f32) {
        let performance = Performance {
            seconds: Some(seconds).filter(|&seconds| seconds != 0.0),
            ..Performance::of(sentence.to_string())
        };
        self.order(Order::Act(performance.into()));
    }

    /// Does a skill of the pack where it stands, such as jumping.
    #[func]
    fn use_skill(&mut self, skill: GString, #[opt(default = "")] variant: GString) {
        self.order(Order::Act(Act::Skill {
            name: skill.to_string(),
            variant: given(&variant),
        }));
    }

    /// Goes to an object of its scene and uses it.
    #[func]
    fn interact(
        &mut self,
        object: GString,
        #[opt(default = "")] variant: GString,
        #[opt(default = "")] approach: GString,
    ) {
        self.order(Order::Act(Act::Interact {
            instance: object.to_string(),
            variant: given(&variant),
            approach: given(&approach),
        }));
    }

    /// Leaves an object or a skill that is held, such as a chair.
    #[func]
    fn end_interaction(&mut self) {
        self.order(Order::Act(Act::EndInteraction));
    }

    /// Puts down the object in the hand.
    #[func]
    fn drop_object(&mut self) {
        self.order(Order::Act(Act::Drop));
    }

    /// Stops everything at once, and stands.
    #[func]
    fn cancel(&mut self) {
        self.order(Order::Act(Act::Cancel));
    }

    fn follow(&mut self, mut path: LivePath, speed: f32) {
        path.speed = Some(speed).filter(|&speed| speed != 0.0);
        path.style = given(&self.style);
        self.order(Order::Act(path.into()));
    }
}
