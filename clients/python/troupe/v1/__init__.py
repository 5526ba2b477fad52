"""The contract's messages, as `proto/troupe/v1` has them. `scripts/generate.py` makes the modules beside this one.

The client takes and gives some of them as they are: scenes, styles, events, sessions.
"""

from troupe.v1.event_pb2 import Activity, ActivityKind, HeldObject, SessionEvent
from troupe.v1.motion_pb2 import Intermediates, Quat, Timing, Vec3
from troupe.v1.scene_pb2 import (
    BoxShape,
    Collider,
    ColliderShape,
    ConvexShape,
    Detected,
    DetectRequest,
    DetectResponse,
    GetObjectDefinitionResponse,
    HeightfieldShape,
    ObjectDefinition,
    ObjectMove,
    ObjectsResponse,
    PutObjectDefinitionResponse,
    Scene,
    SceneObject,
    SceneSummary,
)
from troupe.v1.session_pb2 import ListStylesResponse, PeekResponse, Session, SessionStats, Style

__all__ = [
    "Activity",
    "ActivityKind",
    "BoxShape",
    "Collider",
    "ColliderShape",
    "ConvexShape",
    "DetectRequest",
    "DetectResponse",
    "Detected",
    "GetObjectDefinitionResponse",
    "HeightfieldShape",
    "HeldObject",
    "Intermediates",
    "ListStylesResponse",
    "ObjectDefinition",
    "ObjectMove",
    "ObjectsResponse",
    "PeekResponse",
    "PutObjectDefinitionResponse",
    "Quat",
    "Scene",
    "SceneObject",
    "SceneSummary",
    "Session",
    "SessionEvent",
    "SessionStats",
    "Style",
    "Timing",
    "Vec3",
]
