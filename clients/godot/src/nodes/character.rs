//! The node of a character.

use std::sync::Arc;

use glam::{Quat, Vec3};
use godot::classes::notify::Node3DNotification;
use godot::classes::{INode3D, Node3D, Skeleton3D};
use godot::prelude::*;
use troupe_client::SessionOptions;

use super::server::{GROUP, TroupeServer};
use crate::axes;
use crate::convert::{affine, quaternion, vec3, vector3};
use crate::link::{Actor, Note, Order, OrderError, Orders, Pose, Wanted};
use crate::rig::{Bone, Front, Rig, root_pose};

/// Largest difference of a node's scale from one.
const SCALE_LIMIT: f32 = 1e-3;

/// Where the model of a character looks at rest.
#[derive(GodotConvert, Var, Export, Debug, Clone, Copy, Default, PartialEq, Eq)]
#[godot(via = i64)]
pub enum ModelFront {
    /// Along +Z of the node, as imported models do.
    #[default]
    PlusZ,
    /// Along -Z of the node.
    MinusZ,
}

impl From<ModelFront> for Front {
    fn from(front: ModelFront) -> Self {
        match front {
            ModelFront::PlusZ => Self::Model,
            ModelFront::MinusZ => Self::Camera,
        }
    }
}

/// A character that a Troupe server moves. Put the model below this node. The rest of its skeleton
/// goes to the server, which carries motion over to it.
///
/// All places, velocities and directions are in the world of the scene.
#[derive(GodotClass)]
#[class(init, base = Node3D)]
pub struct TroupeCharacter {
    /// The connection. Empty: the first server of the scene.
    #[export]
    server: Option<Gd<TroupeServer>>,
    /// The skeleton to move. Empty: the first one below this node.
    #[export]
    skeleton: Option<Gd<Skeleton3D>>,
    /// The bone of the hips. It moves with all bones below it. Bones above it keep their pose.
    #[export]
    #[init(val = "Hips".into())]
    root_bone: GString,
    /// Where the model looks at rest.
    #[export]
    model_front: ModelFront,
    /// Name of the pack that makes the motion. Empty: the server's default pack.
    #[export]
    pack: GString,
    /// Name of the pack's body, for packs with several. Empty: the default one.
    #[export]
    body: GString,
    /// Style of the first frames and of commands from now on. Empty: the current one.
    #[export]
    pub(super) style: GString,
    /// The same seed, commands and times give the same motion.
    #[export]
    seed: i64,
    /// Name of the scene on the server. Empty: flat ground at the height of this node.
    #[export]
    scene: GString,
    /// Which characters get plans first if there are too many: 0 is far from the camera, 1 the
    /// hero.
    #[export(range = (0.0, 1.0))]
    #[var(set = set_priority)]
    #[init(val = 0.5)]
    priority: f32,
    /// Whether this node follows the hips over the ground, and its children with it. It does not
    /// turn or change its height.
    #[export]
    #[init(val = true)]
    follow: bool,

    actor: Option<Arc<Actor>>,
    /// The connection that this character was on or failed on.
    generation: u64,
    /// Commands from before the character joined.
    early: Orders,
    joints: Vec<i32>,
    /// Height of the server's ground in Godot's world, metres.
    ground_m: f32,
    pose: Pose,
    has_pose: bool,
    base: Base<Node3D>,
}

#[godot_api]
impl INode3D for TroupeCharacter {
    // Notifications reach this class even if a script overrides _ready or _process.
    fn on_notification(&mut self, what: Node3DNotification) {
        match what {
            Node3DNotification::ENTER_TREE => self.base_mut().set_process_internal(true),
            Node3DNotification::INTERNAL_PROCESS => self.advance(),
            Node3DNotification::EXIT_TREE => self.leave(),
            _ => {}
        }
    }
}

#[godot_api]
impl TroupeCharacter {
    /// The character is on the server, and begins to move.
    #[signal]
    fn opened();

    /// The character could not be opened, or left the server. It does not move from now on.
    #[signal]
    fn failed(message: GString);

    /// A command was refused. The character goes on as before.
    #[signal]
    fn refused(message: GString);

    /// The character came to the end of its path, at this distance from it.
    #[signal]
    fn arrived(distance_m: f64);

    /// The character began to act out a sentence.
    #[signal]
    fn performing(sentence: GString);

    /// The character is done with a sentence, for a reason such as `DONE`.
    #[signal]
    fn performed(reason: GString);

    /// Anything else: `started`, `entered`, `reached`, `attached`, `released`, `done`, `failed` and
    /// `interrupted` of an object or a skill, `fell`, `landed`, `bounded`, `resumed`.
    #[signal]
    fn happened(kind: GString, subject: GString, detail: GString);

