from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class Sound(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    SOUND_MUSIC: _ClassVar[Sound]
    SOUND_SPEECH: _ClassVar[Sound]

class PathPlanner(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    PATH_PLANNER_AUTO: _ClassVar[PathPlanner]
    PATH_PLANNER_OWN: _ClassVar[PathPlanner]
    PATH_PLANNER_CARRIED: _ClassVar[PathPlanner]

class Telling(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    TELLING_WORDS: _ClassVar[Telling]
    TELLING_MUSIC: _ClassVar[Telling]
    TELLING_SPEECH: _ClassVar[Telling]
SOUND_MUSIC: Sound
SOUND_SPEECH: Sound
PATH_PLANNER_AUTO: PathPlanner
PATH_PLANNER_OWN: PathPlanner
PATH_PLANNER_CARRIED: PathPlanner
TELLING_WORDS: Telling
TELLING_MUSIC: Telling
TELLING_SPEECH: Telling

class Vec3(_message.Message):
    __slots__ = ("x", "y", "z")
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    x: float
    y: float
    z: float
    def __init__(self, x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Quat(_message.Message):
    __slots__ = ("w", "x", "y", "z")
    W_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Y_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    w: float
    x: float
    y: float
    z: float
    def __init__(self, w: _Optional[float] = ..., x: _Optional[float] = ..., y: _Optional[float] = ..., z: _Optional[float] = ...) -> None: ...

class Root(_message.Message):
    __slots__ = ("position", "heading")
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    position: Vec3
    heading: float
    def __init__(self, position: _Optional[_Union[Vec3, _Mapping]] = ..., heading: _Optional[float] = ...) -> None: ...

class RootVelocity(_message.Message):
    __slots__ = ("x", "z", "angular", "height")
    X_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    ANGULAR_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    x: float
    z: float
    angular: float
    height: float
    def __init__(self, x: _Optional[float] = ..., z: _Optional[float] = ..., angular: _Optional[float] = ..., height: _Optional[float] = ...) -> None: ...

class Pose(_message.Message):
    __slots__ = ("rotations", "root_height")
    ROTATIONS_FIELD_NUMBER: _ClassVar[int]
    ROOT_HEIGHT_FIELD_NUMBER: _ClassVar[int]
    rotations: _containers.RepeatedScalarFieldContainer[float]
    root_height: float
    def __init__(self, rotations: _Optional[_Iterable[float]] = ..., root_height: _Optional[float] = ...) -> None: ...

class Keyframe(_message.Message):
    __slots__ = ("root", "velocity", "pose", "qpos")
    ROOT_FIELD_NUMBER: _ClassVar[int]
    VELOCITY_FIELD_NUMBER: _ClassVar[int]
    POSE_FIELD_NUMBER: _ClassVar[int]
    QPOS_FIELD_NUMBER: _ClassVar[int]
    root: Root
    velocity: RootVelocity
    pose: Pose
    qpos: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, root: _Optional[_Union[Root, _Mapping]] = ..., velocity: _Optional[_Union[RootVelocity, _Mapping]] = ..., pose: _Optional[_Union[Pose, _Mapping]] = ..., qpos: _Optional[_Iterable[float]] = ...) -> None: ...

class RootKey(_message.Message):
    __slots__ = ("frame", "x", "z", "height", "heading")
    FRAME_FIELD_NUMBER: _ClassVar[int]
    X_FIELD_NUMBER: _ClassVar[int]
    Z_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    frame: int
    x: float
    z: float
    height: float
    heading: float
    def __init__(self, frame: _Optional[int] = ..., x: _Optional[float] = ..., z: _Optional[float] = ..., height: _Optional[float] = ..., heading: _Optional[float] = ...) -> None: ...

class Character(_message.Message):
    __slots__ = ("id", "context", "targets", "frame_count", "allowed_token_counts", "seed", "temperature", "pose_steps", "return_intermediates", "return_positions", "return_six_d", "return_qpos", "hold_feet", "strict", "root")
    ID_FIELD_NUMBER: _ClassVar[int]
    CONTEXT_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    FRAME_COUNT_FIELD_NUMBER: _ClassVar[int]
    ALLOWED_TOKEN_COUNTS_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    POSE_STEPS_FIELD_NUMBER: _ClassVar[int]
    RETURN_INTERMEDIATES_FIELD_NUMBER: _ClassVar[int]
    RETURN_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    RETURN_SIX_D_FIELD_NUMBER: _ClassVar[int]
    RETURN_QPOS_FIELD_NUMBER: _ClassVar[int]
    HOLD_FEET_FIELD_NUMBER: _ClassVar[int]
    STRICT_FIELD_NUMBER: _ClassVar[int]
    ROOT_FIELD_NUMBER: _ClassVar[int]
    id: str
    context: _containers.RepeatedCompositeFieldContainer[Keyframe]
    targets: _containers.RepeatedCompositeFieldContainer[Keyframe]
    frame_count: int
    allowed_token_counts: _containers.RepeatedScalarFieldContainer[int]
    seed: int
    temperature: float
    pose_steps: int
    return_intermediates: bool
    return_positions: bool
    return_six_d: bool
    return_qpos: bool
    hold_feet: bool
    strict: bool
    root: _containers.RepeatedCompositeFieldContainer[RootKey]
    def __init__(self, id: _Optional[str] = ..., context: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ..., targets: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ..., frame_count: _Optional[int] = ..., allowed_token_counts: _Optional[_Iterable[int]] = ..., seed: _Optional[int] = ..., temperature: _Optional[float] = ..., pose_steps: _Optional[int] = ..., return_intermediates: _Optional[bool] = ..., return_positions: _Optional[bool] = ..., return_six_d: _Optional[bool] = ..., return_qpos: _Optional[bool] = ..., hold_feet: _Optional[bool] = ..., strict: _Optional[bool] = ..., root: _Optional[_Iterable[_Union[RootKey, _Mapping]]] = ...) -> None: ...

class InBetweenRequest(_message.Message):
    __slots__ = ("pack", "characters", "skeleton")
    PACK_FIELD_NUMBER: _ClassVar[int]
    CHARACTERS_FIELD_NUMBER: _ClassVar[int]
    SKELETON_FIELD_NUMBER: _ClassVar[int]
    pack: str
    characters: _containers.RepeatedCompositeFieldContainer[Character]
    skeleton: str
    def __init__(self, pack: _Optional[str] = ..., characters: _Optional[_Iterable[_Union[Character, _Mapping]]] = ..., skeleton: _Optional[str] = ...) -> None: ...

class Frames(_message.Message):
    __slots__ = ("frame_count", "root_positions", "rotations", "contacts", "positions", "six_d", "qpos", "hinge_residuals", "clamped_hinges", "hinge_speed_ratios", "fastest_hinges", "hinge_accelerations")
    FRAME_COUNT_FIELD_NUMBER: _ClassVar[int]
    ROOT_POSITIONS_FIELD_NUMBER: _ClassVar[int]
    ROTATIONS_FIELD_NUMBER: _ClassVar[int]
    CONTACTS_FIELD_NUMBER: _ClassVar[int]
    POSITIONS_FIELD_NUMBER: _ClassVar[int]
    SIX_D_FIELD_NUMBER: _ClassVar[int]
    QPOS_FIELD_NUMBER: _ClassVar[int]
    HINGE_RESIDUALS_FIELD_NUMBER: _ClassVar[int]
    CLAMPED_HINGES_FIELD_NUMBER: _ClassVar[int]
    HINGE_SPEED_RATIOS_FIELD_NUMBER: _ClassVar[int]
    FASTEST_HINGES_FIELD_NUMBER: _ClassVar[int]
    HINGE_ACCELERATIONS_FIELD_NUMBER: _ClassVar[int]
    frame_count: int
    root_positions: _containers.RepeatedScalarFieldContainer[float]
    rotations: _containers.RepeatedScalarFieldContainer[float]
    contacts: _containers.RepeatedScalarFieldContainer[float]
    positions: _containers.RepeatedScalarFieldContainer[float]
    six_d: _containers.RepeatedScalarFieldContainer[float]
    qpos: _containers.RepeatedScalarFieldContainer[float]
    hinge_residuals: _containers.RepeatedScalarFieldContainer[float]
    clamped_hinges: _containers.RepeatedScalarFieldContainer[int]
    hinge_speed_ratios: _containers.RepeatedScalarFieldContainer[float]
    fastest_hinges: _containers.RepeatedScalarFieldContainer[int]
    hinge_accelerations: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, frame_count: _Optional[int] = ..., root_positions: _Optional[_Iterable[float]] = ..., rotations: _Optional[_Iterable[float]] = ..., contacts: _Optional[_Iterable[float]] = ..., positions: _Optional[_Iterable[float]] = ..., six_d: _Optional[_Iterable[float]] = ..., qpos: _Optional[_Iterable[float]] = ..., hinge_residuals: _Optional[_Iterable[float]] = ..., clamped_hinges: _Optional[_Iterable[int]] = ..., hinge_speed_ratios: _Optional[_Iterable[float]] = ..., fastest_hinges: _Optional[_Iterable[int]] = ..., hinge_accelerations: _Optional[_Iterable[float]] = ...) -> None: ...

class Intermediates(_message.Message):
    __slots__ = ("predicted_frame_count", "token_count_probabilities", "root_r_g3", "tokens", "root_r_g4")
    PREDICTED_FRAME_COUNT_FIELD_NUMBER: _ClassVar[int]
    TOKEN_COUNT_PROBABILITIES_FIELD_NUMBER: _ClassVar[int]
    ROOT_R_G3_FIELD_NUMBER: _ClassVar[int]
    TOKENS_FIELD_NUMBER: _ClassVar[int]
    ROOT_R_G4_FIELD_NUMBER: _ClassVar[int]
    predicted_frame_count: int
    token_count_probabilities: _containers.RepeatedScalarFieldContainer[float]
    root_r_g3: _containers.RepeatedScalarFieldContainer[float]
    tokens: _containers.RepeatedScalarFieldContainer[int]
    root_r_g4: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, predicted_frame_count: _Optional[int] = ..., token_count_probabilities: _Optional[_Iterable[float]] = ..., root_r_g3: _Optional[_Iterable[float]] = ..., tokens: _Optional[_Iterable[int]] = ..., root_r_g4: _Optional[_Iterable[float]] = ...) -> None: ...

class FeasibilityFigure(_message.Message):
    __slots__ = ("value", "limit", "frame", "joint")
    VALUE_FIELD_NUMBER: _ClassVar[int]
    LIMIT_FIELD_NUMBER: _ClassVar[int]
    FRAME_FIELD_NUMBER: _ClassVar[int]
    JOINT_FIELD_NUMBER: _ClassVar[int]
    value: float
    limit: float
    frame: int
    joint: int
    def __init__(self, value: _Optional[float] = ..., limit: _Optional[float] = ..., frame: _Optional[int] = ..., joint: _Optional[int] = ...) -> None: ...

class Feasibility(_message.Message):
    __slots__ = ("feasible", "worst", "ratio", "root_speed", "root_acceleration", "turning", "joint_speed", "joint_acceleration", "below_ground", "off_ground", "tilt", "bend", "root_reach", "turn_reach", "pose_reach", "hinge_speed", "hinge_acceleration")
    FEASIBLE_FIELD_NUMBER: _ClassVar[int]
    WORST_FIELD_NUMBER: _ClassVar[int]
    RATIO_FIELD_NUMBER: _ClassVar[int]
    ROOT_SPEED_FIELD_NUMBER: _ClassVar[int]
    ROOT_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    TURNING_FIELD_NUMBER: _ClassVar[int]
    JOINT_SPEED_FIELD_NUMBER: _ClassVar[int]
    JOINT_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    BELOW_GROUND_FIELD_NUMBER: _ClassVar[int]
    OFF_GROUND_FIELD_NUMBER: _ClassVar[int]
    TILT_FIELD_NUMBER: _ClassVar[int]
    BEND_FIELD_NUMBER: _ClassVar[int]
    ROOT_REACH_FIELD_NUMBER: _ClassVar[int]
    TURN_REACH_FIELD_NUMBER: _ClassVar[int]
    POSE_REACH_FIELD_NUMBER: _ClassVar[int]
    HINGE_SPEED_FIELD_NUMBER: _ClassVar[int]
    HINGE_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    feasible: bool
    worst: str
    ratio: float
    root_speed: FeasibilityFigure
    root_acceleration: FeasibilityFigure
    turning: FeasibilityFigure
    joint_speed: FeasibilityFigure
    joint_acceleration: FeasibilityFigure
    below_ground: FeasibilityFigure
    off_ground: FeasibilityFigure
    tilt: FeasibilityFigure
    bend: FeasibilityFigure
    root_reach: FeasibilityFigure
    turn_reach: FeasibilityFigure
    pose_reach: FeasibilityFigure
    hinge_speed: FeasibilityFigure
    hinge_acceleration: FeasibilityFigure
    def __init__(self, feasible: _Optional[bool] = ..., worst: _Optional[str] = ..., ratio: _Optional[float] = ..., root_speed: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., root_acceleration: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., turning: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., joint_speed: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., joint_acceleration: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., below_ground: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., off_ground: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., tilt: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., bend: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., root_reach: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., turn_reach: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., pose_reach: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., hinge_speed: _Optional[_Union[FeasibilityFigure, _Mapping]] = ..., hinge_acceleration: _Optional[_Union[FeasibilityFigure, _Mapping]] = ...) -> None: ...

class CharacterResult(_message.Message):
    __slots__ = ("id", "frames", "intermediates", "feasibility")
    ID_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    INTERMEDIATES_FIELD_NUMBER: _ClassVar[int]
    FEASIBILITY_FIELD_NUMBER: _ClassVar[int]
    id: str
    frames: Frames
    intermediates: Intermediates
    feasibility: Feasibility
    def __init__(self, id: _Optional[str] = ..., frames: _Optional[_Union[Frames, _Mapping]] = ..., intermediates: _Optional[_Union[Intermediates, _Mapping]] = ..., feasibility: _Optional[_Union[Feasibility, _Mapping]] = ...) -> None: ...

class GenerateRequest(_message.Message):
    __slots__ = ("pack", "prompt", "path", "past", "seed", "sampling", "skeleton", "raw")
    PACK_FIELD_NUMBER: _ClassVar[int]
    PROMPT_FIELD_NUMBER: _ClassVar[int]
    PATH_FIELD_NUMBER: _ClassVar[int]
    PAST_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SAMPLING_FIELD_NUMBER: _ClassVar[int]
    SKELETON_FIELD_NUMBER: _ClassVar[int]
    RAW_FIELD_NUMBER: _ClassVar[int]
    pack: str
    prompt: Prompt
    path: PathGoal
    past: _containers.RepeatedCompositeFieldContainer[Keyframe]
    seed: int
    sampling: Sampling
    skeleton: str
    raw: bool
    def __init__(self, pack: _Optional[str] = ..., prompt: _Optional[_Union[Prompt, _Mapping]] = ..., path: _Optional[_Union[PathGoal, _Mapping]] = ..., past: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ..., seed: _Optional[int] = ..., sampling: _Optional[_Union[Sampling, _Mapping]] = ..., skeleton: _Optional[str] = ..., raw: _Optional[bool] = ...) -> None: ...

class Sampling(_message.Message):
    __slots__ = ("temperature", "top_k", "top_p", "repetition")
    TEMPERATURE_FIELD_NUMBER: _ClassVar[int]
    TOP_K_FIELD_NUMBER: _ClassVar[int]
    TOP_P_FIELD_NUMBER: _ClassVar[int]
    REPETITION_FIELD_NUMBER: _ClassVar[int]
    temperature: float
    top_k: int
    top_p: float
    repetition: float
    def __init__(self, temperature: _Optional[float] = ..., top_k: _Optional[int] = ..., top_p: _Optional[float] = ..., repetition: _Optional[float] = ...) -> None: ...

class Prompt(_message.Message):
    __slots__ = ("text", "frame_count", "seconds", "targets", "others", "audio", "flow_steps")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    FRAME_COUNT_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    OTHERS_FIELD_NUMBER: _ClassVar[int]
    AUDIO_FIELD_NUMBER: _ClassVar[int]
    FLOW_STEPS_FIELD_NUMBER: _ClassVar[int]
    text: str
    frame_count: int
    seconds: float
    targets: _containers.RepeatedCompositeFieldContainer[Keyframe]
    others: _containers.RepeatedCompositeFieldContainer[Agent]
    audio: Audio
    flow_steps: int
    def __init__(self, text: _Optional[str] = ..., frame_count: _Optional[int] = ..., seconds: _Optional[float] = ..., targets: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ..., others: _Optional[_Iterable[_Union[Agent, _Mapping]]] = ..., audio: _Optional[_Union[Audio, _Mapping]] = ..., flow_steps: _Optional[int] = ...) -> None: ...

class Agent(_message.Message):
    __slots__ = ("text", "past")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    PAST_FIELD_NUMBER: _ClassVar[int]
    text: str
    past: _containers.RepeatedCompositeFieldContainer[Keyframe]
    def __init__(self, text: _Optional[str] = ..., past: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ...) -> None: ...

class Audio(_message.Message):
    __slots__ = ("sound", "codes")
    SOUND_FIELD_NUMBER: _ClassVar[int]
    CODES_FIELD_NUMBER: _ClassVar[int]
    sound: Sound
    codes: _containers.RepeatedScalarFieldContainer[int]
    def __init__(self, sound: _Optional[_Union[Sound, str]] = ..., codes: _Optional[_Iterable[int]] = ...) -> None: ...

class PathGoal(_message.Message):
    __slots__ = ("body", "skeleton", "points", "seconds", "speed", "style", "steps", "guidance", "targets", "strict", "keyframes", "planner")
    BODY_FIELD_NUMBER: _ClassVar[int]
    SKELETON_FIELD_NUMBER: _ClassVar[int]
    POINTS_FIELD_NUMBER: _ClassVar[int]
    SECONDS_FIELD_NUMBER: _ClassVar[int]
    SPEED_FIELD_NUMBER: _ClassVar[int]
    STYLE_FIELD_NUMBER: _ClassVar[int]
    STEPS_FIELD_NUMBER: _ClassVar[int]
    GUIDANCE_FIELD_NUMBER: _ClassVar[int]
    TARGETS_FIELD_NUMBER: _ClassVar[int]
    STRICT_FIELD_NUMBER: _ClassVar[int]
    KEYFRAMES_FIELD_NUMBER: _ClassVar[int]
    PLANNER_FIELD_NUMBER: _ClassVar[int]
    body: str
    skeleton: BodySkeleton
    points: _containers.RepeatedCompositeFieldContainer[PathPoint]
    seconds: float
    speed: float
    style: _containers.RepeatedCompositeFieldContainer[StyleWord]
    steps: int
    guidance: float
    targets: _containers.RepeatedCompositeFieldContainer[Keyframe]
    strict: bool
    keyframes: _containers.RepeatedCompositeFieldContainer[PathKeyframe]
    planner: PathPlanner
    def __init__(self, body: _Optional[str] = ..., skeleton: _Optional[_Union[BodySkeleton, _Mapping]] = ..., points: _Optional[_Iterable[_Union[PathPoint, _Mapping]]] = ..., seconds: _Optional[float] = ..., speed: _Optional[float] = ..., style: _Optional[_Iterable[_Union[StyleWord, _Mapping]]] = ..., steps: _Optional[int] = ..., guidance: _Optional[float] = ..., targets: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ..., strict: _Optional[bool] = ..., keyframes: _Optional[_Iterable[_Union[PathKeyframe, _Mapping]]] = ..., planner: _Optional[_Union[PathPlanner, str]] = ...) -> None: ...

class PathKeyframe(_message.Message):
    __slots__ = ("time", "keyframe")
    TIME_FIELD_NUMBER: _ClassVar[int]
    KEYFRAME_FIELD_NUMBER: _ClassVar[int]
    time: float
    keyframe: Keyframe
    def __init__(self, time: _Optional[float] = ..., keyframe: _Optional[_Union[Keyframe, _Mapping]] = ...) -> None: ...

class StyleWord(_message.Message):
    __slots__ = ("word", "weight")
    WORD_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    word: str
    weight: float
    def __init__(self, word: _Optional[str] = ..., weight: _Optional[float] = ...) -> None: ...

class PathPoint(_message.Message):
    __slots__ = ("position", "heading", "time")
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    TIME_FIELD_NUMBER: _ClassVar[int]
    position: Vec3
    heading: float
    time: float
    def __init__(self, position: _Optional[_Union[Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., time: _Optional[float] = ...) -> None: ...

class BodySkeleton(_message.Message):
    __slots__ = ("joints", "left_axis", "contact_joints", "neutral")
    JOINTS_FIELD_NUMBER: _ClassVar[int]
    LEFT_AXIS_FIELD_NUMBER: _ClassVar[int]
    CONTACT_JOINTS_FIELD_NUMBER: _ClassVar[int]
    NEUTRAL_FIELD_NUMBER: _ClassVar[int]
    joints: _containers.RepeatedCompositeFieldContainer[BodyJoint]
    left_axis: Vec3
    contact_joints: _containers.RepeatedScalarFieldContainer[str]
    neutral: _containers.RepeatedCompositeFieldContainer[Quat]
    def __init__(self, joints: _Optional[_Iterable[_Union[BodyJoint, _Mapping]]] = ..., left_axis: _Optional[_Union[Vec3, _Mapping]] = ..., contact_joints: _Optional[_Iterable[str]] = ..., neutral: _Optional[_Iterable[_Union[Quat, _Mapping]]] = ...) -> None: ...

class BodyJoint(_message.Message):
    __slots__ = ("name", "parent", "offset")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    name: str
    parent: str
    offset: Vec3
    def __init__(self, name: _Optional[str] = ..., parent: _Optional[str] = ..., offset: _Optional[_Union[Vec3, _Mapping]] = ...) -> None: ...

class GenerateResponse(_message.Message):
    __slots__ = ("frames", "is_last", "notes", "character", "feasibility")
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    IS_LAST_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    CHARACTER_FIELD_NUMBER: _ClassVar[int]
    FEASIBILITY_FIELD_NUMBER: _ClassVar[int]
    frames: Frames
    is_last: bool
    notes: _containers.RepeatedScalarFieldContainer[str]
    character: int
    feasibility: Feasibility
    def __init__(self, frames: _Optional[_Union[Frames, _Mapping]] = ..., is_last: _Optional[bool] = ..., notes: _Optional[_Iterable[str]] = ..., character: _Optional[int] = ..., feasibility: _Optional[_Union[Feasibility, _Mapping]] = ...) -> None: ...

class DescribeRequest(_message.Message):
    __slots__ = ("pack", "frames", "others", "into", "seed", "sampling")
    PACK_FIELD_NUMBER: _ClassVar[int]
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    OTHERS_FIELD_NUMBER: _ClassVar[int]
    INTO_FIELD_NUMBER: _ClassVar[int]
    SEED_FIELD_NUMBER: _ClassVar[int]
    SAMPLING_FIELD_NUMBER: _ClassVar[int]
    pack: str
    frames: _containers.RepeatedCompositeFieldContainer[Keyframe]
    others: _containers.RepeatedCompositeFieldContainer[OtherMotion]
    into: Telling
    seed: int
    sampling: Sampling
    def __init__(self, pack: _Optional[str] = ..., frames: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ..., others: _Optional[_Iterable[_Union[OtherMotion, _Mapping]]] = ..., into: _Optional[_Union[Telling, str]] = ..., seed: _Optional[int] = ..., sampling: _Optional[_Union[Sampling, _Mapping]] = ...) -> None: ...

class OtherMotion(_message.Message):
    __slots__ = ("frames",)
    FRAMES_FIELD_NUMBER: _ClassVar[int]
    frames: _containers.RepeatedCompositeFieldContainer[Keyframe]
    def __init__(self, frames: _Optional[_Iterable[_Union[Keyframe, _Mapping]]] = ...) -> None: ...

class DescribeResponse(_message.Message):
    __slots__ = ("text", "audio", "is_last", "notes")
    TEXT_FIELD_NUMBER: _ClassVar[int]
    AUDIO_FIELD_NUMBER: _ClassVar[int]
    IS_LAST_FIELD_NUMBER: _ClassVar[int]
    NOTES_FIELD_NUMBER: _ClassVar[int]
    text: str
    audio: Audio
    is_last: bool
    notes: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, text: _Optional[str] = ..., audio: _Optional[_Union[Audio, _Mapping]] = ..., is_last: _Optional[bool] = ..., notes: _Optional[_Iterable[str]] = ...) -> None: ...

class Timing(_message.Message):
    __slots__ = ("queue_us", "assemble_us", "inference_us", "scatter_us", "total_us", "batch_size")
    QUEUE_US_FIELD_NUMBER: _ClassVar[int]
    ASSEMBLE_US_FIELD_NUMBER: _ClassVar[int]
    INFERENCE_US_FIELD_NUMBER: _ClassVar[int]
    SCATTER_US_FIELD_NUMBER: _ClassVar[int]
    TOTAL_US_FIELD_NUMBER: _ClassVar[int]
    BATCH_SIZE_FIELD_NUMBER: _ClassVar[int]
    queue_us: int
    assemble_us: int
    inference_us: int
    scatter_us: int
    total_us: int
    batch_size: int
    def __init__(self, queue_us: _Optional[int] = ..., assemble_us: _Optional[int] = ..., inference_us: _Optional[int] = ..., scatter_us: _Optional[int] = ..., total_us: _Optional[int] = ..., batch_size: _Optional[int] = ...) -> None: ...

class InBetweenResponse(_message.Message):
    __slots__ = ("pack", "pack_version", "characters", "timing")
    PACK_FIELD_NUMBER: _ClassVar[int]
    PACK_VERSION_FIELD_NUMBER: _ClassVar[int]
    CHARACTERS_FIELD_NUMBER: _ClassVar[int]
    TIMING_FIELD_NUMBER: _ClassVar[int]
    pack: str
    pack_version: str
    characters: _containers.RepeatedCompositeFieldContainer[CharacterResult]
    timing: Timing
    def __init__(self, pack: _Optional[str] = ..., pack_version: _Optional[str] = ..., characters: _Optional[_Iterable[_Union[CharacterResult, _Mapping]]] = ..., timing: _Optional[_Union[Timing, _Mapping]] = ...) -> None: ...

class ListPacksRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListPacksResponse(_message.Message):
    __slots__ = ("packs",)
    PACKS_FIELD_NUMBER: _ClassVar[int]
    packs: _containers.RepeatedCompositeFieldContainer[Pack]
    def __init__(self, packs: _Optional[_Iterable[_Union[Pack, _Mapping]]] = ...) -> None: ...

class GetPackRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class LoadPackRequest(_message.Message):
    __slots__ = ("name", "version")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ...) -> None: ...

class UnloadPackRequest(_message.Message):
    __slots__ = ("name", "version")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ...) -> None: ...

