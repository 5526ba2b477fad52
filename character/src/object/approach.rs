//! How a character approaches an object: from which side, and from how far.

use std::f32::consts::TAU;

use troupe_motion::root::wrap_angle;

use super::{Approach, Definition};

/// The approach that fits a side best.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Choice {
    /// Its index in the definition. `None`: the definition has none, and any side will do.
    pub index: Option<usize>,
    /// The side to come from: the wanted side, or the nearest that is allowed. Radians in (-π, π].
    pub side: f32,
    /// Angle between that and the wanted side, radians.
    pub off: f32,
    /// Where to start, metres from the pivot. `None`: where the character is.
    pub distance_m: Option<f32>,
}

impl Approach {
    /// The side in this range nearest to `side`, and the angle between them.
    fn nearest(&self, side: f32) -> (f32, f32) {
        let past_from = (side - self.from).rem_euclid(TAU);
        if past_from <= self.span {
            return (wrap_angle(side), 0.0);
        }
        let (past_end, before_from) = (past_from - self.span, TAU - past_from);
        match past_end <= before_from {
            true => (wrap_angle(self.from + self.span), past_end),
            false => (wrap_angle(self.from), before_from),
        }
    }
}

impl Definition {
    /// Index of the approach of this name.
    pub fn approach_named(&self, name: &str) -> Option<usize> {
        self.approaches.iter().position(|approach| approach.name == name)
    }

    /// The approach of this index, at its side nearest to `side`. With `None`, or an unknown index:
    /// as [`Definition::approach_from`].
    pub fn approach_by(&self, index: Option<usize>, side: f32) -> Choice {
        let Some((index, approach)) = index.and_then(|index| Some((index, self.approaches.get(index)?)))
        else {
            return self.approach_from(side);
        };
        let (nearest, off) = approach.nearest(side);
        Choice {
            index: Some(index),
            side: nearest,
            off,
            distance_m: approach.distance_m,
        }
    }

    /// The approach nearest to `side` (see [`Definition::side_of`]). Of two equally near, the
    /// first.
    pub fn approach_from(&self, side: f32) -> Choice {
        let mut best = None::<Choice>;
        for (index, approach) in self.approaches.iter().enumerate() {
            let (nearest, off) = approach.nearest(side);
            if best.is_none_or(|before| off < before.off) {
                best = Some(Choice {
                    index: Some(index),
                    side: nearest,
                    off,
                    distance_m: approach.distance_m,
                });
            }
        }
        best.unwrap_or(Choice {
            index: None,
            side: wrap_angle(side),
            off: 0.0,
            distance_m: None,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::super::testing::definition;
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn the_nearest_allowed_side_is_chosen() {
        let mut bench = definition();
        let approach = |name: &str, from: f32, to: f32, distance| Approach {
            name: name.to_owned(),
            from: from.to_radians(),
            span: (to - from).to_radians(),
            distance_m: distance,
        };
        bench.approaches = vec![
            approach("front", -45.0, 45.0, Some(0.7)),
            approach("back", 160.0, 200.0, None),
        ];
        for (side, index, want, off) in [
            (10.0, 0, 10.0, 0.0),
            (60.0, 0, 45.0, 15.0),
            (-100.0, 0, -45.0, 55.0),
            (150.0, 1, 160.0, 10.0),
            (-170.0, 1, -170.0, 0.0),
            (-150.0, 1, -160.0, 10.0),
        ] {
            let choice = bench.approach_from(f32::to_radians(side));
            assert_eq!(choice.index, Some(index), "{side}");
            assert_eq!(choice.distance_m.is_some(), index == 0);
            assert!(
                (choice.side.to_degrees() - want).abs() < 1e-3,
                "{side}: {choice:?}"
            );
            assert!((choice.off.to_degrees() - off).abs() < 1e-3, "{side}: {choice:?}");
        }
        bench.approaches.clear();
        let any = bench.approach_from(3.0);
        assert_eq!((any.index, any.side, any.off), (None, 3.0, 0.0));
    }

    proptest! {
        #[test]
        fn what_is_chosen_is_allowed(from in -6.0_f32..6.0, span in 0.0_f32..6.2, side in -10.0_f32..10.0) {
            let approach = Approach { name: "a".into(), from, span, distance_m: None };
            let (nearest, off) = approach.nearest(side);
            // At an end, rounding may fall to either side.
            let again = approach.nearest(nearest).1;
            prop_assert!(again < 1e-4 && (0.0..=std::f32::consts::PI + 1e-4).contains(&off));
            prop_assert!((wrap_angle(side - nearest).abs() - off).abs() < 1e-3);
        }
    }
}
