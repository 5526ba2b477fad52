from troupe.v1 import motion_pb2 as _motion_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class ActivityKind(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ACTIVITY_KIND_LOCOMOTION: _ClassVar[ActivityKind]
    ACTIVITY_KIND_APPROACHING: _ClassVar[ActivityKind]
    ACTIVITY_KIND_INTERACTING: _ClassVar[ActivityKind]
    ACTIVITY_KIND_HELD: _ClassVar[ActivityKind]
    ACTIVITY_KIND_FALLING: _ClassVar[ActivityKind]
    ACTIVITY_KIND_PERFORMING: _ClassVar[ActivityKind]
ACTIVITY_KIND_LOCOMOTION: ActivityKind
ACTIVITY_KIND_APPROACHING: ActivityKind
ACTIVITY_KIND_INTERACTING: ActivityKind
ACTIVITY_KIND_HELD: ActivityKind
ACTIVITY_KIND_FALLING: ActivityKind
ACTIVITY_KIND_PERFORMING: ActivityKind

class Activity(_message.Message):
    __slots__ = ("kind", "instance", "set", "text")
    KIND_FIELD_NUMBER: _ClassVar[int]
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    SET_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    kind: ActivityKind
    instance: str
    set: str
    text: str
    def __init__(self, kind: _Optional[_Union[ActivityKind, str]] = ..., instance: _Optional[str] = ..., set: _Optional[str] = ..., text: _Optional[str] = ...) -> None: ...

class HeldObject(_message.Message):
    __slots__ = ("slot", "instance", "position", "rotation")
    SLOT_FIELD_NUMBER: _ClassVar[int]
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    slot: int
    instance: str
    position: _motion_pb2.Vec3
    rotation: _motion_pb2.Quat
    def __init__(self, slot: _Optional[int] = ..., instance: _Optional[str] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., rotation: _Optional[_Union[_motion_pb2.Quat, _Mapping]] = ...) -> None: ...

class KeyframeError(_message.Message):
    __slots__ = ("root_m", "heading_deg", "joint_m")
    ROOT_M_FIELD_NUMBER: _ClassVar[int]
    HEADING_DEG_FIELD_NUMBER: _ClassVar[int]
    JOINT_M_FIELD_NUMBER: _ClassVar[int]
    root_m: float
    heading_deg: float
    joint_m: float
    def __init__(self, root_m: _Optional[float] = ..., heading_deg: _Optional[float] = ..., joint_m: _Optional[float] = ...) -> None: ...

class InteractionStarted(_message.Message):
    __slots__ = ("instance", "definition", "variant", "approach", "seed")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    DEFINITION_FIELD_NUMBER: _ClassVar[int]
    VARIANT_FIELD_NUMBER: _ClassVar[int]
    APPROACH_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    instance: str
    definition: str
    variant: str
    approach: str
    seed: int
    def __init__(self, instance: _Optional[str] = ..., definition: _Optional[str] = ..., variant: _Optional[str] = ..., approach: _Optional[str] = ..., seed: _Optional[int] = ...) -> None: ...

class SetEntered(_message.Message):
    __slots__ = ("instance", "set")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    SET_FIELD_NUMBER: _ClassVar[int]
    instance: str
    set: str
    def __init__(self, instance: _Optional[str] = ..., set: _Optional[str] = ...) -> None: ...

class KeyframeReached(_message.Message):
    __slots__ = ("instance", "set", "keyframe", "before", "after", "early_frames")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    SET_FIELD_NUMBER: _ClassVar[int]
    KEYFRAME_FIELD_NUMBER: _ClassVar[int]
    BEFORE_FIELD_NUMBER: _ClassVar[int]
    AFTER_FIELD_NUMBER: _ClassVar[int]
    EARLY_FRAMES_FIELD_NUMBER: _ClassVar[int]
    instance: str
    set: str
    keyframe: int
    before: KeyframeError
    after: KeyframeError
    early_frames: int
    def __init__(self, instance: _Optional[str] = ..., set: _Optional[str] = ..., keyframe: _Optional[int] = ..., before: _Optional[_Union[KeyframeError, _Mapping]] = ..., after: _Optional[_Union[KeyframeError, _Mapping]] = ..., early_frames: _Optional[int] = ...) -> None: ...

class ObjectAttached(_message.Message):
    __slots__ = ("instance", "socket")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    SOCKET_FIELD_NUMBER: _ClassVar[int]
    instance: str
    socket: str
    def __init__(self, instance: _Optional[str] = ..., socket: _Optional[str] = ...) -> None: ...

class ObjectReleased(_message.Message):
    __slots__ = ("instance", "position", "rotation")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    instance: str
    position: _motion_pb2.Vec3
    rotation: _motion_pb2.Quat
    def __init__(self, instance: _Optional[str] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., rotation: _Optional[_Union[_motion_pb2.Quat, _Mapping]] = ...) -> None: ...

class InteractionDone(_message.Message):
    __slots__ = ("instance",)
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    instance: str
    def __init__(self, instance: _Optional[str] = ...) -> None: ...

class InteractionFailed(_message.Message):
    __slots__ = ("instance", "reason", "message")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    instance: str
    reason: str
    message: str
    def __init__(self, instance: _Optional[str] = ..., reason: _Optional[str] = ..., message: _Optional[str] = ...) -> None: ...

class InteractionInterrupted(_message.Message):
    __slots__ = ("instance",)
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    instance: str
    def __init__(self, instance: _Optional[str] = ...) -> None: ...

class CharacterFell(_message.Message):
    __slots__ = ("height",)
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    height: float
    def __init__(self, height: _Optional[float] = ...) -> None: ...

class CharacterLanded(_message.Message):
    __slots__ = ("height", "speed")
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    height: float
    speed: float
    def __init__(self, height: _Optional[float] = ..., speed: _Optional[float] = ...) -> None: ...

class PathArrived(_message.Message):
    __slots__ = ("late", "off")
    LATE_FIELD_NUMBER: _ClassVar[int]
    OFF_FIELD_NUMBER: _ClassVar[int]
    late: float
    off: float
    def __init__(self, late: _Optional[float] = ..., off: _Optional[float] = ...) -> None: ...

class CommandBounded(_message.Message):
    __slots__ = ("wanted_speed", "speed", "facing")
    WANTED_SPEED_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    FACING_FIELD_NUMBER: _ClassVar[int]
    wanted_speed: float
    speed: float
    facing: float
    def __init__(self, wanted_speed: _Optional[float] = ..., speed: _Optional[float] = ..., facing: _Optional[float] = ...) -> None: ...

class PerformanceStarted(_message.Message):
    __slots__ = ("sequence", "text", "pack", "unknown_words")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    UNKNOWN_WORDS_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    text: str
    pack: str
    unknown_words: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, sequence: _Optional[int] = ..., text: _Optional[str] = ..., pack: _Optional[str] = ..., unknown_words: _Optional[_Iterable[str]] = ...) -> None: ...