class SwapPackRequest(_message.Message):
    __slots__ = ("name", "version")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ...) -> None: ...

class PackChange(_message.Message):
    __slots__ = ("name", "version", "changed", "replaced_version", "estimated_bytes", "leaving")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    CHANGED_FIELD_NUMBER: _ClassVar[int]
    REPLACED_VERSION_FIELD_NUMBER: _ClassVar[int]
    ESTIMATED_BYTES_FIELD_NUMBER: _ClassVar[int]
    LEAVING_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    changed: bool
    replaced_version: str
    estimated_bytes: int
    leaving: _containers.RepeatedCompositeFieldContainer[LeavingPack]
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ..., changed: _Optional[bool] = ..., replaced_version: _Optional[str] = ..., estimated_bytes: _Optional[int] = ..., leaving: _Optional[_Iterable[_Union[LeavingPack, _Mapping]]] = ...) -> None: ...

class LeavingPack(_message.Message):
    __slots__ = ("name", "version", "held_ms")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    HELD_MS_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    held_ms: int
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ..., held_ms: _Optional[int] = ...) -> None: ...

class Joint(_message.Message):
    __slots__ = ("name", "parent", "offset")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PARENT_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    name: str
    parent: int
    offset: Vec3
    def __init__(self, name: _Optional[str] = ..., parent: _Optional[int] = ..., offset: _Optional[_Union[Vec3, _Mapping]] = ...) -> None: ...

