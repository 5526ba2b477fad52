"""Reads files with the Python client: jobs as JSON on standard input, answers on standard output."""

import json
import sys
from pathlib import Path
from typing import Any

import numpy as np

import troupe


def skeleton_of(tables: dict[str, Any] | None) -> troupe.Skeleton | None:
    if tables is None:
        return None
    joints = tables["skeleton"]["joints"]
    names = [joint["name"] for joint in joints]
    robot = None
    if tables["robot"] is not None:
        hinges = tuple(
            troupe.Hinge(
                hinge["joint"], names.index(hinge["joint"]), tuple(hinge["axis"]), tuple(hinge["rest"]),
                hinge["lower_rad"], hinge["upper_rad"], hinge["max_speed_rad_per_s"],
            )
            for hinge in tables["robot"]["hinges"]
        )  # fmt: skip
        joints_of = [hinge.joint for hinge in hinges]
        mimics = tuple(
            troupe.Mimic(
                mimic["joint"], names.index(mimic["joint"]), joints_of.index(mimic["follows"]), mimic["multiplier"],
                mimic["offset_rad"], tuple(mimic["axis"]), tuple(mimic["rest"]),
            )
            for mimic in tables["robot"].get("mimics", [])
        )  # fmt: skip
        robot = troupe.Robot(tables["robot"]["name"], hinges, mimics)
    parents = tuple(names.index(joint["parent"]) if joint["parent"] else -1 for joint in joints)
    return troupe.Skeleton(tuple(names), parents, np.array([j["offset_m"] for j in joints], np.float32), robot=robot)


def read(job: dict[str, Any]) -> troupe.Clip:
    path, skeleton, options = Path(job["path"]), skeleton_of(job["tables"]), job["options"]
    if job["extension"]:
        return troupe.Clip.read(path, skeleton, **options)
    fps = options.get("fps", 30)
    match path.suffix:
        case ".csv" if skeleton is not None:
            return troupe.Clip.from_csv(path, skeleton, fps)
        case ".bvh":
            clip = troupe.Clip.from_bvh(path)
            return clip if skeleton is None else clip.on(skeleton)
        case ".npz":
            return troupe.Clip.from_npz(path)
    raise troupe.InvalidArgumentError(f"there is no `Clip.from_{path.suffix[1:]}`: `Clip.read` reads it")


def answer(job: dict[str, Any]) -> dict[str, Any]:
    try:
        clip = read(job)
    except troupe.TroupeError as error:
        return {"error": str(error)}
    except Exception as error:  # what no caller expects is an answer too
        return {"crash": f"{type(error).__name__}: {error}"}
    return {
        "fps": float(clip.fps),
        "names": list(clip.skeleton.names),
        "parents": list(clip.skeleton.parents),
        "offsets": clip.skeleton.offsets.tolist(),
        "roots": clip.root.tolist(),
        "turns": clip.rotations.tolist(),
        "notes": [json.dumps(clip.info[key]) for key in ("fps", "oddities")] if clip.info else [],
    }


json.dump([answer(job) for job in json.load(sys.stdin)], sys.stdout)
