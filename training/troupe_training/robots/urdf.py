"""Reads the part of URDF that motion needs: links, joints, limits, and shapes for the soles and hands.

A URDF is small and its subset plain XML, so Python's own reader does. Frames are ROS's: Z up, X forward, Y left, metres.
"""

import struct
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element

import numpy as np

MAX_MESH_TRIANGLES = 2_000_000
# Attributes of a solid that make its size, and how many numbers each has.
SIZES = {"sphere": {"radius": 1}, "box": {"size": 3}, "cylinder": {"radius": 1, "length": 1}}


class UrdfError(ValueError):
    """A file that is not a URDF this package can use; the message names the joint or link."""


@dataclass
class UrdfJoint:
    """One joint: where the child's frame sits in the parent's at angle 0, and how the child turns in it."""

    name: str
    kind: str  # fixed, revolute, continuous, ...
    parent: str
    child: str
    translation: np.ndarray  # [3]
    rotation: np.ndarray  # [3, 3]
    axis: np.ndarray  # [3], unit, in the joint's own frame
    lower_rad: float
    upper_rad: float
    max_speed_rad_per_s: float


@dataclass
class Shape:
    """A solid of a link: sphere, box, cylinder or mesh, in the link's frame."""

    kind: str
    size: np.ndarray  # sphere: radius; box: edges; cylinder: radius, length
    translation: np.ndarray
    rotation: np.ndarray
    mesh: Path | None = None

    def surface(self, down: np.ndarray) -> np.ndarray:
        """Points ``[N, 3]`` that hold the extremes of the shape's sole: corners, rims, vertices, a sphere's lowest point."""
        if self.kind == "sphere":
            return (self.translation + self.size[0] * down)[None]
        if self.mesh is not None:
            local = stl_vertices(self.mesh)
        elif self.kind == "box":
            corners = np.stack(np.meshgrid([-1, 1], [-1, 1], [-1, 1], indexing="ij"), -1).reshape(-1, 3)
            local = corners * self.size / 2
        else:  # cylinder
            turn = np.linspace(0, 2 * np.pi, 32, endpoint=False)
            rim = np.stack([np.cos(turn), np.sin(turn), np.zeros(32)], -1) * self.size[0]
            half = np.array([0, 0, self.size[1] / 2])
            local = np.concatenate([rim - half, rim + half])
        return local @ self.rotation.T + self.translation


@dataclass
class UrdfLink:
    """One link: its collision shapes and the box of even density that has its mass and inertia, if it gives any."""

    name: str
    shapes: list[Shape] = field(default_factory=list)
    inertia_box: Shape | None = None


@dataclass
class Urdf:
    """A parsed file: links by name, joints in the file's order, and the link that is no joint's child."""

    name: str
    root: str
    links: dict[str, UrdfLink]
    joints: list[UrdfJoint]

    def children(self, link: str) -> list[UrdfJoint]:
        """The joints below a link, in the file's order."""
        return [joint for joint in self.joints if joint.parent == link]

    def below(self, link: str) -> set[str]:
        """A link and every link that hangs on it."""
        return {link}.union(*(self.below(joint.child) for joint in self.children(link)))


def read_urdf(path: Path) -> Urdf:
    """Parses a file. Raises `UrdfError` if it is no URDF, has no tree of links, or a number cannot be read."""
    try:
        root = ElementTree.parse(path).getroot()
    except (ElementTree.ParseError, OSError) as error:
        raise UrdfError(f"{path}: {error}") from error
    if root.tag != "robot":
        raise UrdfError(f"{path}: the root element is <{root.tag}>, a URDF's is <robot>")
    links = {}
    for element in root.findall("link"):
        link = _link(element, Path(path).parent)
        links[link.name] = link
    joints = [_joint(element) for element in root.findall("joint")]
    children = [joint.child for joint in joints]
    for joint in joints:
        for name in (joint.parent, joint.child):
            if name not in links:
                raise UrdfError(f"joint {joint.name}: there is no link {name!r}")
    if len(set(children)) != len(children):
        twice = next(link for link in children if children.count(link) > 1)
        raise UrdfError(f"link {twice} hangs on more than one joint")
    roots = [name for name in links if name not in children]
    if len(roots) != 1:
        raise UrdfError(f"{path}: a tree has one root link, this has {roots or 'none'}")
    urdf = Urdf(root.get("name", Path(path).stem), roots[0], links, joints)
    reached = urdf.below(roots[0])
    ring = [joint.name for joint in joints if joint.child not in reached]
    if ring:
        raise UrdfError(f"joints {ring} form a ring")
    return urdf