class ContactRules(_message.Message):
    __slots__ = ("max_height", "max_speed", "clearance")
    MAX_HEIGHT_FIELD_NUMBER: _ClassVar[int]
    MAX_SPEED_FIELD_NUMBER: _ClassVar[int]
    CLEARANCE_FIELD_NUMBER: _ClassVar[int]
    max_height: _containers.RepeatedScalarFieldContainer[float]
    max_speed: float
    clearance: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, max_height: _Optional[_Iterable[float]] = ..., max_speed: _Optional[float] = ..., clearance: _Optional[_Iterable[float]] = ...) -> None: ...

class Hinge(_message.Message):
    __slots__ = ("joint", "axis", "rest", "lower", "upper", "max_speed", "max_acceleration")
    JOINT_FIELD_NUMBER: _ClassVar[int]
    AXIS_FIELD_NUMBER: _ClassVar[int]
    REST_FIELD_NUMBER: _ClassVar[int]
    LOWER_FIELD_NUMBER: _ClassVar[int]
    UPPER_FIELD_NUMBER: _ClassVar[int]
    MAX_SPEED_FIELD_NUMBER: _ClassVar[int]
    MAX_ACCELERATION_FIELD_NUMBER: _ClassVar[int]
    joint: str
    axis: Vec3
    rest: Quat
    lower: float
    upper: float
    max_speed: float
    max_acceleration: float
    def __init__(self, joint: _Optional[str] = ..., axis: _Optional[_Union[Vec3, _Mapping]] = ..., rest: _Optional[_Union[Quat, _Mapping]] = ..., lower: _Optional[float] = ..., upper: _Optional[float] = ..., max_speed: _Optional[float] = ..., max_acceleration: _Optional[float] = ...) -> None: ...