    /// Whether frames have come.
    #[func]
    fn is_moving(&self) -> bool {
        self.has_pose
    }

    /// The hips in the world of the scene.
    #[func]
    fn hips_position(&self) -> Vector3 {
        vector3(axes::position(self.place()) + Vec3::Y * self.ground_m)
    }

    #[func]
    fn set_priority(&mut self, priority: f32) {
        if priority != self.priority {
            self.priority = priority;
            // A new character takes it from the property.
            if self.actor.is_some() {
                self.order(Order::Priority(priority));
            }
        }
    }

    /// Gives a command to the connection.
    pub(super) fn order(&mut self, order: Order) {
        let given = match &self.actor {
            Some(actor) => actor.order(order),
            None => self.early.push(order),
        };
        if let Err(error) = given {
            self.refuse(&error);
        }
    }

    fn refuse(&mut self, error: &OrderError) {
        self.signals().refused().emit(&error.to_string());
    }

    /// The hips, or the node before the first frame, in Troupe's frame and over its ground.
    pub(super) fn place(&self) -> Vec3 {
        match self.has_pose {
            true => self.pose.root,
            false => self.to_server(self.base().get_global_position()),
        }
    }

    /// A place of the scene in Troupe's frame, over its ground.
    pub(super) fn to_server(&self, place: Vector3) -> Vec3 {
        axes::position(vec3(place) - Vec3::Y * self.ground_m)
    }

    fn advance(&mut self) {
        self.join();
        if let Some(actor) = &self.actor
            && actor.take_pose(&mut self.pose)
        {
            self.show();
        }
        // A character that leaves during this has no more notes.
        while let Some(note) = self.actor.as_ref().and_then(|actor| actor.take_note()) {
            self.report(note);
        }
    }

    /// Joins a connection that this character was not on yet.
    fn join(&mut self) {
        if let Some(server) = &self.server
            && !server.is_instance_valid()
        {
            self.server = None;
        }
        let Some(server) = self.server.clone().or_else(|| self.first_server()) else {
            return;
        };
        let server = server.bind();
        let (Some(link), generation) = server.link() else {
            return;
        };
        if generation == self.generation {
            return;
        }
        self.leave();
        self.generation = generation;
        match self.wanted() {
            Ok(wanted) => {
                let actor = link.join(wanted);
                self.actor = Some(actor.clone());
                for order in self.early.take() {
                    // They are not more than a character may have.
                    let _ = actor.order(order);
                }
            }
            Err(message) => {
                drop(server);
                self.signals().failed().emit(&message);
            }
        }
    }

    fn first_server(&self) -> Option<Gd<TroupeServer>> {
        let tree = self.base().get_tree_or_null()?;
        tree.get_first_node_in_group(GROUP)?.try_cast().ok()
    }

    /// Leaves the server.
    fn leave(&mut self) {
        if let Some(actor) = self.actor.take() {
            actor.leave();
        }
        self.generation = 0;
        self.has_pose = false;
    }

    /// The character as the server shall have it.
    fn wanted(&mut self) -> Result<Wanted, String> {
        let skeleton = self
            .find_skeleton()
            .ok_or("there is no Skeleton3D below the character")?;
        let node = self.base().get_global_transform();
        let scale = vec3(node.basis.get_scale());
        if !scale.abs_diff_eq(Vec3::ONE, SCALE_LIMIT) {
            return Err(format!(
                "the scale of the character is {scale}, but must be 1: scale the model below it"
            ));
        }
        let front = Front::from(self.model_front);
        let placed = self.placed(&skeleton);
        let bones = bones(&skeleton);
        let rig = Rig::new(&bones, &self.root_bone.to_string(), affine(placed), front)
            .map_err(|error| error.to_string())?;
        self.joints = rig
            .bones()
            .iter()
            .filter_map(|&bone| i32::try_from(bone).ok())
            .collect();
        self.skeleton = Some(skeleton);
        self.ground_m = match self.scene.is_empty() {
            true => node.origin.y,
            false => 0.0,
        };
        let heading = heading(node.basis * Vector3::FORWARD).unwrap_or_default() + front.heading();
        let place = self.to_server(node.origin);
        Ok(Wanted {
            rig,
            pack: self.pack.to_string(),
            body: self.body.to_string(),
            session: SessionOptions::new()
                .seed(self.seed.cast_unsigned())
                .at(place, heading)
                .style(self.style.to_string())
                .scene(self.scene.to_string())
                .priority(self.priority),
        })
    }

    /// The skeleton of the property, unless it was freed.
    fn live_skeleton(&self) -> Option<Gd<Skeleton3D>> {
        // A reference to a freed node must not be cloned.
        let skeleton = self.skeleton.as_ref();
        skeleton.filter(|skeleton| skeleton.is_instance_valid()).cloned()
    }