class PerformanceEnded(_message.Message):
    __slots__ = ("sequence", "reason", "message")
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    REASON_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    sequence: int
    reason: str
    message: str
    def __init__(self, sequence: _Optional[int] = ..., reason: _Optional[str] = ..., message: _Optional[str] = ...) -> None: ...

class SessionEvent(_message.Message):
    __slots__ = ("frame", "started", "entered", "reached", "attached", "released", "done", "failed", "interrupted", "fell", "landed", "arrived", "performing", "performed", "bounded")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    STARTED_FIELD_NUMBER: _ClassVar[int]
    ENTERED_FIELD_NUMBER: _ClassVar[int]
    REACHED_FIELD_NUMBER: _ClassVar[int]
    ATTACHED_FIELD_NUMBER: _ClassVar[int]
    RELEASED_FIELD_NUMBER: _ClassVar[int]
    DONE_FIELD_NUMBER: _ClassVar[int]
    FAILED_FIELD_NUMBER: _ClassVar[int]
    INTERRUPTED_FIELD_NUMBER: _ClassVar[int]
    FELL_FIELD_NUMBER: _ClassVar[int]
    LANDED_FIELD_NUMBER: _ClassVar[int]
    ARRIVED_FIELD_NUMBER: _ClassVar[int]
    PERFORMING_FIELD_NUMBER: _ClassVar[int]
    PERFORMED_FIELD_NUMBER: _ClassVar[int]
    BOUNDED_FIELD_NUMBER: _ClassVar[int]
    frame: int
    started: InteractionStarted
    entered: SetEntered
    reached: KeyframeReached
    attached: ObjectAttached
    released: ObjectReleased
    done: InteractionDone
    failed: InteractionFailed
    interrupted: InteractionInterrupted
    fell: CharacterFell
    landed: CharacterLanded
    arrived: PathArrived
    performing: PerformanceStarted
    performed: PerformanceEnded
    bounded: CommandBounded
    def __init__(self, frame: _Optional[int] = ..., started: _Optional[_Union[InteractionStarted, _Mapping]] = ..., entered: _Optional[_Union[SetEntered, _Mapping]] = ..., reached: _Optional[_Union[KeyframeReached, _Mapping]] = ..., attached: _Optional[_Union[ObjectAttached, _Mapping]] = ..., released: _Optional[_Union[ObjectReleased, _Mapping]] = ..., done: _Optional[_Union[InteractionDone, _Mapping]] = ..., failed: _Optional[_Union[InteractionFailed, _Mapping]] = ..., interrupted: _Optional[_Union[InteractionInterrupted, _Mapping]] = ..., fell: _Optional[_Union[CharacterFell, _Mapping]] = ..., landed: _Optional[_Union[CharacterLanded, _Mapping]] = ..., arrived: _Optional[_Union[PathArrived, _Mapping]] = ..., performing: _Optional[_Union[PerformanceStarted, _Mapping]] = ..., performed: _Optional[_Union[PerformanceEnded, _Mapping]] = ..., bounded: _Optional[_Union[CommandBounded, _Mapping]] = ...) -> None: ...

class SessionEvents(_message.Message):
    __slots__ = ("slot", "session_id", "events", "events_dropped")
    SLOT_FIELD_NUMBER: _ClassVar[int]
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    EVENTS_DROPPED_FIELD_NUMBER: _ClassVar[int]
    slot: int
    session_id: str
    events: _containers.RepeatedCompositeFieldContainer[SessionEvent]
    events_dropped: int
    def __init__(self, slot: _Optional[int] = ..., session_id: _Optional[str] = ..., events: _Optional[_Iterable[_Union[SessionEvent, _Mapping]]] = ..., events_dropped: _Optional[int] = ...) -> None: ...