class Mimic(_message.Message):
    __slots__ = ("joint", "follows", "multiplier", "offset", "axis", "rest")
    JOINT_FIELD_NUMBER: _ClassVar[int]
    FOLLOWS_FIELD_NUMBER: _ClassVar[int]
    MULTIPLIER_FIELD_NUMBER: _ClassVar[int]
    OFFSET_FIELD_NUMBER: _ClassVar[int]
    AXIS_FIELD_NUMBER: _ClassVar[int]
    REST_FIELD_NUMBER: _ClassVar[int]
    joint: str
    follows: str
    multiplier: float
    offset: float
    axis: Vec3
    rest: Quat
    def __init__(self, joint: _Optional[str] = ..., follows: _Optional[str] = ..., multiplier: _Optional[float] = ..., offset: _Optional[float] = ..., axis: _Optional[_Union[Vec3, _Mapping]] = ..., rest: _Optional[_Union[Quat, _Mapping]] = ...) -> None: ...

class Robot(_message.Message):
    __slots__ = ("name", "hinges", "qpos_size", "mimics")
    NAME_FIELD_NUMBER: _ClassVar[int]
    HINGES_FIELD_NUMBER: _ClassVar[int]
    QPOS_SIZE_FIELD_NUMBER: _ClassVar[int]
    MIMICS_FIELD_NUMBER: _ClassVar[int]
    name: str
    hinges: _containers.RepeatedCompositeFieldContainer[Hinge]
    qpos_size: int
    mimics: _containers.RepeatedCompositeFieldContainer[Mimic]
    def __init__(self, name: _Optional[str] = ..., hinges: _Optional[_Iterable[_Union[Hinge, _Mapping]]] = ..., qpos_size: _Optional[int] = ..., mimics: _Optional[_Iterable[_Union[Mimic, _Mapping]]] = ...) -> None: ...

