//! Whether one version of a pack can take the place of another.

use std::sync::Arc;

use troupe_engine::pack::Pack;
use troupe_motion::Skeleton;
use troupe_motion::model::{Capabilities, Rig};

use super::LoadedPack;

/// Offsets of the same joints differ by less, metres.
const SAME_M: f32 = 1e-3;

/// The bodies of a pack and the sizes of its plans, without its networks. Scenes, uploads, sessions
/// and the server's clients rely on them.
#[derive(Debug, Clone)]
pub struct Shape {
    name: String,
    family: String,
    capabilities: Capabilities,
    /// Names and rigs of the bodies. A pack with one skeleton has one entry without a name.
    bodies: Vec<(String, Arc<Rig>)>,
}

impl Shape {
    /// The shape of a pack.
    pub fn of(pack: &Pack) -> Self {
        let bodies = match pack.bodies.is_empty() {
            true => vec![(String::new(), pack.rig.clone())],
            false => {
                let bodies = pack.bodies.iter();
                bodies.map(|body| (body.name.clone(), body.rig.clone())).collect()
            }
        };
        Self {
            name: pack.name().to_owned(),
            family: pack.manifest.family.clone(),
            capabilities: pack.manifest.capabilities,
            bodies,
        }
    }

    /// The name of the pack.
    pub fn name(&self) -> &str {
        &self.name
    }

    /// What another pack of this name has otherwise, in words. None: sessions of one can go on with
    /// the other.
    pub fn difference(&self, other: &Pack) -> Option<String> {
        let theirs = Self::of(other);
        if self.family != theirs.family {
            return Some(format!("its family is {}, not {}", theirs.family, self.family));
        }
        let mut capabilities = self.capabilities.list();
        if let Some(lost) = capabilities.find(|able| !theirs.capabilities.has(*able)) {
            return Some(format!("it has no capability {lost}"));
        }
        let names = |shape: &Self| {
            let names: Vec<&str> = shape.bodies.iter().map(|(name, _)| name.as_str()).collect();
            names.join(", ")
        };
        let (own, new) = (names(self), names(&theirs));
        if own != new {
            return Some(format!("it has the bodies {new:?}, not {own:?}"));
        }
        let mut pairs = self.bodies.iter().zip(&theirs.bodies);
        pairs.find_map(|((_, own), (name, new))| {
            let of = if name.is_empty() {
                String::new()
            } else {
                format!(" of the body {name}")
            };
            rig_difference(own, new).map(|found| format!("{found}{of}"))
        })
    }
}

/// What is different about the second of two rigs.
fn rig_difference(own: &Rig, new: &Rig) -> Option<String> {
    if own.fps != new.fps {
        return Some(format!("it has {} frames a second, not {}", new.fps, own.fps));
    }
    if own.dims != new.dims {
        return Some("it has other sizes of segments or tokens".to_owned());
    }
    if own.by_path.is_some() != new.by_path.is_some() {
        return Some("its network does not take the same plans".to_owned());
    }
    let (a, b) = (&own.skeleton, &new.skeleton);
    if a.joint_count() != b.joint_count() {
        return Some(format!(
            "it has {} joints, not {}",
            b.joint_count(),
            a.joint_count()
        ));
    }
    let other = a
        .joints
        .iter()
        .zip(&b.joints)
        .enumerate()
        .find(|(index, (a, b))| {
            let is_moved = *index > 0 && a.offset_m.distance(b.offset_m) >= SAME_M;
            (&a.name, a.parent) != (&b.name, b.parent) || is_moved
        });
    if let Some((_, (own, _))) = other {
        return Some(format!("another joint has the place of {:?}", own.name));
    }
    let contacts = |skeleton: &Skeleton| {
        let contacts = skeleton.contacts.as_ref();
        contacts.map(|contacts| contacts.joints.clone())
    };
    let is_same =
        a.robot == b.robot && contacts(a) == contacts(b) && a.left_axis.distance(b.left_axis) < SAME_M;
    (!is_same).then(|| "it has other hinges, contacts or axes".to_owned())
}

impl LoadedPack {
    /// This pack, which takes the place of the version `before`: it has the styles of that one, so
    /// that whoever holds them sees its own styles too. Their shapes must be the same.
    pub(crate) fn after(&self, before: &Self) -> Self {
        for (table, newer) in before.styles.iter().zip(&self.styles) {
            table.renew(newer);
        }
        self.with_styles(before.styles.clone())
    }
}

#[cfg(test)]
mod tests {
    use troupe_character::testing::toy_rig;
    use troupe_engine::pack::testing::pack_of;

    use super::*;

    fn changed(change: impl FnOnce(&mut Rig)) -> Option<String> {
        let mut rig = toy_rig();
        change(&mut rig);
        Shape::of(&pack_of(toy_rig())).difference(&pack_of(rig))
    }

    #[test]
    fn the_same_shape_fits_and_others_say_why_not() {
        assert_eq!(changed(|_| {}), None);
        assert_eq!(changed(|rig| rig.limits = None), None, "limits may change");
        let why = |found: Option<String>, says: &str| {
            let found = found.unwrap_or_default();
            assert!(found.contains(says), "{found:?}, not {says:?}");
        };
        why(changed(|rig| rig.fps = 60.0), "60 frames a second");
        why(changed(|rig| rig.dims.max_tokens += 1), "sizes of segments");
        why(
            changed(|rig| Arc::make_mut(&mut rig.skeleton).joints[1].offset_m.y += 0.01),
            "another joint",
        );
        why(
            changed(|rig| Arc::make_mut(&mut rig.skeleton).joints[1].name.push('x')),
            "another joint",
        );
        why(
            changed(|rig| {
                let skeleton = Arc::make_mut(&mut rig.skeleton);
                let last = skeleton.joints[1].clone();
                skeleton.joints.push(last);
            }),
            "3 joints, not 2",
        );
        why(
            changed(|rig| Arc::make_mut(&mut rig.skeleton).contacts = None),
            "contacts",
        );
        let shape = Shape::of(&pack_of(toy_rig()));
        let mut still = pack_of(toy_rig());
        still.manifest.capabilities.live = false;
        why(shape.difference(&still), "no capability live");
        still.manifest.family = "other".to_owned();
        why(shape.difference(&still), "its family is other, not");
    }
}