    fn find_skeleton(&self) -> Option<Gd<Skeleton3D>> {
        if let Some(skeleton) = self.live_skeleton() {
            return Some(skeleton);
        }
        // Nodes of an instanced model have another owner.
        let found = self
            .base()
            .find_children_ex("*")
            .type_("Skeleton3D")
            .owned(false)
            .done();
        found.get(0)?.try_cast().ok()
    }

    /// The transform of the skeleton in the frame of this node. It is the same for all instances of
    /// a model, bit by bit, so that they share a skeleton on the server.
    fn placed(&self, skeleton: &Gd<Skeleton3D>) -> Transform3D {
        let mut placed = skeleton.get_transform();
        let mut above = skeleton.get_parent_node_3d();
        while let Some(node) = above {
            if node.instance_id() == self.base().instance_id() {
                return placed;
            }
            placed = node.get_transform() * placed;
            above = node.get_parent_node_3d();
        }
        // The skeleton is elsewhere in the scene, or below a node without a place.
        self.base().get_global_transform().affine_inverse() * skeleton.get_global_transform()
    }

    /// Shows the newest frame.
    fn show(&mut self) {
        let Some(mut skeleton) = self.live_skeleton() else {
            // The model is gone. Another one joins, or its lack is reported.
            return self.leave();
        };
        if self.pose.rotations.len() != self.joints.len() {
            return;
        }
        self.has_pose = true;
        let hips = axes::position(self.pose.root) + Vec3::Y * self.ground_m;
        if self.follow {
            let height = self.base().get_global_position().y;
            let below = Vector3::new(hips.x, height, hips.z);
            self.base_mut().set_global_position(below);
        }
        let joints = self.joints.iter().zip(&self.pose.rotations).skip(1);
        for (&bone, &rotation) in joints {
            skeleton.set_bone_pose_rotation(bone, quaternion(axes::rotation(rotation)));
        }
        self.show_root(&mut skeleton, hips);
    }

    fn show_root(&self, skeleton: &mut Gd<Skeleton3D>, hips: Vec3) {
        let (Some(&root), Some(&turned)) = (self.joints.first(), self.pose.rotations.first()) else {
            return;
        };
        let mut above = skeleton.get_global_transform();
        let parent = skeleton.get_bone_parent(root);
        if parent >= 0 {
            above = above * skeleton.get_bone_global_pose(parent);
        }
        let turned: Quat = axes::rotation(turned);
        let (position, rotation) = root_pose(affine(above), hips, turned);
        skeleton.set_bone_pose_position(root, vector3(position));
        skeleton.set_bone_pose_rotation(root, quaternion(rotation));
    }

    fn report(&mut self, note: Note) {
        match note {
            Note::Opened => self.signals().opened().emit(),
            Note::Failed(message) => {
                self.actor = None;
                self.signals().failed().emit(&message);
            }
            Note::Refused(message) => self.signals().refused().emit(&message),
            Note::Arrived { off_m } => self.signals().arrived().emit(f64::from(off_m)),
            Note::Performing(sentence) => self.signals().performing().emit(&sentence),
            Note::Performed(reason) => self.signals().performed().emit(&reason),
            Note::Happened {
                kind,
                subject,
                detail,
            } => {
                self.signals().happened().emit(kind, &subject, &detail);
            }
        }
    }
}

/// The bones of a skeleton at rest.
fn bones(skeleton: &Gd<Skeleton3D>) -> Vec<Bone> {
    let bone = |index| Bone {
        name: skeleton.get_bone_name(index).to_string(),
        parent: usize::try_from(skeleton.get_bone_parent(index)).ok(),
        rest: affine(skeleton.get_bone_rest(index)),
    };
    (0..skeleton.get_bone_count()).map(bone).collect()
}

/// The heading of a direction in Godot's world, radians. None: it points straight up or down.
pub(super) fn heading(direction: Vector3) -> Option<f32> {
    let Vec3 { x, z, .. } = axes::position(vec3(direction));
    (x.hypot(z) > 1e-6).then(|| x.atan2(z))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn headings_are_turns_about_y_from_ahead() {
        for degrees in [-170.0_f32, -90.0, -30.0, 0.0, 45.0, 90.0, 179.0] {
            let turn = Quaternion::from_axis_angle(Vector3::UP, degrees.to_radians());
            let found = heading(turn * Vector3::FORWARD).unwrap();
            assert!((found.to_degrees() - degrees).abs() < 1e-3, "{degrees}: {found}");
        }
        assert_eq!(heading(Vector3::UP), None);
        assert_eq!(heading(Vector3::ZERO), None);
    }
}