class Pack(_message.Message):
    __slots__ = ("name", "version", "licence", "credits", "fps", "joints", "contact_joints", "context_frames", "max_targets", "min_frames", "max_frames", "frames_per_token", "heads", "codes", "content_hash", "is_default", "parameters", "figures_json", "left_axis", "ground_y", "contact_rules", "engine", "robot", "family", "capabilities", "bodies", "words", "sampler_steps", "diffusion_steps", "language", "skills")
    NAME_FIELD_NUMBER: _ClassVar[int]
    VERSION_FIELD_NUMBER: _ClassVar[int]
    LICENCE_FIELD_NUMBER: _ClassVar[int]
    CREDITS_FIELD_NUMBER: _ClassVar[int]
    FPS_FIELD_NUMBER: _ClassVar[int]
    JOINTS_FIELD_NUMBER: _ClassVar[int]
    CONTACT_JOINTS_FIELD_NUMBER: _ClassVar[int]
    CONTEXT_FRAMES_FIELD_NUMBER: _ClassVar[int]
    MAX_TARGETS_FIELD_NUMBER: _ClassVar[int]
    MIN_FRAMES_FIELD_NUMBER: _ClassVar[int]
    MAX_FRAMES_FIELD_NUMBER: _ClassVar[int]
    FRAMES_PER_TOKEN_FIELD_NUMBER: _ClassVar[int]
    HEADS_FIELD_NUMBER: _ClassVar[int]
    CODES_FIELD_NUMBER: _ClassVar[int]
    CONTENT_HASH_FIELD_NUMBER: _ClassVar[int]
    IS_DEFAULT_FIELD_NUMBER: _ClassVar[int]
    PARAMETERS_FIELD_NUMBER: _ClassVar[int]
    FIGURES_JSON_FIELD_NUMBER: _ClassVar[int]
    LEFT_AXIS_FIELD_NUMBER: _ClassVar[int]
    GROUND_Y_FIELD_NUMBER: _ClassVar[int]
    CONTACT_RULES_FIELD_NUMBER: _ClassVar[int]
    ENGINE_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    FAMILY_FIELD_NUMBER: _ClassVar[int]
    CAPABILITIES_FIELD_NUMBER: _ClassVar[int]
    BODIES_FIELD_NUMBER: _ClassVar[int]
    WORDS_FIELD_NUMBER: _ClassVar[int]
    SAMPLER_STEPS_FIELD_NUMBER: _ClassVar[int]
    DIFFUSION_STEPS_FIELD_NUMBER: _ClassVar[int]
    LANGUAGE_FIELD_NUMBER: _ClassVar[int]
    SKILLS_FIELD_NUMBER: _ClassVar[int]
    name: str
    version: str
    licence: str
    credits: _containers.RepeatedScalarFieldContainer[str]
    fps: float
    joints: _containers.RepeatedCompositeFieldContainer[Joint]
    contact_joints: _containers.RepeatedScalarFieldContainer[str]
    context_frames: int
    max_targets: int
    min_frames: int
    max_frames: int
    frames_per_token: int
    heads: int
    codes: int
    content_hash: str
    is_default: bool
    parameters: int
    figures_json: str
    left_axis: Vec3
    ground_y: float
    contact_rules: ContactRules
    engine: str
    robot: Robot
    family: str
    capabilities: _containers.RepeatedScalarFieldContainer[str]
    bodies: _containers.RepeatedCompositeFieldContainer[PackBody]
    words: _containers.RepeatedScalarFieldContainer[str]
    sampler_steps: int
    diffusion_steps: int
    language: Language
    skills: _containers.RepeatedCompositeFieldContainer[PackSkill]
    def __init__(self, name: _Optional[str] = ..., version: _Optional[str] = ..., licence: _Optional[str] = ..., credits: _Optional[_Iterable[str]] = ..., fps: _Optional[float] = ..., joints: _Optional[_Iterable[_Union[Joint, _Mapping]]] = ..., contact_joints: _Optional[_Iterable[str]] = ..., context_frames: _Optional[int] = ..., max_targets: _Optional[int] = ..., min_frames: _Optional[int] = ..., max_frames: _Optional[int] = ..., frames_per_token: _Optional[int] = ..., heads: _Optional[int] = ..., codes: _Optional[int] = ..., content_hash: _Optional[str] = ..., is_default: _Optional[bool] = ..., parameters: _Optional[int] = ..., figures_json: _Optional[str] = ..., left_axis: _Optional[_Union[Vec3, _Mapping]] = ..., ground_y: _Optional[float] = ..., contact_rules: _Optional[_Union[ContactRules, _Mapping]] = ..., engine: _Optional[str] = ..., robot: _Optional[_Union[Robot, _Mapping]] = ..., family: _Optional[str] = ..., capabilities: _Optional[_Iterable[str]] = ..., bodies: _Optional[_Iterable[_Union[PackBody, _Mapping]]] = ..., words: _Optional[_Iterable[str]] = ..., sampler_steps: _Optional[int] = ..., diffusion_steps: _Optional[int] = ..., language: _Optional[_Union[Language, _Mapping]] = ..., skills: _Optional[_Iterable[_Union[PackSkill, _Mapping]]] = ...) -> None: ...

