"""Client of the Troupe motion server: live characters and in-betweening as numpy arrays.

    import troupe

    with troupe.Client("127.0.0.1:8080") as client, client.crowd(50) as crowd:
        crowd.walk([(0, 0, 1.4)] * 50)
        frames = crowd.step(30).frames
        frames.world_positions()  # (30, 50, joints, 3) metres

Right-handed, Y up, +Z forward, metres, radians; quaternions are (w, x, y, z). `troupe.aio` has the same for asyncio.
"""

from troupe import clip as _clip
from troupe import frames as _frames
from troupe.client import Client
from troupe.clip import Clip
from troupe.conventions import Convention
from troupe.crowd import CrowdStep
from troupe.drive import DriveOptions, Tick
from troupe.errors import (
    AlreadyExistsError,
    AnswerError,
    CancelledError,
    DeadlineExceededError,
    FailedPreconditionError,
    InternalError,
    InvalidArgumentError,
    NotFoundError,
    PermissionDeniedError,
    ResourceExhaustedError,
    SessionError,
    StreamEndedError,
    TroupeError,
    UnauthenticatedError,
    UnavailableError,
    UnimplementedError,
    UnreachableError,
)
from troupe.events import Attached, Event, Fault, Left, NotAttached, Refused, Resumed, StreamEvent
from troupe.frames import Frames
from troupe.generate import FollowPath, Generated, GeneratedPart, Planner
from troupe.inbetween import InBetween, InBetweenAnswer, RootKey
from troupe.intent import Act, Locomotion, cancel, drop, end_interaction, follow_path, interact, skill
from troupe.keyframe import Keyframe
from troupe.live import Crowd, Drive, Session
from troupe.mjcf import robot_mjcf
from troupe.options import Encoding, FrameOptions, SessionOptions
from troupe.pack import Body, Pack
from troupe.route import Route
from troupe.skeleton import Hinge, Mimic, Robot, Skeleton
from troupe.words import Agent, Audio, Prompt, Sampling, Sound

join_clips = _clip.joined
join_frames = _frames.joined

__all__ = [
    "Act",
    "Agent",
    "AlreadyExistsError",
    "AnswerError",
    "Attached",
    "Audio",
    "Body",
    "CancelledError",
    "Client",
    "Clip",
    "Convention",
    "Crowd",
    "CrowdStep",
    "DeadlineExceededError",
    "Drive",
    "DriveOptions",
    "Encoding",
    "Event",
    "FailedPreconditionError",
    "Fault",
    "FollowPath",
    "FrameOptions",
    "Frames",
    "Generated",
    "GeneratedPart",
    "Hinge",
    "InBetween",
    "InBetweenAnswer",
    "InternalError",
    "InvalidArgumentError",
    "Keyframe",
    "Left",
    "Locomotion",
    "Mimic",
    "NotAttached",
    "NotFoundError",
    "Pack",
    "PermissionDeniedError",
    "Planner",
    "Prompt",
    "Refused",
    "ResourceExhaustedError",
    "Resumed",
    "Robot",
    "RootKey",
    "Route",
    "Sampling",
    "Session",
    "SessionError",
    "SessionOptions",
    "Skeleton",
    "Sound",
    "StreamEndedError",
    "StreamEvent",
    "Tick",
    "TroupeError",
    "UnauthenticatedError",
    "UnavailableError",
    "UnimplementedError",
    "UnreachableError",
    "cancel",
    "drop",
    "end_interaction",
    "follow_path",
    "interact",
    "join_clips",
    "join_frames",
    "robot_mjcf",
    "skill",
]
