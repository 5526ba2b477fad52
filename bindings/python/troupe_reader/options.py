"""Options of reading, as keyword arguments. Their names are those of the command line: `max_slide` is `--max-slide`."""

from collections.abc import Sequence
from typing import TYPE_CHECKING, Literal, TypedDict

if TYPE_CHECKING:
    from troupe_reader._native import Agreement, Skeleton


class Choice(TypedDict):
    """An option that decides how a file is read."""

    option: str
    """Its name, as in `FileOptions`."""
    values: list[str]
    """The values that fit the file, `true` for a flag. Empty if they are not known."""


class FileOptions(TypedDict, total=False):
    """What a file may leave open. `None` is as if the option were not given."""

    up: Literal["x", "y", "z", "-x", "-y", "-z"] | None
    """The axis that points up."""
    unit: float | str | None
    """Metres a unit of the file, or the unit's name: m, ft, dm, cmu, in, cm, mm."""
    fps: float | None
    """Frames a second of the file; for glTF, the rate at which it is sampled."""
    resample_fps: float | None
    """Rate to which the clip is brought, Hz."""
    animation: str | None
    """Name of a glTF file's animation."""
    root: str | None
    """Name of the joint that is the character's root."""
    rest_pose: Literal["t", "a", "standing", "none"] | None
    """Rest pose of the file's skeleton."""
    leading_pose: Literal["find", "keep", "drop"] | None
    """Whether a pose before the motion is kept. By default it is left out if it is found."""
    max_slide: float | None
    """Farthest that a joint may move in its parent and still be held there, metres."""
    strip_namespaces: bool | None
    """Whether joints' names lose what stands before a `:` or `|`."""
    skeleton: "Skeleton | None"
    """The skeleton to read onto, joints by name. Robots' files need one."""
    other_bones: bool | None
    """Whether the file's bones may differ from the skeleton's in length."""
    quaternion: Literal["xyzw", "wxyz"] | None
    """Order of a robot's quaternion."""
    degrees: bool | None
    """Whether a robot's angles are in degrees."""
    joint_order: str | Sequence[str] | None
    """Order of a robot's hinges: `tree`, `isaaclab`, or the names of joints."""
    agreement: "Agreement | None"
    """What the other files of the folder show."""


class LimbParts(TypedDict, total=False):
    """A limb by the names of its joints. What is left out stays as it is found."""

    girdle: list[str]
    """Joints between the trunk and the limb: clavicles."""
    upper: list[str]
    """Shoulder or hip, and twists along the upper bone."""
    lower: list[str]
    """Elbow or knee, and twists along the lower bone."""
    end: str
    """Wrist or ankle; "" for an arm that the body lacks, which then has none."""
    toe: str
    """The joint that the toes turn about; "" for a foot without one."""


class Parts(TypedDict, total=False):
    """The parts of a body by the names of its joints. What is left out stays as it is found."""

    trunk: list[str]
    """From the pelvis to the joint that the arms hang on."""
    neck: list[str]
    """From above the trunk to the head."""
    tail: list[str]
    """From the first joint of the tail to its tip."""
    on_fours: bool
    """Whether the body stands on four legs."""
    left_leg: LimbParts
    right_leg: LimbParts
    left_arm: LimbParts
    right_arm: LimbParts


class WorstJoints(TypedDict):
    """The joints of the body whose figures are worst, by name. Empty if no joint has the figure."""

    bone: str
    """Of `worst_deg`: where the bone begins."""
    line: str
    """Of `lines_deg`: the left end of a line across the body, or its beginning."""
    skate: str
    """The point of a foot that slides most beyond the clip's."""
    under: str
    """Of `under_m`."""
    short: str
    """Of `short_m`."""


class RetargetFigures(TypedDict):
    """What a clip keeps of its motion on another body."""

    directions_deg: float
    """Mean angle between the bones of limbs in the clip and on the body, degrees."""
    worst_deg: float
    """The largest mean of a single bone, degrees."""
    lines_deg: float
    """Angle between the lines across the body, such as from hip to hip, of the worst line, degrees."""
    skate_mps: float
    """Mean speed of the body's feet over the ground while the clip's stand, m/s."""
    source_skate_mps: float
    """The same of the clip's feet, scaled."""
    under_m: float
    """Farthest that a foot is under the ground, deeper than in the clip, metres."""
    short_m: float
    """Farthest that a foot remains from its place, metres."""
    joints: WorstJoints
    """Which joints these are."""
    faults: list[str]
    """What is beyond the bar, each as a sentence. Empty if all is well."""