class PackSkill(_message.Message):
    __slots__ = ("name", "description", "variants", "held")
    NAME_FIELD_NUMBER: _ClassVar[int]
    DESCRIPTION_FIELD_NUMBER: _ClassVar[int]
    VARIANTS_FIELD_NUMBER: _ClassVar[int]
    HELD_FIELD_NUMBER: _ClassVar[int]
    name: str
    description: str
    variants: _containers.RepeatedScalarFieldContainer[str]
    held: bool
    def __init__(self, name: _Optional[str] = ..., description: _Optional[str] = ..., variants: _Optional[_Iterable[str]] = ..., held: _Optional[bool] = ...) -> None: ...

class Language(_message.Message):
    __slots__ = ("tasks", "max_prompt_pieces", "max_agents", "audio_codes", "flow_steps", "sampling")
    TASKS_FIELD_NUMBER: _ClassVar[int]
    MAX_PROMPT_PIECES_FIELD_NUMBER: _ClassVar[int]
    MAX_AGENTS_FIELD_NUMBER: _ClassVar[int]
    AUDIO_CODES_FIELD_NUMBER: _ClassVar[int]
    FLOW_STEPS_FIELD_NUMBER: _ClassVar[int]
    SAMPLING_FIELD_NUMBER: _ClassVar[int]
    tasks: _containers.RepeatedScalarFieldContainer[str]
    max_prompt_pieces: int
    max_agents: int
    audio_codes: int
    flow_steps: int
    sampling: Sampling
    def __init__(self, tasks: _Optional[_Iterable[str]] = ..., max_prompt_pieces: _Optional[int] = ..., max_agents: _Optional[int] = ..., audio_codes: _Optional[int] = ..., flow_steps: _Optional[int] = ..., sampling: _Optional[_Union[Sampling, _Mapping]] = ...) -> None: ...

