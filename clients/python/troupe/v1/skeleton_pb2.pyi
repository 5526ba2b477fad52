from troupe.v1 import motion_pb2 as _motion_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class SkeletonFile(_message.Message):
    __slots__ = ("name", "data")
    NAME_FIELD_NUMBER: _ClassVar[int]
    DATA_FIELD_NUMBER: _ClassVar[int]
    name: str
    data: bytes
    def __init__(self, name: _Optional[str] = ..., data: _Optional[bytes] = ...) -> None: ...

class PutSkeletonRequest(_message.Message):
    __slots__ = ("name", "file", "joints", "parts", "pack", "body", "force")
    NAME_FIELD_NUMBER: _ClassVar[int]
    FILE_FIELD_NUMBER: _ClassVar[int]
    JOINTS_FIELD_NUMBER: _ClassVar[int]
    PARTS_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    FORCE_FIELD_NUMBER: _ClassVar[int]
    name: str
    file: SkeletonFile
    joints: _motion_pb2.BodySkeleton
    parts: str
    pack: str
    body: str
    force: bool
    def __init__(self, name: _Optional[str] = ..., file: _Optional[_Union[SkeletonFile, _Mapping]] = ..., joints: _Optional[_Union[_motion_pb2.BodySkeleton, _Mapping]] = ..., parts: _Optional[str] = ..., pack: _Optional[str] = ..., body: _Optional[str] = ..., force: _Optional[bool] = ...) -> None: ...

class OwnSkeleton(_message.Message):
    __slots__ = ("name", "joints", "robot", "parts", "height", "notes", "forced", "fit", "left_axis")
    NAME_FIELD_NUMBER: _ClassVar[int]
    JOINTS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    PARTS_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    FORCED_FIELD_NUMBER: _ClassVar[int]
    FIT_FIELD_NUMBER: _ClassVar[int]
    LEFT_AXIS_FIELD_NUMBER: _ClassVar[int]
    name: str
    joints: _containers.RepeatedCompositeFieldContainer[_motion_pb2.Joint]
    robot: _motion_pb2.Robot
    parts: str
    height: float
    notes: _containers.RepeatedScalarFieldContainer[str]
    forced: bool
    fit: SkeletonFit
    left_axis: _motion_pb2.Vec3
    def __init__(self, name: _Optional[str] = ..., joints: _Optional[_Iterable[_Union[_motion_pb2.Joint, _Mapping]]] = ..., robot: _Optional[_Union[_motion_pb2.Robot, _Mapping]] = ..., parts: _Optional[str] = ..., height: _Optional[float] = ..., notes: _Optional[_Iterable[str]] = ..., forced: _Optional[bool] = ..., fit: _Optional[_Union[SkeletonFit, _Mapping]] = ..., left_axis: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ...) -> None: ...

class SkeletonFit(_message.Message):
    __slots__ = ("pack", "body", "scale", "trials", "faults", "contact_joints")
    PACK_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    SCALE_FIELD_NUMBER: _ClassVar[int]
    TRIALS_FIELD_NUMBER: _ClassVar[int]
    FAULTS_FIELD_NUMBER: _ClassVar[int]
    CONTACT_JOINTS_FIELD_NUMBER: _ClassVar[int]
    pack: str
    body: str
    scale: float
    trials: _containers.RepeatedCompositeFieldContainer[SkeletonTrial]
    faults: _containers.RepeatedScalarFieldContainer[str]
    contact_joints: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, pack: _Optional[str] = ..., body: _Optional[str] = ..., scale: _Optional[float] = ..., trials: _Optional[_Iterable[_Union[SkeletonTrial, _Mapping]]] = ..., faults: _Optional[_Iterable[str]] = ..., contact_joints: _Optional[_Iterable[str]] = ...) -> None: ...

class SkeletonTrial(_message.Message):
    __slots__ = ("motion", "directions_deg", "worst_deg", "worst_joint", "skate", "source_skate", "under_ground", "short", "lines_deg")
    MOTION_FIELD_NUMBER: _ClassVar[int]
    DIRECTIONS_DEG_FIELD_NUMBER: _ClassVar[int]
    WORST_DEG_FIELD_NUMBER: _ClassVar[int]
    WORST_JOINT_FIELD_NUMBER: _ClassVar[int]
    SKATE_FIELD_NUMBER: _ClassVar[int]
    SOURCE_SKATE_FIELD_NUMBER: _ClassVar[int]
    UNDER_GROUND_FIELD_NUMBER: _ClassVar[int]
    SHORT_FIELD_NUMBER: _ClassVar[int]
    LINES_DEG_FIELD_NUMBER: _ClassVar[int]
    motion: str
    directions_deg: float
    worst_deg: float
    worst_joint: str
    skate: float
    source_skate: float
    under_ground: float
    short: float
    lines_deg: float
    def __init__(self, motion: _Optional[str] = ..., directions_deg: _Optional[float] = ..., worst_deg: _Optional[float] = ..., worst_joint: _Optional[str] = ..., skate: _Optional[float] = ..., source_skate: _Optional[float] = ..., under_ground: _Optional[float] = ..., short: _Optional[float] = ..., lines_deg: _Optional[float] = ...) -> None: ...

class GetSkeletonRequest(_message.Message):
    __slots__ = ("name", "pack", "body")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    name: str
    pack: str
    body: str
    def __init__(self, name: _Optional[str] = ..., pack: _Optional[str] = ..., body: _Optional[str] = ...) -> None: ...

class ListSkeletonsRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class SkeletonSummary(_message.Message):
    __slots__ = ("name", "joint_count", "sessions")
    NAME_FIELD_NUMBER: _ClassVar[int]
    JOINT_COUNT_FIELD_NUMBER: _ClassVar[int]
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    name: str
    joint_count: int
    sessions: int
    def __init__(self, name: _Optional[str] = ..., joint_count: _Optional[int] = ..., sessions: _Optional[int] = ...) -> None: ...

class ListSkeletonsResponse(_message.Message):
    __slots__ = ("skeletons",)
    SKELETONS_FIELD_NUMBER: _ClassVar[int]
    skeletons: _containers.RepeatedCompositeFieldContainer[SkeletonSummary]
    def __init__(self, skeletons: _Optional[_Iterable[_Union[SkeletonSummary, _Mapping]]] = ...) -> None: ...

class DeleteSkeletonRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteSkeletonResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...
