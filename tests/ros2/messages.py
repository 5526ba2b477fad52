"""ROS 2's messages for Cyclone DDS, with the names that ROS gives them on the wire."""

from dataclasses import dataclass

from cyclonedds.idl import IdlStruct
from cyclonedds.idl.types import float64, int32, sequence, uint8, uint32


@dataclass
class Time(IdlStruct, typename="builtin_interfaces.msg.dds_.Time_"):
    """A time."""

    sec: int32 = 0
    nanosec: uint32 = 0

    @property
    def seconds(self) -> float:
        """Seconds since the epoch."""
        return self.sec + self.nanosec * 1e-9


@dataclass
class Header(IdlStruct, typename="std_msgs.msg.dds_.Header_"):
    """Time and frame."""

    stamp: Time
    frame_id: str


@dataclass
class JointState(IdlStruct, typename="sensor_msgs.msg.dds_.JointState_"):
    """Angles by name."""

    header: Header
    name: sequence[str]
    position: sequence[float64]
    velocity: sequence[float64]
    effort: sequence[float64]


@dataclass
class Vector3(IdlStruct, typename="geometry_msgs.msg.dds_.Vector3_"):
    """A vector."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Point(IdlStruct, typename="geometry_msgs.msg.dds_.Point_"):
    """A place."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0


@dataclass
class Quaternion(IdlStruct, typename="geometry_msgs.msg.dds_.Quaternion_"):
    """A rotation."""

    x: float64 = 0.0
    y: float64 = 0.0
    z: float64 = 0.0
    w: float64 = 1.0


@dataclass
class Transform(IdlStruct, typename="geometry_msgs.msg.dds_.Transform_"):
    """A place and a rotation."""

    translation: Vector3
    rotation: Quaternion


@dataclass
class TransformStamped(IdlStruct, typename="geometry_msgs.msg.dds_.TransformStamped_"):
    """From one frame to another."""

    header: Header
    child_frame_id: str
    transform: Transform


@dataclass
class TFMessage(IdlStruct, typename="tf2_msgs.msg.dds_.TFMessage_"):
    """Transforms."""

    transforms: sequence[TransformStamped]


@dataclass
class Twist(IdlStruct, typename="geometry_msgs.msg.dds_.Twist_"):
    """A velocity."""

    linear: Vector3
    angular: Vector3


@dataclass
class Pose(IdlStruct, typename="geometry_msgs.msg.dds_.Pose_"):
    """A place and a rotation."""

    position: Point
    orientation: Quaternion


@dataclass
class PoseStamped(IdlStruct, typename="geometry_msgs.msg.dds_.PoseStamped_"):
    """A pose with its frame."""

    header: Header
    pose: Pose


@dataclass
class Path(IdlStruct, typename="nav_msgs.msg.dds_.Path_"):
    """A way."""

    header: Header
    poses: sequence[PoseStamped]


@dataclass
class String(IdlStruct, typename="std_msgs.msg.dds_.String_"):
    """Text."""

    data: str


@dataclass
class Clock(IdlStruct, typename="rosgraph_msgs.msg.dds_.Clock_"):
    """A simulator's time."""

    clock: Time


@dataclass
class Log(IdlStruct, typename="rcl_interfaces.msg.dds_.Log_"):
    """A note."""

    stamp: Time
    level: uint8
    name: str
    msg: str
    file: str
    function: str
    line: uint32