class PackBody(_message.Message):
    __slots__ = ("name", "joints", "contact_joints", "left_axis", "robot", "height", "words")
    NAME_FIELD_NUMBER: _ClassVar[int]
    JOINTS_FIELD_NUMBER: _ClassVar[int]
    CONTACT_JOINTS_FIELD_NUMBER: _ClassVar[int]
    LEFT_AXIS_FIELD_NUMBER: _ClassVar[int]
    ROBOT_FIELD_NUMBER: _ClassVar[int]
    HEIGHT_FIELD_NUMBER: _ClassVar[int]
    WORDS_FIELD_NUMBER: _ClassVar[int]
    name: str
    joints: _containers.RepeatedCompositeFieldContainer[Joint]
    contact_joints: _containers.RepeatedScalarFieldContainer[str]
    left_axis: Vec3
    robot: Robot
    height: float
    words: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, name: _Optional[str] = ..., joints: _Optional[_Iterable[_Union[Joint, _Mapping]]] = ..., contact_joints: _Optional[_Iterable[str]] = ..., left_axis: _Optional[_Union[Vec3, _Mapping]] = ..., robot: _Optional[_Union[Robot, _Mapping]] = ..., height: _Optional[float] = ..., words: _Optional[_Iterable[str]] = ...) -> None: ...
