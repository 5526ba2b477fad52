from troupe.v1 import motion_pb2 as _motion_pb2
from troupe.v1 import session_pb2 as _session_pb2
from google.protobuf.internal import containers as _containers
from google.protobuf.internal import enum_type_wrapper as _enum_type_wrapper
from google.protobuf import descriptor as _descriptor
from google.protobuf import message as _message
from collections.abc import Iterable as _Iterable, Mapping as _Mapping
from typing import ClassVar as _ClassVar, Optional as _Optional, Union as _Union

DESCRIPTOR: _descriptor.FileDescriptor

class DocumentFormat(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    DOCUMENT_FORMAT_TOML: _ClassVar[DocumentFormat]
    DOCUMENT_FORMAT_JSON: _ClassVar[DocumentFormat]

class ObjectState(int, metaclass=_enum_type_wrapper.EnumTypeWrapper):
    __slots__ = ()
    OBJECT_STATE_FREE: _ClassVar[ObjectState]
    OBJECT_STATE_RESERVED: _ClassVar[ObjectState]
    OBJECT_STATE_HELD: _ClassVar[ObjectState]
DOCUMENT_FORMAT_TOML: DocumentFormat
DOCUMENT_FORMAT_JSON: DocumentFormat
OBJECT_STATE_FREE: ObjectState
OBJECT_STATE_RESERVED: ObjectState
OBJECT_STATE_HELD: ObjectState

class Document(_message.Message):
    __slots__ = ("format", "text")
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    TEXT_FIELD_NUMBER: _ClassVar[int]
    format: DocumentFormat
    text: str
    def __init__(self, format: _Optional[_Union[DocumentFormat, str]] = ..., text: _Optional[str] = ...) -> None: ...

class BoxShape(_message.Message):
    __slots__ = ("center", "half_extents")
    CENTER_FIELD_NUMBER: _ClassVar[int]
    HALF_EXTENTS_FIELD_NUMBER: _ClassVar[int]
    center: _motion_pb2.Vec3
    half_extents: _motion_pb2.Vec3
    def __init__(self, center: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., half_extents: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ...) -> None: ...

class ConvexShape(_message.Message):
    __slots__ = ("points",)
    POINTS_FIELD_NUMBER: _ClassVar[int]
    points: _containers.RepeatedCompositeFieldContainer[_motion_pb2.Vec3]
    def __init__(self, points: _Optional[_Iterable[_Union[_motion_pb2.Vec3, _Mapping]]] = ...) -> None: ...

class HeightfieldShape(_message.Message):
    __slots__ = ("rows", "columns", "width", "depth", "heights")
    ROWS_FIELD_NUMBER: _ClassVar[int]
    COLUMNS_FIELD_NUMBER: _ClassVar[int]
    WIDTH_FIELD_NUMBER: _ClassVar[int]
    DEPTH_FIELD_NUMBER: _ClassVar[int]
    HEIGHTS_FIELD_NUMBER: _ClassVar[int]
    rows: int
    columns: int
    width: float
    depth: float
    heights: _containers.RepeatedScalarFieldContainer[float]
    def __init__(self, rows: _Optional[int] = ..., columns: _Optional[int] = ..., width: _Optional[float] = ..., depth: _Optional[float] = ..., heights: _Optional[_Iterable[float]] = ...) -> None: ...

class ColliderShape(_message.Message):
    __slots__ = ("box", "convex", "heightfield")
    BOX_FIELD_NUMBER: _ClassVar[int]
    CONVEX_FIELD_NUMBER: _ClassVar[int]
    HEIGHTFIELD_FIELD_NUMBER: _ClassVar[int]
    box: BoxShape
    convex: ConvexShape
    heightfield: HeightfieldShape
    def __init__(self, box: _Optional[_Union[BoxShape, _Mapping]] = ..., convex: _Optional[_Union[ConvexShape, _Mapping]] = ..., heightfield: _Optional[_Union[HeightfieldShape, _Mapping]] = ...) -> None: ...

class Collider(_message.Message):
    __slots__ = ("id", "position", "heading", "rotation", "shape")
    ID_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    SHAPE_FIELD_NUMBER: _ClassVar[int]
    id: str
    position: _motion_pb2.Vec3
    heading: float
    rotation: _motion_pb2.Quat
    shape: ColliderShape
    def __init__(self, id: _Optional[str] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., rotation: _Optional[_Union[_motion_pb2.Quat, _Mapping]] = ..., shape: _Optional[_Union[ColliderShape, _Mapping]] = ...) -> None: ...

class SceneObject(_message.Message):
    __slots__ = ("id", "definition", "position", "heading", "rotation", "state", "holder", "revision")
    ID_FIELD_NUMBER: _ClassVar[int]
    DEFINITION_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    STATE_FIELD_NUMBER: _ClassVar[int]
    HOLDER_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    id: str
    definition: str
    position: _motion_pb2.Vec3
    heading: float
    rotation: _motion_pb2.Quat
    state: ObjectState
    holder: str
    revision: int
    def __init__(self, id: _Optional[str] = ..., definition: _Optional[str] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., rotation: _Optional[_Union[_motion_pb2.Quat, _Mapping]] = ..., state: _Optional[_Union[ObjectState, str]] = ..., holder: _Optional[str] = ..., revision: _Optional[int] = ...) -> None: ...

class Scene(_message.Message):
    __slots__ = ("name", "convention", "ground", "colliders", "objects", "revision", "sessions")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    GROUND_FIELD_NUMBER: _ClassVar[int]
    COLLIDERS_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    name: str
    convention: _session_pb2.Convention
    ground: float
    colliders: _containers.RepeatedCompositeFieldContainer[Collider]
    objects: _containers.RepeatedCompositeFieldContainer[SceneObject]
    revision: int
    sessions: int
    def __init__(self, name: _Optional[str] = ..., convention: _Optional[_Union[_session_pb2.Convention, str]] = ..., ground: _Optional[float] = ..., colliders: _Optional[_Iterable[_Union[Collider, _Mapping]]] = ..., objects: _Optional[_Iterable[_Union[SceneObject, _Mapping]]] = ..., revision: _Optional[int] = ..., sessions: _Optional[int] = ...) -> None: ...

class SceneSummary(_message.Message):
    __slots__ = ("name", "revision", "colliders", "objects", "sessions")
    NAME_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    COLLIDERS_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    SESSIONS_FIELD_NUMBER: _ClassVar[int]
    name: str
    revision: int
    colliders: int
    objects: int
    sessions: int
    def __init__(self, name: _Optional[str] = ..., revision: _Optional[int] = ..., colliders: _Optional[int] = ..., objects: _Optional[int] = ..., sessions: _Optional[int] = ...) -> None: ...

class PutSceneRequest(_message.Message):
    __slots__ = ("scene", "document", "name")
    SCENE_FIELD_NUMBER: _ClassVar[int]
    DOCUMENT_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    scene: Scene
    document: Document
    name: str
    def __init__(self, scene: _Optional[_Union[Scene, _Mapping]] = ..., document: _Optional[_Union[Document, _Mapping]] = ..., name: _Optional[str] = ...) -> None: ...

class GetSceneRequest(_message.Message):
    __slots__ = ("name", "convention", "without_colliders")
    NAME_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    WITHOUT_COLLIDERS_FIELD_NUMBER: _ClassVar[int]
    name: str
    convention: _session_pb2.Convention
    without_colliders: bool
    def __init__(self, name: _Optional[str] = ..., convention: _Optional[_Union[_session_pb2.Convention, str]] = ..., without_colliders: _Optional[bool] = ...) -> None: ...

class ListScenesRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListScenesResponse(_message.Message):
    __slots__ = ("scenes",)
    SCENES_FIELD_NUMBER: _ClassVar[int]
    scenes: _containers.RepeatedCompositeFieldContainer[SceneSummary]
    def __init__(self, scenes: _Optional[_Iterable[_Union[SceneSummary, _Mapping]]] = ...) -> None: ...

class DeleteSceneRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteSceneResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class AddObjectsRequest(_message.Message):
    __slots__ = ("scene", "convention", "objects")
    SCENE_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    scene: str
    convention: _session_pb2.Convention
    objects: _containers.RepeatedCompositeFieldContainer[SceneObject]
    def __init__(self, scene: _Optional[str] = ..., convention: _Optional[_Union[_session_pb2.Convention, str]] = ..., objects: _Optional[_Iterable[_Union[SceneObject, _Mapping]]] = ...) -> None: ...

class ObjectMove(_message.Message):
    __slots__ = ("id", "position", "heading", "rotation")
    ID_FIELD_NUMBER: _ClassVar[int]
    POSITION_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    ROTATION_FIELD_NUMBER: _ClassVar[int]
    id: str
    position: _motion_pb2.Vec3
    heading: float
    rotation: _motion_pb2.Quat
    def __init__(self, id: _Optional[str] = ..., position: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., rotation: _Optional[_Union[_motion_pb2.Quat, _Mapping]] = ...) -> None: ...

class MoveObjectsRequest(_message.Message):
    __slots__ = ("scene", "convention", "moves")
    SCENE_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    MOVES_FIELD_NUMBER: _ClassVar[int]
    scene: str
    convention: _session_pb2.Convention
    moves: _containers.RepeatedCompositeFieldContainer[ObjectMove]
    def __init__(self, scene: _Optional[str] = ..., convention: _Optional[_Union[_session_pb2.Convention, str]] = ..., moves: _Optional[_Iterable[_Union[ObjectMove, _Mapping]]] = ...) -> None: ...

class RemoveObjectsRequest(_message.Message):
    __slots__ = ("scene", "ids")
    SCENE_FIELD_NUMBER: _ClassVar[int]
    IDS_FIELD_NUMBER: _ClassVar[int]
    scene: str
    ids: _containers.RepeatedScalarFieldContainer[str]
    def __init__(self, scene: _Optional[str] = ..., ids: _Optional[_Iterable[str]] = ...) -> None: ...

class ObjectResult(_message.Message):
    __slots__ = ("id", "problem")
    ID_FIELD_NUMBER: _ClassVar[int]
    PROBLEM_FIELD_NUMBER: _ClassVar[int]
    id: str
    problem: _session_pb2.Problem
    def __init__(self, id: _Optional[str] = ..., problem: _Optional[_Union[_session_pb2.Problem, _Mapping]] = ...) -> None: ...

class ObjectsResponse(_message.Message):
    __slots__ = ("results", "revision")
    RESULTS_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    results: _containers.RepeatedCompositeFieldContainer[ObjectResult]
    revision: int
    def __init__(self, results: _Optional[_Iterable[_Union[ObjectResult, _Mapping]]] = ..., revision: _Optional[int] = ...) -> None: ...

class ObjectVariant(_message.Message):
    __slots__ = ("name", "weight")
    NAME_FIELD_NUMBER: _ClassVar[int]
    WEIGHT_FIELD_NUMBER: _ClassVar[int]
    name: str
    weight: float
    def __init__(self, name: _Optional[str] = ..., weight: _Optional[float] = ...) -> None: ...

class ObjectDefinition(_message.Message):
    __slots__ = ("name", "pack", "description", "revision", "solid", "shared", "variants", "approaches", "sockets", "sets", "objects")
    NAME_FIELD_NUMBER: _ClassVar[int]
    PACK_FIELD_NUMBER: _ClassVar[int]
    DESCRIPTION_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    SOLID_FIELD_NUMBER: _ClassVar[int]
    SHARED_FIELD_NUMBER: _ClassVar[int]
    VARIANTS_FIELD_NUMBER: _ClassVar[int]
    APPROACHES_FIELD_NUMBER: _ClassVar[int]
    SOCKETS_FIELD_NUMBER: _ClassVar[int]
    SETS_FIELD_NUMBER: _ClassVar[int]
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    name: str
    pack: str
    description: str
    revision: int
    solid: bool
    shared: bool
    variants: _containers.RepeatedCompositeFieldContainer[ObjectVariant]
    approaches: _containers.RepeatedScalarFieldContainer[str]
    sockets: _containers.RepeatedScalarFieldContainer[str]
    sets: _containers.RepeatedScalarFieldContainer[str]
    objects: int
    def __init__(self, name: _Optional[str] = ..., pack: _Optional[str] = ..., description: _Optional[str] = ..., revision: _Optional[int] = ..., solid: _Optional[bool] = ..., shared: _Optional[bool] = ..., variants: _Optional[_Iterable[_Union[ObjectVariant, _Mapping]]] = ..., approaches: _Optional[_Iterable[str]] = ..., sockets: _Optional[_Iterable[str]] = ..., sets: _Optional[_Iterable[str]] = ..., objects: _Optional[int] = ...) -> None: ...

class PutObjectDefinitionRequest(_message.Message):
    __slots__ = ("pack", "document", "name", "check_only")
    PACK_FIELD_NUMBER: _ClassVar[int]
    DOCUMENT_FIELD_NUMBER: _ClassVar[int]
    NAME_FIELD_NUMBER: _ClassVar[int]
    CHECK_ONLY_FIELD_NUMBER: _ClassVar[int]
    pack: str
    document: Document
    name: str
    check_only: bool
    def __init__(self, pack: _Optional[str] = ..., document: _Optional[_Union[Document, _Mapping]] = ..., name: _Optional[str] = ..., check_only: _Optional[bool] = ...) -> None: ...

class PutObjectDefinitionResponse(_message.Message):
    __slots__ = ("definition", "replaced", "rebound")
    DEFINITION_FIELD_NUMBER: _ClassVar[int]
    REPLACED_FIELD_NUMBER: _ClassVar[int]
    REBOUND_FIELD_NUMBER: _ClassVar[int]
    definition: ObjectDefinition
    replaced: bool
    rebound: int
    def __init__(self, definition: _Optional[_Union[ObjectDefinition, _Mapping]] = ..., replaced: _Optional[bool] = ..., rebound: _Optional[int] = ...) -> None: ...

class GetObjectDefinitionRequest(_message.Message):
    __slots__ = ("name", "format")
    NAME_FIELD_NUMBER: _ClassVar[int]
    FORMAT_FIELD_NUMBER: _ClassVar[int]
    name: str
    format: DocumentFormat
    def __init__(self, name: _Optional[str] = ..., format: _Optional[_Union[DocumentFormat, str]] = ...) -> None: ...

class GetObjectDefinitionResponse(_message.Message):
    __slots__ = ("definition", "document")
    DEFINITION_FIELD_NUMBER: _ClassVar[int]
    DOCUMENT_FIELD_NUMBER: _ClassVar[int]
    definition: ObjectDefinition
    document: Document
    def __init__(self, definition: _Optional[_Union[ObjectDefinition, _Mapping]] = ..., document: _Optional[_Union[Document, _Mapping]] = ...) -> None: ...

class ListObjectDefinitionsRequest(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class ListObjectDefinitionsResponse(_message.Message):
    __slots__ = ("definitions",)
    DEFINITIONS_FIELD_NUMBER: _ClassVar[int]
    definitions: _containers.RepeatedCompositeFieldContainer[ObjectDefinition]
    def __init__(self, definitions: _Optional[_Iterable[_Union[ObjectDefinition, _Mapping]]] = ...) -> None: ...

class DeleteObjectDefinitionRequest(_message.Message):
    __slots__ = ("name",)
    NAME_FIELD_NUMBER: _ClassVar[int]
    name: str
    def __init__(self, name: _Optional[str] = ...) -> None: ...

class DeleteObjectDefinitionResponse(_message.Message):
    __slots__ = ()
    def __init__(self) -> None: ...

class DetectBox(_message.Message):
    __slots__ = ("scene", "center", "heading", "half_extents", "sweep")
    SCENE_FIELD_NUMBER: _ClassVar[int]
    CENTER_FIELD_NUMBER: _ClassVar[int]
    HEADING_FIELD_NUMBER: _ClassVar[int]
    HALF_EXTENTS_FIELD_NUMBER: _ClassVar[int]
    SWEEP_FIELD_NUMBER: _ClassVar[int]
    scene: str
    center: _motion_pb2.Vec3
    heading: float
    half_extents: _motion_pb2.Vec3
    sweep: _motion_pb2.Vec3
    def __init__(self, scene: _Optional[str] = ..., center: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., heading: _Optional[float] = ..., half_extents: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ..., sweep: _Optional[_Union[_motion_pb2.Vec3, _Mapping]] = ...) -> None: ...

class DetectRequest(_message.Message):
    __slots__ = ("session_id", "ahead", "box", "convention", "only_free")
    SESSION_ID_FIELD_NUMBER: _ClassVar[int]
    AHEAD_FIELD_NUMBER: _ClassVar[int]
    BOX_FIELD_NUMBER: _ClassVar[int]
    CONVENTION_FIELD_NUMBER: _ClassVar[int]
    ONLY_FREE_FIELD_NUMBER: _ClassVar[int]
    session_id: str
    ahead: float
    box: DetectBox
    convention: _session_pb2.Convention
    only_free: bool
    def __init__(self, session_id: _Optional[str] = ..., ahead: _Optional[float] = ..., box: _Optional[_Union[DetectBox, _Mapping]] = ..., convention: _Optional[_Union[_session_pb2.Convention, str]] = ..., only_free: _Optional[bool] = ...) -> None: ...

class Detected(_message.Message):
    __slots__ = ("object", "distance", "share", "side", "approach", "off", "variants", "free", "usable")
    OBJECT_FIELD_NUMBER: _ClassVar[int]
    DISTANCE_FIELD_NUMBER: _ClassVar[int]
    SHARE_FIELD_NUMBER: _ClassVar[int]
    SIDE_FIELD_NUMBER: _ClassVar[int]
    APPROACH_FIELD_NUMBER: _ClassVar[int]
    OFF_FIELD_NUMBER: _ClassVar[int]
    VARIANTS_FIELD_NUMBER: _ClassVar[int]
    FREE_FIELD_NUMBER: _ClassVar[int]
    USABLE_FIELD_NUMBER: _ClassVar[int]
    object: SceneObject
    distance: float
    share: float
    side: float
    approach: str
    off: float
    variants: _containers.RepeatedCompositeFieldContainer[ObjectVariant]
    free: bool
    usable: bool
    def __init__(self, object: _Optional[_Union[SceneObject, _Mapping]] = ..., distance: _Optional[float] = ..., share: _Optional[float] = ..., side: _Optional[float] = ..., approach: _Optional[str] = ..., off: _Optional[float] = ..., variants: _Optional[_Iterable[_Union[ObjectVariant, _Mapping]]] = ..., free: _Optional[bool] = ..., usable: _Optional[bool] = ...) -> None: ...

class DetectResponse(_message.Message):
    __slots__ = ("objects", "revision", "scene")
    OBJECTS_FIELD_NUMBER: _ClassVar[int]
    REVISION_FIELD_NUMBER: _ClassVar[int]
    SCENE_FIELD_NUMBER: _ClassVar[int]
    objects: _containers.RepeatedCompositeFieldContainer[Detected]
    revision: int
    scene: str
    def __init__(self, objects: _Optional[_Iterable[_Union[Detected, _Mapping]]] = ..., revision: _Optional[int] = ..., scene: _Optional[str] = ...) -> None: ...
