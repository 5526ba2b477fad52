"""A robot as a model for MuJoCo, made from its pack: hinges and lengths, no shells and no dynamics."""

from __future__ import annotations

from collections.abc import Iterable
from xml.etree import ElementTree as Xml

import numpy as np

from troupe.conventions import Convention
from troupe.errors import InvalidArgumentError
from troupe.skeleton import Hinge, Skeleton

RADIUS_M = 0.035
SHORTEST_M = 0.02
NO_CONTACT = {"contype": "0", "conaffinity": "0"}


def robot_mjcf(skeleton: Skeleton, *, name: str = "", floor: bool = True) -> str:
    """The MJCF text of a robot: capsules for links, hinges with their ranges, a free joint at the root.

    Its `qpos` is that of frames (`Frames.to_qpos`). It is for kinematics: masses are those of the capsules.

    Raises:
        InvalidArgumentError: The skeleton is no robot's, or its hinges are not in the order of the tree.

    """
    robot = skeleton.robot
    if robot is None:
        raise InvalidArgumentError("skeleton: it is no robot's", field="skeleton", allowed="one with a robot")
    order = [hinge.index for hinge in robot.hinges]
    if order != [joint for joint in _depth_first(skeleton, 0) if joint in order]:
        message = "skeleton: its hinges are not in the order of the tree, which MuJoCo's qpos has"
        raise InvalidArgumentError(message, field="skeleton", allowed="hinges from the root outwards, limb by limb")
    root = Xml.Element("mujoco", model=name or robot.name)
    Xml.SubElement(root, "compiler", angle="radian", autolimits="true")
    Xml.SubElement(root, "statistic", center="0 0 0.7", extent="1.5")
    look = Xml.SubElement(root, "visual")
    Xml.SubElement(look, "global", offwidth="1920", offheight="1080")
    Xml.SubElement(look, "headlight", ambient="0.35 0.35 0.37", diffuse="0.35 0.35 0.35", specular="0.1 0.1 0.1")
    Xml.SubElement(look, "quality", shadowsize="4096", offsamples="8")
    Xml.SubElement(look, "map", shadowclip="2")
    _materials(Xml.SubElement(root, "asset"))
    world = Xml.SubElement(root, "worldbody")
    if floor:
        plane = {"name": "floor", "type": "plane", "size": "0 0 0.05", "material": "floor"}
        Xml.SubElement(world, "geom", plane | NO_CONTACT)
    hinges = {hinge.index: hinge for hinge in robot.hinges}
    _body(world, skeleton, hinges, 0)
    Xml.indent(root)
    return Xml.tostring(root, encoding="unicode")


def _materials(asset: Xml.Element) -> None:
    sky = {"builtin": "gradient", "rgb1": "0.93 0.94 0.95", "rgb2": "0.70 0.75 0.81", "width": "256", "height": "1536"}
    Xml.SubElement(asset, "texture", {"type": "skybox"} | sky)
    tiles = {"builtin": "checker", "rgb1": "0.80 0.81 0.82", "rgb2": "0.74 0.75 0.77", "width": "512", "height": "512"}
    Xml.SubElement(asset, "texture", {"name": "floor", "type": "2d"} | tiles)
    repeat = {"texuniform": "true", "texrepeat": "1 1", "reflectance": "0.08"}
    Xml.SubElement(asset, "material", {"name": "floor", "texture": "floor"} | repeat)
    Xml.SubElement(asset, "material", name="link", rgba="0.85 0.86 0.88 1", specular="0.4", shininess="0.5")
    Xml.SubElement(asset, "material", name="joint", rgba="0.22 0.24 0.28 1", specular="0.3", shininess="0.4")


def _body(parent: Xml.Element, skeleton: Skeleton, hinges: dict[int, Hinge], joint: int) -> None:
    of = Convention.ROS
    body = Xml.SubElement(parent, "body", name=skeleton.names[joint])
    radius = RADIUS_M
    if joint == 0:
        Xml.SubElement(body, "freejoint", name="root")
        # The light goes along, so that the shadow stays sharp.
        shine = {"pos": "1.5 -1.5 4", "dir": "-0.35 0.35 -1", "diffuse": "0.6 0.6 0.58", "mode": "track"}
        Xml.SubElement(body, "light", {"directional": "true"} | shine)
        radius *= 1.6
    else:
        body.set("pos", _text(of.position_from_native(skeleton.offsets[joint])))
    hinge = hinges.get(joint)
    if hinge is not None:
        body.set("quat", _text(of.rotation_from_native(np.array(hinge.rest, np.float32))))
        axis = of.position_from_native(np.array(hinge.axis, np.float32))
        limits = f"{hinge.lower:.7g} {hinge.upper:.7g}"
        Xml.SubElement(body, "joint", name=hinge.joint, type="hinge", axis=_text(axis), range=limits)
    children = skeleton.children(joint)
    ball = {"type": "sphere", "size": f"{radius * 1.15:.4g}", "material": "joint"}
    Xml.SubElement(body, "geom", ball | NO_CONTACT)
    for child in children:
        tip = of.position_from_native(skeleton.offsets[child])
        if np.linalg.norm(tip) >= SHORTEST_M:
            link = {"type": "capsule", "fromto": "0 0 0 " + _text(tip), "size": f"{radius:.4g}", "material": "link"}
            Xml.SubElement(body, "geom", link | NO_CONTACT)
        _body(body, skeleton, hinges, child)


def _depth_first(skeleton: Skeleton, joint: int) -> Iterable[int]:
    yield joint
    for child in skeleton.children(joint):
        yield from _depth_first(skeleton, child)


def _text(numbers: Iterable[float]) -> str:
    return " ".join(f"{float(number):.7g}" for number in numbers)