def _numbers(element: Element | None, attribute: str, default: str, count: int, where: str) -> np.ndarray:
    text = default if element is None else element.get(attribute, default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        values = np.array([])
    if values.shape != (count,) or not np.isfinite(values).all():
        raise UrdfError(f"{where}: {attribute} {text!r} should be {count} finite number{'s'[: count > 1]}")
    return values


def rpy_matrix(rpy: np.ndarray) -> np.ndarray:
    """Rotation of URDF's roll, pitch, yaw: about the fixed X, then Y, then Z axis."""
    (cr, cp, cy), (sr, sp, sy) = np.cos(rpy), np.sin(rpy)
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def _origin(element: Element, where: str) -> tuple[np.ndarray, np.ndarray]:
    origin = element.find("origin")
    rpy = _numbers(origin, "rpy", "0 0 0", 3, where)
    return _numbers(origin, "xyz", "0 0 0", 3, where), rpy_matrix(rpy)


def _joint(element: Element) -> UrdfJoint:
    name, kind = element.get("name", "?"), element.get("type", "?")
    where = f"joint {name}"
    parent, child = element.find("parent"), element.find("child")
    if parent is None or child is None:
        raise UrdfError(f"{where}: a joint needs <parent> and <child>")
    translation, rotation = _origin(element, where)
    axis, limit = np.array([1.0, 0.0, 0.0]), element.find("limit")
    lower, upper, speed = -np.pi, np.pi, 0.0
    if kind in ("revolute", "continuous"):
        if element.find("mimic") is not None:
            raise UrdfError(f"{where}: mimic joints have no column of their own; they are not supported")
        axis = _numbers(element.find("axis"), "xyz", "1 0 0", 3, where)
        if np.linalg.norm(axis) < 1e-6:
            raise UrdfError(f"{where}: its axis has no length")
        axis = axis / np.linalg.norm(axis)
        speed = float(_numbers(limit, "velocity", "0", 1, where)[0])
    if kind == "revolute":
        if limit is None:
            raise UrdfError(f"{where}: a revolute joint needs a <limit>")
        lower = float(_numbers(limit, "lower", "0", 1, where)[0])
        upper = float(_numbers(limit, "upper", "0", 1, where)[0])
        if lower >= upper:
            raise UrdfError(f"{where}: its lower limit {lower} is not below the upper {upper}")
    return UrdfJoint(
        name, kind, parent.get("link", ""), child.get("link", ""), translation, rotation, axis, lower, upper, speed
    )


def _link(element: Element, folder: Path) -> UrdfLink:
    link = UrdfLink(element.get("name", "?"))
    where = f"link {link.name}"
    shapes = (_shape(collision, folder, where) for collision in element.findall("collision"))
    link.shapes += [shape for shape in shapes if shape is not None]
    inertial = element.find("inertial")
    if inertial is not None:
        link.inertia_box = _inertia_box(inertial, where)
    return link


def _shape(collision: Element, folder: Path, where: str) -> Shape | None:
    """The collision's shape; None for a mesh that is not beside the URDF, or not an STL."""
    translation, rotation = _origin(collision, where)
    geometry = collision.find("geometry")
    solid = None if geometry is None else next(iter(geometry), None)
    if solid is None:
        return None
    if solid.tag == "mesh":
        file = folder / solid.get("filename", "").removeprefix("package://")
        scale = _numbers(solid, "scale", "1 1 1", 3, where)
        readable = file.suffix.lower() == ".stl" and file.exists()
        return Shape("mesh", scale, translation, rotation @ np.diag(scale), file) if readable else None
    kind = "cylinder" if solid.tag == "capsule" else solid.tag
    if kind not in SIZES:
        return None
    size = np.concatenate([_numbers(solid, name, "", count, where) for name, count in SIZES[kind].items()])
    return Shape(kind, size, translation, rotation)


def _inertia_box(inertial: Element, where: str) -> Shape | None:
    """The box with the link's mass and moments of inertia about the link's axes: Ixx = m (b² + c²) / 12 and so on."""
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        return None
    translation, rotation = _origin(inertial, where)
    kilograms = float(_numbers(mass, "value", "0", 1, where)[0])
    moments = np.array([float(_numbers(inertia, key, "0", 1, where)[0]) for key in ("ixx", "iyy", "izz")])
    if kilograms <= 0:
        return None
    edges = np.sqrt(np.maximum(moments.sum() / 2 - moments, 0.0) * 12 / kilograms)
    return Shape("box", edges, translation, rotation)


def stl_vertices(path: Path) -> np.ndarray:
    """Vertices ``[N, 3]`` of a binary STL file."""
    data = path.read_bytes()
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= 84 else -1
    if not 0 < count <= MAX_MESH_TRIANGLES or len(data) < 84 + 50 * count:
        raise UrdfError(f"{path}: not a binary STL file")
    triangle = np.dtype([("normal", "<f4", 3), ("corners", "<f4", (3, 3)), ("attribute", "<u2")])
    return np.frombuffer(data, triangle, count, 84)["corners"].reshape(-1, 3).astype(np.float64)
