//! A definition in the metres of a character of any size.

use super::{Definition, Hold, Keyframe, Motion, Origin, Set};

impl Definition {
    /// The definition for a character whose metre has `scale` metres of the scene, above 0.
    ///
    /// What is about the object comes into the character's metres: the pivot, where approaches
    /// start, sockets, and the keyframes of sets whose origin is the object. Two things are about
    /// the character's own body and stay: sets whose origin is the character, and the height of a
    /// standing body over the ground. Low hips rest on the object, so their height is the object's,
    /// and a whole pose bends its legs to suit ([`Keyframe::pose_scale`]).
    ///
    /// Shape, body, rule of release and text stay in metres of the scene: only the scene needs
    /// them.
    #[must_use]
    pub fn scaled(&self, scale: f32) -> Self {
        let mut scaled = self.clone();
        scaled.middle_m /= scale;
        scaled.pivot_m /= scale;
        for distance_m in (scaled.approaches.iter_mut()).filter_map(|approach| approach.distance_m.as_mut()) {
            *distance_m /= scale;
        }
        for socket in &mut scaled.sockets {
            socket.position_m /= scale;
        }
        for (index, set) in scaled.sets.iter_mut().enumerate() {
            if set.is_low() || self.begins_low(index) {
                // As it would be for the body that it was written for. Heights no longer show that.
                set.motion.get_or_insert(Motion::Stance);
            }
            if set.origin == Origin::Object {
                let low_hips_m = set.low_hips_m;
                (set.keyframes.iter_mut()).for_each(|key| key.scale(scale, low_hips_m));
            }
        }
        scaled
    }

    /// Whether the hips are low when the set of this index begins.
    fn begins_low(&self, index: usize) -> bool {
        let is_low = |set: &usize| self.sets.get(*set).is_some_and(Set::is_low);
        let is_held = |set: &usize| (self.sets.get(*set)).is_some_and(|set| set.hold == Hold::UntilEnded);
        self.variants.iter().any(|variant| {
            let mut ways = [&variant.entry, &variant.exit].into_iter();
            let follows = ways.any(|way| way.windows(2).any(|two| two[1] == index && is_low(&two[0])));
            let mut held = variant.entry.iter().filter(|set| is_held(set));
            follows || (variant.exit.first() == Some(&index) && held.any(is_low))
        })
    }
}

impl Set {
    /// Whether a keyframe has the hips low over the ground.
    fn is_low(&self) -> bool {
        let mut over_ground = self.keyframes.iter().filter(|key| key.from_ground);
        over_ground.any(|key| key.height_m.is_some_and(|height| height < self.low_hips_m))
    }

    /// Whether hips rest on the object at a keyframe, in a definition for any size.
    pub(crate) fn rests(&self) -> bool {
        let rests = |key: &Keyframe| key.pose_scale.is_some() || key.resting_m(self.low_hips_m).is_some();
        self.origin == Origin::Object && self.keyframes.iter().any(rests)
    }
}

impl Keyframe {
    /// The height of hips that rest on the object, if it is written in metres of the scene.
    fn resting_m(&self, low_hips_m: f32) -> Option<f32> {
        let stands = |height: f32| self.from_ground && height >= low_hips_m;
        self.height_m.filter(|&height| !stands(height))
    }

    fn scale(&mut self, scale: f32, low_hips_m: f32) {
        self.place_m = self.place_m.map(|place| place.map(|along| along / scale));
        for point in &mut self.points {
            point.position_m /= scale;
        }
        if let Some(height) = self.resting_m(low_hips_m) {
            self.height_m = Some(height / scale);
            self.pose_scale = Some(scale);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::definition;
    use super::*;
    use troupe_motion::Vec3;

    #[test]
    fn lengths_of_the_object_are_scaled_and_those_of_the_body_stay() {
        let cup = definition();
        let own = cup.scaled(2.0);
        assert_eq!(own.pivot_m, Vec3::new(0.0, 0.025, 0.0));
        assert_eq!(own.middle_m, Vec3::new(0.0, 0.025, 0.0));
        assert_eq!(own.approaches[0].distance_m, Some(0.45));
        assert_eq!(own.sockets[0].position_m, Vec3::new(0.0, -0.05, 0.01));
        let reach = &own.set("reach").unwrap().keyframes[0];
        assert_eq!(reach.place_m, Some([0.0, 0.225]));
        assert_eq!(reach.points[0].position_m, Vec3::new(0.0, 0.06, 0.025));
        assert_eq!((reach.height_m, reach.pose_scale), (Some(0.8), None), "it stands");
        for set in ["grab", "put-down"] {
            assert_eq!(own.set(set), cup.set(set), "relative to the character");
        }
        let same = cup.scaled(1.0);
        assert_eq!((same.pivot_m, same.approaches), (cup.pivot_m, cup.approaches));
    }

    #[test]
    fn hips_that_are_low_as_written_need_no_networks() {
        let mut seat = definition();
        let is_low = |set: &str, seat: &Definition| seat.set(set).unwrap().motion;
        assert_eq!(is_low("reach", &seat.scaled(0.5)), None);
        // The variant "slow" goes from "reach" to "lift", and its exit is "put-down".
        for (set, height) in [(0, 0.9), (1, 0.5)] {
            seat.sets[set].keyframes[0].height_m = Some(height);
        }
        seat.sets[3].motion = None;
        let small = seat.scaled(0.5);
        assert_eq!(small.set("lift").unwrap().keyframes[0].height_m, Some(1.0));
        assert_eq!(small.set("lift").unwrap().keyframes[0].pose_scale, Some(0.5));
        for (set, motion) in [
            ("reach", None),
            ("lift", Some(Motion::Stance)),
            ("put-down", Some(Motion::Stance)),
        ] {
            assert_eq!(is_low(set, &small), motion, "{set}");
        }
    }
}
