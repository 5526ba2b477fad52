//! Messages of ROS 2, as its interface files define them. Serde's order of fields is that of the
//! wire.

use glam::{DQuat, DVec3};
use ros2_client::Message;
use ros2_client::builtin_interfaces::Time;
use serde::{Deserialize, Serialize};

/// `std_msgs/Header`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Header {
    pub(crate) stamp: Time,
    pub(crate) frame_id: String,
}

/// `sensor_msgs/JointState`. Columns have a number for each name, or none.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct JointState {
    pub(crate) header: Header,
    pub(crate) name: Vec<String>,
    /// Radians.
    pub(crate) position: Vec<f64>,
    /// Radians per second.
    pub(crate) velocity: Vec<f64>,
    pub(crate) effort: Vec<f64>,
}

/// `geometry_msgs/Vector3`, and `geometry_msgs/Point`, which has the same fields.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Vector3 {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
}

/// `geometry_msgs/Quaternion`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Quaternion {
    pub(crate) x: f64,
    pub(crate) y: f64,
    pub(crate) z: f64,
    pub(crate) w: f64,
}

/// `geometry_msgs/Transform`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Transform {
    pub(crate) translation: Vector3,
    pub(crate) rotation: Quaternion,
}

/// `geometry_msgs/TransformStamped`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TransformStamped {
    pub(crate) header: Header,
    pub(crate) child_frame_id: String,
    pub(crate) transform: Transform,
}

/// `tf2_msgs/TFMessage`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct TfMessage {
    pub(crate) transforms: Vec<TransformStamped>,
}

/// `geometry_msgs/Twist`: metres and radians per second.
#[derive(Debug, Clone, Copy, Default, PartialEq, Serialize, Deserialize)]
pub(crate) struct Twist {
    pub(crate) linear: Vector3,
    pub(crate) angular: Vector3,
}

/// `geometry_msgs/Pose`.
#[derive(Debug, Clone, Copy, PartialEq, Serialize, Deserialize)]
pub(crate) struct Pose {
    pub(crate) position: Vector3,
    pub(crate) orientation: Quaternion,
}

/// `geometry_msgs/PoseStamped`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct PoseStamped {
    pub(crate) header: Header,
    pub(crate) pose: Pose,
}

/// `nav_msgs/Path`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Path {
    pub(crate) header: Header,
    pub(crate) poses: Vec<PoseStamped>,
}

/// `std_msgs/String`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Text {
    pub(crate) data: String,
}

/// `rosgraph_msgs/Clock`.
#[derive(Debug, Clone, PartialEq, Serialize, Deserialize)]
pub(crate) struct Clock {
    pub(crate) clock: Time,
}

impl Message for JointState {}
impl Message for TfMessage {}
impl Message for Twist {}
impl Message for Path {}
impl Message for Text {}
impl Message for Clock {}

impl From<DVec3> for Vector3 {
    fn from(DVec3 { x, y, z }: DVec3) -> Self {
        Self { x, y, z }
    }
}

impl From<DQuat> for Quaternion {
    fn from(DQuat { x, y, z, w }: DQuat) -> Self {
        Self { x, y, z, w }
    }
}
