from troupe.v1 import event_pb2 as _event_pb2
from troupe.v1 import motion_pb2 as _motion_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Convention(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CONVENTION_NATIVE: _ClassVar[Convention]
    CONVENTION_UNREAL: _ClassVar[Convention]
    CONVENTION_UNITY: _ClassVar[Convention]
    CONVENTION_ROS: _ClassVar[Convention]

class Clock(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    CLOCK_FREE: _ClassVar[Clock]
    CLOCK_STEP: _ClassVar[Clock]
    CLOCK_DRIVE: _ClassVar[Clock]

class CommandStatus(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    COMMAND_STATUS_ACCEPTED: _ClassVar[CommandStatus]
    COMMAND_STATUS_REPEATED: _ClassVar[CommandStatus]
    COMMAND_STATUS_LATE: _ClassVar[CommandStatus]
    COMMAND_STATUS_REFUSED: _ClassVar[CommandStatus]

class Encoding(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    ENCODING_F32: _ClassVar[Encoding]
    ENCODING_COMPACT: _ClassVar[Encoding]
    ENCODING_QPOS: _ClassVar[Encoding]
CONVENTION_NATIVE: Convention
CONVENTION_UNREAL: Convention
CONVENTION_UNITY: Convention
CONVENTION_ROS: Convention
CLOCK_FREE: Clock
CLOCK_STEP: Clock
CLOCK_DRIVE: Clock
COMMAND_STATUS_ACCEPTED: CommandStatus
COMMAND_STATUS_REPEATED: CommandStatus
COMMAND_STATUS_LATE: CommandStatus
COMMAND_STATUS_REFUSED: CommandStatus
ENCODING_F32: Encoding
ENCODING_COMPACT: Encoding
ENCODING_QPOS: Encoding

class SessionOptions(_message.Message):
    __slots__ = ("id", "pack", "style", "seed", "convention", "position", "heading", "context", "ttl_ms", "look_ahead_frames", "replan_interval_frames", "root_ratio", "temperature", "priority", "scene", "body", "skeleton", "record")
    ID_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    CONTEXT_FIELD_NUMBER: _ClassVar[int]
    TTL_MS_FIELD_NUMBER: _ClassVar[int]
    LOOK_AHEAD_FRAMES_FIELD_NUMBER: _ClassVar[int]
    REPLAN_INTERVAL_FRAMES_FIELD_NUMBER: _ClassVar[int]
    ROOT_RATIO_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    PRIORITY_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    SKELETON_FIELD_NUMBER: _ClassVar[int]
    RECORD_FIELD_NUMBER: _ClassVar[int]
    id: str
    pack: str
    style: str
    seed: int
    convention: Convention
    position: _motion_pb2.Vec3
    heading: float
    context: _containers.RepeatedCompositeFieldContainer[_motion_pb2.Keyframe]
    ttl_ms: int
    look_ahead_frames: int
    replan_interval_frames: int
    root_ratio: float
    temperature: float
    priority: float
    scene: str
    body: str
    skeleton: str
    record: bool
    def __init__(self, id: _Optional[str] = ..., pack: _Optional[str] = ..., style: _Optional[str] = ..., seed: _Optional[int] = ..., convention: _Optional[_Union[Convention, str]] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., context: _Optional[_Iterable[_Union[_motion_pb2.Keyframe, _Mapping]]] = ..., ttl_ms: _Optional[int] = ..., look_ahead_frames: _Optional[int] = ..., replan_interval_frames: _Optional[int] = ..., root_ratio: _Optional[float] = ..., temperature: _Optional[float] = ..., priority: _Optional[float] = ..., scene: _Optional[str] = ..., body: _Optional[str] = ..., skeleton: _Optional[str] = ..., record: _Optional[bool] = ...) -> None: ...

class CreateSessionsRequest(_message.Message):
    __slots__ = ("sessions",)
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[SessionOptions]
    def __init__(self, sessions: _Optional[_Iterable[_Union[SessionOptions, _Mapping]]] = ...) -> None: ...

class CreateSessionsResponse(_message.Message):
    __slots__ = ("sessions",)
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[Session]
    def __init__(self, sessions: _Optional[_Iterable[_Union[Session, _Mapping]]] = ...) -> None: ...

class SessionStats(_message.Message):
    __slots__ = ("plans_for_command", "plans_for_low_buffer", "plans_for_interval", "late_plans", "underruns", "failed_plans", "events_dropped", "plans_for_object")
    PLANS_FOR_COMMAND_FIELD_NUMBER: _ClassVar[int]
    PLANS_FOR_LOW_BUFFER_FIELD_NUMBER: _ClassVar[int]
    PLANS_FOR_INTERVAL_FIELD_NUMBER: _ClassVar[int]
    LATE_PLANS_FIELD_NUMBER: _ClassVar[int]
    UNDERRUNS_FIELD_NUMBER: _ClassVar[int]
    FAILED_PLANS_FIELD_NUMBER: _ClassVar[int]
    EVENTS_DROPPED_FIELD_NUMBER: _ClassVar[int]
    PLANS_FOR_OBJECT_FIELD_NUMBER: _ClassVar[int]
    plans_for_command: int
    plans_for_low_buffer: int
    plans_for_interval: int
    late_plans: int
    underruns: int
    failed_plans: int
    events_dropped: int
    plans_for_object: int
    def __init__(self, plans_for_command: _Optional[int] = ..., plans_for_low_buffer: _Optional[int] = ..., plans_for_interval: _Optional[int] = ..., late_plans: _Optional[int] = ..., underruns: _Optional[int] = ..., failed_plans: _Optional[int] = ..., events_dropped: _Optional[int] = ..., plans_for_object: _Optional[int] = ...) -> None: ...

class Session(_message.Message):
    __slots__ = ("id", "pack", "style", "seed", "convention", "frame", "position", "heading", "speed", "last_sequence", "clock", "ttl_ms", "expires_in_ms", "buffered_frames", "stats", "priority", "scene", "activity", "held", "body", "skeleton", "recorded")
    ID_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    LAST_SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    CLOCK_FIELD_NUMBER: _ClassVar[int]
    TTL_MS_FIELD_NUMBER: _ClassVar[int]
    EXPIRES_IN_MS_FIELD_NUMBER: _ClassVar[int]
    BUFFERED_FRAMES_FIELD_NUMBER: _ClassVar[int]
    STATS_FIELD_NUMBER: _ClassVar[int]
    PRIORITY_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    ACTIVITY_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    SKELETON_FIELD_NUMBER: _ClassVar[int]
    RECORDED_FIELD_NUMBER: _ClassVar[int]
    id: str
    pack: str
    style: str
    seed: int
    convention: Convention
    frame: int
    position: _motion_pb2.Vec3
    heading: float
    speed: float
    last_sequence: int
    clock: Clock
    ttl_ms: int
    expires_in_ms: int
    buffered_frames: int
    stats: SessionStats
    priority: float
    scene: str
    activity: _event_pb2.Activity
    held: _event_pb2.HeldObject
    body: str
    skeleton: str
    recorded: bool
    def __init__(self, id: _Optional[str] = ..., pack: _Optional[str] = ..., style: _Optional[str] = ..., seed: _Optional[int] = ..., convention: _Optional[_Union[Convention, str]] = ..., frame: _Optional[int] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., speed: _Optional[float] = ..., last_sequence: _Optional[int] = ..., clock: _Optional[_Union[Clock, str]] = ..., ttl_ms: _Optional[int] = ..., expires_in_ms: _Optional[int] = ..., buffered_frames: _Optional[int] = ..., stats: _Optional[_Union[SessionStats, _Mapping]] = ..., priority: _Optional[float] = ..., scene: _Optional[str] = ..., activity: _Optional[_Union[_event_pb2.Activity, _Mapping]] = ..., held: _Optional[_Union[_event_pb2.HeldObject, _Mapping]] = ..., body: _Optional[str] = ..., skeleton: _Optional[str] = ..., recorded: _Optional[bool] = ...) -> None: ...

class SessionResume(_message.Message):
    __slots__ = ("session_id", "frame", "pose")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    frame: int
    pose: _motion_pb2.Keyframe
    def __init__(self, session_id: _Optional[str] = ..., frame: _Optional[int] = ..., pose: _Optional[_Union[_motion_pb2.Keyframe, _Mapping]] = ...) -> None: ...

class ResumeSessionsRequest(_message.Message):
    __slots__ = ("sessions",)
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[SessionResume]
    def __init__(self, sessions: _Optional[_Iterable[_Union[SessionResume, _Mapping]]] = ...) -> None: ...

class ResumedSession(_message.Message):
    __slots__ = ("session", "restored", "restored_frame")
    SESSION_FIELD_NUMBER: _ClassVar[int]
    RESTORED_FIELD_NUMBER: _ClassVar[int]
    RESTORED_FRAME_FIELD_NUMBER: _ClassVar[int]
    session: Session
    restored: bool
    restored_frame: int
    def __init__(self, session: _Optional[_Union[Session, _Mapping]] = ..., restored: _Optional[bool] = ..., restored_frame: _Optional[int] = ...) -> None: ...

class ResumeSessionsResponse(_message.Message):
    __slots__ = ("sessions", "problems")
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    PROBLEMS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[ResumedSession]
    problems: _containers.RepeatedCompositeFieldContainer[SessionProblem]
    def __init__(self, sessions: _Optional[_Iterable[_Union[ResumedSession, _Mapping]]] = ..., problems: _Optional[_Iterable[_Union[SessionProblem, _Mapping]]] = ...) -> None: ...

class GetSessionRequest(_message.Message):
    __slots__ = ("id",)
    ID_FIELD_NUMBER: _ClassVar[int]
    id: str
    def __init__(self, id: _Optional[str] = ...) -> None: ...

class ListSessionsRequest(_message.Message):
    __slots__ = ("page_size", "page_token")
    PAGE_SIZE_FIELD_NUMBER: _ClassVar[int]
    PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    page_size: int
    page_token: str
    def __init__(self, page_size: _Optional[int] = ..., page_token: _Optional[str] = ...) -> None: ...

class ListSessionsResponse(_message.Message):
    __slots__ = ("sessions", "next_page_token", "total")
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    NEXT_PAGE_TOKEN_FIELD_NUMBER: _ClassVar[int]
    TOTAL_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[Session]
    next_page_token: str
    total: int
    def __init__(self, sessions: _Optional[_Iterable[_Union[Session, _Mapping]]] = ..., next_page_token: _Optional[str] = ..., total: _Optional[int] = ...) -> None: ...

class CloseSessionsRequest(_message.Message):
    __slots__ = ("ids",)
    IDS_FIELD_NUMBER: _ClassVar[int]
    ids: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, ids: _Optional[_Iterable[str]] = ...) -> None: ...

class CloseSessionsResponse(_message.Message):
    __slots__ = ("closed", "problems")
    CLOSED_FIELD_NUMBER: _ClassVar[int]
    PROBLEMS_FIELD_NUMBER: _ClassVar[int]
    closed: int
    problems: _containers.RepeatedCompositeFieldContainer[SessionProblem]
    def __init__(self, closed: _Optional[int] = ..., problems: _Optional[_Iterable[_Union[SessionProblem, _Mapping]]] = ...) -> None: ...

class Locomote(_message.Message):
    __slots__ = ("velocity", "facing", "style", "gait", "height")
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    FACING_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    GAIT_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    velocity: _motion_pb2.Vec3
    facing: float
    style: str
    gait: str
    height: float
    def __init__(self, velocity: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., facing: _Optional[float] = ..., style: _Optional[str] = ..., gait: _Optional[str] = ..., height: _Optional[float] = ...) -> None: ...

class FollowPath(_message.Message):
    __slots__ = ("points", "speed", "style", "loop")
    POINTS_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    LOOP_FIELD_NUMBER: _ClassVar[int]
    points: _containers.RepeatedCompositeFieldContainer[_motion_pb2.PathPoint]
    speed: float
    style: str
    loop: bool
    def __init__(self, points: _Optional[_Iterable[_Union[_motion_pb2.PathPoint, _Mapping]]] = ..., speed: _Optional[float] = ..., style: _Optional[str] = ..., loop: _Optional[bool] = ...) -> None: ...

class Interact(_message.Message):
    __slots__ = ("instance", "variant", "approach")
    INSTANCE_FIELD_NUMBER: _ClassVar[int]
    VARIANT_FIELD_NUMBER: _ClassVar[int]
    APPROACH_FIELD_NUMBER: _ClassVar[int]
    instance: str
    variant: str
    approach: str
    def __init__(self, instance: _Optional[str] = ..., variant: _Optional[str] = ..., approach: _Optional[str] = ...) -> None: ...

class UseSkill(_message.Message):
    __slots__ = ("name", "variant")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VARIANT_FIELD_NUMBER: _ClassVar[int]
    name: str
    variant: str
    def __init__(self, name: _Optional[str] = ..., variant: _Optional[str] = ...) -> None: ...

class EndInteraction(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class Cancel(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class DropHeld(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class Perform(_message.Message):
    __slots__ = ("text", "pack", "seconds", "temperature")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    text: str
    pack: str
    seconds: float
    temperature: float
    def __init__(self, text: _Optional[str] = ..., pack: _Optional[str] = ..., seconds: _Optional[float] = ..., temperature: _Optional[float] = ...) -> None: ...

class Command(_message.Message):
    __slots__ = ("session_id", "sequence", "at_frame", "locomote", "interact", "end_interaction", "cancel", "drop", "follow_path", "perform", "skill", "priority")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    AT_FRAME_FIELD_NUMBER: _ClassVar[int]
    LOCOMOTE_FIELD_NUMBER: _ClassVar[int]
    INTERACT_FIELD_NUMBER: _ClassVar[int]
    END_INTERACTION_FIELD_NUMBER: _ClassVar[int]
    CANCEL_FIELD_NUMBER: _ClassVar[int]
    DROP_FIELD_NUMBER: _ClassVar[int]
    FOLLOW_PATH_FIELD_NUMBER: _ClassVar[int]
    PERFORM_FIELD_NUMBER: _ClassVar[int]
    SKILL_FIELD_NUMBER: _ClassVar[int]
    PRIORITY_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    sequence: int
    at_frame: int
    locomote: Locomote
    interact: Interact
    end_interaction: EndInteraction
    cancel: Cancel
    drop: DropHeld
    follow_path: FollowPath
    perform: Perform
    skill: UseSkill
    priority: float
    def __init__(self, session_id: _Optional[str] = ..., sequence: _Optional[int] = ..., at_frame: _Optional[int] = ..., locomote: _Optional[_Union[Locomote, _Mapping]] = ..., interact: _Optional[_Union[Interact, _Mapping]] = ..., end_interaction: _Optional[_Union[EndInteraction, _Mapping]] = ..., cancel: _Optional[_Union[Cancel, _Mapping]] = ..., drop: _Optional[_Union[DropHeld, _Mapping]] = ..., follow_path: _Optional[_Union[FollowPath, _Mapping]] = ..., perform: _Optional[_Union[Perform, _Mapping]] = ..., skill: _Optional[_Union[UseSkill, _Mapping]] = ..., priority: _Optional[float] = ...) -> None: ...

class Problem(_message.Message):
    __slots__ = ("reason", "message", "field", "allowed")
    REASON_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    FIELD_FIELD_NUMBER: _ClassVar[int]
    ALLOWED_FIELD_NUMBER: _ClassVar[int]
    reason: str
    message: str
    field: str
    allowed: str
    def __init__(self, reason: _Optional[str] = ..., message: _Optional[str] = ..., field: _Optional[str] = ..., allowed: _Optional[str] = ...) -> None: ...

class CommandResult(_message.Message):
    __slots__ = ("session_id", "sequence", "status", "problem")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    SEQUENCE_FIELD_NUMBER: _ClassVar[int]
    STATUS_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    sequence: int
    status: CommandStatus
    problem: Problem
    def __init__(self, session_id: _Optional[str] = ..., sequence: _Optional[int] = ..., status: _Optional[_Union[CommandStatus, str]] = ..., problem: _Optional[_Union[Problem, _Mapping]] = ...) -> None: ...

class CommandRequest(_message.Message):
    __slots__ = ("commands",)
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    commands: _containers.RepeatedCompositeFieldContainer[Command]
    def __init__(self, commands: _Optional[_Iterable[_Union[Command, _Mapping]]] = ...) -> None: ...

class CommandResponse(_message.Message):
    __slots__ = ("results",)
    RESULTS_FIELD_NUMBER: _ClassVar[int]
    results: _containers.RepeatedCompositeFieldContainer[CommandResult]
    def __init__(self, results: _Optional[_Iterable[_Union[CommandResult, _Mapping]]] = ...) -> None: ...

class FrameBlock(_message.Message):
    __slots__ = ("pack", "slots", "frame_count", "first_frames", "root_positions", "rotations", "packed_roots", "packed_rotations", "contacts", "positions", "six_d", "qpos", "hinge_residuals", "clamped_hinges", "body", "skeleton", "hinge_speed_ratios", "fastest_hinges", "hinge_accelerations")
    PACK_FIELD_NUMBER: _ClassVar[int]
    SLOTS_FIELD_NUMBER: _ClassVar[int]
    FRAME_COUNT_FIELD_NUMBER: _ClassVar[int]
    FIRST_FRAMES_FIELD_NUMBER: _ClassVar[int]
    ROOT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    ROTATIONS_FIELD_NUMBER: _ClassVar[int]
    PACKED_ROOTS_FIELD_NUMBER: _ClassVar[int]
    PACKED_ROTATIONS_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    SIX_D_FIELD_NUMBER: _ClassVar[int]
    QPOS_FIELD_NUMBER: _ClassVar[int]
    HINGE_RESIDUALS_FIELD_NUMBER: _ClassVar[int]
    CLAMPED_HINGES_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    SKELETON_FIELD_NUMBER: _ClassVar[int]
    HINGE_SPEED_RATIOS_FIELD_NUMBER: _ClassVar[int]
    FASTEST_HINGES_FIELD_NUMBER: _ClassVar[int]
    HINGE_ACCELERATIONS_FIELD_NUMBER: _ClassVar[int]
    pack: str
    slots: _containers.RepeatedScalarFieldContainer[int]
    frame_count: int
    first_frames: _containers.RepeatedScalarFieldContainer[int]
    root_positions: _containers.RepeatedScalarFieldContainer[float]
    rotations: _containers.RepeatedScalarFieldContainer[float]
    packed_roots: bytes
    packed_rotations: bytes
    contacts: bytes
    positions: _containers.RepeatedScalarFieldContainer[float]
    six_d: _containers.RepeatedScalarFieldContainer[float]
    qpos: _containers.RepeatedScalarFieldContainer[float]
    hinge_residuals: _containers.RepeatedScalarFieldContainer[float]
    clamped_hinges: _containers.RepeatedScalarFieldContainer[int]
    body: str
    skeleton: str
    hinge_speed_ratios: _containers.RepeatedScalarFieldContainer[float]
    fastest_hinges: _containers.RepeatedScalarFieldContainer[int]
    hinge_accelerations: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, pack: _Optional[str] = ..., slots: _Optional[_Iterable[int]] = ..., frame_count: _Optional[int] = ..., first_frames: _Optional[_Iterable[int]] = ..., root_positions: _Optional[_Iterable[float]] = ..., rotations: _Optional[_Iterable[float]] = ..., packed_roots: _Optional[bytes] = ..., packed_rotations: _Optional[bytes] = ..., contacts: _Optional[bytes] = ..., positions: _Optional[_Iterable[float]] = ..., six_d: _Optional[_Iterable[float]] = ..., qpos: _Optional[_Iterable[float]] = ..., hinge_residuals: _Optional[_Iterable[float]] = ..., clamped_hinges: _Optional[_Iterable[int]] = ..., body: _Optional[str] = ..., skeleton: _Optional[str] = ..., hinge_speed_ratios: _Optional[_Iterable[float]] = ..., fastest_hinges: _Optional[_Iterable[int]] = ..., hinge_accelerations: _Optional[_Iterable[float]] = ...) -> None: ...

class SessionProblem(_message.Message):
    __slots__ = ("slot", "session_id", "problem")
    SLOT_FIELD_NUMBER: _ClassVar[int]
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    slot: int
    session_id: str
    problem: Problem
    def __init__(self, slot: _Optional[int] = ..., session_id: _Optional[str] = ..., problem: _Optional[_Union[Problem, _Mapping]] = ...) -> None: ...

class StepRequest(_message.Message):
    __slots__ = ("session_ids", "frames", "rate_hz", "commands", "encoding", "return_positions", "return_six_d")
    SESSION_IDS_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    RETURN_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    RETURN_SIX_D_FIELD_NUMBER: _ClassVar[int]
    session_ids: _containers.RepeatedScalarFieldContainer[str]
    frames: int
    rate_hz: int
    commands: _containers.RepeatedCompositeFieldContainer[Command]
    encoding: Encoding
    return_positions: bool
    return_six_d: bool
    def __init__(self, session_ids: _Optional[_Iterable[str]] = ..., frames: _Optional[int] = ..., rate_hz: _Optional[int] = ..., commands: _Optional[_Iterable[_Union[Command, _Mapping]]] = ..., encoding: _Optional[_Union[Encoding, str]] = ..., return_positions: _Optional[bool] = ..., return_six_d: _Optional[bool] = ...) -> None: ...

class StepResponse(_message.Message):
    __slots__ = ("blocks", "command_results", "problems", "total_us", "waited_us", "events", "held")
    BLOCKS_FIELD_NUMBER: _ClassVar[int]
    COMMAND_RESULTS_FIELD_NUMBER: _ClassVar[int]
    PROBLEMS_FIELD_NUMBER: _ClassVar[int]
    TOTAL_US_FIELD_NUMBER: _ClassVar[int]
    WAITED_US_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    blocks: _containers.RepeatedCompositeFieldContainer[FrameBlock]
    command_results: _containers.RepeatedCompositeFieldContainer[CommandResult]
    problems: _containers.RepeatedCompositeFieldContainer[SessionProblem]
    total_us: int
    waited_us: int
    events: _containers.RepeatedCompositeFieldContainer[_event_pb2.SessionEvents]
    held: _containers.RepeatedCompositeFieldContainer[_event_pb2.HeldObject]
    def __init__(self, blocks: _Optional[_Iterable[_Union[FrameBlock, _Mapping]]] = ..., command_results: _Optional[_Iterable[_Union[CommandResult, _Mapping]]] = ..., problems: _Optional[_Iterable[_Union[SessionProblem, _Mapping]]] = ..., total_us: _Optional[int] = ..., waited_us: _Optional[int] = ..., events: _Optional[_Iterable[_Union[_event_pb2.SessionEvents, _Mapping]]] = ..., held: _Optional[_Iterable[_Union[_event_pb2.HeldObject, _Mapping]]] = ...) -> None: ...

class DriveOpen(_message.Message):
    __slots__ = ("rate_hz", "encoding", "return_positions", "close_sessions", "return_six_d", "watch")
    RATE_HZ_FIELD_NUMBER: _ClassVar[int]
    ENCODING_FIELD_NUMBER: _ClassVar[int]
    RETURN_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    CLOSE_SESSIONS_FIELD_NUMBER: _ClassVar[int]
    RETURN_SIX_D_FIELD_NUMBER: _ClassVar[int]
    WATCH_FIELD_NUMBER: _ClassVar[int]
    rate_hz: int
    encoding: Encoding
    return_positions: bool
    close_sessions: bool
    return_six_d: bool
    watch: str
    def __init__(self, rate_hz: _Optional[int] = ..., encoding: _Optional[_Union[Encoding, str]] = ..., return_positions: _Optional[bool] = ..., close_sessions: _Optional[bool] = ..., return_six_d: _Optional[bool] = ..., watch: _Optional[str] = ...) -> None: ...

class DriveAttach(_message.Message):
    __slots__ = ("session_ids",)
    SESSION_IDS_FIELD_NUMBER: _ClassVar[int]
    session_ids: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, session_ids: _Optional[_Iterable[str]] = ...) -> None: ...

class DriveDetach(_message.Message):
    __slots__ = ("session_ids",)
    SESSION_IDS_FIELD_NUMBER: _ClassVar[int]
    session_ids: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, session_ids: _Optional[_Iterable[str]] = ...) -> None: ...

class DriveRequest(_message.Message):
    __slots__ = ("open", "attach", "detach", "command")
    OPEN_FIELD_NUMBER: _ClassVar[int]
    ATTACH_FIELD_NUMBER: _ClassVar[int]
    DETACH_FIELD_NUMBER: _ClassVar[int]
    COMMAND_FIELD_NUMBER: _ClassVar[int]
    open: DriveOpen
    attach: DriveAttach
    detach: DriveDetach
    command: CommandRequest
    def __init__(self, open: _Optional[_Union[DriveOpen, _Mapping]] = ..., attach: _Optional[_Union[DriveAttach, _Mapping]] = ..., detach: _Optional[_Union[DriveDetach, _Mapping]] = ..., command: _Optional[_Union[CommandRequest, _Mapping]] = ...) -> None: ...

class Attached(_message.Message):
    __slots__ = ("session_id", "slot")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    SLOT_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    slot: int
    def __init__(self, session_id: _Optional[str] = ..., slot: _Optional[int] = ...) -> None: ...

class DriveAttached(_message.Message):
    __slots__ = ("sessions", "problems")
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    PROBLEMS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[Attached]
    problems: _containers.RepeatedCompositeFieldContainer[SessionProblem]
    def __init__(self, sessions: _Optional[_Iterable[_Union[Attached, _Mapping]]] = ..., problems: _Optional[_Iterable[_Union[SessionProblem, _Mapping]]] = ...) -> None: ...

class DriveFrames(_message.Message):
    __slots__ = ("tick", "blocks", "dropped_ticks", "underruns", "held")
    TICK_FIELD_NUMBER: _ClassVar[int]
    BLOCKS_FIELD_NUMBER: _ClassVar[int]
    DROPPED_TICKS_FIELD_NUMBER: _ClassVar[int]
    UNDERRUNS_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    tick: int
    blocks: _containers.RepeatedCompositeFieldContainer[FrameBlock]
    dropped_ticks: int
    underruns: int
    held: _containers.RepeatedCompositeFieldContainer[_event_pb2.HeldObject]
    def __init__(self, tick: _Optional[int] = ..., blocks: _Optional[_Iterable[_Union[FrameBlock, _Mapping]]] = ..., dropped_ticks: _Optional[int] = ..., underruns: _Optional[int] = ..., held: _Optional[_Iterable[_Union[_event_pb2.HeldObject, _Mapping]]] = ...) -> None: ...

class DriveEvents(_message.Message):
    __slots__ = ("sessions",)
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[_event_pb2.SessionEvents]
    def __init__(self, sessions: _Optional[_Iterable[_Union[_event_pb2.SessionEvents, _Mapping]]] = ...) -> None: ...

class DriveLeft(_message.Message):
    __slots__ = ("sessions",)
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    sessions: _containers.RepeatedCompositeFieldContainer[SessionProblem]
    def __init__(self, sessions: _Optional[_Iterable[_Union[SessionProblem, _Mapping]]] = ...) -> None: ...

class DriveClosing(_message.Message):
    __slots__ = ("reason",)
    REASON_FIELD_NUMBER: _ClassVar[int]
    reason: Problem
    def __init__(self, reason: _Optional[_Union[Problem, _Mapping]] = ...) -> None: ...

class DriveResponse(_message.Message):
    __slots__ = ("frames", "attached", "left", "commands", "closing", "events")
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    ATTACHED_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    CLOSING_FIELD_NUMBER: _ClassVar[int]
    EVENTS_FIELD_NUMBER: _ClassVar[int]
    frames: DriveFrames
    attached: DriveAttached
    left: DriveLeft
    commands: CommandResponse
    closing: DriveClosing
    events: DriveEvents
    def __init__(self, frames: _Optional[_Union[DriveFrames, _Mapping]] = ..., attached: _Optional[_Union[DriveAttached, _Mapping]] = ..., left: _Optional[_Union[DriveLeft, _Mapping]] = ..., commands: _Optional[_Union[CommandResponse, _Mapping]] = ..., closing: _Optional[_Union[DriveClosing, _Mapping]] = ..., events: _Optional[_Union[DriveEvents, _Mapping]] = ...) -> None: ...

class PeekRequest(_message.Message):
    __slots__ = ("session_id", "frames")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    frames: int
    def __init__(self, session_id: _Optional[str] = ..., frames: _Optional[int] = ...) -> None: ...

class PlanView(_message.Message):
    __slots__ = ("number", "cause", "asked_at_frame", "splice_frame", "context", "targets", "root_r_g1", "root_r_g2", "root_r_g3", "root_r_g4", "tokens", "token_count_probabilities", "gaits")
    NUMBER_FIELD_NUMBER: _ClassVar[int]
    CAUSE_FIELD_NUMBER: _ClassVar[int]
    ASKED_AT_FRAME_FIELD_NUMBER: _ClassVar[int]
    SPLICE_FRAME_FIELD_NUMBER: _ClassVar[int]
    CONTEXT_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    ROOT_R_G1_FIELD_NUMBER: _ClassVar[int]
    ROOT_R_G2_FIELD_NUMBER: _ClassVar[int]
    ROOT_R_G3_FIELD_NUMBER: _ClassVar[int]
    ROOT_R_G4_FIELD_NUMBER: _ClassVar[int]
    TOKENS_FIELD_NUMBER: _ClassVar[int]
    TOKEN_COUNT_PROBABILITIES_FIELD_NUMBER: _ClassVar[int]
    GAITS_FIELD_NUMBER: _ClassVar[int]
    number: int
    cause: str
    asked_at_frame: int
    splice_frame: int
    context: _containers.RepeatedCompositeFieldContainer[_motion_pb2.Keyframe]
    targets: _containers.RepeatedCompositeFieldContainer[_motion_pb2.Keyframe]
    root_r_g1: _motion_pb2.Root
    root_r_g2: _containers.RepeatedScalarFieldContainer[float]
    root_r_g3: _containers.RepeatedScalarFieldContainer[float]
    root_r_g4: _containers.RepeatedScalarFieldContainer[float]
    tokens: _containers.RepeatedScalarFieldContainer[int]
    token_count_probabilities: _containers.RepeatedScalarFieldContainer[float]
    gaits: _containers.RepeatedCompositeFieldContainer[GaitWeight]
    def __init__(self, number: _Optional[int] = ..., cause: _Optional[str] = ..., asked_at_frame: _Optional[int] = ..., splice_frame: _Optional[int] = ..., context: _Optional[_Iterable[_Union[_motion_pb2.Keyframe, _Mapping]]] = ..., targets: _Optional[_Iterable[_Union[_motion_pb2.Keyframe, _Mapping]]] = ..., root_r_g1: _Optional[_Union[_motion_pb2.Root, _Mapping]] = ..., root_r_g2: _Optional[_Iterable[float]] = ..., root_r_g3: _Optional[_Iterable[float]] = ..., root_r_g4: _Optional[_Iterable[float]] = ..., tokens: _Optional[_Iterable[int]] = ..., token_count_probabilities: _Optional[_Iterable[float]] = ..., gaits: _Optional[_Iterable[_Union[GaitWeight, _Mapping]]] = ...) -> None: ...

class GaitWeight(_message.Message):
    __slots__ = ("gait", "weight")
    GAIT_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    gait: str
    weight: float
    def __init__(self, gait: _Optional[str] = ..., weight: _Optional[float] = ...) -> None: ...

class PeekResponse(_message.Message):
    __slots__ = ("session", "future", "plan", "in_flight", "waiting")
    SESSION_FIELD_NUMBER: _ClassVar[int]
    FUTURE_FIELD_NUMBER: _ClassVar[int]
    PLAN_FIELD_NUMBER: _ClassVar[int]
    IN_FLIGHT_FIELD_NUMBER: _ClassVar[int]
    WAITING_FIELD_NUMBER: _ClassVar[int]
    session: Session
    future: FrameBlock
    plan: PlanView
    in_flight: bool
    waiting: Command
    def __init__(self, session: _Optional[_Union[Session, _Mapping]] = ..., future: _Optional[_Union[FrameBlock, _Mapping]] = ..., plan: _Optional[_Union[PlanView, _Mapping]] = ..., in_flight: _Optional[bool] = ..., waiting: _Optional[_Union[Command, _Mapping]] = ...) -> None: ...

class GetRecordingRequest(_message.Message):
    __slots__ = ("session_id",)
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    def __init__(self, session_id: _Optional[str] = ...) -> None: ...

class SessionRecording(_message.Message):
    __slots__ = ("session_id", "lines", "ended")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    LINES_FIELD_NUMBER: _ClassVar[int]
    ENDED_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    lines: str
    ended: bool
    def __init__(self, session_id: _Optional[str] = ..., lines: _Optional[str] = ..., ended: _Optional[bool] = ...) -> None: ...

class ReplayRequest(_message.Message):
    __slots__ = ("recording", "anyway")
    RECORDING_FIELD_NUMBER: _ClassVar[int]
    ANYWAY_FIELD_NUMBER: _ClassVar[int]
    recording: str
    anyway: bool
    def __init__(self, recording: _Optional[str] = ..., anyway: _Optional[bool] = ...) -> None: ...

class ReplayDifference(_message.Message):
    __slots__ = ("frame", "field", "message")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    FIELD_FIELD_NUMBER: _ClassVar[int]
    MESSAGE_FIELD_NUMBER: _ClassVar[int]
    frame: int
    field: str
    message: str
    def __init__(self, frame: _Optional[int] = ..., field: _Optional[str] = ..., message: _Optional[str] = ...) -> None: ...

class ReplayResponse(_message.Message):
    __slots__ = ("frames", "is_last", "equal", "difference", "commands", "underruns", "notes")
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    IS_LAST_FIELD_NUMBER: _ClassVar[int]
    EQUAL_FIELD_NUMBER: _ClassVar[int]
    DIFFERENCE_FIELD_NUMBER: _ClassVar[int]
    COMMANDS_FIELD_NUMBER: _ClassVar[int]
    UNDERRUNS_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    frames: int
    is_last: bool
    equal: bool
    difference: ReplayDifference
    commands: int
    underruns: int
    notes: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, frames: _Optional[int] = ..., is_last: _Optional[bool] = ..., equal: _Optional[bool] = ..., difference: _Optional[_Union[ReplayDifference, _Mapping]] = ..., commands: _Optional[int] = ..., underruns: _Optional[int] = ..., notes: _Optional[_Iterable[str]] = ...) -> None: ...

class ListStylesRequest(_message.Message):
    __slots__ = ("pack", "body")
    PACK_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    pack: str
    body: str
    def __init__(self, pack: _Optional[str] = ..., body: _Optional[str] = ...) -> None: ...

class ListStylesResponse(_message.Message):
    __slots__ = ("pack", "styles", "default_style", "body")
    PACK_FIELD_NUMBER: _ClassVar[int]
    STYLES_FIELD_NUMBER: _ClassVar[int]
    DEFAULT_STYLE_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    pack: str
    styles: _containers.RepeatedCompositeFieldContainer[Style]
    default_style: str
    body: str
    def __init__(self, pack: _Optional[str] = ..., styles: _Optional[_Iterable[_Union[Style, _Mapping]]] = ..., default_style: _Optional[str] = ..., body: _Optional[str] = ...) -> None: ...

class GetStyleRequest(_message.Message):
    __slots__ = ("pack", "style", "body")
    PACK_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    pack: str
    style: str
    body: str
    def __init__(self, pack: _Optional[str] = ..., style: _Optional[str] = ..., body: _Optional[str] = ...) -> None: ...

class PutStyleRequest(_message.Message):
    __slots__ = ("pack", "style", "body")
    PACK_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    BODY_FIELD_NUMBER: _ClassVar[int]
    pack: str
    style: Style
    body: str
    def __init__(self, pack: _Optional[str] = ..., style: _Optional[_Union[Style, _Mapping]] = ..., body: _Optional[str] = ...) -> None: ...

class Style(_message.Message):
    __slots__ = ("name", "default_speed", "replan_interval_frames", "allowed_token_counts", "is_static", "root_ratio", "gaits", "built_in", "words")
    NAME_FIELD_NUMBER: _ClassVar[int]
    DEFAULT_SPEED_FIELD_NUMBER: _ClassVar[int]
    REPLAN_INTERVAL_FRAMES_FIELD_NUMBER: _ClassVar[int]
    ALLOWED_TOKEN_COUNTS_FIELD_NUMBER: _ClassVar[int]
    IS_STATIC_FIELD_NUMBER: _ClassVar[int]
    ROOT_RATIO_FIELD_NUMBER: _ClassVar[int]
    GAITS_FIELD_NUMBER: _ClassVar[int]
    BUILT_IN_FIELD_NUMBER: _ClassVar[int]
    WORDS_FIELD_NUMBER: _ClassVar[int]
    name: str
    default_speed: float
    replan_interval_frames: int
    allowed_token_counts: _containers.RepeatedScalarFieldContainer[int]
    is_static: bool
    root_ratio: float
    gaits: _containers.RepeatedCompositeFieldContainer[Gait]
    built_in: bool
    words: _containers.RepeatedCompositeFieldContainer[_motion_pb2.StyleWord]
    def __init__(self, name: _Optional[str] = ..., default_speed: _Optional[float] = ..., replan_interval_frames: _Optional[int] = ..., allowed_token_counts: _Optional[_Iterable[int]] = ..., is_static: _Optional[bool] = ..., root_ratio: _Optional[float] = ..., gaits: _Optional[_Iterable[_Union[Gait, _Mapping]]] = ..., built_in: _Optional[bool] = ..., words: _Optional[_Iterable[_Union[_motion_pb2.StyleWord, _Mapping]]] = ...) -> None: ...

class Gait(_message.Message):
    __slots__ = ("name", "left", "forward", "turn", "period_frames", "keys", "key_count", "height")
    NAME_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    FORWARD_FIELD_NUMBER: _ClassVar[int]
    TURN_FIELD_NUMBER: _ClassVar[int]
    PERIOD_FRAMES_FIELD_NUMBER: _ClassVar[int]
    KEYS_FIELD_NUMBER: _ClassVar[int]
    KEY_COUNT_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    name: str
    left: float
    forward: float
    turn: float
    period_frames: float
    keys: _containers.RepeatedCompositeFieldContainer[GaitKey]
    key_count: int
    height: float
    def __init__(self, name: _Optional[str] = ..., left: _Optional[float] = ..., forward: _Optional[float] = ..., turn: _Optional[float] = ..., period_frames: _Optional[float] = ..., keys: _Optional[_Iterable[_Union[GaitKey, _Mapping]]] = ..., key_count: _Optional[int] = ..., height: _Optional[float] = ...) -> None: ...

class GaitKey(_message.Message):
    __slots__ = ("rotations", "height", "left", "forward", "turn")
    ROTATIONS_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    LEFT_FIELD_NUMBER: _ClassVar[int]
    FORWARD_FIELD_NUMBER: _ClassVar[int]
    TURN_FIELD_NUMBER: _ClassVar[int]
    rotations: _containers.RepeatedScalarFieldContainer[float]
    height: float
    left: float
    forward: float
    turn: float
    def __init__(self, rotations: _Optional[_Iterable[float]] = ..., height: _Optional[float] = ..., left: _Optional[float] = ..., forward: _Optional[float] = ..., turn: _Optional[float] = ...) -> None: ...
